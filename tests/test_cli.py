"""The commands as their users run them: exit codes, the one line, what is left behind."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

import campaigns
from spa_fo.cli import main


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a command that must leave with 2 after exactly one line; return the line."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("spa-fo: ")
    return lines[0]


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder)
    return folder


@pytest.fixture(scope="module")
def fitted(steps: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("out") / "model.json"
    assert main(["fit", str(steps), "--out", str(path)]) == 0
    return path


def test_fit_writes_the_contracts_model(fitted: Path) -> None:
    model = json.loads(fitted.read_text())
    assert model["schema"] == "spa-fo/model/1"
    assert model["campaign"] == "steps"
    assert model["effects"] == []
    assert model["output"] == {"unit": "rad"}
    assert model["input"] == {"signal": "command", "reference_kpa": 30.0}
    gain = model["transfer_function"]["b0"] / model["transfer_function"]["a0"]
    assert gain == pytest.approx(campaigns.TRUTH["b0"] / campaigns.TRUTH["a0"], rel=0.01)


def test_predict_writes_a_row_for_every_sample(steps: Path, fitted: Path, tmp_path: Path) -> None:
    out = tmp_path / "prediction.csv"
    assert main(["predict", str(fitted), str(steps), "--out", str(out)]) == 0
    table = pd.read_csv(out)
    assert list(table) == ["experiment", "trial", "t_s", "angle_deg", "predicted_deg"]
    assert len(table) == 8 * 400
    assert set(table["trial"]) == {1, 2, 3, 4}
    error = table["angle_deg"] - table["predicted_deg"]
    # What is left is the noise that was put in: the model is the truth's own kind.
    assert math.sqrt(np.mean(error**2)) == pytest.approx(campaigns.NOISE_DEG, rel=0.05)


def test_the_same_seed_gives_the_same_bytes(steps: Path, fitted: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.json"
    main(["fit", str(steps), "--out", str(again)])
    assert again.read_bytes() == fitted.read_bytes()


def test_fit_takes_whole_logs_where_there_are_no_steps(tmp_path: Path) -> None:
    folder = tmp_path / "stairs"
    folder.mkdir()
    campaigns.free_campaign(folder)
    out = tmp_path / "model.json"
    assert main(["fit", str(folder), "--out", str(out)]) == 0
    found = json.loads(out.read_text())["transfer_function"]
    assert found["b0"] / found["a0"] == pytest.approx(0.934 / 1.638, rel=0.01)


def test_fit_takes_the_pressure_where_there_is_no_command(tmp_path: Path) -> None:
    folder = tmp_path / "stairs"
    folder.mkdir()
    document = campaigns.free_campaign(folder)
    columns = document["log"]["columns"]
    columns["pressure"] = columns.pop("command")
    campaigns.write_yaml(folder, document)
    out = tmp_path / "model.json"
    assert main(["fit", str(folder), "--out", str(out)]) == 0
    model = json.loads(out.read_text())
    assert model["input"]["signal"] == "pressure"
    found = model["transfer_function"]
    assert found["b0"] / found["a0"] == pytest.approx(0.934 / 1.638, rel=0.01)


def test_parse_tells_what_the_logs_hold(steps: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["parse", str(steps)]) == 0
    out = capsys.readouterr().out
    assert out.count("step_30/trial_") == 4


@pytest.mark.parametrize("command", ["fit", "predict", "parse"])
def test_every_command_has_help_with_an_example(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main([command, "--help"])
    assert left.value.code == 0
    assert f"example:\n  spa-fo {command} " in capsys.readouterr().out


def test_a_missing_campaign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "model.json"
    line = refused(["fit", str(tmp_path / "nowhere"), "--out", str(out)], capsys)
    assert "nowhere" in line
    assert not out.exists()


def rewrite(file: str, data: bytes) -> Callable[[Path], None]:
    """Return a spoiler that replaces a log, its checksum made to fit."""

    def spoil(folder: Path) -> None:
        (folder / file).write_bytes(data)
        campaigns.write_sums(folder)

    return spoil


def edit(change: Callable[[dict[str, Any]], None]) -> Callable[[Path], None]:
    """Return a spoiler that changes campaign.yaml."""

    def spoil(folder: Path) -> None:
        path = folder / "campaign.yaml"
        document = yaml.safe_load(path.read_text())
        change(document)
        path.write_text(yaml.safe_dump(document, sort_keys=False))

    return spoil


def short_trial(seconds: float) -> bytes:
    rows = [f"{i / 25:.2f},{27.5 if i >= 25 else 0.0:.2f},0.0" for i in range(int(25 * seconds))]
    return ("t,command,angle\n" + "\n".join(rows) + "\n").encode()


TRIAL = "step_30/trial_01.csv"
SPOILERS: dict[str, tuple[Callable[[Path], None], list[str]]] = {
    "no file": (lambda folder: (folder / TRIAL).unlink(), [TRIAL]),
    "binary": (rewrite(TRIAL, bytes(range(256)) * 40), [TRIAL]),
    "not the bytes of SHA256SUMS": (
        lambda folder: (folder / TRIAL).write_bytes(short_trial(12)) and None,
        [TRIAL, "SHA256SUMS"],
    ),
    "no column of that name": (rewrite(TRIAL, b"time,p,x\n0,0,0\n1,0,0\n"), [TRIAL]),
    "nan everywhere": (
        rewrite(TRIAL, b"t,command,angle\n" + b"nan,nan,nan\n" * 100),
        [TRIAL],
    ),
    "too few points": (rewrite(TRIAL, short_trial(1.08)), [TRIAL]),
    "a setpoint without trials": (
        edit(lambda document: document["experiments"][0].update(trials=[])),
        ["campaign.yaml", "experiments[0].trials"],
    ),
    "unknown key": (
        edit(lambda document: document.update(experimets=[])),
        ["campaign.yaml", "experimets", "did you mean 'experiments'"],
    ),
    "a step that is none": (
        rewrite(TRIAL, b"t,command,angle\n" + b"".join(b"%d,0,0\n" % i for i in range(300))),
        [TRIAL],
    ),
    "a wrong schema": (
        edit(lambda document: document.update(schema="spa-fo/campaign/9")),
        ["campaign.yaml", "schema"],
    ),
}


@pytest.mark.parametrize("spoiler", SPOILERS)
def test_bad_campaigns(spoiler: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=2)
    spoil, words = SPOILERS[spoiler]
    spoil(folder)
    out = tmp_path / "model.json"
    line = refused(["fit", str(folder), "--out", str(out)], capsys)
    for word in words:
        assert word in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["steps"]


def test_an_empty_trial_is_left_out_and_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=2)
    rewrite(TRIAL, b"")(folder)
    model, table = tmp_path / "model.json", tmp_path / "table.csv"
    for command in (["fit", str(folder)], ["predict", str(model), str(folder)]):
        out = model if command[0] == "fit" else table
        assert main([*command, "--out", str(out)]) == 0
        assert f"{folder}: {TRIAL} is empty: left out\n" in capsys.readouterr().err
    rows = pd.read_csv(table)
    assert set(rows[rows.experiment == "step_30"].trial) == {2}


BAD_LOGS = {
    "wrong banner": (
        campaigns.rig_trial().replace("spa-rig 1", "spa-rig 7").encode(),
        90.0,
        "line 1",
    ),
    "no banner": (campaigns.rig_trial().partition("\n")[2].encode(), 90.0, "line 1"),
    "all checksums wrong": (
        campaigns.RIG_BANNER.encode()
        + b"".join(b"%d,%d,0.00,93,354*00\n" % (i, i) for i in range(99)),
        90.0,
        "checksum",
    ),
    "truncated mid-line": (
        (campaigns.RIG_BANNER + campaigns.rig_trial()[len(campaigns.RIG_BANNER) :][:11]).encode(),
        90.0,
        "",
    ),
    # 420 counts are 60 degrees.
    "angle outside calibration": (
        campaigns.rig_trial(top=420).encode(),
        20.0,
        "angle outside calibration",
    ),
}


@pytest.mark.parametrize("case", BAD_LOGS)
def test_bad_rig_logs(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, top_deg, word = BAD_LOGS[case]
    folder = tmp_path / "arm"
    campaigns.rig_campaign(folder, log, campaigns.rig_calibration(top_deg))
    out = tmp_path / "model.json"
    line = refused(["fit", str(folder), "--out", str(out)], capsys)
    assert "step_30/trial_01.log" in line
    assert word in line
    assert not out.exists()


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"schema": "spa-fo/model/9"}, "schema"),
        ({"transfer_function": {"alpha2": 1.4}}, "transfer_function.alpha1"),
        ({"input": {"signal": "voltage", "reference_kpa": 30}}, "input.signal"),
        (
            {"effects": [{"id": "creep", "stage": "actuator", "parameters": {}}]},
            "effects[0].parameters.per_decade",
        ),
    ],
)
def test_bad_models(
    change: dict[str, Any],
    key: str,
    steps: Path,
    fitted: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    model = tmp_path / "model.json"
    model.write_text(json.dumps(json.loads(fitted.read_text()) | change))
    out = tmp_path / "p.csv"
    line = refused(["predict", str(model), str(steps), "--out", str(out)], capsys)
    assert f"{model}: {key}: " in line
    assert not out.exists()


@pytest.mark.parametrize(
    ("name", "low", "high"), [("a0", 5.0, 6.0), ("a0", 0.3, 0.7), ("alpha2", 1.1, 1.3)]
)
def test_a_bound_that_the_optimum_lies_on(
    name: str, low: float, high: float, steps: Path, tmp_path: Path
) -> None:
    """Also where a coefficient's logarithm does not come back to the last digit."""
    out = tmp_path / "model.json"
    for more in ((), ("--whole-logs",)):
        bound = ["--bound", f"{name}={low}:{high}"]
        assert main(["fit", str(steps), "--out", str(out), *bound, *more]) == 0
        found = json.loads(out.read_text())["transfer_function"]
        assert low <= found[name] <= high
        assert found["alpha1"] < found["alpha2"]


def test_own_bounds_are_kept(steps: Path, tmp_path: Path) -> None:
    out = tmp_path / "model.json"
    arguments = ["fit", str(steps), "--out", str(out), "--bound", "a0=3:4", "--bound", "a1=1:1.5"]
    assert main(arguments) == 0
    found = json.loads(out.read_text())["transfer_function"]
    assert 3 <= found["a0"] <= 4
    assert 1 <= found["a1"] <= 1.5


@pytest.mark.parametrize(
    ("bound", "message"),
    [
        ("a0=2:1", "bounds of a0 are reversed: 2 > 1"),
        ("a0=2", "expected NAME=LOW:HIGH, such as a0=1:2, found 'a0=2'"),
        ("a7=1:2", "a7 is no parameter; expected one of alpha2, alpha1, a1, a0, b0"),
        ("a0=-1:2", "the lower bound of a0 must be positive, not -1"),
    ],
)
def test_bad_bounds(
    bound: str, message: str, steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "model.json"
    line = refused(["fit", str(steps), "--out", str(out), "--bound", bound], capsys)
    assert line == f"spa-fo: --bound: {message}"
    assert not out.exists()


def test_a_place_that_cannot_be_written(steps: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(["fit", str(steps), "--out", "/proc/model.json"], capsys)
    assert "/proc/model.json: cannot be written" in line


@pytest.mark.parametrize(
    "name", ["step_30/trial_01.csv", "campaign.yaml", "SHA256SUMS", "step_30/new.log"]
)
def test_nothing_is_written_over_the_campaign(
    name: str, steps: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.read_bytes() for path in steps.rglob("*") if path.is_file()}
    for command in ("fit", "parse"):
        line = refused([command, str(steps), "--out", str(steps / "." / name)], capsys)
        assert "is a file of the campaign or the model; expected another to write" in line
    assert {path: path.read_bytes() for path in steps.rglob("*") if path.is_file()} == before


def test_no_prediction_is_written_over_its_model(
    steps: Path, fitted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = fitted.read_bytes()
    assert str(fitted) in refused(
        ["predict", str(fitted), str(steps), "--out", str(fitted)], capsys
    )
    assert fitted.read_bytes() == before


def test_a_name_that_no_file_can_have(
    steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / ("m" * 300)
    assert "cannot be written" in refused(["fit", str(steps), "--out", str(out)], capsys)
    line = refused(["fit", str(tmp_path / ("c" * 300)), "--out", str(tmp_path / "m.json")], capsys)
    assert "c" * 300 in line


def test_a_negative_seed(steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "model.json"
    with pytest.raises(SystemExit) as left:
        main(["fit", str(steps), "--out", str(out), "--seed=-1"])
    assert left.value.code == 2
    assert "expected a whole number from 0, found '-1'" in capsys.readouterr().err


def test_a_terminal_of_another_encoding(steps: Path, tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "spa_fo.cli", "fit", str(steps), "--out", str(tmp_path / "m.json")],
        env=dict(os.environ) | {"PYTHONIOENCODING": "latin-1"},
        capture_output=True,
        check=False,
    )
    assert run.returncode == 0
    assert b"?\xb2/dof" in run.stdout


def test_a_closed_pipe_is_no_error(steps: Path) -> None:
    command = f"{sys.executable} -m spa_fo.cli parse {steps} | head -c 1"
    run = subprocess.run(
        ["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, check=False
    )
    assert run.stderr == ""
    assert run.returncode in (0, 141)
