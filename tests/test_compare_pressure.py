"""What changed between two campaigns whose logs hold command and pressure, and no angle."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from blind.first_rig import write_case
from blind_documents import document, read
from spa_fo.api import Campaign, Comparison
from spa_fo.cli import main
from spa_fo.compare.pressure_alone import _held_to
from spa_fo.errors import BadInput
from spa_fo.gap.decide.verdict import chosen

ROOT = Path(__file__).resolve().parent.parent
RICH = {"name": "rich", "repeats": 2}


def without_angle(campaign: Path, out: Path, *columns: str) -> Path:
    """Write what a campaign holds again, as csv of these columns and no angle."""
    data = read(campaign)
    columns = columns or ("command", "pressure")
    logged = []
    for trial in data.trials:
        signals = {"time": trial.t_s, "command": trial.command_kpa, "pressure": trial.pressure_kpa}
        about = (trial.experiment, trial.trial, trial.order, trial.started_s, trial.protocol)
        logged.append((about, np.column_stack([signals[name] for name in ("time", *columns)])))
    return write_pressures(out, logged, columns, data.campaign.reference_kpa)


def write_pressures(
    out: Path, logged: list[Any], columns: tuple[str, ...], reference_kpa: float
) -> Path:
    """Write a campaign of command and pressure."""
    out.mkdir(parents=True)
    experiments: dict[str, dict[str, Any]] = {}
    sums = []
    head = ",".join(("time", *columns))
    for (experiment, number, order, started_s, protocol), rows in logged:
        file = f"{experiment}_{number}.csv"
        np.savetxt(out / file, rows, "%.6g", ",", header=head, comments="")
        sums.append(f"{hashlib.sha256((out / file).read_bytes()).hexdigest()}  {file}\n")
        one = {"name": experiment, "protocol": protocol, "trials": []}
        trials = experiments.setdefault(experiment, one)["trials"]
        trials.append({"file": file, "order": order, "started_s": started_s})
    (out / "SHA256SUMS").write_text("".join(sums))
    units = {"time": "s", "command": "kPa", "pressure": "kPa"}
    description = {
        "schema": "spa-fo/campaign/1",
        "name": out.name,
        "material": "drive",
        "provenance": {"kind": "synthetic"},
        "log": {
            "format": "csv",
            "columns": {name: {"column": name, "unit": units[name]} for name in ("time", *columns)},
        },
        "input": {"reference_kpa": reference_kpa},
        "experiments": list(experiments.values()),
    }
    (out / "campaign.yaml").write_text(yaml.safe_dump(description, sort_keys=False))
    return out


def sines(out: Path, delay_s: float, seed: int) -> Path:
    """Command slow sines without any jump to a drive that is late."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 20.0, 0.05)
    logged = []
    for number in range(1, 7):
        kpa = [30.0 - 30.0 * np.cos(np.pi * np.maximum(t - late, 0.0)) for late in (0.0, delay_s)]
        measured = kpa[1] + 0.05 * rng.standard_normal(len(t))
        about = ("sine", number, number, 60.0 * number, "free")
        logged.append((about, np.column_stack((t, kpa[0], measured))))
    return write_pressures(out, logged, ("command", "pressure"), 60.0)


def pair(folder: Path, *effects: str, size: float = 6.0, seed: int = 11) -> tuple[Path, Path]:
    """Measure the pressure of one drive before any effect, and with these."""
    model = {"kind": "earlier", "off": 0.0}
    asked = document(*effects, size=size, seed=seed, protocol=RICH, model=model)
    write_case(asked, folder / "case")
    return (
        without_angle(folder / "case" / "earlier", folder / "before"),
        without_angle(folder / "case" / "campaign", folder / "after"),
    )


def test_pressures_are_compared_whatever_their_protocol_says(tmp_path: Path) -> None:
    folders = [sines(tmp_path / name, 0.1, seed) for seed, name in enumerate(("before", "after"))]
    for folder in folders:
        text = (folder / "campaign.yaml").read_text().replace("protocol: free", "protocol: step")
        (folder / "campaign.yaml").write_text(text)
    assert Comparison.of_pressure(*folders).kind == "nothing_changed"


@pytest.fixture(scope="module")
def leaking(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return pair(tmp_path_factory.mktemp("leaking"), "leak")


def test_nothing_changed_where_nothing_did(tmp_path: Path) -> None:
    comparison = Comparison.of_pressure(*pair(tmp_path))
    assert comparison.kind == "nothing_changed"
    assert comparison.causes == ()
    assert set(comparison.document["where"]["stage"].values()) == {0.0}
    assert comparison.headline()[0] == "Nothing changed in the drive (100 %); no angle was logged."


@pytest.mark.parametrize(
    ("effect", "seed"), [("line_lag", 11), ("slew_limit", 11), ("dead_time", 11), ("leak", 12)]
)
def test_what_changed_in_the_drive_is_named(effect: str, seed: int, tmp_path: Path) -> None:
    comparison = Comparison.of_pressure(*pair(tmp_path, effect, seed=seed))
    assert comparison.kind in ("cause", "ambiguous")
    assert (effect,) == comparison.causes[0]
    assert comparison.document["where"]["stage"]["drive"] == 1.0


def test_a_command_that_never_jumps_is_compared_all_over(tmp_path: Path) -> None:
    same = Comparison.of_pressure(
        sines(tmp_path / "before", 0.1, 5), sines(tmp_path / "again", 0.1, 6)
    )
    assert same.kind == "nothing_changed"
    later = Comparison.of_pressure(tmp_path / "before", sines(tmp_path / "after", 0.2, 7))
    assert later.kind != "nothing_changed"
    chances = [cause["probability"] for cause in later.document["causes"]]
    assert chances == sorted(chances, reverse=True)


def test_an_effect_of_the_actuator_is_not_seen(tmp_path: Path) -> None:
    assert Comparison.of_pressure(*pair(tmp_path, "contact_stop")).kind == "nothing_changed"


def test_the_files_are_those_of_the_contract_in_kpa(
    leaking: tuple[Path, Path], tmp_path: Path
) -> None:
    comparison = Comparison.of_pressure(*leaking)
    assert comparison.causes == (("leak",),)
    comparison.save(tmp_path / "changed")
    found = json.loads((tmp_path / "changed" / "comparison.json").read_text())
    assert (found["schema"], found["compared"]) == ("spa-fo/comparison/1", "pressure")
    assert found["verdict"]["kind"] == "cause"
    assert sum(cause["probability"] for cause in found["causes"]) == pytest.approx(1.0)
    assert found["gap"]["rmse_kpa"] > 3.0 * found["gap"]["noise_floor_kpa"]
    assert not any(key.endswith("_deg") for key in keys(found))
    rate = found["causes"][0]["parameters"]["leak"]["rate_per_s"]
    assert rate["ci95"][0] < rate["value"] < rate["ci95"][1]
    page = (tmp_path / "changed" / "comparison.md").read_text()
    assert "°" not in page
    assert "No angle was logged" in page
    for name in ("measured.png", "change.png"):
        assert (tmp_path / "changed" / name).stat().st_size > 1000
    assert not (tmp_path / "changed" / "augmented_model.json").exists()
    with pytest.raises(BadInput, match="holds no angle"):
        _ = comparison.model


def keys(part: Any) -> Iterator[str]:
    if isinstance(part, dict):
        for key, value in part.items():
            yield key
            yield from keys(value)
    elif isinstance(part, list):
        for item in part:
            yield from keys(item)


def test_the_command(
    leaking: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = map(str, leaking)
    out = str(tmp_path / "changed")
    assert main(["compare", before, after, "--out", out]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("What changed: leak")
    assert said[-1].endswith("comparison.md")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--model", "campaign.yaml"], "belongs to campaigns that both hold an angle"),
        (["--exclude-effect", "laek"], "did you mean 'leak'"),
    ],
)
def test_a_bad_request_is_one_line(
    leaking: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    said: str,
) -> None:
    before, after = leaking
    options = [str(before / each) if each.endswith(".yaml") else each for each in options]
    with pytest.raises(SystemExit) as left:
        main(["compare", str(before), str(after), "--out", str(tmp_path / "changed"), *options])
    assert left.value.code == 2
    assert said in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "changed").exists()


@pytest.mark.parametrize("command", ["fit", "parse"])
def test_every_other_command_refuses_a_log_without_an_angle(
    command: str, leaking: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main([command, str(leaking[0]), "--out", str(tmp_path / "out")])
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "expected a column 'angle' or 'flex_adc'" in line
    with pytest.raises(BadInput, match="expected a column 'angle' or 'flex_adc'"):
        Campaign.load(leaking[0])


def test_without_pressure_there_is_nothing_to_compare(
    leaking: tuple[Path, Path], tmp_path: Path
) -> None:
    bare = without_angle(leaking[0].parent / "case" / "earlier", tmp_path / "bare", "command")
    with pytest.raises(BadInput, match="expected a command and a pressure column"):
        Comparison.of_pressure(leaking[0], bare)


def test_a_reference_with_an_angle_is_compared_by_its_pressure(
    leaking: tuple[Path, Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    earlier = leaking[0].parent / "case" / "earlier"
    assert main(["compare", str(earlier), str(leaking[1]), "--out", str(tmp_path / "out")]) == 0
    assert capsys.readouterr().out.startswith("What changed: leak")


def test_a_name_needs_a_change_that_is_clear() -> None:
    """What is within three times of what was expected has no name, and what is beyond is some."""
    weighed = {(): 0.2, ("leak",): 0.7}
    errors = {(): 5.0, ("leak",): 0.1}
    small, unknown = _held_to(weighed, 0.1, errors, clearly=False)
    assert (small["leak",], unknown) == (0.0, pytest.approx(0.8))
    clear, unknown = _held_to(weighed, 0.1, errors, clearly=True)
    assert (clear["leak",], unknown) == (pytest.approx(0.7), pytest.approx(0.1))
    useless, _ = _held_to(weighed, 0.1, {(): 5.0, ("leak",): 4.9}, clearly=True)
    assert useless["leak",] == 0.0
    nothing, unknown = _held_to({(): 0.9}, 0.1, {(): 5.0}, clearly=True)
    assert chosen(list(nothing.items()), unknown) == ("unknown", ())


# --- measured ------------------------------------------------------------------------------------


def test_nothing_changed_within_a_measured_log(
    measured: Any, shared_data: Path, tmp_path: Path
) -> None:
    """Earlier and later cycles of one log, and halves of one."""
    halves = [pair for pair in measured.PAIRS if "early to late" in pair.name]
    assert len(halves) == 5
    for each in halves:
        found = measured.compared(each, shared_data, tmp_path)
        assert found.kind == "nothing_changed", each.name
        assert found.result.compared == "pressure"
