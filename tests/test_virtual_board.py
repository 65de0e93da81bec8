"""The virtual board: its program line by line, its faults, and the pseudo-terminal."""

from __future__ import annotations

import time

import numpy as np
import pytest
import serial

from spa_fo.errors import BadInput
from spa_fo.rig.spa_rig_log import parse_spa_rig_log
from spa_fo.virtual_rig.actuators import PLANS
from spa_fo.virtual_rig.board import BenchPlant, VirtualBoard
from spa_fo.virtual_rig.faults import EVENTS, SHARES, FaultyPlant, parse_faults
from spa_fo.virtual_rig.pty_server import PtyServer, link_to
from virtual_bench import LagPlant, said, serving

BANNER = (
    b"# spa-rig 1 board=virtual adc_bits=10 vref_mv=5000 rate_hz=50 "
    b"columns=seq,t_us,cmd_kpa,p_adc,flex_adc\r\n"
)


def board(**options) -> VirtualBoard:
    return VirtualBoard(LagPlant(), **options)


def running(rate: str = "50") -> VirtualBoard:
    it = board()
    it.receive(said(f"run {rate}"))
    return it


def commands(lines: bytes) -> list[float]:
    return [float(line.split(b",")[2]) for line in lines.splitlines() if b"*" in line]


# --- the program ----------------------------------------------------------------------------------


def test_a_reset_is_greeted_and_leaves_it_idle() -> None:
    it = running()
    greeting = it.reset()
    assert greeting.startswith(BANNER)
    assert b"# ready limit_kpa=100 watchdog_ms=500 max_rate_hz=1000 queue=32\r\n" in greeting
    assert it.state == "idle"
    assert it.advance(10) == b""


def test_a_run_is_a_log_that_the_parser_takes() -> None:
    it = board()
    log = it.receive(said("run")) + it.advance(100) + it.receive(said("stop"))
    parsed = parse_spa_rig_log(log, "log")
    assert parsed.seq.tolist() == list(range(100))
    assert parsed.report.damaged == {}
    assert np.diff(parsed.t_s) == pytest.approx(0.02, abs=2e-4)
    assert log.endswith(b"# stopped samples=100\r\n")


def test_a_set_point_acts_on_the_sample_it_names() -> None:
    it = running()
    it.receive(said("set 20 5") + said("set 30.5 8"))
    assert commands(it.advance(10)) == [0.0] * 5 + [20.0] * 3 + [30.5] * 2


def test_a_set_point_without_a_sample_acts_at_once_and_forgets_those_that_wait() -> None:
    it = running()
    it.receive(said("set 20 5") + said("set 10"))
    assert commands(it.advance(8)) == [10.0] * 8


def test_of_set_points_that_are_due_together_the_last_counts() -> None:
    it = running()
    it.advance(10)
    it.receive(said("set 20 3") + said("set 25 7"))
    assert commands(it.advance(2)) == [25.0, 25.0]


def test_vent_forgets_everything_and_needs_no_checksum() -> None:
    it = running()
    it.receive(said("set 20") + said("set 30 9"))
    it.advance(5)
    assert it.receive(b"vent\n") == b""
    assert commands(it.advance(10)) == [0.0] * 10


@pytest.mark.parametrize(
    ("command", "why"),
    [
        ("fly", "unknown"),
        ("run", "state"),
        ("angle 10", "state"),
        ("pause", "state"),
        ("set", "argument"),
        ("set -1", "argument"),
        ("set 1.234", "argument"),
        ("set 10 x", "argument"),
        ("set 100.01", "limit"),
        ("ping 3", "argument"),
        ("SET 10", "unknown"),
        ("", "unknown"),
    ],
)
def test_what_cannot_be_obeyed_is_refused_and_changes_nothing(command: str, why: str) -> None:
    it = running()
    assert it.receive(said(command)) == f"# refused {why}: {command}\r\n".encode()
    assert commands(it.advance(3)) == [0.0] * 3


def test_the_queue_has_an_end_and_its_samples_never_fall() -> None:
    it = running()
    for seq in range(100, 132):
        assert it.receive(said(f"set 1 {seq}")) == b""
    assert b"refused full" in it.receive(said("set 1 200"))
    it = running()
    it.receive(said("set 1 50"))
    assert b"refused argument" in it.receive(said("set 1 49"))


@pytest.mark.parametrize("line", [b"set 20\n", b"set 20*00\n", b"x" * 200 + b"\n", b"\xff*FE\n"])
def test_a_damaged_command_is_not_obeyed(line: bytes) -> None:
    it = running()
    assert it.receive(line) == b"# damaged command\r\n"
    assert commands(it.advance(2)) == [0.0, 0.0]


def test_a_command_may_come_in_pieces() -> None:
    it = running()
    line = said("set 20")
    assert [it.receive(line[i : i + 1]) for i in range(len(line))] == [b""] * len(line)
    assert commands(it.advance(1)) == [20.0]


def test_silence_under_pressure_trips_it_and_only_a_run_ends_that() -> None:
    it = running()
    assert it.silence(9.0) == b""  # vented, it may be left alone
    it.receive(said("set 20"))
    it.advance(5)
    assert it.silence(0.49) == b""
    assert it.silence(0.51) == b"# trip watchdog\r\n"
    assert it.silence(0.6) == b""
    assert commands(it.advance(3)) == [0.0] * 3
    assert b"refused state" in it.receive(said("set 20"))
    it.receive(said("stop") + said("run") + said("set 20"))
    assert commands(it.advance(1)) == [20.0]


def test_too_much_measured_pressure_trips_it() -> None:
    plant = FaultyPlant(LagPlant())
    it = VirtualBoard(plant)
    it.receive(said("run") + said("set 20"))
    it.advance(50)
    plant.rail("pressure")
    out = it.advance(2) + it.advance(3) + it.advance(3)
    assert out.count(b"# trip pressure") == 1
    assert commands(out)[-1] == 0.0


def test_a_calibration_logs_only_while_an_angle_stands() -> None:
    it = board()
    log = it.receive(said("cal"))
    assert it.advance(5) == b""
    for angle in ("0", "15.5", "-3"):
        it.receive(said(f"angle {angle}"))
        log += it.advance(10)
        it.receive(said("pause"))
        assert it.advance(5) == b""
        it.rest(2.0)
    parsed = parse_spa_rig_log(log, "log")
    assert parsed.seq.tolist() == list(range(30))
    assert np.unique(parsed.columns["angle_deg"]).tolist() == [-3.0, 0.0, 15.5]
    assert parsed.report.pauses == 2


def test_rates_are_whole_fractions_of_the_bench() -> None:
    it = board()
    assert b"refused argument" in it.receive(said("run 300"))
    assert b"refused argument" in it.receive(said("run 0"))
    assert b"rate_hz=200 " in it.receive(said("run 200"))
    log = it.advance(5)
    stamps = [int(line.split(b",")[1]) for line in log.splitlines()]
    assert np.diff(stamps) == pytest.approx(5000, abs=100)


def test_micros_wraps_when_told() -> None:
    it = running()
    it.wrap_in(0.1)
    stamps = [int(line.split(b",")[1]) for line in it.advance(10).splitlines()]
    assert max(stamps) > 2**32 - 50_000
    assert min(stamps) < 200_000


def test_random_bytes_neither_stop_it_nor_press_too_hard() -> None:
    rng = np.random.default_rng(5)
    words = [b"set ", b"run", b"cal", b"angle ", b"stop", b"*", b"\n", b"9", b"100.5", b"hello"]
    for _ in range(200):
        it = running()
        parts = [words[k] if k < len(words) else rng.bytes(3) for k in rng.integers(0, 14, size=60)]
        it.receive(said("set 99"))
        answers = it.receive(b"".join(parts))
        assert all(len(line) <= 82 for line in answers.splitlines())
        assert max(commands(it.advance(5)), default=0.0) <= 100.0


def test_the_bench_bends_the_specimen() -> None:
    it = VirtualBoard(BenchPlant(PLANS["fx_pro"].specimen, seed=3))
    it.receive(said("run") + said("set 40 25"))
    rows = BANNER + it.advance(150)
    flex = parse_spa_rig_log(rows, "log").columns["flex_adc"]
    assert flex[-20:].mean() > flex[:25].mean() + 20.0


# --- faults ---------------------------------------------------------------------------------------


def test_orders_of_faults() -> None:
    faults = parse_faults(["cut=0.01", "stall@3+2", "unplug@4.5#2", "flex-railed@1"])
    assert faults.shares == (("cut", 0.01),)
    stall, unplug, railed = faults.events
    assert (stall.at_s, stall.lasts_s, stall.run) == (3.0, 2.0, None)
    assert (unplug.at_s, unplug.run) == (4.5, 2)
    assert [event.kind for event in faults.due(2, 0.0, 5.0)] == ["stall", "unplug", "flex-railed"]
    assert [event.kind for event in faults.due(1, 0.0, 5.0)] == ["stall", "flex-railed"]
    assert faults.due(1, 3.0, 4.0) == []
    assert railed.kind == "flex-railed"


@pytest.mark.parametrize("order", ["cut", "cut=2", "smoke@3", "reset@", "cut@3", "reset=0.1", ""])
def test_orders_that_are_none(order: str) -> None:
    with pytest.raises(BadInput, match="--fault"):
        parse_faults([order])


@pytest.mark.parametrize("kind", SHARES)
def test_each_damage_is_seen_by_the_parser(kind: str) -> None:
    it = running()
    rows = it.advance(400).splitlines(keepends=True)
    faults, rng = parse_faults([f"{kind}=0.1"]), np.random.default_rng(2)
    log = BANNER + b"".join(faults.damaged(row, rng) for row in rows)
    report = parse_spa_rig_log(log, "log").report
    assert report.missing_samples >= 20
    assert report.valid + report.missing_samples >= 390
    assert (report.damaged_lines == 0) is (kind == "lost")


# --- the pseudo-terminal --------------------------------------------------------------------------


def heard(port: serial.Serial, until: bytes, seconds: float = 5.0) -> bytes:
    data, end = b"", time.monotonic() + seconds
    while until not in data and time.monotonic() < end:
        data += port.read(max(1, port.in_waiting))
    return data


@pytest.mark.parametrize("speed", [1.0, 40.0])
def test_it_speaks_over_a_port_and_opening_resets_it(speed: float) -> None:
    with serving(speed=speed) as served:
        for _ in range(2):
            with serial.Serial(served.port, 500_000, timeout=0.05) as port:
                assert heard(port, b"queue=32").startswith(BANNER)
                port.write(said("run"))
                log = heard(port, b"\n9,")
                port.write(said("stop"))
                log += heard(port, b"samples=")
            time.sleep(0.1)  # an opening that follows a closing at once may go unnoticed
        assert log.startswith(BANNER)
        assert parse_spa_rig_log(log, "log").report.missing_samples == 0


def test_its_time_goes_on_while_it_rests() -> None:
    with serving(speed=100.0) as served:
        with serial.Serial(served.port, 500_000, timeout=0.05) as port:
            heard(port, b"queue=32")
            time.sleep(0.2)
            port.write(said("run"))
            heard(port, b"\n3,")
        assert served.plant.rested_s > 15.0


def test_another_baud_rate_is_noise() -> None:
    with serving() as served, serial.Serial(served.port, 115_200, timeout=0.05) as port:
        noise = heard(port, b"never", 0.4)
        assert len(noise) > 100
        assert b"spa-rig" not in noise


def test_an_unplugged_port_is_gone() -> None:
    with serving("unplug@0.2") as served, serial.Serial(served.port, 500_000, timeout=0.05) as port:
        heard(port, b"queue=32")
        port.write(said("run"))
        with pytest.raises((serial.SerialException, OSError, TypeError)):
            drain(port)


def drain(port: serial.Serial) -> None:
    for _ in range(200):
        port.read(max(1, port.in_waiting))


def test_a_stall_holds_back_and_loses_nothing_that_has_room() -> None:
    with serving("stall@0.2+20", speed=40.0) as served:
        with serial.Serial(served.port, 500_000, timeout=0.02) as port:
            heard(port, b"queue=32")
            port.write(said("run"))
            log = heard(port, b"\n60,")
        assert parse_spa_rig_log(log.rpartition(b"\n")[0], "log").report.missing_samples == 0


def test_what_finds_no_room_is_lost_in_whole_lines() -> None:
    with serving("stall@0.05+0.4", speed=1.0) as served:
        with serial.Serial(served.port, 500_000, timeout=0.02) as port:
            heard(port, b"queue=32")
            port.write(said("run 1000"))
            log = heard(port, b"\n500,")
        report = parse_spa_rig_log(log.rpartition(b"\n")[0], "log").report
        assert report.missing_samples > 100
        assert report.damaged == {}


def test_a_link_names_the_port_and_replaces_no_file(tmp_path) -> None:
    link = tmp_path / "board"
    link_to("/dev/pts/0", link)
    link_to("/dev/pts/1", link)
    assert str(link.readlink()) == "/dev/pts/1"
    file = tmp_path / "file"
    file.write_text("mine")
    with pytest.raises(BadInput, match="is a file"):
        link_to("/dev/pts/1", file)
    assert file.read_text() == "mine"


def test_a_strange_baud_rate_is_refused() -> None:
    with pytest.raises(BadInput, match="--baud"):
        PtyServer(board(), FaultyPlant(LagPlant()), baud=12345)


def test_every_event_can_be_struck() -> None:
    for kind in EVENTS:
        with serving(f"{kind}@0.1") as served:
            with serial.Serial(served.port, 500_000, timeout=0.02) as port:
                heard(port, b"queue=32")
                port.write(said("run"))
                try:
                    log = heard(port, b"\n40,", 0.5 if kind in ("reset", "unplug") else 5.0)
                except (serial.SerialException, OSError, TypeError):
                    log = b""
            if kind == "reset":
                assert log.count(b"# ready") == 1
            elif kind == "unplug":
                assert log == b""
            else:
                assert b"\n40," in log
