"""The firmware on a simulated ATmega2560: the protocol, the rate of its samples, and its safety."""

from __future__ import annotations

import random
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import simulated_board
from simulated_board import FIRMWARE, Event, Run, build, command, play
from spa_fo.cli import main
from spa_fo.rig import read_campaign, read_trials
from spa_fo.rig.spa_rig_log import SpaRigLog, parse_spa_rig_log
from spa_fo.rig.wire import LineParser, parse_banner
from spa_fo.virtual_rig.board import VirtualBoard

MISSING = simulated_board.why_not()
pytestmark = pytest.mark.skipif(bool(MISSING), reason=MISSING)

READY = "# ready limit_kpa=100 watchdog_ms=500 max_rate_hz=1000 queue=32"
FULL_DUTY = 1023  # at 100 kPa


def pings(begin_ms: int, end_ms: int) -> list[tuple[int, str]]:
    return [(ms, "ping") for ms in range(begin_ms, end_ms, 90)]


def read(run: Run, which: int = 0) -> SpaRigLog:
    return parse_spa_rig_log(run.log(which), "simulated")


def test_what_it_says_after_a_reset() -> None:
    run = play([], 100)
    assert run.lines[1:] == [READY]
    banner = parse_banner(run.lines[0].encode())
    assert (banner.board, banner.adc_bits, banner.vref_mv, banner.rate_hz) == (
        "mega2560",
        10,
        5000,
        50,
    )
    assert banner.columns == ("seq", "t_us", "cmd_kpa", "p_adc", "flex_adc")
    assert run.pins == ()  # vented from the first instruction on


def test_a_trial_at_the_default_rate() -> None:
    run = play([(100, "run"), *pings(150, 3000), (3000, "stop")], 3100)
    log = read(run)
    assert log.banner.rate_hz == 50
    assert log.report.damaged == {}
    assert log.report.gaps == 0
    assert log.seq.tolist() == list(range(145))
    assert run.comments[-1] == "# stopped samples=145"
    assert 100_000 < int(run.rows[0][1]) < 120_000  # the first sample within 20 ms
    assert set(log.columns["cmd_kpa"]) == {0.0}
    assert set(log.columns["p_adc"]) == {102.0}  # 0 kPa: 0.5 V of 5 V
    assert set(log.columns["flex_adc"]) == {350.0}


@pytest.mark.parametrize("rate", [1, 3, 7, 50, 333, 875, 999, 1000])
def test_the_rate_of_the_samples(rate: int) -> None:
    end = 8000 if rate < 10 else 2500
    run = play([(50, f"run {rate}"), (end, "stop")], end + 50)
    log = read(run)
    t_us = np.array([int(row[1]) for row in run.rows])
    assert log.seq.tolist() == list(range(len(t_us)))
    assert len(t_us) == pytest.approx((end - 52) / 1000 * rate, abs=1.01)
    # The interrupt's lateness jitters, the sampling rate does not drift.
    grid = t_us[0] + np.arange(t_us.size) * 1e6 / rate
    assert np.abs(t_us - grid).max() < 12.0


def test_a_setpoint_falls_on_its_sample() -> None:
    events = [(100, "run"), (150, "set 30 25"), (160, "set 12.5 40"), (170, "set 0 50")]
    run = play([*events, *pings(150, 1500), (1500, "stop")], 1600)
    by_seq = {int(row[0]): row for row in run.rows}
    assert [by_seq[seq][2] for seq in (24, 25, 39, 40, 49, 50)] == [
        *("0.00", "30.00", "30.00", "12.50", "12.50", "0.00")
    ]
    assert [(duty, valve) for _, duty, valve in run.pins] == [(307, 1), (128, 1), (0, 0)]
    for (ms, _, _), seq in zip(run.pins, (25, 40, 50), strict=True):
        assert ms == pytest.approx(int(by_seq[seq][1]) / 1000, abs=1.1)
    pressure = read(run).columns["p_adc"]
    assert pressure[25] == 102  # read at the instant at which the command changes
    assert pressure[39] == pytest.approx(145, abs=2)


def test_of_several_due_at_once_the_last_counts() -> None:
    events = [(100, "run 10"), (150, b"".join(map(command, ("set 20", "set 30 0", "set 40 1"))))]
    run = play([*events, *pings(200, 1000), (1000, "stop")], 1100)
    assert [row[2] for row in run.rows[:3]] == ["0.00", "40.00", "40.00"]


def test_a_setpoint_without_seq_clears_the_queue() -> None:
    events = [(100, "run"), (150, "set 30 10"), (160, "set 40 20"), (200, "set 5")]
    run = play([*events, *pings(150, 1000), (1000, "stop")], 1100)
    assert {row[2] for row in run.rows} == {"0.00", "5.00"}


def test_the_queue_holds_32() -> None:
    sets = [command(f"set 10 {1000 + i}") for i in range(33)]
    events = [(100, "run"), *((120 + 3 * i, one) for i, one in enumerate(sets))]
    run = play([*events, (300, "set 11 999"), (310, "vent"), (320, "set 9 5")], 400)
    assert run.comments[1:] == ["# refused full: set 10 1032", "# refused argument: set 11 999"]


def test_vent_with_and_without_checksum() -> None:
    for vent in (b"vent\n", b"vent\r\n", command("vent")):
        events = [(100, "run"), (150, "set 30"), (160, "set 50 40"), (500, vent)]
        run = play([*events, *pings(150, 1500), (1500, "stop")], 1600)
        commanded = [row[2] for row in run.rows]
        assert commanded[10] == "30.00"
        assert set(commanded[21:]) == {"0.00"}  # the queue is forgotten too
        assert len(run.rows) == 70
        assert run.pins[-1][1:] == (0, 0)
        assert run.comments[1:] == ["# stopped samples=70"]


def test_silence_vents() -> None:
    events = [(100, "run"), (150, "set 40"), (400, "ping"), (1500, "set 20"), (1600, "stop")]
    run = play(events, 1700)
    assert run.comments[1:] == [
        "# trip watchdog",
        "# refused state: set 20",
        "# stopped samples=75",
    ]
    vented_ms, duty, valve = run.pins[-1]
    assert (duty, valve) == (0, 0)
    assert 900 <= vented_ms <= 936
    rows = read(run)
    assert rows.report.gaps == 0  # it goes on sampling
    after = np.array([int(row[1]) for row in run.rows]) > 1000 * (vented_ms + 1)
    assert set(rows.columns["cmd_kpa"][after]) == {0.0}
    assert rows.columns["cmd_kpa"][~after][-1] == 40.0


def test_silence_forgets_what_waits() -> None:
    run = play([(100, "run"), (150, "set 40 50"), (1500, "stop")], 1600)
    assert run.comments[1:] == ["# trip watchdog", "# stopped samples=70"]
    assert {row[2] for row in run.rows} == {"0.00"}
    assert run.pins == ()


@pytest.mark.parametrize("blanks", range(0, 50, 5))
def test_stop_finishes_the_line_at_hand(blanks: int) -> None:
    # A conversion fills nine tenths of a sample's millisecond; blanks, of 20 us each, move the
    # command through it.
    run = play([(100, "run 1000"), (1000, blanks * b" " + b"\n" + command("stop"))], 1100)
    assert run.lines[-1] == f"# stopped samples={len(run.rows)}"
    assert 890 < len(run.rows) < 905


def test_no_watchdog_while_nothing_is_commanded() -> None:
    run = play([(100, "run"), (3000, "stop")], 3100)
    assert run.comments[1:] == ["# stopped samples=145"]


def test_damaged_lines_do_not_feed_the_watchdog() -> None:
    noise = [(ms, b"ping*00\n") for ms in range(200, 1500, 90)]
    run = play([(100, "run"), (150, "set 30"), *noise], 1500)
    assert "# trip watchdog" in run.comments
    assert run.comments.count("# damaged command") == len(noise)


def test_a_run_after_a_trip_obeys_again() -> None:
    events = [(100, "run"), (150, "set 30"), (1000, "stop"), (1100, "run"), (1150, "set 20")]
    run = play([*events, *pings(1150, 1500), (1500, "stop")], 1600)
    assert run.comments.count("# trip watchdog") == 1
    assert read(run, 1).columns["cmd_kpa"].max() == 20.0


@pytest.mark.parametrize(("kpa", "trips"), [(119.0, False), (122.0, True)])
def test_too_much_pressure_vents(kpa: float, trips: bool) -> None:
    events = [(100, "run"), (150, "set 90"), (600, kpa), *pings(150, 1000), (1000, "stop")]
    run = play(events, 1100)
    assert run.comments.count("# trip pressure") == trips
    if trips:
        vented_ms = run.pins[-1][0]
        assert run.pins[-1][1:] == (0, 0)
        assert 640 <= vented_ms <= 665  # three samples of 20 ms
        assert run.rows[-1][2] == "0.00"
    else:
        assert run.rows[-1][2] == "90.00"


@pytest.mark.parametrize("tenth", range(1, 11))
def test_a_spike_shorter_than_a_conversion_leaves_no_trace(tenth: int) -> None:
    events = [(50, ("spike", str(tenth), "400")), (100, "run 500"), (300, "stop")]
    run = play(events, 350)
    assert {row[3] for row in run.rows} == {"102"}
    assert len(run.rows) > 90


def test_the_clock_wraps() -> None:
    poke = f"0x{build().address('clock_overflows')}={2**17 - 40}"  # 1.3 s before
    run = play([(100, "run"), (3000, "stop")], 3100, ["--poke", poke])
    stamps = [int(row[1]) for row in run.rows]
    assert max(stamps) > 2**32 - 20_001
    assert min(stamps) < 20_000
    log = read(run)
    assert (log.report.wraps, log.report.gaps, log.report.damaged_lines) == (1, 0, 0)
    np.testing.assert_allclose(np.diff(log.t_s), 0.02, atol=1e-5)


def test_a_calibration() -> None:
    events = [
        (100, "cal"),
        (500, "angle -12.5"),
        (1000, "pause"),
        (1500, "angle 90"),
        (2000, "stop"),
    ]
    run = play(events, 2100)
    log = read(run)
    assert log.banner.columns == ("seq", "t_us", "angle_deg", "flex_adc")
    assert log.seq.tolist() == list(range(len(log.seq)))
    angles = log.columns["angle_deg"]
    assert [row[2] for row in run.rows[:1] + run.rows[-1:]] == ["-12.5", "90.0"]
    change = int(np.argmax(angles == 90.0))
    assert change == 25
    assert log.t_s[change] - log.t_s[change - 1] == pytest.approx(0.52, abs=0.02)
    assert set(log.columns["flex_adc"][angles == 90.0]) == {170.0}
    assert run.comments[1:] == [f"# stopped samples={len(angles)}"]
    assert run.pins == ()


def test_hello_vents_and_greets() -> None:
    run = play([(100, "run"), (150, "set 30"), (300, "hello")], 600)
    assert run.lines[-1] == READY
    assert run.lines[-2] == run.lines[0]
    assert run.pins[-1][1:] == (0, 0)


ANSWERS: list[tuple[str, str, str]] = [
    ("", "foo", "unknown"),
    ("", "ping now", "argument"),
    ("", "run 0", "argument"),
    ("", "run 1001", "argument"),
    ("", "run 5x", "argument"),
    ("", "run 50 50", "argument"),
    ("", "set 30", "state"),
    ("", "set", "argument"),
    ("", "angle 3", "state"),
    ("", "pause", "state"),
    ("run", "run", "state"),
    ("run", "cal", "state"),
    ("run", "angle 3", "state"),
    ("run", "set 100.01", "limit"),
    ("run", "set 101 5", "limit"),
    ("run", "set -1", "argument"),
    ("run", "set 1.234", "argument"),
    ("run", "set 1.", "argument"),
    ("run", "set .5", "argument"),
    ("run", "set 1 x", "argument"),
    ("run", "set  1", "argument"),
    ("run", "set 1 2 3", "argument"),
    ("cal", "angle 360.1", "argument"),
    ("cal", "angle 1.25", "argument"),
    ("cal", "angle +1", "argument"),
    ("cal", "set 3", "state"),
]


@pytest.mark.parametrize(("state", "said", "why"), ANSWERS)
def test_what_it_refuses(state: str, said: str, why: str) -> None:
    events = [(100, said)] if not state else [(100, state), (150, said)]
    run = play(events, 300)
    assert run.comments[bool(state) :] == [f"# refused {why}: {said}"]


@pytest.mark.parametrize(
    "line",
    [
        b"run\n",
        b"run*68\n",
        b"run*6\n",
        b"run*69 \n",
        b"\n",
        b"*\n",
        b"run *69\n",
        b"ping" + 60 * b" " + b"*00\n",
        b"\xff\xfe\x00\n",
        command("run " + 35 * "0" + "50").rstrip(b"\n") + b"\n",
    ],
)
def test_damaged_commands_are_not_acted_upon(line: bytes) -> None:
    run = play([(100, line)], 300)
    assert run.comments == ["# damaged command"]


def test_a_line_of_forty_bytes_is_heard() -> None:
    said = "x" * 37
    for end in (b"\n", b"\r\n"):
        line = command(said).rstrip(b"\n") + end
        assert play([(100, line)], 200).comments == [f"# refused unknown: {said}"]
    assert play([(100, command("x" * 38))], 200).comments == ["# damaged command"]


def test_a_comment_has_at_most_80_printable_bytes() -> None:
    line = b"\x01\xf0" + 33 * b"y"
    value = 0
    for byte in line:
        value ^= byte
    run = play([(100, line + b"*%02X\n" % value)], 200)
    assert run.comments == ["# refused unknown: ??" + 33 * "y"]


def test_no_loss_at_1_khz() -> None:
    seconds = 8
    end = 100 + 1000 * seconds
    events: list[tuple[int, str]] = [(100, "run 1000")]
    events += [(ms, f"set {ms % 97}.5 {ms}") for ms in range(400, end, 90)]
    run = play([*events, (end, "stop")], end + 100)
    log = read(run)
    assert log.report.damaged == {}
    assert log.seq.tolist() == list(range(len(log.seq)))
    assert run.comments[1:] == [f"# stopped samples={len(log.seq)}"]
    assert len(log.seq) == pytest.approx(1000 * seconds, abs=5)


def assert_whole_lines_at_the_rate(run: Run) -> None:
    """Every data line is whole, and at 1 kHz its clock agrees with its seq."""
    parser = LineParser(("seq", "t_us", "cmd_kpa", "p_adc", "flex_adc"))
    data = [line for line in run.lines if not line.startswith("#")]
    assert all(parser.parse(line.encode()) for line in data)
    stamps = np.array([int(row[1]) for row in run.rows])
    seq = np.array([int(row[0]) for row in run.rows])
    assert np.abs(stamps - stamps[0] - 1000 * (seq - seq[0])).max() < 40


def test_a_flood_of_commands_costs_commands_and_no_samples() -> None:
    flood = [(ms, 3 * command("nonsense " + 20 * "x")) for ms in range(500, 1500, 2)]
    # A byte that is lost joins two lines: the empty one before it keeps `stop` whole.
    run = play([(100, "run 1000"), *flood, (1990, b"\n"), (2000, "stop")], 2100)
    assert_whole_lines_at_the_rate(run)
    assert len(run.rows) == 1898
    assert run.comments[-1] == "# stopped samples=1898"
    assert 100 < run.comments.count("# damaged command") < 1500


def test_a_slow_wire_costs_whole_lines_and_no_rate() -> None:
    run = play(
        [(100, "run 1000"), (1500, "stop")], 1700, defines="-DBAUD=125000UL"
    )  # carries 12.5 of the 25 kB/s
    assert_whole_lines_at_the_rate(run)
    assert 400 < len(run.rows) < 1000
    assert run.comments[-1] == "# stopped samples=1398"
    assert read(run).report.gaps > 100


class StillPlant:
    """An actuator that does nothing, for the virtual board."""

    now_s = 0.0

    def begin_trial(self) -> None:
        """Nothing to draw."""

    def rest(self, seconds: float) -> None:
        """Nothing to rest."""

    def drive(self, command_kpa: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Counts at rest."""
        return np.full(command_kpa.size, 102), np.full(command_kpa.size, 350)

    def bend(self, angle_deg: np.ndarray) -> np.ndarray:
        """Counts at rest."""
        return np.full(angle_deg.size, 350)


SAID = (
    *("run", "run 100", "run 1000", "run 0", "run 1001", "cal", "cal 20", "cal x", "stop", "hello"),
    *("ping", "vent", "pause", "angle 10", "angle -3.5", "angle 361", "angle", "nonsense", ""),
    *("set 0", "set 20", "set 100", "set 100.01", "set 7 900000", "set 8 900001", "set 9 899999"),
    *("set 1.5 x", "stop now", "run 50 1", "set 1  2", " run", "RUN"),
)


def streams(seed: int, count: int) -> list[bytes]:
    """Lines a host might send, one in three of them damaged."""
    rng = random.Random(seed)
    lines = []
    for _ in range(count):
        line = command(rng.choice(SAID))
        if rng.random() < 1 / 3:
            at = rng.randrange(len(line))
            other = bytes(rng.randrange(256) for _ in range(rng.randrange(3)))
            line = line[:at] + other + line[at + 1 :]
        lines.append(line)
    return lines


def expected(lines: list[bytes]) -> list[str]:
    """What the virtual board answers to the same."""
    board = VirtualBoard(StillPlant(), line_end=b"\n")
    said = b"".join(board.receive(line) for line in lines).decode("ascii")
    return [line for line in _normal(said.splitlines()) if line.startswith("#")]


def _normal(lines: list[str]) -> list[str]:
    lines = [line.replace("board=virtual", "board=mega2560") for line in lines]
    return [re.sub(r"(stopped samples=)\d+", r"\1N", line) for line in lines]


def differences(seed: int, count: int) -> list[tuple[str, str]]:
    """Answers that differ between the firmware and the virtual board, fed with the same lines."""
    lines = streams(seed, count)
    # 5 ms apart, so that answers fit; often enough that the watchdog has no say.
    events: list[tuple[int, Event]] = [(100 + 5 * i, line) for i, line in enumerate(lines)]
    found = _normal(play(events, 200 + 5 * count).comments)
    wanted = expected(lines)
    pairs = list(zip(found, wanted, strict=False))
    unequal = [pair for pair in pairs if pair[0] != pair[1]]
    if len(found) != len(wanted):
        unequal.append((f"{len(found)} answers", f"{len(wanted)} answers"))
    return unequal


@pytest.mark.parametrize("seed", range(3))
def test_it_answers_as_the_virtual_board_does(seed: int) -> None:
    assert differences(seed, 600) == []


def test_the_virtual_actuator_behind_the_converters() -> None:
    actuator = f"{sys.executable} {FIRMWARE / 'sim' / 'actuator.py'}"
    events = [(100, "run"), (200, "set 30 20"), *pings(200, 3000), (3000, "stop")]
    log = read(play(events, 3100, ["--actuator", actuator]))
    pressure, flex = log.columns["p_adc"], log.columns["flex_adc"]
    assert pressure[:20].mean() == pytest.approx(102.5, abs=1.5)
    assert pressure[-20:].mean() == pytest.approx(102.3 + 44.5, abs=3.0)
    assert abs(flex[-20:].mean() - flex[:20].mean()) > 30.0


@pytest.fixture(scope="module")
def port() -> Iterator[str]:
    """A pseudo-terminal with the board behind it, the virtual actuator at its pins."""
    built = build()
    actuator = f"{sys.executable} {FIRMWARE / 'sim' / 'actuator.py'}"
    with subprocess.Popen(
        [built.simboard, built.elf, "--actuator", actuator], stdout=subprocess.PIPE, text=True
    ) as board:
        assert board.stdout is not None
        yield board.stdout.readline().strip()
        board.kill()


def test_the_recorder_records_from_it(tmp_path: Path, port: str) -> None:
    arguments = ["--campaign", str(tmp_path / "arm"), "--material", "simulated", "--synthetic"]
    calibration = ["calibration", port, "--angles", "0,30,60", "--settle", "0.2"]
    assert main(["record", *calibration, *arguments, "--dwell", "0.5"]) == 0
    step = ["--experiment", "step", "--pressure", "28", "--trials", "1", "--rest", "0.5"]
    assert main(["record", port, *arguments, *step, "--dwell", "1", "--release", "0.4"]) == 0
    data = read_trials(read_campaign(tmp_path / "arm"))
    assert all(report.damaged_lines == 0 for report in data.report.files)
    assert all(report.gaps == 0 for report in data.report.files)
    assert data.calibration is not None
    assert sorted(data.calibration.angles_deg.tolist()) == [0.0, 30.0, 60.0]
    (trial,) = data.trials
    assert trial.t_s.size == 95
    assert trial.command_kpa is not None
    assert trial.pressure_kpa is not None
    assert np.flatnonzero(np.diff(trial.command_kpa)).tolist() == [24, 74]
    assert trial.pressure_kpa[65:75].mean() == pytest.approx(28.0, abs=1.5)
    assert trial.angle_deg[70:75].mean() - trial.angle_deg[:25].mean() > 5.0
