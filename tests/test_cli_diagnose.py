"""``spa-fo diagnose`` as its users run it: what it writes and prints, and what it refuses."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import campaigns
from spa_fo.cli import main
from spa_fo.plant.effects.library import IDS

# Few effects, so that a diagnosis takes a second.
KEPT = ("stiffening", "parameter_shift", "sensor_saturation")
FEW = [word for name in IDS if name not in KEPT for word in ("--exclude-effect", name)]


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=3)
    return folder


def write_model(path: Path, **changes: Any) -> Path:
    document = {
        "schema": "spa-fo/model/1",
        "campaign": "another",
        "material": "test rubber",
        "transfer_function": campaigns.TRUTH,
        "input": {"signal": "command", "reference_kpa": campaigns.REFERENCE_KPA},
        "output": {"unit": "rad"},
        "effects": [],
    }
    path.write_text(json.dumps(document | changes))
    return path


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The model that the logs were made with."""
    return write_model(tmp_path_factory.mktemp("model") / "truth.json")


@pytest.fixture(scope="module")
def softer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The model of a specimen a tenth softer."""
    changed = campaigns.TRUTH | {"b0": 1.1 * campaigns.TRUTH["b0"]}
    path = tmp_path_factory.mktemp("model") / "softer.json"
    return write_model(path, transfer_function=changed)


def command(steps: Path, model: Path, out: Path, *more: str) -> list[str]:
    return ["diagnose", str(steps), "--model", str(model), "--out", str(out), *FEW, *more]


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must leave with 2; return its last line, the only one of an error."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert [line for line in lines if line.startswith("spa-fo: ")] == lines[-1:]
    assert captured.out == ""
    return lines[-1]


def test_no_gap_is_an_answer(
    steps: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "deep" / "diagnosis"
    assert main(command(steps, truth, out)) == 0
    captured = capsys.readouterr()
    answer, _, page = captured.out.splitlines()
    assert answer == "No gap above the noise floor."
    assert Path(page) == out / "diagnosis.html"
    for said in ("explaining ", "weighing ", "predicting trials that took no part"):
        assert f"\n{said}" in f"\n{captured.err}"
    document = json.loads((out / "diagnosis.json").read_text())
    assert document["verdict"] == {"kind": "no_gap", "sets": [], "next_experiment": None}
    assert document["shrink"] is None
    augmented = json.loads((out / "augmented_model.json").read_text())
    plain = json.loads(truth.read_text())
    assert augmented["effects"] == []
    assert augmented["transfer_function"] == plain["transfer_function"]


@pytest.fixture(scope="module")
def shifted(
    steps: Path, softer: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, str]:
    """The diagnosis of another specimen: its folder and what was printed."""
    out = tmp_path_factory.mktemp("out") / "diagnosis"
    run = subprocess.run(
        [sys.executable, "-m", "spa_fo.cli", *command(steps, softer, out)],
        env=dict(os.environ) | {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    return out, run.stdout


def test_a_gap_is_named_and_every_file_written(shifted: tuple[Path, str]) -> None:
    out, printed = shifted
    document = json.loads((out / "diagnosis.json").read_text())
    assert document["schema"] == "spa-fo/diagnosis/1"
    assert document["verdict"]["sets"][0] == ["parameter_shift"]
    assert printed.startswith("Cause: other coefficients (")
    assert sum(cause["probability"] for cause in document["causes"]) == pytest.approx(1.0)
    tried = {name for cause in document["causes"] for name in cause["set"]}
    assert tried == {"none", "unknown", *KEPT}
    page = (out / "diagnosis.md").read_text()
    for picture in (part.split(")")[0] for part in page.split("](")[1:]):
        assert (out / picture).read_bytes().startswith(b"\x89PNG")


def test_the_augmented_model_predicts(
    shifted: tuple[Path, str], steps: Path, tmp_path: Path
) -> None:
    table = tmp_path / "p.csv"
    model = shifted[0] / "augmented_model.json"
    assert main(["predict", str(model), str(steps), "--out", str(table)]) == 0
    rows = table.read_text().splitlines()[1:]
    missed = [float(row.split(",")[3]) - float(row.split(",")[4]) for row in rows]
    rms = (sum(each**2 for each in missed) / len(missed)) ** 0.5
    assert rms == pytest.approx(campaigns.NOISE_DEG, rel=0.05)


def test_the_same_seed_gives_the_same_bytes_for_any_number_of_threads(
    shifted: tuple[Path, str], steps: Path, softer: Path, tmp_path: Path
) -> None:
    threads = dict.fromkeys(
        ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "2"
    )
    out = tmp_path / "again"
    subprocess.run(
        [sys.executable, "-m", "spa_fo.cli", *command(steps, softer, out)],
        env=dict(os.environ) | threads,
        capture_output=True,
        check=True,
    )
    for name in ("diagnosis.json", "augmented_model.json", "diagnosis.md", "gap.png"):
        assert (out / name).read_bytes() == (shifted[0] / name).read_bytes(), name


def test_help_with_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["diagnose", "--help"])
    assert left.value.code == 0
    assert "example:\n  spa-fo diagnose " in capsys.readouterr().out


def test_a_model_of_another_reference_pressure_is_the_same_model(
    steps: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same gain in rad per kPa, written against twice the pressure."""
    transfer_function = campaigns.TRUTH | {"b0": 2.0 * campaigns.TRUTH["b0"]}
    reference = {"signal": "command", "reference_kpa": 2.0 * campaigns.REFERENCE_KPA}
    model = write_model(
        tmp_path / "model.json", transfer_function=transfer_function, input=reference
    )
    assert main(command(steps, model, tmp_path / "out")) == 0
    assert capsys.readouterr().out.startswith("No gap above the noise floor.")


def test_a_misspelt_effect(
    steps: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    line = refused(command(steps, truth, out, "--exclude-effect", "crep"), capsys)
    assert line == "spa-fo: --exclude-effect: is 'crep'; did you mean 'creep'?"
    assert not out.exists()


def test_a_missing_campaign(
    truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert "nowhere" in refused(command(tmp_path / "nowhere", truth, out), capsys)
    assert not out.exists()


def _without_a1(document: dict[str, Any]) -> None:
    del document["transfer_function"]["a1"]


def _with_creep(document: dict[str, Any]) -> None:
    parameters = {"per_decade": 0.03, "typical_s": 12.0, "decades": 1.0}
    document["effects"] = [{"id": "creep", "stage": "actuator", "parameters": parameters}]


def _bending_back(document: dict[str, Any]) -> None:
    document["transfer_function"]["b0"] = -0.9


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (_bending_back, "transfer_function.b0: expected a positive number"),
        (_without_a1, "transfer_function.a1: missing"),
        (_with_creep, "effects: holds effects; expected a plain model"),
    ],
)
def test_bad_models(
    spoil: Callable[[dict[str, Any]], None],
    words: str,
    steps: Path,
    truth: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    model = tmp_path / "model.json"
    document = json.loads(truth.read_text())
    spoil(document)
    model.write_text(json.dumps(document))
    out = tmp_path / "out"
    assert words in refused(command(steps, model, out), capsys)
    assert not out.exists()


def test_a_broken_model(steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.json"
    model.write_text('{"schema": ')
    assert str(model) in refused(command(steps, model, tmp_path / "out"), capsys)
    missing = tmp_path / "missing.json"
    assert str(missing) in refused(command(steps, missing, tmp_path / "out"), capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["model.json"]


def test_a_damaged_campaign(
    steps: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "steps"
    shutil.copytree(steps, folder)
    (folder / "step_30" / "trial_01.csv").write_bytes(b"t,command,angle\n")
    campaigns.write_sums(folder)
    line = refused(command(folder, truth, tmp_path / "out"), capsys)
    assert "step_30/trial_01.csv" in line
    assert not (tmp_path / "out").exists()


def test_an_answer_that_cannot_be_written(
    steps: Path, truth: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "taken"
    out.write_text("a file")
    assert "cannot be written" in refused(command(steps, truth, out), capsys)
    assert out.read_text() == "a file"
