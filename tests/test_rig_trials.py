"""From a campaign folder to trials: angles, pressures, flags, and what was refused."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import naive_rig
from naive_rig import data_line, log, rows
from spa_fo.errors import BadInput
from spa_fo.rig import CampaignData, Trial, load_trials, read_campaign, read_trials, write_trials
from spa_fo.rig.protocol_check import command_changes, contradiction

TRIAL = "step_20/trial_02.log"


def read(folder: Path) -> CampaignData:
    return read_trials(read_campaign(folder))


def with_trial(tmp_path: Path, data: bytes, **experiment: Any) -> Path:
    """The small campaign with other bytes for its second trial."""
    document: dict[str, Any] = naive_rig.description()
    document["experiments"][0].update(experiment)
    return naive_rig.write_campaign(tmp_path / "small", document, {TRIAL: data})


def refused(folder: Path) -> str:
    with pytest.raises(BadInput) as caught:
        read(folder)
    text = str(caught.value)
    assert text.isprintable()
    return text.replace(str(folder), "small")


def edited(fields: dict[int, dict[int, object]], n: int = 200) -> bytes:
    """A log with some columns of some rows replaced, checksums made good."""
    lines = rows(n, seed=2)
    for place, changes in fields.items():
        texts: list[object] = [*lines[place].split(b"*")[0].decode().split(",")]
        for column, value in changes.items():
            texts[column] = value
        lines[place] = data_line(*texts)
    return log(lines)


def test_trials_in_the_order_of_the_description(tmp_path: Path) -> None:
    data = read(naive_rig.write_campaign(tmp_path / "small"))
    assert [(t.experiment, t.trial, t.order, t.started_s) for t in data.trials] == [
        ("step_20", 1, 1, 0.0),
        ("step_20", 2, 2, 60.0),
    ]
    trial = data.trials[1]
    assert (trial.protocol, trial.setpoint_deg, trial.label) == ("step", 20.0, "step_20 trial 2")
    assert trial.t_s[0] == 0.0
    assert trial.command_kpa is not None
    assert trial.pressure_kpa is not None
    assert trial.flex_adc is not None
    assert trial.command_kpa[[0, -1]].tolist() == [0.0, 20.0]
    counts = [float(row.split(b",")[3]) for row in rows(seed=2)]
    expected = (np.array(counts) * 5.0 / 1023 - 0.5) / 4.0 * 551.6
    np.testing.assert_allclose(trial.pressure_kpa, expected, rtol=1e-13, atol=1e-12)
    # The sensor's counts are 350 + 4 a degree, and rise by 90.
    assert trial.angle_deg[-50:].mean() == pytest.approx(22.5, abs=0.4)
    assert not trial.after_reset.any()
    assert data.report.warnings == ()


def test_the_angle_comes_through_the_earliest_calibration(tmp_path: Path) -> None:
    data = read(naive_rig.write_campaign(tmp_path / "small"))
    assert data.calibration is data.calibrations[0]
    assert data.calibration is not None
    assert data.calibration.file == "calibration/pre.log"
    for trial in data.trials:
        assert trial.flex_adc is not None
        np.testing.assert_array_equal(trial.angle_deg, data.calibration.angle_deg(trial.flex_adc))
        np.testing.assert_array_equal(
            trial.outside_calibration, data.calibration.outside(trial.flex_adc)
        )
    assert data.drifts[0].mean_deg == pytest.approx(1.5, abs=0.15)


def test_damage_is_reported_by_file(tmp_path: Path) -> None:
    lines = rows(200, seed=2)
    lines[10] = lines[10][:-3]
    lines[20] = lines[20].replace(b"*", b"1*")
    folder = with_trial(tmp_path, log([*lines[:150], naive_rig.BANNER.encode(), *rows(40)])[:-5])
    data = read(folder)
    report = {file.file: file for file in data.report.files}[TRIAL]
    assert report.resets == 1
    assert {key: item.count for key, item in report.damaged.items()} == {"cut": 2, "checksum": 1}
    assert data.trials[1].after_reset.sum() == 39
    stored = json.loads(json.dumps(data.report.to_dict()))
    entry = next(file for file in stored["files"] if file["file"] == TRIAL)
    assert entry["damaged"]["checksum"] == {"count": 1, "first_lines": [22]}
    table = data.report.to_markdown()
    assert (
        "| step_20/trial_02.log | 192 | 187 | 2 cut (lines 12, 192), 1 checksum (line 22) |"
        in table
    )


@pytest.mark.parametrize(("before", "known"), [(10, 100), (120, 120)])
def test_a_reset_at_any_time_leaves_a_trial_to_read(
    tmp_path: Path, before: int, known: int
) -> None:
    data = read(with_trial(tmp_path, log([*rows(before), naive_rig.BANNER.encode(), *rows(90)])))
    assert np.count_nonzero(~data.trials[1].after_reset) == known


def test_excursions_are_flagged_and_counted(tmp_path: Path) -> None:
    # Undershoot of 5 deg below a calibration from 0 to 90 deg.
    data = read(with_trial(tmp_path, edited({i: {4: 330} for i in range(40, 60)})))
    trial = data.trials[1]
    assert trial.outside_calibration[40:60].all()
    assert trial.angle_deg[45] == pytest.approx(-5.0, abs=0.5)
    report = data.report.files[-1]
    assert report.outside_calibration == trial.outside_calibration.sum() >= 20


def test_samples_far_outside_the_calibration_are_left_out_and_told(tmp_path: Path) -> None:
    # The sensor's counts are 350 + 4 a degree; calibrated up to 90 deg.
    far = {i: {4: 830} for i in range(100, 103)}  # 120 deg
    data = read(with_trial(tmp_path, edited(far)))
    assert data.trials[1].t_s.size == 197
    report = data.report.files[-1]
    assert report.damaged["far outside calibration"].count == 3
    assert report.damaged["far outside calibration"].first_lines == (102, 103, 104)
    assert data.report.warnings == (
        "step_20/trial_02.log: 3 of 200 samples lie far outside the calibration, 0 to 90 deg, "
        "and are left out",
    )
    assert "3 far outside calibration (lines 102, 103, 104)" in data.report.to_markdown()


def test_a_trial_that_lies_outside_its_calibration_for_the_most_part_is_refused(
    tmp_path: Path,
) -> None:
    def trial(samples: int) -> bytes:
        return edited({i: {4: 830} for i in range(200 - samples, 200)})

    assert read(with_trial(tmp_path / "half", trial(100))).trials[1].t_s.size == 100
    text = refused(with_trial(tmp_path / "most", trial(101)))
    assert text.startswith(
        "small/step_20/trial_02.log: angle outside calibration: 101 of 200 samples, "
    )
    assert text.endswith("but calibration/pre.log covers 0 to 90 deg")


def test_a_plateau_a_little_outside_is_flagged_and_one_beyond_is_refused(tmp_path: Path) -> None:
    # The sensor's counts are 350 + 4 a degree; calibrated up to 90 deg.
    for counts, angle_deg in ((734, 96.0), (762, 103.0)):
        folder = tmp_path / str(counts)
        near = read(with_trial(folder, edited({i: {4: counts} for i in range(60, 200)})))
        assert near.trials[1].outside_calibration[60:].all()
        assert near.trials[1].angle_deg[-1] == pytest.approx(angle_deg, abs=0.5)
    far = with_trial(tmp_path / "far", edited({i: {4: 822} for i in range(60, 200)}))
    assert "angle outside calibration: 140 of 200 samples" in refused(far)


def test_a_broken_contact_is_no_angle(tmp_path: Path) -> None:
    data = read(with_trial(tmp_path, edited({100: {4: 0}, 101: {4: 0}})))
    assert data.trials[1].t_s.size == 198
    report = data.report.files[-1]
    assert report.damaged["adc dropout"].first_lines == (102, 103)
    assert report.valid == 198


def test_a_sensor_torn_off_is_not_a_broken_contact(tmp_path: Path) -> None:
    some = read(with_trial(tmp_path / "some", edited({i: {4: 0} for i in range(100, 120)})))
    assert some.report.files[-1].damaged["far outside calibration"].count == 20
    most = with_trial(tmp_path / "most", edited({i: {4: 0} for i in range(60, 180)}))
    assert "angle outside calibration: 120 of 200 samples" in refused(most)


def test_a_command_no_pump_could_mean(tmp_path: Path) -> None:
    data = read(with_trial(tmp_path, edited({100: {2: "20000"}})))
    assert data.report.files[-1].damaged["command range"].first_lines == (102,)
    assert data.trials[1].command_kpa is not None
    assert data.trials[1].command_kpa.max() == 20.0


def test_a_line_that_lost_two_equal_bytes_passes_its_checksum(tmp_path: Path) -> None:
    """And its command is that of no other row."""
    data = read(with_trial(tmp_path, edited({100: {2: "0.00"}})))
    damaged = data.report.files[-1].damaged["command for one row"]
    assert (damaged.first_lines, data.trials[1].protocol) == ((102,), "step")
    assert data.trials[1].command_kpa is not None
    assert set(data.trials[1].command_kpa.tolist()) == {0.0, 20.0}
    assert data.trials[1].t_s.size == data.trials[0].t_s.size - 1


def test_a_free_command_may_change_for_one_row(tmp_path: Path) -> None:
    data = read(with_trial(tmp_path, edited({100: {2: "0.00"}}), protocol="free"))
    assert not data.report.files[-1].damaged
    assert data.trials[1].t_s.size == data.trials[0].t_s.size


def test_a_log_may_hold_the_angle_itself(tmp_path: Path) -> None:
    document: dict[str, Any] = naive_rig.description()
    del document["calibration"]
    banner = naive_rig.BANNER.replace("flex_adc", "angle_deg")
    files = {f"step_20/trial_{i:02d}.log": log(rows(seed=i), banner) for i in (1, 2)}
    folder = naive_rig.write_campaign(tmp_path / "small", document, files)
    for stray in (folder / "calibration").iterdir():
        stray.unlink()
    naive_rig.write_checksums(folder)
    data = read(folder)
    assert data.calibration is None
    assert data.trials[0].flex_adc is None
    assert data.trials[0].angle_deg.max() > 400


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"hello\n", "small/step_20/trial_02.log: line 1: expected the banner"),
        (np.random.default_rng(0).bytes(3000), "small/step_20/trial_02.log: line 1: expected"),
        (log([row[:-1] + b"g" for row in rows()]), "holds no valid sample in 201 lines: 200"),
        (
            naive_rig.calibration_log(seed=7),
            "line 1: campaign.yaml says it is a trial, but its columns are seq,t_us,angle_deg,flex",
        ),
        (
            log(rows(seed=2), naive_rig.BANNER.replace("5000", "3300")),
            "line 1: its banner means vref_mv 3300, but campaign.yaml says pressure_sensor.vref_mv",
        ),
        (
            log(rows(seed=2), naive_rig.BANNER.replace("=10", "=12")),
            "its banner means adc_max 4095, but campaign.yaml says pressure_sensor.adc_max 1023",
        ),
        (
            log(rows(rise=10**6)),
            "campaign.yaml says that experiment 'step_20' is a step, but its command is 0 through",
        ),
        (
            edited({i: {2: "40.00"} for i in range(120, 200)}),
            "is a step, but its command rises 2 times; expected one step",
        ),
        (
            edited({i: {2: f"{i / 10:.2f}"} for i in range(200)}),
            "is a step, but its command rises 0 times; expected one step",
        ),
        (log(rows(1)), "holds fewer than 2 valid samples"),
    ],
    ids=lambda value: value[:40] if isinstance(value, str) else "",
)
def test_a_description_that_lies_about_a_trial(tmp_path: Path, data: bytes, message: str) -> None:
    assert message in refused(with_trial(tmp_path, data))


def test_who_needs_no_protocol_takes_a_contradicted_one_for_free(tmp_path: Path) -> None:
    stairs = edited({i: {2: "40.00"} for i in range(120, 200)})
    campaign = read_campaign(with_trial(tmp_path, stairs))
    with pytest.raises(BadInput, match="expected one step"):
        read_trials(campaign)
    data = read_trials(campaign, protocols="free")
    assert {trial.protocol for trial in data.trials} == {"free"}
    assert [experiment.protocol for experiment in data.campaign.experiments] == ["free"]
    (warning,) = [text for text in data.report.warnings if "rises 2 times" in text]
    assert warning.startswith("step_20/trial_02.log: campaign.yaml says")
    assert warning.endswith("it is taken for a free one")
    assert {
        trial.protocol
        for trial in read_trials(
            read_campaign(with_trial(tmp_path / "sound", log(rows(seed=2)))), protocols="free"
        ).trials
    } == {"step"}


def test_a_trial_of_another_setpoint(tmp_path: Path) -> None:
    text = refused(with_trial(tmp_path, log(rows(seed=2, level=45.0))))
    assert "kPa, but the trials of experiment 'step_20' command 32.5 kPa in the middle" in text
    free = with_trial(tmp_path / "free", log(rows(seed=2, level=45.0)), setpoint_deg=None)
    assert len(read(free).trials) == 2


def test_a_file_that_cannot_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = naive_rig.write_campaign(tmp_path / "small")
    plain = Path.read_bytes

    def failing(path: Path) -> bytes:
        if path.name == "trial_02.log":
            raise PermissionError(13, "Permission denied")
        return plain(path)

    monkeypatch.setattr(Path, "read_bytes", failing)
    assert "trial_02.log: cannot be read (Permission denied); expected a raw" in refused(folder)


def test_a_trial_given_as_calibration(tmp_path: Path) -> None:
    folder = naive_rig.write_campaign(
        tmp_path / "small", files={"calibration/post.log": log(rows(seed=8))}
    )
    text = refused(folder)
    assert text.startswith("small/calibration/post.log: line 1: campaign.yaml says it is a calib")


def test_a_calibration_without_counts(tmp_path: Path) -> None:
    lines = [data_line(i, 20_000 * i, 15 * (i // 20)) for i in range(200)]
    banner = naive_rig.CALIBRATION_BANNER.replace(",flex_adc", "")
    folder = naive_rig.write_campaign(
        tmp_path / "small", files={"calibration/pre.log": log(lines, banner)}
    )
    assert "expected seq,t_us,angle_deg,flex_adc" in refused(folder)


def test_a_calibration_of_two_angles(tmp_path: Path) -> None:
    lines = [data_line(i, 20_000 * i, 90 * (i // 100), 350 + i // 100) for i in range(200)]
    folder = naive_rig.write_campaign(
        tmp_path / "small",
        files={"calibration/pre.log": log(lines, naive_rig.CALIBRATION_BANNER)},
    )
    assert "calibration/pre.log: holds dwells at 2 known angles" in refused(folder)


def test_counts_without_any_calibration(tmp_path: Path) -> None:
    document: dict[str, Any] = naive_rig.description()
    del document["calibration"]
    folder = naive_rig.write_campaign(tmp_path / "small", document)
    assert "holds flex counts, but campaign.yaml names no calibration" in refused(folder)


def test_trials_that_overlap_are_a_warning(tmp_path: Path) -> None:
    document: dict[str, Any] = naive_rig.description()
    document["experiments"][0]["trials"][1]["started_s"] = 2.0
    data = read(naive_rig.write_campaign(tmp_path / "small", document))
    assert data.report.warnings[0].startswith("step_20 trial 1 ends at 4.0 s of campaign time")


def same(a: Trial, b: Trial) -> bool:
    pairs = [(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(Trial)]
    return all(
        np.array_equal(x, y) and x.dtype == y.dtype if isinstance(x, np.ndarray) else x == y
        for x, y in pairs
    )


def test_the_table_of_trials_reads_back_exactly(tmp_path: Path) -> None:
    data = read(with_trial(tmp_path, log([*rows(120), naive_rig.BANNER.encode(), *rows(9)])))
    path = tmp_path / "trials.csv"
    write_trials(path, data.trials)
    loaded = load_trials(path, data.campaign)
    assert all(same(a, b) for a, b in zip(data.trials, loaded, strict=True))
    bare = [
        dataclasses.replace(t, command_kpa=None, pressure_kpa=None, flex_adc=None)
        for t in data.trials
    ]
    write_trials(path, bare)
    assert all(same(a, b) for a, b in zip(bare, load_trials(path, data.campaign), strict=True))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: "", "cannot be read"),
        (lambda t: t.replace("angle_deg", "angle"), "line 1: expected the columns"),
        (lambda t: t.replace("step_20,2,", "step_20,3,"), "lacks step_20 trial 2"),
        (lambda t: t + "other,1" + 7 * ",1" + "\n", "holds other trial 1"),
        (lambda t: t + "step_20,2,1\n", "line 402: expected 9 fields"),
        (lambda t: t + "step_20,2,1,1,1,1,nan,0,0\n", "step_20 trial 2: expected finite"),
        (lambda t: t + "step_20,2,1,1,1,1,x,0,0\n", "step_20 trial 2: could not convert"),
    ],
)
def test_a_table_that_is_not_the_campaigns(tmp_path: Path, change: Any, message: str) -> None:
    data = read(naive_rig.write_campaign(tmp_path / "small"))
    path = tmp_path / "trials.csv"
    write_trials(path, data.trials)
    path.write_text(change(path.read_text()))
    with pytest.raises(BadInput, match=message):
        load_trials(path, data.campaign)


def test_logs_without_pressure_need_no_pressure_sensor(tmp_path: Path) -> None:
    document = naive_rig.description()
    document.pop("pressure_sensor")
    files = {f"step_20/trial_0{k}.log": naive_rig.log_without_pressure(k) for k in (1, 2)}
    data = read(naive_rig.write_campaign(tmp_path / "small", document, files))
    assert [trial.pressure_kpa for trial in data.trials] == [None, None]
    assert data.trials[0].command_kpa is not None
    assert data.trials[0].angle_deg.max() > 5.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("bits=10", "bits=12"), "adc_max 4095, but that of the calibration 1023"),
        (("vref_mv=5000", "vref_mv=3300"), "vref_mv 3300, but that of the calibration 5000"),
    ],
)
def test_without_a_pressure_sensor_the_calibration_says_which_converter_it_was(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    document = naive_rig.description()
    document.pop("pressure_sensor")
    banner = naive_rig.BANNER.replace(*change)
    files = {f"step_20/trial_0{k}.log": naive_rig.log_without_pressure(k, banner) for k in (1, 2)}
    folder = naive_rig.write_campaign(tmp_path / "small", document, files)
    with pytest.raises(BadInput, match=message):
        read(folder)


def test_counts_of_a_pressure_need_its_sensor(tmp_path: Path) -> None:
    document = naive_rig.description()
    document.pop("pressure_sensor")
    folder = naive_rig.write_campaign(tmp_path / "small", document)
    with pytest.raises(BadInput) as caught:
        read(folder)
    assert str(caught.value) == (
        f"{folder / 'campaign.yaml'}: pressure_sensor: is missing; step_20/trial_01.log holds "
        "p_adc, ADC counts"
    )


CSV = {
    "format": "csv",
    "columns": {
        "time": {"column": "t", "unit": "ms"},
        "command": {"column": "c", "unit": "bar"},
        "angle": {"column": "a", "unit": "rad", "rest": "zero"},
    },
}


def csv_campaign(tmp_path: Path, text: str, form: dict[str, Any] = CSV) -> Path:
    document: dict[str, Any] = naive_rig.description(1)
    document.pop("calibration")
    document.pop("pressure_sensor")
    document["log"] = form
    document["experiments"][0]["trials"][0]["file"] = "a.csv"
    folder = tmp_path / "small"
    folder.mkdir()
    naive_rig.write_campaign(folder, document, {"a.csv": text.encode()})
    return folder


def test_rest_zero_is_the_mean_before_the_first_change(tmp_path: Path) -> None:
    lines = [
        f"{500 + 10 * i},{0.2 * (i >= 20)},{0.1 + 0.001 * (i % 2) + i // 20}" for i in range(60)
    ]
    trial = read(csv_campaign(tmp_path, "t,c,a\n" + "\n".join(lines) + "\n")).trials[0]
    assert trial.t_s[0] == 0.0
    assert trial.t_s[-1] == pytest.approx(0.59)
    assert trial.angle_deg[:20].mean() == pytest.approx(0.0, abs=1e-12)
    assert trial.angle_deg[20] == pytest.approx(np.degrees(1.0 - 0.0005))
    assert trial.command_kpa is not None
    assert trial.command_kpa.max() == pytest.approx(20.0)
    assert trial.pressure_kpa is None
    keep = {**CSV, "columns": {**CSV["columns"], "angle": {"column": "a", "unit": "rad"}}}  # type: ignore[dict-item]
    (tmp_path / "kept").mkdir()
    kept = read(csv_campaign(tmp_path / "kept", "t,c,a\n" + "\n".join(lines) + "\n", keep))
    assert kept.trials[0].angle_deg[0] == pytest.approx(np.degrees(0.1))


def test_a_zero_from_few_samples_is_noted(tmp_path: Path) -> None:
    text = "t,c,a\n0,0,0.1\n10,0.2,0.1\n20,0.2,0.5\n"
    report = read(csv_campaign(tmp_path, text)).report
    assert report.files[0].notes == ("its zero is the mean of only 1 samples",)
    still = {**CSV, "columns": {k: v for k, v in CSV["columns"].items() if k != "command"}}  # type: ignore[attr-defined]
    (tmp_path / "still").mkdir()
    (trial,) = read(csv_campaign(tmp_path / "still", text, still)).trials
    assert trial.angle_deg.mean() == pytest.approx(0.0, abs=1e-12)
    assert trial.command_kpa is None


def test_csv_flex_counts_go_through_the_calibration(tmp_path: Path) -> None:
    document: dict[str, Any] = naive_rig.description(1)
    document["log"] = {
        "format": "csv",
        "columns": {
            "time": {"column": "t", "unit": "s"},
            "command": {"column": "c", "unit": "kPa"},
            "flex_adc": {"column": "f", "unit": 1},
        },
    }
    document["experiments"][0]["trials"][0]["file"] = "a.csv"
    text = "t,c,f\n" + "".join(f"{i / 50},{20 * (i > 9)},{350 + 4 * i}\n" for i in range(90))
    folder = naive_rig.write_campaign(tmp_path / "small", document, {"a.csv": text.encode()})
    trial = read(folder).trials[0]
    np.testing.assert_allclose(trial.angle_deg, np.arange(90), atol=0.5)


def test_the_changes_of_a_command() -> None:
    t = np.arange(0.0, 10.0, 0.02)
    step = np.where(t > 1, 20.0, 0.0)
    assert command_changes(t, step).tolist() == [20.0]
    assert command_changes(t, step - np.where(t > 6, 20.0, 0.0)).tolist() == [20.0, -20.0]
    ramp = np.clip((t - 1) / 0.2, 0, 1) * 20.0
    np.testing.assert_allclose(command_changes(t, ramp), [20.0])
    noisy = step + np.random.default_rng(0).normal(0, 0.02, t.size)
    np.testing.assert_allclose(command_changes(t, noisy), [20.0], atol=0.1)
    assert command_changes(t, np.full(t.size, 7.0)).tolist() == [7.0]
    assert command_changes(t, np.zeros(t.size)).size == 0
    assert command_changes(t, t).size == 0


def test_protocols_are_held_to_their_word() -> None:
    t = np.arange(0.0, 20.0, 0.02)
    step = np.where(t > 1, 20.0, 0.0)
    stairs = 10.0 * np.minimum(np.floor(t / 4), 3)
    triangle = 20.0 * (1 - np.abs(t / 10 - 1))
    assert contradiction("step", t, step) is None
    assert contradiction("step_release", t, step * (t < 10)) is None
    assert contradiction("step_release", t, step) is None
    assert contradiction("staircase", t, stairs) is None
    assert contradiction("triangle", t, triangle) is None
    fast = 20.0 * (1 - np.abs(np.minimum(t, 3.0) / 1.5 - 1))  # up in 1.5 s and down again
    assert contradiction("triangle", t, fast) is None
    assert contradiction("hold", t, step) is None
    assert contradiction("free", t, 0 * t) is None
    assert contradiction("step", t, 0 * t + 20.0) is None
    assert contradiction("step_release", t, 20.0 * (t < 10)) is None
    assert contradiction("step", t, stairs) == "its command rises 3 times; expected one step"
    assert contradiction("step", t, triangle) == "its command rises 0 times; expected one step"
    for other in (step, step * (t < 10)):
        assert "expected several steps" in str(contradiction("staircase", t, other))
        assert contradiction("triangle", t, other) == "its command jumps by 20 kPa; expected ramps"
    assert contradiction("hold", t, 0 * t) == "its command is 0 throughout"
