"""Implausible numbers are told in one line, impossible ones refused, plausible ones neither."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import campaigns
from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.plant import Model, TransferFunction, write_model
from spa_fo.plant.belonging import strangers
from spa_fo.rig import CampaignData, read_campaign, read_trials

Edit = Callable[[Path, dict[str, Any]], None]


def column(role: str, **keys: object) -> Edit:
    return lambda _, document: document["log"]["columns"][role].update(keys)


def reference(kpa: float) -> Edit:
    return lambda _, document: document["input"].update(reference_kpa=kpa)


def cells(place: int, value: str, *, every: bool) -> Edit:
    def edit(folder: Path, _: dict[str, Any]) -> None:
        for path in sorted(folder.rglob("*.csv")):
            head, *rows = (line.split(",") for line in path.read_text().splitlines())
            for row in rows if every else rows[50:51]:
                row[place] = value
            path.write_text("\n".join(",".join(row) for row in [head, *rows]) + "\n")

    return edit


def edited(folder: Path, edit: Edit, *, steps: bool = True) -> Path:
    write = campaigns.step_campaign if steps else campaigns.free_campaign
    document = write(folder, trials=2)
    edit(folder, document)
    campaigns.write_yaml(folder, document)
    campaigns.write_sums(folder)
    return folder


def read(folder: Path) -> CampaignData:
    return read_trials(read_campaign(folder))


def odd(folder: Path) -> list[str]:
    """The campaign's warnings but those on copies, which constant angles make."""
    return [line for line in read(folder).report.warnings if "a copy?" not in line]


TOLD: dict[str, tuple[Edit, str]] = {
    "degrees labelled rad": (
        column("angle", unit="rad"),
        "beyond a full turn, in step_30 trial 1, step_30 trial 2, step_60 trial 1 and 1 more: "
        "log.columns.angle says rad, the logs may hold degrees",
    ),
    "radians labelled deg": (
        column("angle", scale=0.0174533),
        "the angle reaches 1.2 deg at most: log.columns.angle says deg, the logs may hold radians",
    ),
    "far beyond a turn": (
        column("angle", scale=100.0),
        "more: log.columns.angle may have another scale",
    ),
    "a wild sample": (cells(2, "5e3", every=False), "the angle reaches 5000 deg, beyond a full"),
    "no movement": (
        cells(2, "5.0", every=True),
        "the angle does not move at all in step_30 trial 1, step_30 trial 2, step_60 trial 1 and",
    ),
    "a hundred times the reference": (
        column("command", scale=100.0),
        "input.reference_kpa is 30, but the commands reach 5510 kPa: a unit or scale of",
    ),
    "a hundredth of the reference": (reference(3000.0), "is 3000, but the commands reach 55.1 kPa"),
}


def held(place: int, begin: int, end: int, value: str = "") -> Edit:
    """Repeat a value of a column, or the one that stands where it begins."""

    def edit(folder: Path, _: dict[str, Any]) -> None:
        path = sorted(folder.rglob("*.csv"))[0]
        head, *rows = (line.split(",") for line in path.read_text().splitlines())
        repeated = value or rows[begin][place]
        for row in rows[begin:end]:
            row[place] = repeated
        path.write_text("\n".join(",".join(row) for row in [head, *rows]) + "\n")

    return edit


def test_a_channel_that_stands_still_while_its_input_moves_is_told(tmp_path: Path) -> None:
    (line,) = odd(edited(tmp_path / "frozen", held(2, 150, 399)))
    assert line.startswith("the angle stands at ")
    assert line.endswith("while what bends it moves, in step_30 trial 1: frozen, or not read anew")
    (line,) = odd(edited(tmp_path / "rail", held(2, 150, 399, "70")))
    assert line.startswith("the angle reads 70 deg, its largest, for ")
    assert line.endswith("in step_30 trial 1: at its rail or against a stop")
    # The command does not move in that time, or the time is short.
    assert odd(edited(tmp_path / "plateau", held(2, 100, 150))) == []
    assert odd(edited(tmp_path / "short", held(2, 195, 205))) == []


def test_angles_of_a_broken_contact_are_left_out(tmp_path: Path) -> None:
    report = read(edited(tmp_path / "arm", held(2, 120, 123, "0"))).report
    assert report.files[0].damaged["angle dropout"].first_lines == (122, 123, 124)
    assert sum("angle dropout" in file.damaged for file in report.files) == 1
    long = read(edited(tmp_path / "long", held(2, 120, 140, "0"))).report
    assert not any("angle dropout" in file.damaged for file in long.files)


@pytest.mark.parametrize("case", TOLD)
def test_the_implausible_is_told(tmp_path: Path, case: str) -> None:
    edit, words = TOLD[case]
    (line,) = odd(edited(tmp_path / "arm", edit))
    assert words in line


def test_an_angle_in_another_unit_than_its_setpoint(tmp_path: Path) -> None:
    def scaled(_: Path, document: dict[str, Any]) -> None:
        for experiment in document["experiments"]:
            experiment["setpoint_deg"] /= 57.3

    (line,) = odd(edited(tmp_path / "arm", scaled))
    assert "deg for a setpoint_deg of 0.52" in line


def test_the_plausible_is_not_told(tmp_path: Path) -> None:
    for i, edit in enumerate((reference(2.0), reference(1000.0), column("angle", scale=-4.0))):
        assert odd(edited(tmp_path / f"{i}", edit)) == []


def test_a_warning_is_in_the_report_and_told_by_commands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = edited(tmp_path / "arm", reference(3000.0))
    assert main(["parse", str(folder)]) == 0
    assert "- input.reference_kpa is 3000, but" in capsys.readouterr().out
    model = tmp_path / "model.json"
    write_model(model, Model("arm", "test rubber", TransferFunction(**campaigns.TRUTH), 3000.0))
    assert main(["predict", str(model), str(folder), "--out", str(tmp_path / "p.csv")]) == 0
    assert f"{folder}: input.reference_kpa is 3000" in capsys.readouterr().err


@pytest.mark.parametrize("steps", [True, False], ids=["steps", "whole logs"])
@pytest.mark.parametrize(
    ("edit", "where"),
    [
        (column("angle", scale=1e300), "holds 0 valid rows in"),
        (cells(2, "1e300", every=True), "too large (lines 2, 3, 4, 5, 6, ...)"),
        (column("time", scale=1e300), "too large"),
        (column("time", scale=1e-300), "s; expected a trial's time, in the unit of log.columns."),
        (reference(1e300), "campaign.yaml: input.reference_kpa: is 1e+300, but the commands"),
        (reference(1e-300), "campaign.yaml: input.reference_kpa: is 1e-300, but the commands"),
        (column("command", scale=1e-300), "campaign.yaml: input.reference_kpa: is 30, but the"),
        (column("angle", scale=1e-300), "log.columns.angle: the angle does not move in any trial"),
        (cells(2, "5.0", every=True), "log.columns.angle: the angle does not move in any trial"),
    ],
)
def test_the_impossible_is_refused_in_one_line(
    tmp_path: Path, edit: Edit, where: str, steps: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = edited(tmp_path / "arm", edit, steps=steps)
    out = tmp_path / "model.json"
    with pytest.raises(SystemExit) as left:
        main(["fit", str(folder), "--out", str(out)])
    assert left.value.code == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert where in error
    assert not out.exists()


@pytest.mark.parametrize("value", ["inf", "-inf", "1e300", "1e999", "nan"])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_value_that_is_none_costs_its_row_alone(tmp_path: Path, value: str, place: int) -> None:
    data = read(edited(tmp_path / "arm", cells(place, value, every=False)))
    assert [file.valid for file in data.report.files] == [399] * 4
    assert all(file.damaged_lines == 1 for file in data.report.files)


def test_a_model_says_where_it_does_not_belong(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "arm"
    campaigns.step_campaign(folder, trials=2)
    campaign = read_campaign(folder)

    def model(name: str = "arm", of: str = "test rubber", kpa: float = 30.0) -> Model:
        return Model(name, of, TransferFunction(**campaigns.TRUTH), kpa)

    assert strangers(model(), campaign) is None
    assert strangers(model(kpa=20.0), campaign) is None
    path = tmp_path / "model.json"
    write_model(path, model("leg", "steel", 3000.0))
    assert main(["predict", str(path), str(folder), "--out", str(tmp_path / "p.csv")]) == 0
    assert (
        f"{path}: the model is of campaign 'leg', this is 'arm'; it is of steel, this is test "
        "rubber; it has reference_kpa 3000, this campaign 30\n" in capsys.readouterr().err
    )


def test_a_campaign_that_continues_the_models_own_is_no_stranger(tmp_path: Path) -> None:
    document = campaigns.step_campaign(tmp_path / "arm", trials=2)
    campaigns.write_yaml(tmp_path / "arm", {**document, "continues": "leg"})
    model = Model("leg", "test rubber", TransferFunction(**campaigns.TRUTH), 30.0)
    assert strangers(model, read_campaign(tmp_path / "arm")) is None


def test_a_trial_that_lasts_no_time_names_its_file(tmp_path: Path) -> None:
    folder = edited(tmp_path / "arm", column("time", scale=1e-300))
    with pytest.raises(BadInput, match=r"step_30/trial_01\.csv: lasts 1\.6e-299 s; expected"):
        read(folder)
