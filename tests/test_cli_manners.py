"""How the commands behave: quick refusals, suggestions, Ctrl-C, results that are there already."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

import campaigns
from spa_fo import places
from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.plant import Model, TransferFunction, read_model, write_model

HEAVY = ("numpy", "numba", "scipy", "pandas", "matplotlib", "yaml", "jsonschema", "serial")
# So that it is the kernels' work, or the report's, that is interrupted.
WORK = "explaining "


def model(path: Path, campaign: str = "steps", **extra: object) -> Path:
    write_model(
        path, Model(campaign, "rubber", TransferFunction(**campaigns.TRUTH), 30.0, extra=extra)
    )
    return path


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=2)
    return folder


def line_of(arguments: Sequence[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as left:
        main(list(arguments))
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


# --- refusals ------------------------------------------------------------------------------------

REFUSALS = [
    ["--help"],
    ["--version"],
    ["pars"],
    ["fit", "--ouput", "x"],
    ["parse", "nowhere"],
    ["inspect", "nowhere.csv"],
    ["init", "nowhere"],
    ["fit", "nowhere", "--out", "m.json"],
    ["predict", "none.json", "nowhere", "--out", "p.csv"],
    ["diagnose", "nowhere", "--model", "none.json", "--out", "d"],
    ["plan", "nowhere", "--diagnosis", "none.json", "--out", "p.csv"],
    ["export", "none.json", "--to", "csv"],
    ["check", "/dev/nowhere"],
    ["record", "/dev/nowhere", "--campaign", "c", "--experiment", "e"],
]


def test_a_refusal_waits_for_no_library(tmp_path: Path) -> None:
    """All in one process: whatever one of them imported would show."""
    ask = f"""
import sys, json
from spa_fo.cli import main
codes = []
for arguments in {REFUSALS!r}:
    try:
        main(arguments)
    except SystemExit as left:
        codes.append(left.code)
print(json.dumps([codes, [name for name in {HEAVY!r} if name in sys.modules]]))
"""
    run = subprocess.run(
        [sys.executable, "-c", ask], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    codes, imported = json.loads(run.stdout.splitlines()[-1])
    assert codes == [0, 0, *[2] * (len(REFUSALS) - 2)]
    assert imported == []
    assert len(run.stderr.splitlines()) == len(REFUSALS) - 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["pars"], "COMMAND: is 'pars'; did you mean 'parse'?"),
        (["rig", "serv"], "COMMAND: is 'serv'; did you mean 'serve'?"),
        (["--verson"], "--verson: is no option; did you mean '--version'?"),
        (["fit", "x", "--ouput", "m"], "--ouput: is no option; did you mean '--out'?"),
        (["fit", "x", "--sed=3"], "--sed: is no option; did you mean '--seed'?"),
        (["export", "m", "--to", "simulik"], "--to: is 'simulik'; did you mean 'simulink'?"),
        (["fit", "x"], "the following arguments are required: --out (spa-fo fit --help)"),
        ([], "the following arguments are required: COMMAND (spa-fo --help)"),
    ],
)
def test_a_typing_error_is_answered_with_what_was_meant(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in line_of(arguments, capsys)


def test_abbreviations_and_negative_numbers_are_no_typing_errors(tmp_path: Path) -> None:
    from spa_fo.cli import command_line

    options = command_line().parse_args(["fit", "x", "--ou", "m.json", "--whole"])
    assert options.whole_logs
    record = ["record", "/dev/x", "--campaign", "c", "--setpoint", "-3"]
    assert command_line().parse_args(record).setpoint == -3.0


def test_a_near_campaign_is_suggested(steps: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = line_of(["parse", str(steps.with_name("step"))], capsys)
    assert f"did you mean '{steps}'?" in line


# --- where results go ----------------------------------------------------------------------------


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("x")
    for path, check, words in (
        (tmp_path, places.output_file, "it is a folder; expected a file"),
        (file / "m.json", places.output_file, f"{file} is a file; expected a folder"),
        (file, places.output_folder, "it is a file; expected a folder"),
        (file / "deep" / "er", places.output_folder, f"{file} is a file; expected a folder"),
        (Path("/proc/m.json"), places.output_file, "cannot be written"),
        (tmp_path / ("m" * 300), places.output_file, "cannot be written"),
    ):
        with pytest.raises(BadInput, match="cannot be written") as refused:
            check(path)
        assert words in str(refused.value)
    places.output_file(tmp_path / "new" / "deep" / "m.json")
    places.output_folder(tmp_path / "new" / "folder")
    assert sorted(tmp_path.iterdir()) == [file]


def test_a_bad_place_is_refused_before_the_work(
    steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from spa_fo.api import Campaign

    monkeypatch.setattr(Campaign, "load", lambda _: pytest.fail("read"))
    truth = model(tmp_path / "m.json")
    for command in (
        ["fit", str(steps), "--out", str(tmp_path)],
        ["parse", str(steps), "--plot", str(tmp_path)],
        ["predict", str(truth), str(steps), "--out", str(tmp_path)],
        ["diagnose", str(steps), "--model", str(truth), "--out", str(truth)],
    ):
        assert "cannot be written: it is a f" in line_of(command, capsys)


def test_a_rerun_says_what_it_replaces_and_another_campaigns_result_is_kept(
    steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Fitted:
        def save(self, path: Path) -> None:
            model(path)

    monkeypatch.setattr("spa_fo.api.campaign.Campaign.fit", lambda *_, **__: Fitted())
    out = model(tmp_path / "m.json")
    assert main(["fit", str(steps), "--out", str(out)]) == 0
    assert f"{out}: replaced the model of 'steps'" in capsys.readouterr().err
    foreign = model(tmp_path / "other.json", "other")
    before = foreign.read_bytes()
    line = line_of(["fit", str(steps), "--out", str(foreign)], capsys)
    assert "holds the model of 'other'; expected another place, or --overwrite" in line
    assert foreign.read_bytes() == before
    assert main(["fit", str(steps), "--out", str(foreign), "--overwrite"]) == 0
    assert read_model(foreign).campaign == "steps"


def test_what_may_be_replaced(tmp_path: Path) -> None:
    path = tmp_path / "x"
    assert places.replaced_model(path, "a", False) == ""
    path.write_text("")
    assert places.replaced_model(path, "a", False) == ""
    for text, found in (
        ("notes", "something else than a model"),
        ('{"schema": "spa-fo/model/1", "campaign": "b"}', "the model of 'b'"),
        ('{"schema": "spa-fo/model/1", "campaign": "a", "effects": [1]}', "a model of 'a' with"),
    ):
        path.write_text(text)
        with pytest.raises(BadInput, match=found):
            places.replaced_model(path, "a", False)
        assert places.replaced_model(path, "a", True).startswith(found)
    (tmp_path / "diagnosis.json").write_text('{"campaign": "a", "seed": 3}')
    assert places.replaced_diagnosis(tmp_path, "a", False) == "the diagnosis of 'a' (seed 3)"
    with pytest.raises(BadInput, match="holds the diagnosis of 'a'"):
        places.replaced_diagnosis(tmp_path, "b", False)


def test_tables_and_exports_replace_their_like_alone(
    steps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = model(tmp_path / "m.json")
    notes = tmp_path / "notes"
    notes.write_text("do not lose this")
    predict = ["predict", str(truth), str(steps)]
    for command in (predict, ["parse", str(steps)], ["export", str(truth), "--to", "simulink"]):
        out = tmp_path / f"{command[0]}.out"
        assert main([*command, "--out", str(out)]) == 0
        assert "in place of" not in capsys.readouterr().err
        assert main([*command, "--out", str(out)]) == 0
        assert "in place of" in capsys.readouterr().err
        assert "holds something else than" in line_of([*command, "--out", str(notes)], capsys)
    assert notes.read_text() == "do not lose this"


# --- Ctrl-C --------------------------------------------------------------------------------------


def has_workers(process: subprocess.Popen[str]) -> bool:
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
    return bool(children.split())


def interrupted(arguments: Sequence[str], heard: str, *, at_work: bool = False) -> tuple[int, str]:
    """Press Ctrl-C, for the command and its workers alike, once it said something.

    With `at_work`, only while worker processes of it run.
    """
    process = subprocess.Popen(
        [sys.executable, "-m", "spa_fo.cli", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"NUMBA_NUM_THREADS": "2"},
    )
    assert process.stderr is not None
    said = ""
    while heard not in said:
        line = process.stderr.readline()
        assert line, said
        said += line
    while at_work and not has_workers(process):
        assert process.poll() is None, "ended, and no worker process was seen"
        time.sleep(0.001)
    os.killpg(process.pid, signal.SIGINT)
    _, rest = process.communicate(timeout=60)
    return process.returncode, rest


@pytest.mark.parametrize("at_work", [False, True])
def test_ctrl_c_ends_a_diagnosis_in_one_line(steps: Path, tmp_path: Path, at_work: bool) -> None:
    """Also in the midst of worker processes; none of them is left."""
    truth = model(tmp_path / "m.json")
    out = tmp_path / "out"
    code, said = interrupted(
        ["diagnose", str(steps), "--model", str(truth), "--out", str(out)], WORK, at_work=at_work
    )
    assert code == 130
    assert said.splitlines()[-1] == "spa-fo: stopped; nothing half-written is left"
    assert "Traceback" not in said
    assert list(tmp_path.iterdir()) == [truth]


def test_ctrl_c_in_process(
    steps: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    from spa_fo.api import Campaign

    def interrupted_fit(*_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGINT)
        time.sleep(10.0)  # Python handles a signal between two of its own steps

    # A shell that starts the tests in the background leaves Ctrl-C ignored.
    handler = signal.default_int_handler
    before = signal.signal(signal.SIGINT, handler)
    request.addfinalizer(lambda: signal.signal(signal.SIGINT, before))
    monkeypatch.setattr(Campaign, "fit", interrupted_fit)
    with pytest.raises(SystemExit) as left:
        main(["fit", str(steps), "--out", str(tmp_path / "m.json")])
    assert left.value.code == 130
    assert capsys.readouterr().err == "spa-fo: stopped; nothing half-written is left\n"
    assert list(tmp_path.iterdir()) == []
    assert signal.getsignal(signal.SIGINT) is handler


# --- what a model says of itself -----------------------------------------------------------------


def test_an_export_says_that_the_cause_is_unknown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, extra in (("known", {}), ("unknown", {"verdict": "unknown"})):
        path = model(tmp_path / f"{name}.json", **extra)
        assert main(["export", str(path), "--to", "csv"]) == 0
        assert ("VERDICT UNKNOWN" in capsys.readouterr().out) == bool(extra)
        text = (tmp_path / f"{name}_filter.csv").read_text(encoding="utf-8")
        assert ("VERDICT UNKNOWN" in text) == bool(extra)


@dataclass(frozen=True)
class Found:
    kind: str
    model: Model


@pytest.mark.parametrize("kind", ["cause", "ambiguous", "no_gap", "unknown"])
def test_a_model_knows_that_its_diagnosis_does_not_know(kind: str) -> None:
    from spa_fo.api.model import _with_verdict

    plain = Model("steps", "rubber", TransferFunction(**campaigns.TRUTH), 30.0)
    found = _with_verdict(Found(kind, plain))  # type: ignore[arg-type]
    assert found.model.extra == ({"verdict": "unknown"} if kind == "unknown" else {})
