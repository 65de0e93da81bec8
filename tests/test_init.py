"""``spa-fo init``: from a folder of raw logs to a campaign that the other commands read."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import naive_rig
from foreign_habits import HABITS, RATE_HZ, command, driven, write_folder
from spa_fo.cli import main
from spa_fo.rig import CampaignData, read_campaign, read_trials
from spa_fo.rig.protocol_guess import guess_protocol, same_command
from spa_fo.validation import load_yaml

WRITTEN = {"campaign.yaml", "SHA256SUMS", "overview.png"}


def digests(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


def initialised(folder: Path) -> CampaignData:
    """Run init, then parse; the raw files are as they were and nothing else was written."""
    before = digests(folder)
    assert main(["init", str(folder)]) == 0
    after = digests(folder)
    assert {name: after[name] for name in before} == before
    assert set(after) - set(before) == WRITTEN
    assert main(["parse", str(folder)]) == 0
    return read_trials(read_campaign(folder))


def refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    before = digests(folder) if folder.is_dir() else {}
    with pytest.raises(SystemExit) as left:
        main(["init", str(folder)])
    assert left.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert (digests(folder) if folder.is_dir() else {}) == before
    return error


@pytest.mark.parametrize("habit", HABITS)
def test_a_folder_in_any_habit_becomes_a_campaign(tmp_path: Path, habit: str) -> None:
    folder = write_folder(tmp_path / "arm", HABITS[habit])
    (folder / "README.txt").write_text("What was measured, and why\n")
    data = initialised(folder)
    assert [(e.name, e.protocol, len(e.trials)) for e in data.campaign.experiments] == [
        ("step_release_28kpa", "step_release", 3),
        ("step_release_50kpa", "step_release", 1),
        ("staircase_30kpa", "staircase", 1),
    ]
    orders = {file.file: file.order for _, _, file in data.campaign.trial_files()}
    assert orders == {f"run_{i:02d}.csv": i for i in range(1, 6)}
    assert data.campaign.reference_kpa == pytest.approx(50.0)
    made = driven(command((1, 0), (10, 28), (5, 0)))
    first = data.trials[0]
    assert first.command_kpa is not None
    assert first.pressure_kpa is not None
    np.testing.assert_allclose(first.command_kpa, made.command, atol=0.02)
    np.testing.assert_allclose(first.pressure_kpa, made.pressure, atol=0.2)
    np.testing.assert_allclose(first.angle_deg, made.angle, atol=0.3)
    text = (folder / "campaign.yaml").read_text(encoding="utf-8")
    assert "material: unknown  # UNSURE" in text
    assert "#   README.txt: holds no rows of numbers" in text
    assert data.report.warnings == ()


def test_dates_give_order_and_campaign_time(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "arm", HABITS["german_stamps"])
    names = sorted(path.name for path in folder.iterdir())
    for name in names:
        (folder / name).rename(folder / f"z{9 - int(name[4:6])}.csv")  # names against time
    data = initialised(folder)
    started = {file.file: file.started_s for _, _, file in data.campaign.trial_files()}
    assert started == {f"z{9 - i}.csv": pytest.approx(600.0 * (i - 1)) for i in range(1, 6)}
    assert "order and started_s" not in (folder / "campaign.yaml").read_text()


def test_without_dates_the_order_of_names_is_unsure(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "arm", HABITS["plain"])
    (folder / "run_02.csv").rename(folder / "run_10.csv")
    data = initialised(folder)
    orders = {file.file: file.order for _, _, file in data.campaign.trial_files()}
    assert orders["run_10.csv"] == 5
    text = (folder / "campaign.yaml").read_text()
    assert "UNSURE: order and started_s: the logs do not say when they began" in text


def test_from_raw_folder_to_a_fit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_folder(tmp_path / "arm", HABITS["labview"], ".lvm")
    model = tmp_path / "model.json"
    assert main(["init", str(folder)]) == 0
    assert main(["fit", str(folder), "--out", str(model)]) == 0
    assert load_yaml(model)["input"]["reference_kpa"] == 50.0
    capsys.readouterr()


def test_subfolders_name_experiments(tmp_path: Path) -> None:
    write_folder(tmp_path / "arm" / "day 1", HABITS["plain"])
    one = tmp_path / "arm" / "fast"
    one.mkdir()
    (one / "a.csv").write_bytes(HABITS["plain"](driven(command((1, 0), (2, 10), (2, 20), (2, 0)))))
    data = initialised(tmp_path / "arm")
    assert [e.name for e in data.campaign.experiments][-1] == "fast"


def test_what_is_there_is_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_folder(tmp_path / "arm", HABITS["plain"])
    for name in ("campaign.yaml", "SHA256SUMS"):
        (folder / name).write_text("mine")
        line = refused(folder, capsys)
        assert f"{folder / name}: is there already; expected a folder of logs without it" in line
        (folder / name).unlink()
    (folder / "overview.png").write_bytes(b"mine")
    assert main(["init", str(folder)]) == 0
    assert (folder / "overview.png").read_bytes() == b"mine"


def test_folders_that_make_no_campaign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "is not there; expected a folder of logs" in refused(tmp_path / "none", capsys)
    folder = tmp_path / "arm"
    folder.mkdir()
    assert "holds no log to read; expected csv or spa-rig logs\n" in refused(folder, capsys)
    (folder / "note.txt").write_text("nothing\n")
    assert "spa-rig logs; note.txt: holds no rows of numbers" in refused(folder, capsys)
    rows = "\n".join(f"{i / 25},{30 * (i > 25)}" for i in range(100))
    (folder / "a.csv").write_text(f"t_s,cmd_kPa\n{rows}\n")
    assert "holds no log with an angle (a.csv: time, command)" in refused(folder, capsys)


def test_odd_files_are_left_out_and_told(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "arm", HABITS["plain"])
    (folder / "copy.csv").write_bytes((folder / "run_01.csv").read_bytes())
    (folder / "empty.csv").write_bytes(b"")
    (folder / "board.log").write_text("booting\nready\n")
    (folder / "other.csv").write_bytes(HABITS["german_excel"](driven(command((1, 0), (3, 9)), 9)))
    (folder / ".hidden.csv").write_bytes(b"1,2\n")
    data = initialised(folder)
    assert sum(1 for _ in data.campaign.trial_files()) == 5
    text = (folder / "campaign.yaml").read_text(encoding="utf-8")
    assert "#   run_01.csv: holds the same bytes as copy.csv" in text
    assert "#   empty.csv: is empty; expected a csv log" in text
    assert "#   board.log: holds no rows of numbers" in text
    assert "#   other.csv: is not written as the others: line 1 names no column" in text
    assert ".hidden" not in text


def test_a_folder_of_a_boards_logs(tmp_path: Path) -> None:
    folder = naive_rig.write_campaign(tmp_path / "small")
    for name in ("campaign.yaml", "SHA256SUMS"):
        (folder / name).unlink()
    data = initialised(folder)
    assert [(e.name, len(e.trials)) for e in data.campaign.experiments] == [("step_20", 2)]
    assert [item.file for item in data.campaign.calibration] == [
        "calibration/pre.log",
        "calibration/post.log",
    ]
    assert data.campaign.calibration[0].started_s < 0.0 < data.campaign.calibration[1].started_s
    assert "pressure_sensor:  # UNSURE" in (folder / "campaign.yaml").read_text()


def test_a_folder_of_a_boards_logs_without_pressure_names_no_sensor(tmp_path: Path) -> None:
    logs = {f"step_20/trial_0{k}.log": naive_rig.log_without_pressure(k) for k in (1, 2)}
    folder = naive_rig.write_campaign(tmp_path / "small", files=logs)
    for name in ("campaign.yaml", "SHA256SUMS"):
        (folder / name).unlink()
    data = initialised(folder)
    assert data.campaign.pressure_sensor is None
    assert data.trials[0].pressure_kpa is None


RAMP = np.linspace(0.0, 30.0, 200)
COMMANDS = {
    "step": command((1, 0), (9, 30)),
    "step_release": command((1, 0), (9, 30), (5, 0)),
    "hold": command((1, 0), (60, 30), (10, 0)),
    "staircase": command((1, 0), (4, 10), (4, 20), (4, 30), (4, 0)),
    "triangle": np.concatenate([np.zeros(25), RAMP, RAMP[::-1], RAMP, RAMP[::-1], np.zeros(50)]),
    "free": 15.0 - 15.0 * np.cos(np.arange(1000) / 40.0),
}


@pytest.mark.parametrize("protocol", COMMANDS)
@given(rest_s=st.floats(0.2, 5.0), scale=st.floats(0.1, 1e4), base=st.floats(0.0, 0.5))
@settings(deadline=None, max_examples=25)
def test_a_protocol_is_told_whatever_its_size(
    protocol: str, rest_s: float, scale: float, base: float
) -> None:
    u = scale * (COMMANDS[protocol] / 30.0 + base * (protocol not in ("hold", "free")))
    u = np.concatenate([np.full(round(rest_s * RATE_HZ), u[0]), u])
    assert guess_protocol(np.arange(u.size) / RATE_HZ, u)[0] == protocol


def test_pulses_are_free_and_so_is_nothing() -> None:
    pulses = np.tile(command((2, 0), (4, 30)), 5)
    t = np.arange(pulses.size) / RATE_HZ
    assert guess_protocol(t, pulses)[0] == "free"
    assert guess_protocol(t, np.zeros(t.size))[0] == "free"


def test_a_controllers_output_is_free() -> None:
    rng = np.random.default_rng(0)
    output = np.convolve(rng.normal(0.0, 50.0, 1040), np.ones(40) / 5.0, mode="valid")
    assert guess_protocol(np.arange(output.size) / RATE_HZ, output)[0] == "free"


def test_repeats_have_one_command() -> None:
    def timed(u: np.ndarray, jitter: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        return np.arange(u.size) / RATE_HZ + jitter * np.sin(np.arange(u.size)), u

    step, staircase = COMMANDS["step_release"], COMMANDS["staircase"]
    later = np.concatenate([np.zeros(40), step])
    assert same_command(timed(step), timed(later, 0.01))
    assert not same_command(timed(step), timed(1.1 * step))
    assert not same_command(timed(step), timed(staircase))
    assert not same_command(timed(step), timed(COMMANDS["hold"]))
    assert not same_command(timed(np.zeros(99)), timed(np.zeros(99)))
