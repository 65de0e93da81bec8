"""The recorder: what it commands, what it writes, and what it leaves when something goes wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml

import recorder_shows as shows
from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.gap.plan import profiles
from spa_fo.rig import read_campaign, read_trials
from spa_fo.rig.board_link import BoardLink, PortLost, greeting
from spa_fo.rig.campaign_entry import ABORTED
from spa_fo.rig.campaign_files import Setup
from spa_fo.rig.command_profile import CommandProfile, plateaus, read_profile, triangle
from spa_fo.rig.live_stream import LiveStream, Progress, Remark, Row
from spa_fo.rig.live_view import LiveView
from spa_fo.rig.record_series import Series, account, record_dwells, record_series
from spa_fo.rig.recorder import Outcome, record_trial
from spa_fo.rig.recording import KILLED, RecordingFolder
from spa_fo.rig.set_points import Pacer
from spa_fo.rig.spa_rig_log import parse_spa_rig_log, read_spa_rig_log
from spa_fo.rig.wire import format_line
from virtual_bench import serving

SETUP = Setup("test rubber", 30.0, kind="synthetic")
UP = plateaus("step_release", [30.0], rest_s=0.4, dwell_s=1.0, release_s=0.6)
STEP = Series("step_30", 30.0, UP, {"protocol": "step_release"}, trials=1, rest_s=5.0)
CLOSED_S = 0.05  # a port that is opened again at once was never seen closed
ANGLES = [0.0, 25.0, 50.0, 25.0, 0.0]


def record(served, folder: Path, *series: Series, stop=lambda: None, calibrate: bool = True):
    """Calibrate and record series; what was kept."""
    kept = []
    time.sleep(CLOSED_S)
    with BoardLink(served.port) as link:
        info = link.wait_ready()
        with RecordingFolder(folder, SETUP) as open_folder:
            if calibrate:
                kept.append(record_dwells(link, info, open_folder, ANGLES, 0.5))
            for one in series:
                kept += record_series(link, info, open_folder, one, stop)
    return kept


def valid(folder: Path):
    return read_trials(read_campaign(folder))


# --- profiles -------------------------------------------------------------------------------------


def commands(profile: CommandProfile, rate_hz: float = 50.0) -> np.ndarray:
    held = np.zeros(profile.samples(rate_hz))
    for sample, kpa in profile.by_sample(rate_hz):
        held[sample:] = kpa
    return held


def test_a_step_and_release() -> None:
    expected = np.repeat([0.0, 30.0, 0.0], [20, 50, 30])
    assert commands(UP) == pytest.approx(expected)
    assert UP.by_sample(1000.0) == [(400, 30.0), (1400, 0.0)]


def test_a_staircase() -> None:
    stairs = plateaus("staircase", [10, 20, 10], rest_s=0.2, dwell_s=0.4, release_s=0.2)
    assert commands(stairs) == pytest.approx(np.repeat([0, 10, 20, 10, 0], [10, 20, 20, 20, 10]))


def test_a_triangle_ramps_to_its_peak_and_back() -> None:
    profile = triangle(40.0, cycles=2, rest_s=0.5, ramp_s=1.0, release_s=0.5)
    held = commands(profile)
    t = np.arange(held.size) / 50.0
    expected = np.interp(t, [0.5, 1.5, 2.5, 3.5, 4.5], [0.0, 40.0, 0.0, 40.0, 0.0])
    assert held == pytest.approx(expected, abs=0.01)
    assert held.size == 250


def test_changes_within_one_sample_are_one() -> None:
    profile = CommandProfile("free", 1.0, ((0.101, 5.0), (0.109, 7.0), (0.5, 7.0), (0.6, 0.0)))
    assert profile.by_sample(50.0) == [(6, 7.0), (30, 0.0)]


def test_the_profile_of_a_plan_is_taken_sample_by_sample(tmp_path: Path) -> None:
    chosen = profiles.family(profiles.Limits(40.0, 60.0), ("rich", "staircase", "up-step"))[0]
    profiles.write_profile(tmp_path / "next.csv", chosen, "to tell creep from sensor creep")
    t, command = chosen.sampled()
    read = read_profile(tmp_path / "next.csv")
    assert commands(read) == pytest.approx(command)
    assert read.duration_s == pytest.approx(t[-1] + 0.02)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "header"),
        ("t,p\n0,1\n", "header"),
        ("t_s,cmd_kpa\n0,1\n", "two rows"),
        ("t_s,cmd_kpa\n0,1\n0,2\n", "line 3: expected times that rise"),
        ("t_s,cmd_kpa\n0,1\n1,x\n", "line 3: expected two numbers"),
        ("t_s,cmd_kpa\n0,1\n1,-2\n", "line 3"),
        ("t_s,cmd_kpa\n0,1\n1,nan\n", "line 3"),
        ("t_s,cmd_kpa\n0,1\n1,2,3\n", "line 3"),
    ],
)
def test_what_is_no_profile_is_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "profile.csv"
    path.write_text(text)
    with pytest.raises(BadInput, match=message):
        read_profile(path)


# --- pacing ---------------------------------------------------------------------------------------


def test_set_points_are_sent_ahead_once_and_never_more_than_the_queue_holds() -> None:
    pacer = Pacer([(k, float(k)) for k in range(10, 40)], lookahead=15, queue=4, patience=3)
    assert pacer.commands(-6) == []
    assert pacer.commands(-5) == ["set 10 10"]
    assert pacer.commands(5) == ["set 11 11", "set 12 12", "set 13 13"]
    assert pacer.commands(9) == []
    assert pacer.commands(11) == ["set 14 14", "set 15 15"]
    assert pacer.commands(11) == []


def test_a_command_that_is_not_obeyed_is_sent_again_with_all_behind_it() -> None:
    pacer = Pacer([(10, 20.0), (30, 5.5)], lookahead=25, queue=8, patience=3)
    assert pacer.commands(5) == ["set 20 10", "set 5.5 30"]
    said = [pacer.see(seq, 0.0) for seq in range(6, 14)]
    assert said == [[]] * 7 + [["set 20"]]
    assert pacer.commands(13) == ["set 5.5 30"]
    assert pacer.see(14, 20.0) == []
    assert pacer.repairs == 1


def test_one_damaged_number_does_not_end_a_trial() -> None:
    progress = Progress()
    assert [progress.see(seq) for seq in (0, 1, 2, 999_999, 3, 4, 7, 8)] == [
        *(True, True, True),
        *(False, False, True, False, True),
    ]
    assert progress.seq == 8


def test_a_stream_in_any_pieces_says_the_same() -> None:
    sent = shows.stream(samples=60)
    whole = LiveStream(shows.COLUMNS, 1023).feed(sent)
    pieces = LiveStream(shows.COLUMNS, 1023)
    rng = np.random.default_rng(3)
    cuts = [0, *sorted(rng.integers(0, len(sent), size=40).tolist()), len(sent)]
    heard = [item for a, b in pairwise(cuts) for item in pieces.feed(sent[a:b])]
    assert heard == whole
    assert sum(isinstance(item, Row) for item in whole) == 60
    assert [item.greets for item in whole if isinstance(item, Remark)] == [True, False]


def test_what_a_board_says_besides_is_no_number_of_a_row() -> None:
    stream = LiveStream((*shows.COLUMNS, "state"), 1023)
    line = format_line(["0", "20000", "0.0", "512", "300", "warm"])
    (row,) = stream.feed(line + b"\n")
    assert isinstance(row, Row)
    assert set(row.fields) == set(shows.COLUMNS) - {"seq"}
    assert (stream.rows, stream.damaged) == (1, 0)


def test_an_endless_line_is_damage_and_takes_no_memory() -> None:
    stream = LiveStream(shows.COLUMNS, 1023)
    for _ in range(100):
        assert stream.feed(b"7" * 1000) == []
    assert stream.damaged == 20


def test_the_greeting_is_found_behind_noise() -> None:
    heard = b"\xff\x00gibberish\r\n" + shows.BANNER + b"# ready limit_kpa=80 watchdog_ms=500 "
    assert greeting(heard) is None
    info = greeting(heard + b"max_rate_hz=500 queue=32 speed=20\r\n")
    assert info is not None
    assert (info.limit_kpa, info.max_rate_hz, info.queue, info.speed) == (80.0, 500.0, 32, 20.0)
    assert greeting(shows.BANNER + b"# ready limit_kpa=x max_rate_hz=1 queue=2\r\n") is None


# --- a series -------------------------------------------------------------------------------------


def test_a_series_is_a_campaign_with_the_same_command_in_every_trial(tmp_path: Path) -> None:
    folder = tmp_path / "arm"
    with serving() as served:
        three = Series("step_30", 30.0, UP, STEP.options, trials=3, rest_s=8.0)
        kept = record(served, folder, three)
        sent = bytes(served.sent)
    assert [one.file for one in kept] == [
        "calibration/cal_01.log",
        *(f"step_30/trial_{k:02d}.log" for k in (1, 2, 3)),
    ]
    assert all(one.why == "" for one in kept)
    data = valid(folder)
    assert data.campaign.name == "arm"
    assert data.campaign.provenance.kind == "synthetic"
    assert data.report.warnings == ()
    assert [trial.order for trial in data.trials] == [1, 2, 3]
    starts = [trial.started_s for trial in data.trials]
    assert starts[0] == 0.0
    assert np.diff(starts) == pytest.approx(10.0, abs=6.0)  # a busy machine rests longer
    assert data.campaign.calibration[0].started_s < -1.0
    for trial in data.trials:
        assert trial.command_kpa is not None
        assert trial.command_kpa[:100] == pytest.approx(commands(UP))
        assert trial.angle_deg[60:70] == pytest.approx(30.0, abs=2.0)
    for one in kept:
        assert (folder / one.file).read_bytes() in sent  # byte for byte
    assert all(file.missing_samples == 0 for file in data.report.files)
    assert not list(folder.rglob("*.recording"))


def test_a_recorded_trial_is_never_overwritten(tmp_path: Path) -> None:
    with serving() as served:
        record(served, tmp_path, STEP)
        (tmp_path / "step_30" / "trial_02.log").write_bytes(b"mine")
        first = (tmp_path / "step_30" / "trial_01.log").read_bytes()
        kept = record(served, tmp_path, STEP, calibrate=False)
    assert kept[0].file == "step_30/trial_03.log"
    assert (tmp_path / "step_30" / "trial_01.log").read_bytes() == first
    assert (tmp_path / "step_30" / "trial_02.log").read_bytes() == b"mine"


def test_time_goes_on_between_sessions_and_in_a_campaign_that_continues(tmp_path: Path) -> None:
    first, later = tmp_path / "first", tmp_path / "later"
    with serving() as served:
        record(served, first, STEP)
        end = datetime.fromisoformat(memory(first)["clock"]["utc"])
        with RecordingFolder(first) as folder:
            hour = folder.begin_trial(
                "step_30", "step_release", 30.0, {}, now=end + timedelta(hours=1)
            )
            assert hour.started_s == pytest.approx(3602.0, abs=0.1)
            folder.finish(hour, 0.0, "nothing")
    with RecordingFolder(later, SETUP, continues=first, now=end) as folder:
        begun = folder.begin_trial(
            "more", "step_release", None, {}, now=end + timedelta(seconds=100)
        )
        begun.write((first / "step_30" / "trial_01.log").read_bytes()[:-1])
        folder.finish(begun, 2.0, None)
    campaign = read_campaign(later)
    assert campaign.continues == "first"
    (trial,) = campaign.experiments[0].trials
    assert trial.order == 2
    assert trial.started_s == pytest.approx(102.0, abs=0.1)
    earliest = read_campaign(first).calibration[0]
    assert campaign.calibration[0].started_s == earliest.started_s
    assert campaign.calibration[0].path.read_bytes() == earliest.path.read_bytes()


def memory(folder: Path):
    return yaml.safe_load((folder / "recording.yaml").read_text())


def test_a_trial_before_any_calibration_waits_for_it(tmp_path: Path) -> None:
    with serving() as served:
        kept = record(served, tmp_path, STEP, calibrate=False)
        assert kept[0].place == "step_30"
        with pytest.raises(BadInput, match="names no calibration"):
            valid(tmp_path)
        record(served, tmp_path)
    assert valid(tmp_path).campaign.calibration[0].started_s > 2.0


def test_what_a_person_wrote_above_the_keys_stays(tmp_path: Path) -> None:
    with serving() as served:
        record(served, tmp_path)
        path = tmp_path / "campaign.yaml"
        path.write_text("# glued on Monday\n" + path.read_text().replace("rubber", "silicone"))
        record(served, tmp_path, STEP, calibrate=False)
    assert path.read_text().startswith("# glued on Monday\n")
    assert read_campaign(tmp_path).material == "test silicone"


@pytest.mark.parametrize("rate_hz", [200, 1000])
def test_other_rates(tmp_path: Path, rate_hz: int) -> None:
    with serving(speed=10.0) as served:
        record(served, tmp_path, Series("step_30", 30.0, UP, {}, rate_hz=rate_hz))
    (trial,) = valid(tmp_path).trials
    assert np.median(np.diff(trial.t_s)) == pytest.approx(1.0 / rate_hz, rel=0.01)
    assert trial.command_kpa is not None
    assert np.flatnonzero(trial.command_kpa)[0] == round(0.4 * rate_hz)


# --- trouble --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("reset@0.8#2", "reset itself"),
        ("unplug@0.8#2", "port was lost"),
        ("pressure-railed@0.8#2", "trip pressure"),
        ("stall@0.8+400#2", "no new samples"),
    ],
)
def test_a_trial_cut_short_is_kept_as_aborted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, why: str
) -> None:
    monkeypatch.setattr("spa_fo.rig.recorder._SILENCE_S", 0.5)
    monkeypatch.setattr("spa_fo.rig.recorder._STOP_S", 0.5)
    with serving(fault) as served:
        kept = record(served, tmp_path, replace(STEP, trials=3))
        sent = bytes(served.sent)
    assert len(kept) == 2  # the series ends there
    assert why in kept[1].why
    log = (tmp_path / kept[1].file).read_bytes()
    assert log in sent
    (trial,) = valid(tmp_path).trials
    assert trial.experiment == "step_30" + ABORTED
    assert trial.protocol == "free"
    assert trial.t_s.size >= 35
    assert kept[1].why in [one.get("why") for one in memory(tmp_path)["logs"]]


def test_stopping_vents_and_keeps_the_trial(tmp_path: Path) -> None:
    with serving() as served:
        seen = []

        def stop() -> str | None:
            return "enough" if served.board.seq > 40 and seen[0] else None

        seen.append(True)
        kept = record(served, tmp_path, STEP, stop=lambda: stop() if seen else None)
        time.sleep(0.05)
        assert served.board.state == "idle"
    assert kept[-1].why == "enough"
    (trial,) = valid(tmp_path).trials
    assert trial.experiment == "step_30_aborted"
    assert trial.t_s[-1] < 1.9


def test_a_dead_sensor_does_not_spoil_the_campaign(tmp_path: Path) -> None:
    with serving("flex-railed@0.5#3") as served:
        kept = record(served, tmp_path, replace(STEP, trials=3))
    assert [one.place for one in kept] == ["calibration", "step_30", ""]
    assert "angle outside calibration" in kept[2].why
    data = valid(tmp_path)
    assert len(data.trials) == 1
    assert data.report.warnings == (
        "step_30/trial_02.log is in SHA256SUMS, but campaign.yaml does not name it",
    )


def test_a_calibration_of_a_dead_sensor_is_set_aside(tmp_path: Path) -> None:
    with serving("flex-stuck@0#1") as served:
        kept = record(served, tmp_path, STEP)
    assert kept[0].place == ""
    assert "counts hardly change" in kept[0].why
    assert read_campaign(tmp_path).calibration == ()


def test_a_bad_cable_costs_lines_not_trials(tmp_path: Path) -> None:
    with serving("cut=0.02", "doubled=0.02", "flipped=0.02", "lost=0.02", "glued=0.01") as served:
        kept = record(served, tmp_path, replace(STEP, trials=3))
    assert [one.why for one in kept] == [""] * 4
    data = valid(tmp_path)
    assert sum(file.damaged_lines for file in data.report.files) > 5
    for trial in data.trials:
        assert trial.command_kpa is not None
        assert set(trial.command_kpa) == {0.0, 30.0}


class DeafBoard:
    """A link whose every third command is damaged on the way; the board answers by the protocol."""

    def __init__(self, lose: int = 3) -> None:
        self.board = shows.board()
        self._out = b""
        self._count, self._lose = 0, lose

    def send(self, *commands: str) -> None:
        for command in commands:
            self._count += 1
            line = bytearray(shows.said(command))
            if self._count % self._lose == 0:
                line[0] ^= 1
            self._out += self.board.receive(bytes(line))

    def read(self) -> bytes:
        out, self._out = self._out + self.board.advance(1), b""
        return out


@pytest.mark.parametrize("lose", [2, 3, 4, 5, 7])
def test_damaged_commands_are_sent_again(lose: int) -> None:
    link = DeafBoard(lose)
    log = bytearray()
    outcome = record_trial(link, shows.INFO, UP, 50, log.extend)
    assert outcome.aborted is None
    assert outcome.lost == 0
    parsed = parse_spa_rig_log(bytes(log), "log")
    assert parsed.columns["cmd_kpa"].max() == 30.0
    assert parsed.columns["cmd_kpa"][-1] == 0.0


def test_a_board_that_does_not_obey_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    link = DeafBoard()
    monkeypatch.setattr(link.board, "_set", lambda *_: b"")
    outcome = record_trial(link, shows.INFO, UP, 50, lambda data: None)
    assert outcome.aborted == "the board does not do what it is told"


def test_a_full_disk_vents_and_says_so(tmp_path: Path) -> None:
    with serving() as served, BoardLink(served.port) as link:
        info = link.wait_ready()
        with RecordingFolder(tmp_path, SETUP) as folder:
            begun = folder.begin_trial("step_30", "step_release", 30.0, {})
            os.dup2(os.open("/dev/full", os.O_WRONLY), begun.fd)
            with pytest.raises(BadInput, match="No space left"):
                record_trial(link, info, UP, 50, begun.write)


def test_ports_that_cannot_be_opened(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="spa-fo ports lists them"):
        BoardLink(str(tmp_path / "no_board"))
    busy = pytest.raises(BadInput, match="another program has it open")
    with serving() as served, BoardLink(served.port), busy:
        BoardLink(served.port)


def test_no_board_is_told_apart_from_another_baud_rate() -> None:
    noise = pytest.raises(BadInput, match="another baud rate")
    with serving() as served, BoardLink(served.port, 115_200) as link, noise:
        link.wait_ready(0.5)
    silence = pytest.raises(BadInput, match="nothing came")
    with serving(reset_on_open=False) as served, BoardLink(served.port) as link, silence:
        link.wait_ready(0.3)


def test_a_board_that_does_not_reset_is_greeted() -> None:
    with serving(reset_on_open=False) as served, BoardLink(served.port, hello_after_s=0.05) as link:
        assert link.wait_ready(2.0).banner.board == "virtual"


def test_a_lost_port_is_a_lost_port() -> None:
    with serving("unplug@0.1") as served, BoardLink(served.port) as link:
        link.wait_ready()
        link.send("run")
        with pytest.raises(PortLost):
            drain(link)


def drain(link: BoardLink) -> None:
    for _ in range(100):
        link.read()


# --- killed ---------------------------------------------------------------------------------------


def test_two_recorders_do_not_share_a_folder(tmp_path: Path) -> None:
    with RecordingFolder(tmp_path, SETUP), pytest.raises(BadInput, match="another recorder"):
        RecordingFolder(tmp_path)
    RecordingFolder(tmp_path).close()


def test_a_folder_without_a_campaign_needs_a_material(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="--material"):
        RecordingFolder(tmp_path / "new")
    assert not (tmp_path / "new").exists()


class Killed(BaseException):
    """Stands for SIGKILL: no handler of the recorder sees it as an error."""


class Fuse:
    """Lets so many writes through and kills at the next."""

    def __init__(self, writes: int) -> None:
        self.left = writes

    def before(self, original):
        def write(*arguments):
            self.left -= 1
            if self.left == -1:
                raise Killed
            original(*arguments)

        return write


WRITES = ["spa_fo.rig.recording.write_text", "spa_fo.rig.checksums.write_text"]
WRITES += ["spa_fo.rig.campaign_files.write_text"]


@pytest.mark.parametrize("first", [True, False], ids=["first trial", "later trial"])
def test_a_kill_before_any_write_leaves_a_folder_that_the_next_run_finishes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: bool
) -> None:
    log = shows.BANNER + b"".join(
        line for line in shows.stream(samples=100).splitlines(keepends=True) if b"*" in line
    )
    outcomes = set()
    for kill_at in range(8):
        folder = tmp_path / f"{kill_at}"
        with RecordingFolder(folder, SETUP) as prepared:
            if not first:
                begun = prepared.begin_trial("step_30", "free", None, {})
                begun.write(log)
                prepared.finish(begun, 2.0, None)
        with monkeypatch.context() as patch:
            fuse = Fuse(kill_at)
            for target in WRITES:
                module, name = target.rsplit(".", 1)
                patch.setattr(target, fuse.before(getattr(sys.modules[module], name)))
            recorder = RecordingFolder(folder)
            try:
                now = datetime.now(UTC) + timedelta(minutes=1)
                begun = recorder.begin_trial("step_30", "free", None, {}, now=now)
                begun.write(log + b"100,")
                recorder.finish(begun, 2.0, None, now=now)
                outcomes.add("done")
            except Killed:
                outcomes.add(f"killed {kill_at}")
            finally:
                recorder.close()
        if not first:
            read_campaign(folder)  # valid as it lies there
        with RecordingFolder(folder) as recovered:
            assert not list(folder.rglob("*.recording"))
        logs = sorted(path.name for path in (folder / "step_30").glob("*.log"))
        if kill_at > 0:
            assert logs == ["trial_01.log"] if first else ["trial_01.log", "trial_02.log"]
            campaign = read_campaign(folder)
            assert {file.file for _, _, file in campaign.trial_files()} == {
                f"step_30/{name}" for name in logs
            }
            assert {one["file"] for one in recovered.memory["logs"]} == {
                f"step_30/{name}" for name in logs
            }
    assert "done" in outcomes
    assert len(outcomes) >= 5


def test_a_killed_recorder_is_recovered_as_aborted(tmp_path: Path) -> None:
    with serving() as served:
        record(served, tmp_path, STEP)
    with RecordingFolder(tmp_path) as folder:
        begun = folder.begin_trial("step_30", "step_release", 30.0, {})
        begun.write((tmp_path / "step_30" / "trial_01.log").read_bytes()[:2000])
        os.close(begun.fd)
    campaign = read_campaign(tmp_path)
    assert campaign.warnings == (
        "step_30/trial_02.log is still being recorded, or its recorder was killed",
    )
    with RecordingFolder(tmp_path) as folder:
        (kept,) = folder.recovered
    assert (kept.file, kept.place) == ("step_30/trial_02.log", "step_30_aborted")
    assert kept.why == KILLED
    data = valid(tmp_path)
    assert [trial.experiment for trial in data.trials] == ["step_30", "step_30_aborted"]
    assert data.trials[1].t_s.size > 40


def test_an_unlisted_log_without_a_journal_is_still_refused(tmp_path: Path) -> None:
    with serving() as served:
        record(served, tmp_path, STEP)
    (tmp_path / "step_30" / "trial_09.log").write_bytes(b"?")
    with pytest.raises(BadInput, match="is not listed"):
        read_campaign(tmp_path)


def test_a_killed_recorder_loses_nothing_that_it_had_read(tmp_path: Path) -> None:
    result = shows.kills(12, tmp_path, seed=4)
    assert result.kills == 12
    assert result.invalid == 0
    assert result.wrong_bytes == 0
    assert result.logs > 0
    assert result.lost_lines <= result.kills


# --- fuzzed ---------------------------------------------------------------------------------------


def test_fuzzed_streams_neither_crash_nor_hang_nor_let_a_wrong_row_in() -> None:
    result = shows.fuzz(150, seed=11)
    assert result.streams == 150
    assert result.wrong_rows == 0
    assert result.damages > 1000
    assert result.rows > 5000
    assert result.refused < 15  # those whose banner was hit


@pytest.mark.parametrize("begins", [b"", shows.BANNER])
def test_endless_noise_is_given_up(monkeypatch: pytest.MonkeyPatch, begins: bytes) -> None:
    monkeypatch.setattr("spa_fo.rig.recorder._SILENCE_S", 0.3)
    monkeypatch.setattr("spa_fo.rig.recorder._STOP_S", 0.2)
    rng = np.random.default_rng(1)

    class Noise:
        first = begins

        def send(self, *commands: str) -> None:
            pass

        def read(self) -> bytes:
            out, self.first = self.first + rng.bytes(100), b""
            return out

    outcome = record_trial(Noise(), shows.INFO, UP, 50, lambda data: None)
    assert outcome.aborted is not None
    assert outcome.rows == 0


def test_a_fast_board_loses_no_sample(tmp_path: Path) -> None:
    result = shows.endurance(2.5, tmp_path)
    assert result.samples >= 2500
    assert result.lost == 0
    assert result.damaged == 0
    assert result.same_bytes


# --- the commands ---------------------------------------------------------------------------------


def run(*arguments: object) -> int:
    time.sleep(CLOSED_S)
    try:
        return main([str(argument) for argument in arguments])
    except SystemExit as end:
        return int(end.code or 0)


def test_a_campaign_by_commands(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "arm"
    here = ["--campaign", folder]
    calibrate = ["--angles", "0,20,40,20,0", "--settle", "0.01", "--dwell", "0.4"]
    short = ["--rest", "0.4", "--dwell", "0.6", "--release", "0.4", "--rest-between", "5"]
    profile = tmp_path / "next.csv"
    profile.write_text("# spa-fo profile 1 test\nt_s,cmd_kpa\n0,0\n0.5,12.5\n1,0\n")
    with serving() as served:
        new = ["--material", "test rubber"]
        assert run("record", "calibration", served.port, *here, *new, *calibrate) == 0
        step = ["--experiment", "step_30", "--setpoint", "30", "--pressure", "30", *short]
        assert run("record", served.port, *here, *step, "--trials", "2") == 0
        assert run("record", served.port, *here, "--experiment", "step_30") == 0
        assert run("record", served.port, *here, "--experiment", "p", "--profile", profile) == 0
        assert run("record", served.port, *here, "--experiment", "p") == 0
        other = tmp_path / "other.csv"
        other.write_text("t_s,cmd_kpa\n0,0\n0.5,10\n1,0\n")
        assert run("record", served.port, *here, "--experiment", "p", "--profile", other) == 2
        assert "is not the profile of the trials" in capfd.readouterr().err
    data = valid(folder)
    assert [trial.label for trial in data.trials] == [
        *("step_30 trial 1", "step_30 trial 2", "step_30 trial 3", "p trial 1", "p trial 2")
    ]
    same = [trial.command_kpa[:70].tolist() for trial in data.trials[:3]]
    assert same[0] == same[1] == same[2]
    assert data.trials[3].command_kpa.max() == 12.5
    assert data.campaign.provenance.kind == "synthetic"


def test_a_person_is_led_through_the_angles(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    asked: list[str] = []
    here = ["--campaign", tmp_path, "--material", "m", "--angles", "0,20,40", "--dwell", "0.4"]
    with serving() as served:
        monkeypatch.setattr("builtins.input", asked.append)
        assert run("record", "calibration", served.port, *here) == 0
        assert [question.split(" deg")[0] for question in asked] == [
            "1/3: set the fixture to 0",
            "2/3: set the fixture to 20",
            "3/3: set the fixture to 40",
        ]

        def nobody(question: str) -> None:
            if question.startswith("2/3"):
                raise EOFError

        monkeypatch.setattr("builtins.input", nobody)
        assert run("record", "calibration", served.port, *here) == 1
    assert "nobody is there to press Enter" in capfd.readouterr().err
    angles = read_spa_rig_log(tmp_path / "calibration" / "cal_01.log").columns["angle_deg"]
    assert np.unique(angles).tolist() == [0.0, 20.0, 40.0]
    (listed,) = yaml.safe_load((tmp_path / "campaign.yaml").read_text())["calibration"]
    assert listed["file"] == "calibration/cal_01.log"
    assert (tmp_path / "calibration" / "cal_02.log").exists()


def test_an_aborted_trial_is_done_again_by_name_alone(tmp_path: Path) -> None:
    here = ["--campaign", tmp_path, "--material", "m", "--experiment", "x"]
    asked = ["--setpoint", "30", "--pressure", "30", "--rest", "0.2", "--dwell", "0.4"]
    with serving("reset@0.3#1") as served:
        assert run("record", served.port, *here, *asked, "--release", "0.2") == 1
        assert run("record", served.port, *here) == 0
    again = read_campaign(tmp_path).experiments
    assert [(it.name, it.setpoint_deg, it.protocol) for it in again] == [
        ("x_aborted", None, "free"),
        ("x", 30.0, "step_release"),
    ]
    assert "samples" not in memory(tmp_path)["logs"][0]  # a reset board does not know


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--experiment", "x"], "--pressure: expected the command in kPa"),
        (["--experiment", "x", "--pressure", "120"], "the board's limit is 100 kPa"),
        (["--experiment", "x", "--pressure", "10,20"], "one pressure for a step_release"),
        (["--experiment", "x", "--protocol", "free"], "--profile: expected a file"),
        (
            ["--experiment", "x", "--pressure", "9", "--ramp", "2"],
            "--ramp: a step_release has none",
        ),
        (["--experiment", "x", "--pressure", "9", "--rate", "2000"], "samples at 1000 Hz"),
        (["--experiment", "a/b", "--pressure", "9"], "--experiment: expected letters"),
        (["--pressure", "9"], "--experiment: expected a name"),
        (["--experiment", "x", "--profile", "/nowhere.csv"], "/nowhere.csv: cannot be read"),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_trial(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    with serving() as served:
        here = ["--campaign", tmp_path, "--material", "m"]
        assert run("record", served.port, *here, *arguments) == 2
    last = capfd.readouterr().err.splitlines()[-1]
    assert last.startswith("spa-fo: ")
    assert message in last
    assert not list(tmp_path.rglob("*.log"))


def test_the_pressure_of_a_setpoint_by_a_model(tmp_path: Path) -> None:
    model = tmp_path / "model.json"
    model.write_text(
        json.dumps(
            {
                "transfer_function": {"a0": 1.6, "b0": 0.8},
                "input": {"signal": "command", "reference_kpa": 30.0},
            }
        )
    )
    with serving() as served:
        here = ["--campaign", tmp_path / "arm", "--material", "m", "--experiment", "x"]
        short = ["--rest", "0.2", "--dwell", "0.4", "--release", "0.2"]
        assert run("record", served.port, *here, *short, "--setpoint", "30", "--model", model) == 0
    log = read_spa_rig_log(tmp_path / "arm" / "x" / "trial_01.log")
    assert log.columns["cmd_kpa"].max() == pytest.approx(np.radians(30) * 2.0 * 30.0, abs=0.01)


def test_a_setpoint_alone_commands_the_reference_and_says_so(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with serving() as served:
        here = ["--campaign", tmp_path / "arm", "--material", "m", "--experiment", "x"]
        short = ["--rest", "0.2", "--dwell", "0.4", "--release", "0.2"]
        assert run("record", served.port, *here, *short, "--setpoint", "30") == 0
    assert "reference of 30 kPa" in capfd.readouterr().err
    log = read_spa_rig_log(tmp_path / "arm" / "x" / "trial_01.log")
    assert log.columns["cmd_kpa"].max() == 30.0


def test_ctrl_c_vents_keeps_the_trial_and_says_so(tmp_path: Path) -> None:
    arguments = ["--campaign", str(tmp_path), "--material", "m", "--experiment", "x"]
    arguments += ["--pressure", "20", "--rest", "0.1", "--dwell", "20"]
    with serving(speed=1.0) as served:
        process = subprocess.Popen(
            [sys.executable, "-m", "spa_fo.cli", "record", served.port, *arguments],
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(400):
            if served.board.seq > 20:
                break
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=20)
        assert served.board.state == "idle"
    assert process.returncode == 130
    assert "aborted: stopped by the operator (in campaign.yaml as x_aborted)" in said
    log = read_spa_rig_log(tmp_path / "x" / "trial_01.log")
    assert log.columns["cmd_kpa"].max() == 20.0
    assert log.report.damaged == {}


def test_help_shows_an_example(capfd: pytest.CaptureFixture[str]) -> None:
    for command in (["record"], ["ports"], ["check"], ["rig"], ["rig", "serve"]):
        assert run(*command, "--help") == 0
        assert f"spa-fo {' '.join(command)}" in capfd.readouterr().out.split("example:")[1]


def test_ports_are_listed(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    from spa_fo.rig import board_link

    class Comport:
        device, description, vid = "/dev/ttyACM7", "Arduino Mega 2560", 0x2341

    monkeypatch.setattr(board_link.list_ports, "comports", lambda: [Comport()])
    assert run("ports") == 0
    assert capfd.readouterr().out == "/dev/ttyACM7  Arduino Mega 2560\n"


def test_the_live_view_shows_values_and_nothing_in_a_file(tmp_path: Path) -> None:
    class Terminal:
        text = ""

        def isatty(self) -> bool:
            return True

        def write(self, text: str) -> None:
            self.text += text

        def flush(self) -> None:
            pass

    row = Row(3, {"t_us": 5.0, "cmd_kpa": 30.0, "p_adc": 146.0, "flex_adc": 300.0})
    terminal = Terminal()
    view = LiveView("step_30 1/2", 4, 2.0, read_sensor(), None, terminal)  # type: ignore[arg-type]
    view(row)
    view.close()
    assert "step_30 1/2 [######                  ] 0.5/2.0 s  command 30.0 kPa" in terminal.text
    assert "pressure 29.5 kPa  flex 300" in terminal.text
    with (tmp_path / "out").open("w") as out:
        LiveView("x", 4, 2.0, out=out)(row)
    assert (tmp_path / "out").read_text() == ""


def read_sensor():
    from spa_fo.rig.live_check import USUAL_SENSOR

    return USUAL_SENSOR


def test_the_account_of_a_trial() -> None:
    from spa_fo.rig.recorded_log import Kept

    outcome = Outcome(rows=690, damaged=2, taken=692)
    assert account(Kept("a/trial_01.log", "a", ""), outcome) == (
        "a/trial_01.log: 690 samples, 2 lost, 2 damaged lines"
    )
    outcome = Outcome("the port was lost (gone)", rows=3)
    assert account(Kept("", "", "nothing came"), outcome).startswith(
        "nothing was recorded: the port"
    )
