"""Bad inputs to the commands, and what their one line has to say: file, line or key, what is right.

Every case leaves with exit code 2, one line on stderr, and nothing new in the folder.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

import campaigns
from spa_fo.cli import main
from spa_fo.plant import Model, TransferFunction, write_model

CSV, LOG, CALIBRATION = "steps/step_30/trial_01.csv", "step_30/trial_01.log", "calibration/pre.log"
PARSE, PARSE_ARM = "parse steps", "parse arm"
FIT, PREDICT = "fit steps --out new.json", "predict model.json steps --out new.csv"
DIAGNOSE = "diagnose steps --model model.json --out new"
PLAN, EXPORT = "plan steps --diagnosis diagnosis.json --out new.csv", "export model.json --to csv"

Spoil = Callable[[Path], object]


@dataclass(frozen=True)
class Case:
    """What is done to the inputs, the command, and words that its line must hold."""

    name: str
    command: str
    words: tuple[str, ...]
    spoil: Spoil = lambda _: None


def _yaml(folder: str, change: Callable[[dict[str, Any]], object]) -> Spoil:
    """Change campaign.yaml of a campaign."""

    def spoil(place: Path) -> None:
        path = place / folder / "campaign.yaml"
        document = yaml.safe_load(path.read_text())
        change(document)
        path.write_text(yaml.safe_dump(document, sort_keys=False))

    return spoil


def _json(file: str, change: Callable[[dict[str, Any]], object]) -> Spoil:
    def spoil(place: Path) -> None:
        document = json.loads((place / file).read_text())
        change(document)
        (place / file).write_text(json.dumps(document))

    return spoil


def _bytes(file: str, data: bytes, listed: bool = True) -> Spoil:
    """Put other bytes into a file; SHA256SUMS made to fit unless it shall not."""

    def spoil(place: Path) -> None:
        (place / file).parent.mkdir(exist_ok=True)
        (place / file).write_bytes(data)
        folder = place / Path(file).parts[0]
        if listed and folder.is_dir():
            campaigns.write_sums(folder)

    return spoil


def _gone(file: str) -> Spoil:
    return lambda place: (place / file).unlink()


def _key(*keys: str, value: Any = None) -> Callable[[dict[str, Any]], None]:
    """Set a nested key, or take it out where the value is None."""

    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[int(key) if key.isdecimal() else key]
        if value is None:
            del document[keys[-1]]
        else:
            document[keys[-1]] = value

    return change


def _in_campaign(name: str, words: tuple[str, ...], *keys: str, value: Any = None) -> Case:
    change = _yaml("steps", _key(*keys, value=value))
    return Case(f"campaign.yaml: {name}", PARSE, ("steps/campaign.yaml", *words), change)


def _in_model(name: str, words: tuple[str, ...], *keys: str, value: Any = None) -> Case:
    change = _json("model.json", _key(*keys, value=value))
    return Case(f"model.json: {name}", PREDICT, ("model.json", *words), change)


CHANGED = campaigns.rig_trial().replace("*", "*Z")
FLAT = campaigns.rig_calibration(90.0)
NOT_RISING = b"t,command,angle\n" + b"".join(b"%d,0,0\n" % i for i in range(300))
FEW = b"t,command,angle\n0,0,0\n0.04,0,0\n0.08,27.5,1\n0.12,27.5,2\n"

CASES = (
    # campaign.yaml
    Case("no folder", "parse nowhere", ("nowhere", "expected a campaign folder")),
    Case("nearly a folder", "parse step", ("step: is not there", "did you mean 'steps'?")),
    Case(
        "a file for a folder", "parse model.json", ("model.json", "is a file; expected a campaign")
    ),
    Case(
        "no campaign.yaml", PARSE, ("steps/campaign.yaml", "missing"), _gone("steps/campaign.yaml")
    ),
    Case("empty yaml", PARSE, ("campaign.yaml", "empty"), _bytes("steps/campaign.yaml", b" \n")),
    Case(
        "binary yaml", PARSE, ("campaign.yaml", "UTF-8"), _bytes("steps/campaign.yaml", b"\xff\xfe")
    ),
    Case(
        "broken yaml",
        PARSE,
        ("campaign.yaml", "line 2"),
        _bytes("steps/campaign.yaml", b"a: [1\nb: ]"),
    ),
    Case(
        "a key twice",
        PARSE,
        ("line 2", "'a' is given twice"),
        _bytes("steps/campaign.yaml", b"a: 1\na: 2"),
    ),
    Case("yaml of a list", PARSE, ("a mapping of keys",), _bytes("steps/campaign.yaml", b"- 1\n")),
    _in_campaign(
        "another schema", ("schema", "spa-fo/campaign/1"), "schema", value="spa-fo/campaign/9"
    ),
    _in_campaign("no name", ("name: is missing",), "name"),
    _in_campaign("no material", ("material: is missing",), "material"),
    _in_campaign("an empty name", ("name", "expected some text"), "name", value=""),
    _in_campaign("no provenance", ("provenance: is missing",), "provenance"),
    _in_campaign(
        "provenance of no kind",
        ("provenance.kind", "synthetic"),
        "provenance",
        "kind",
        value="syntetic",
    ),
    _in_campaign(
        "a mistyped key", ("experimets", "did you mean 'experiments'?"), "experimets", value=[]
    ),
    _in_campaign("no experiments", ("experiments: is missing",), "experiments"),
    _in_campaign("experiments: none", ("experiments", "at least 1"), "experiments", value=[]),
    _in_campaign("a number for a list", ("experiments", "expected a list"), "experiments", value=3),
    _in_campaign(
        "a protocol of another name",
        ("experiments[0].protocol", "did you mean 'step_release'?"),
        *("experiments", "0", "protocol"),
        value="step_relase",
    ),
    _in_campaign(
        "a setpoint in words",
        ("experiments[0].setpoint_deg", "expected a number or null"),
        *("experiments", "0", "setpoint_deg"),
        value="thirty",
    ),
    _in_campaign(
        "an experiment without trials",
        ("experiments[0].trials", "at least one"),
        *("experiments", "0", "trials"),
        value=[],
    ),
    _in_campaign(
        "an order twice",
        ("experiments[0].trials[0].order", "order 2 is already taken"),
        *("experiments", "0", "trials", "0", "order"),
        value=2,
    ),
    _in_campaign(
        "an order of 1.5",
        ("experiments[0].trials[0].order", "a whole number"),
        *("experiments", "0", "trials", "0", "order"),
        value=1.5,
    ),
    _in_campaign(
        "time against order",
        ("started_s", "expected it to rise with order"),
        *("experiments", "0", "trials", "0", "started_s"),
        value=1e6,
    ),
    _in_campaign(
        "a file outside",
        ("../other.csv", "inside the folder"),
        *("experiments", "0", "trials", "0", "file"),
        value="../other.csv",
    ),
    _in_campaign(
        "a unit of another kind",
        ("log.columns.command.unit", "kPa"),
        *("log", "columns", "command", "unit"),
        value="kpa",
    ),
    _in_campaign(
        "an angle in degrees of Celsius",
        ("log.columns.angle.unit", "deg"),
        *("log", "columns", "angle", "unit"),
        value="°C",
    ),
    _in_campaign("no angle", ("log.columns", "'angle' or 'flex_adc'"), "log", "columns", "angle"),
    _in_campaign("no time", ("log.columns.time: is missing",), "log", "columns", "time"),
    _in_campaign("no columns", ("log.columns: is missing",), "log", "columns"),
    _in_campaign("a format of its own", ("log.format", "csv"), "log", "format", value="xlsx"),
    _in_campaign(
        "a reference of 0",
        ("input.reference_kpa", "more than 0"),
        "input",
        "reference_kpa",
        value=0,
    ),
    _in_campaign(
        "an infinite reference",
        ("input.reference_kpa", "a finite number"),
        *("input", "reference_kpa"),
        value=float("inf"),
    ),
    Case(
        "a column that is not there",
        PARSE,
        (CSV, "log.columns.angle", "names no column 'angel'; did you mean 'angle'?"),
        _yaml("steps", _key("log", "columns", "angle", "column", value="angel")),
    ),
    Case(
        "counts without a sensor",
        PARSE_ARM,
        ("arm/campaign.yaml: pressure_sensor: is missing",),
        _yaml("arm", _key("pressure_sensor")),
    ),
    Case(
        "a sensor that falls",
        PARSE_ARM,
        ("pressure_sensor.volts", "expected two rising numbers"),
        _yaml("arm", _key("pressure_sensor", "volts", value=[4.5, 0.5])),
    ),
    # checksums
    Case("no checksums", PARSE, ("steps/SHA256SUMS", "is missing"), _gone("steps/SHA256SUMS")),
    Case(
        "no checksum of one",
        PARSE,
        ("SHA256SUMS", "does not list"),
        _bytes("steps/SHA256SUMS", b"", False),
    ),
    Case(
        "no checksum at all",
        PARSE,
        ("SHA256SUMS: line 1", "64 hex digits"),
        _bytes("steps/SHA256SUMS", b"abc  step_30/trial_01.csv\n", False),
    ),
    Case("other bytes", PARSE, (CSV, "SHA-256", "SHA256SUMS"), _bytes(CSV, FEW, listed=False)),
    # logs
    Case("no log", PARSE, (CSV, "is not there, but campaign.yaml names it"), _gone(CSV)),
    Case("a binary log", PARSE, (CSV, "is binary"), _bytes(CSV, bytes(range(256)) * 9)),
    Case("a header alone", PARSE, (CSV, "valid rows"), _bytes(CSV, b"t,command,angle\n")),
    Case("other names", PARSE, (CSV, "names no column 't'"), _bytes(CSV, b"a,b,c\n0,0,0\n1,0,0\n")),
    Case(
        "nan alone",
        PARSE,
        (CSV, "valid rows"),
        _bytes(CSV, b"t,command,angle\n" + b"nan,nan,nan\n" * 9),
    ),
    Case("a step that is none", FIT, (CSV, "its command is 0 throughout"), _bytes(CSV, NOT_RISING)),
    Case("a step of two samples", FIT, (CSV, "at least 10 samples"), _bytes(CSV, FEW)),
    Case(
        "every checksum of a line wrong",
        PARSE_ARM,
        (LOG, "holds no valid sample", "checksum"),
        _bytes(f"arm/{LOG}", (campaigns.RIG_BANNER + "0,1,0.00,93,354*00\n" * 9).encode()),
    ),
    Case(
        "no banner",
        PARSE_ARM,
        (LOG, "line 1"),
        _bytes(f"arm/{LOG}", campaigns.rig_trial().partition("\n")[2].encode()),
    ),
    Case(
        "a calibration for a trial",
        PARSE_ARM,
        (LOG, "its columns are"),
        _bytes(f"arm/{LOG}", campaigns.rig_calibration(90.0).replace(",15.0,", ",16.0,").encode()),
    ),
    # calibration
    Case(
        "no calibration's log", PARSE_ARM, (CALIBRATION, "not there"), _gone(f"arm/{CALIBRATION}")
    ),
    Case(
        "an empty calibration",
        PARSE_ARM,
        (CALIBRATION, "is empty"),
        _bytes(f"arm/{CALIBRATION}", b""),
    ),
    Case(
        "a short calibration",
        PARSE_ARM,
        (CALIBRATION, "known angles; expected a calibration of at least 3"),
        _bytes(f"arm/{CALIBRATION}", "".join(FLAT.splitlines(keepends=True)[:180]).encode()),
    ),
    Case(
        "an angle beyond the calibration",
        PARSE_ARM,
        (LOG, "angle outside calibration", CALIBRATION),
        _bytes(f"arm/{LOG}", campaigns.rig_trial(top=600).encode()),
    ),
    # model.json
    Case("no model", PREDICT, ("model.json", "expected a model file"), _gone("model.json")),
    Case(
        "a cut model",
        PREDICT,
        ("model.json: line 1", "expected JSON"),
        _bytes("model.json", b'{"a": '),
    ),
    Case("a binary model", PREDICT, ("model.json", "JSON"), _bytes("model.json", b"\x00\xff")),
    Case(
        "a model of a list", PREDICT, ("model.json", "a JSON object"), _bytes("model.json", b"[]")
    ),
    _in_model("another schema", ("schema", "spa-fo/model/1"), "schema", value="x"),
    _in_model("no campaign", ("campaign: missing",), "campaign"),
    _in_model("a number for a material", ("material: expected text",), "material", value=3),
    _in_model("no transfer function", ("transfer_function: missing",), "transfer_function"),
    _in_model("no a1", ("transfer_function.a1: missing",), "transfer_function", "a1"),
    _in_model(
        "a0 in words", ("transfer_function.a0", "a number"), "transfer_function", "a0", value="x"
    ),
    _in_model("orders reversed", ("alpha1 < alpha2",), "transfer_function", "alpha1", value=1.9),
    _in_model("a negative a0", ("a0 must be positive",), "transfer_function", "a0", value=-1),
    _in_model(
        "another signal", ("input.signal", "command, pressure"), "input", "signal", value="volt"
    ),
    _in_model("no reference", ("input.reference_kpa",), "input", "reference_kpa"),
    _in_model("another unit", ("output.unit", '"rad"'), "output", "unit", value="deg"),
    _in_model("effects of no list", ("effects: expected a list",), "effects", value=3),
    _in_model(
        "a mistyped effect",
        ("effects[0].id", "'crep'", "did you mean 'creep'?"),
        "effects",
        value=[{"id": "crep", "stage": "actuator", "parameters": {}}],
    ),
    Case(
        "a model driven by what is not logged",
        PREDICT,
        (CSV, "expected a pressure column: it drives the model"),
        _json("model.json", _key("input", "signal", value="pressure")),
    ),
    # outputs
    Case("a folder for a file", "fit steps --out steps", ("steps: cannot be written", "folder")),
    Case(
        "a file for a parent",
        "diagnose steps --model model.json --out model.json/d",
        ("model.json", "expected a folder"),
    ),
    Case("a file as DIR", "diagnose steps --model model.json --out model.json", ("it is a file",)),
    Case(
        "over the campaign", "fit steps --out steps/campaign.yaml", ("is a file of the campaign",)
    ),
    Case(
        "over the model",
        "predict model.json steps --out model.json",
        ("is a file of the campaign or",),
    ),
    Case(
        "over something else", "parse steps --out diagnosis.json", ("something else", "--overwrite")
    ),
    Case("where nobody may", "fit steps --out /proc/m.json", ("/proc/m.json: cannot be written",)),
    # options
    Case("a mistyped command", "diagnos steps", ("COMMAND", "did you mean 'diagnose'?")),
    Case("a mistyped option", FIT + " --sede 3", ("--sede: is no option", "'--seed'")),
    Case("no --out", "fit steps", ("required: --out",)),
    Case("a negative seed", FIT + " --seed=-1", ("--seed: expected a whole number from 0",)),
    Case(
        "a bound of no parameter",
        FIT + " --bound a7=1:2",
        ("--bound: a7 is no parameter", "alpha2"),
    ),
    Case("a reversed bound", FIT + " --bound a0=2:1", ("--bound: bounds of a0 are reversed",)),
    Case("a bound of no form", FIT + " --bound a0", ("--bound: expected NAME=LOW:HIGH",)),
    Case(
        "another input", FIT + " --input comand", ("--input: is 'comand'; did you mean 'command'?",)
    ),
    Case(
        "an input not logged",
        FIT + " --input pressure",
        ("steps/campaign.yaml", "a pressure column"),
    ),
    Case("a mistyped effect", DIAGNOSE + " --exclude-effect crep", ("did you mean 'creep'?",)),
    Case("a duration of 0", PLAN + " --max-duration 0", ("--max-duration: expected a positive",)),
    Case("a target of no name", "export model.json --to matlab", ("--to: is 'matlab'", "simulink")),
    Case("an order of 0", EXPORT + " --order 0", ("--order: expected a whole number from 1",)),
    Case("an order too high", EXPORT + " --order 900", ("order", "expected")),
    Case("a band upside down", EXPORT + " --band 10 1", ("--band",)),
    Case(
        "a sampling time in words",
        EXPORT + " --sample-time fast",
        ("--sample-time: expected a pos",),
    ),
    Case("no such port", "check /dev/nowhere", ("/dev/nowhere", "expected a serial port")),
    Case("a faulty fault", "rig serve --fault cat=1", ("--fault: expected KIND=SHARE",)),
    Case("another specimen", "rig serve --specimen elastosil", ("--specimen", "dragon_skin_20")),
    Case("a folder of no logs", "init nowhere", ("nowhere", "expected a folder of logs")),
    Case("a campaign already", "init steps", ("steps/campaign.yaml", "is there already")),
    # diagnosis.json
    Case("no diagnosis", PLAN, ("diagnosis.json", "as spa-fo diagnose"), _gone("diagnosis.json")),
    Case(
        "another's diagnosis", PLAN, ("diagnosis.json: campaign", "expected a diagnosis of 'steps'")
    ),
    Case("a diagnosis that is none", PLAN, ("is not JSON",), _bytes("diagnosis.json", b"verdict")),
)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sound inputs of every kind."""
    place = tmp_path_factory.mktemp("inputs")
    (place / "steps").mkdir()
    campaigns.step_campaign(place / "steps", trials=2)
    campaigns.rig_campaign(
        place / "arm", campaigns.rig_trial().encode(), campaigns.rig_calibration(90.0)
    )
    write_model(
        place / "model.json",
        Model("steps", "rubber", TransferFunction(**campaigns.TRUTH), campaigns.REFERENCE_KPA),
    )
    diagnosis = {"schema": "spa-fo/diagnosis/1", "campaign": "another"}
    (place / "diagnosis.json").write_text(json.dumps(diagnosis))
    return place


def files(place: Path) -> set[Path]:
    return {path for path in place.rglob("*") if path.is_file()}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_one_line_says_what_is_wrong(
    case: Case,
    inputs: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    place = tmp_path / "here"
    shutil.copytree(inputs, place)
    case.spoil(place)
    monkeypatch.chdir(place)
    before = files(place)
    with pytest.raises(SystemExit) as left:
        main(case.command.split())
    said = capsys.readouterr().err
    assert left.value.code == 2, said
    assert len(said.splitlines()) == 1, said
    assert said.startswith("spa-fo: ")
    for words in case.words:
        assert words in said
    assert files(place) == before


def test_the_sound_inputs_are_sound(
    inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or a case could be refused for another reason than its own."""
    place = tmp_path / "here"
    shutil.copytree(inputs, place)
    monkeypatch.chdir(place)
    for command in (PARSE, PARSE_ARM, PREDICT, EXPORT):
        assert main(command.split()) == 0
