"""Real logs of others, read by configuration alone; the worst of them refused with the reason."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import naive_rig
from spa_fo.errors import BadInput
from spa_fo.rig import CampaignData, read_campaign, read_trials
from spa_fo.rig.csv_log import read_csv_log
from spa_fo.rig.log_format import Column, LogFormat

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"


def build(tmp_path: Path, shared_data: Path, name: str) -> CampaignData:
    """Make the campaign as the example's README says, and read it."""
    folder = tmp_path / name
    shutil.copytree(shared_data / name, folder)
    shutil.copy(EXAMPLES / name / "campaign.yaml", folder)
    naive_rig.write_checksums(folder)
    return read_trials(read_campaign(folder))


def test_the_soft_arm(tmp_path: Path, shared_data: Path) -> None:
    data = build(tmp_path, shared_data, "soft_arm_steps")
    assert data.campaign.provenance.kind == "measured"
    assert [trial.t_s.size for trial in data.trials] == [5785, 6599, 6159, 5947, 6059]
    for trial, psi in zip(data.trials, (5, 10, 15, 20, 25), strict=True):
        assert trial.command_kpa is not None
        assert trial.pressure_kpa is not None
        assert trial.command_kpa[0] == 0.0
        assert trial.command_kpa.max() == pytest.approx((psi - 1.5) * 6.894757, rel=1e-6)
        assert np.count_nonzero(np.diff(trial.command_kpa) > 0) == 6
        assert abs(trial.angle_deg[:100].mean()) < 0.1
    tops = [trial.angle_deg.max() for trial in data.trials]
    assert tops == sorted(tops)
    assert sum(file.damaged_lines for file in data.report.files) == 0
    assert data.report.warnings == ()


def test_the_bellow(tmp_path: Path, shared_data: Path) -> None:
    data = build(tmp_path, shared_data, "bellow_bending")
    assert [trial.t_s.size for trial in data.trials] == [4551] * 3
    for trial, volts in zip(data.trials, (7, 9, 11), strict=True):
        assert trial.command_kpa is not None
        assert trial.command_kpa.max() == pytest.approx(100 * volts / 12, rel=1e-4)
        assert trial.angle_deg.max() > 35
        assert trial.angle_deg.min() < -30


@pytest.mark.parametrize("name", ["dragon_skin_20", "fx_pro"])
def test_the_stand_in_campaigns(name: str) -> None:
    data = read_trials(read_campaign(EXAMPLES.parent / "raw" / name))
    files = data.report.files
    for file in files:
        other = file.duplicates + file.comments + file.banners
        assert file.valid + file.damaged_lines + other == file.lines
    assert sum(file.damaged_lines for file in files) > 5
    assert sum(file.resets for file in files) == 1
    assert sum(file.wraps for file in files) == 1
    assert len(data.trials) == 18
    for trial in data.trials:
        assert np.isfinite(trial.angle_deg).all()
        assert np.all(np.diff(trial.t_s) > 0)
    assert data.calibration is not None
    assert data.calibration.range_deg == (0.0, 90.0)
    assert len(data.drifts) == 1


def columns(**places: tuple[int | str, str]) -> dict[str, Column]:
    return {role: Column(place, unit) for role, (place, unit) in places.items()}


PUMP = LogFormat("csv", ";", False, columns(time=(1, "s"), pressure=(4, "hPa"), command=(6, "1")))
PUMP_7 = LogFormat("csv", ";", False, columns(time=(1, "s"), pressure=(5, "hPa"), command=(7, "1")))
ARM = LogFormat("csv", columns=columns(time=("time", "s"), command=("pd_4", "psi")))
ARM_BY_INDEX = LogFormat("csv", columns=columns(time=(1, "s"), command=(2, "psi"), angle=(20, "1")))
GLOVE = LogFormat("csv", columns=columns(time=("Time_ms", "ms"), flex_adc=("Thumb", "1")))
PADDED = LogFormat("csv", ",", False, columns(time=(1, "s"), command=(2, "1"), angle=(6, "deg")))
DOTS = LogFormat("csv", ";", False, columns(time=(1, "ms"), pressure=(3, "kPa")))

QUIRKS: list[tuple[str, LogFormat, int | None, dict[str, int] | str]] = [
    ("OldPumpDynamics__PressureVoltage__Exp1102OudeActuator__data12.txt", PUMP, 1026, {"nan": 474}),
    ("OldPumpDynamics__PressureVoltage__OudeData__data.txt", PUMP_7, 481, {"cut": 1}),
    (
        "OldPumpDynamics__PressureVoltage__OudeData__data10b.txt",
        LogFormat("csv", ";", False, columns(time=(1, "s"), pressure=(5, "hPa"))),
        209,
        {"cut": 1},
    ),
    ("OldPumpDynamics__PressureVoltage__OudeData__data13.txt", PUMP_7, 107, {"nan": 1393}),
    (
        "OldPumpDynamics__PressureVoltage__OudeData__data13.txt",
        PUMP,
        None,
        "holds 0 valid rows in 1500 lines; expected at least 2; left out:",
    ),
    ("OldPumpDynamics__PressureVoltage__V4__dataxxx.txt", PUMP, None, "is empty; expected a csv"),
    ("OldPumpDynamics__PumpwActuatorwAirtank__README.txt", PUMP, None, "1 cut (line 1)"),
    ("OldPumpDynamics__StepResponse__README.txt", PUMP, None, "1 fields (line 1)"),
    (
        "OldPumpDynamics__StepResponse__pomp12.txt",
        LogFormat("csv", ";", False, columns(time=(1, "s"), pressure=(4, "hPa"))),
        1072,
        {},
    ),
    ("PIDpressureControl__OldMeasurements__PressurePIDxxx.txt", PUMP, None, "1 cut (line 1)"),
    ("aborted_run.csv", ARM, None, "holds 1 valid rows in 2 lines; expected at least 2"),
    ("flex_adc_dropout.csv", GLOVE, 400, {}),
    (
        "header_37_rows_41.csv",
        ARM,
        None,
        "the header has 37 names but the rows have 41 fields, so 'time' could be any",
    ),
    ("header_37_rows_41.csv", ARM_BY_INDEX, 399, {}),
    ("padded_no_header.txt", PADDED, 300, {}),
    (
        "thousands_dots_CC0.csv",
        DOTS,
        None,
        "line 10: '1.035.000' looks like thousands grouped by dots",
    ),
]


@pytest.mark.parametrize(("file", "form", "valid", "left_out"), QUIRKS)
def test_logs_at_their_worst(
    shared_data: Path,
    file: str,
    form: LogFormat,
    valid: int | None,
    left_out: dict[str, int] | str,
) -> None:
    path = shared_data / "log_quirks" / file
    if isinstance(left_out, str):
        with pytest.raises(BadInput) as caught:
            read_csv_log(path, form)
        assert left_out in str(caught.value)
        assert file in str(caught.value)
        return
    report = read_csv_log(path, form).report
    assert {reason: item.count for reason, item in report.damaged.items()} == left_out
    assert report.valid == valid


def test_every_quirk_has_an_expectation(shared_data: Path) -> None:
    found = {path.name for path in (shared_data / "log_quirks").iterdir()}
    assert found == {file for file, _, _, _ in QUIRKS}


def test_a_dropout_of_the_converter_is_left_out_of_the_trial(
    tmp_path: Path, shared_data: Path
) -> None:
    document = naive_rig.description(1)
    document["log"] = {
        "format": "csv",
        "columns": {
            "time": {"column": "Time_ms", "unit": "ms"},
            "flex_adc": {"column": "Thumb", "unit": 1},
        },
    }
    document["experiments"] = [
        {
            "name": "glove",
            "protocol": "free",
            "trials": [{"file": "glove.csv", "order": 1, "started_s": 0}],
        }
    ]
    glove = (shared_data / "log_quirks" / "flex_adc_dropout.csv").read_bytes()
    files = {"glove.csv": glove, "calibration/pre.log": naive_rig.calibration_log(offset=300)}
    data = read_trials(read_campaign(naive_rig.write_campaign(tmp_path / "glove", document, files)))
    report = data.report.files[-1]
    assert report.damaged["adc dropout"].first_lines == (199,)
    assert report.valid == data.trials[0].t_s.size == 399
