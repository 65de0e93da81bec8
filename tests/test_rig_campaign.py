"""campaign.yaml against its schema, against itself, and against the files."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

import naive_rig
from campaigns import write_sums
from spa_fo.errors import BadInput
from spa_fo.rig import read_campaign
from spa_fo.rig.checksums import read_checksums
from spa_fo.validation import package_schema

Document = dict[str, Any]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return naive_rig.write_campaign(tmp_path / "small")


def rewrite(folder: Path, change: Callable[[Document], object]) -> None:
    path = folder / "campaign.yaml"
    document = copy.deepcopy(yaml.safe_load(path.read_text()))
    change(document)
    path.write_text(yaml.safe_dump(document, sort_keys=False))


def refused(folder: Path) -> str:
    with pytest.raises(BadInput) as caught:
        read_campaign(folder)
    text = str(caught.value)
    assert text.isprintable()
    return text.replace(str(folder), "small")


def test_a_campaign_is_read(folder: Path) -> None:
    campaign = read_campaign(str(folder))
    assert (campaign.name, campaign.material) == ("small", "Dragon Skin 20")
    assert campaign.provenance.kind == "synthetic"
    assert campaign.reference_kpa == 30.0
    assert campaign.log.format == "spa-rig"
    assert [item.file for item in campaign.calibration] == [
        "calibration/pre.log",
        "calibration/post.log",
    ]
    (experiment,) = campaign.experiments
    assert (experiment.name, experiment.setpoint_deg, experiment.protocol) == (
        "step_20",
        20.0,
        "step",
    )
    assert [(e.name, n, t.order) for e, n, t in campaign.trial_files()] == [
        ("step_20", 1, 1),
        ("step_20", 2, 2),
    ]
    assert campaign.continues is None
    assert campaign.warnings == ()


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(
        package_schema("spa_fo.rig", "campaign.schema.yaml")
    )


def test_the_earliest_calibration_comes_first_however_listed(folder: Path) -> None:
    rewrite(folder, lambda d: d["calibration"].reverse())
    assert read_campaign(folder).calibration[0].file == "calibration/pre.log"


def test_a_later_campaign_may_continue_an_earlier_one(folder: Path) -> None:
    def change(document: Document) -> None:
        document["continues"] = "first"
        for i, trial in enumerate(document["experiments"][0]["trials"]):
            trial.update(order=15 + i, started_s=9000.0 + 60 * i)

    rewrite(folder, change)
    assert read_campaign(folder).continues == "first"


def test_the_pressure_sensor_is_linear(folder: Path) -> None:
    sensor = read_campaign(folder).pressure_sensor
    assert sensor is not None
    counts = [0.1 * 1023, 0.5 * 1023, 0.9 * 1023]
    assert sensor.pressure_kpa(counts) == pytest.approx([0.0, 275.8, 551.6])


CHANGES: list[tuple[str, Callable[[Document], object], str]] = [
    (
        "unknown key",
        lambda d: d.update(materail="x"),
        "campaign.yaml: materail: unknown key; did you mean 'material'?",
    ),
    (
        "unknown inner key",
        lambda d: d["experiments"][0]["trials"][1].update(ordr=3),
        "campaign.yaml: experiments[0].trials[1].ordr: unknown key; did you mean 'order'?",
    ),
    ("missing key", lambda d: d.pop("material"), "campaign.yaml: material: is missing"),
    ("schema", lambda d: d.update(schema="spa-fo/campaign/2"), "schema: is 'spa-fo/campaign/2'"),
    (
        "protocol",
        lambda d: d["experiments"][0].update(protocol="steps"),
        "experiments[0].protocol: is 'steps'; did you mean 'step'?",
    ),
    (
        "kind",
        lambda d: d["provenance"].update(kind="real"),
        "provenance.kind: is 'real'; expected one of: measured, synthetic",
    ),
    (
        "sensor upside down",
        lambda d: d["pressure_sensor"].update(kpa=[551.6, 0]),
        "pressure_sensor.kpa: is [551.6, 0]; expected two rising numbers",
    ),
    (
        "reference",
        lambda d: d["input"].update(reference_kpa=0),
        "input.reference_kpa: is 0; expected more than 0",
    ),
    ("no experiments", lambda d: d.update(experiments=[]), "experiments: is []; expected at least"),
    (
        "an experiment without trials",
        lambda d: d["experiments"][0].update(trials=[]),
        "experiments[0].trials: experiment 'step_20' has no trials; expected at least one",
    ),
    (
        "trials null",
        lambda d: d["experiments"][0].update(trials=None),
        "experiments[0].trials: is null; expected a list",
    ),
    (
        "two of a name",
        lambda d: d["experiments"].append({**d["experiments"][0]}),
        "experiments[1].name: 'step_20' is the name of two",
    ),
    (
        "file twice",
        lambda d: d["experiments"][0]["trials"][1].update(file="step_20/trial_01.log"),
        "experiments[0].trials[1].file: file step_20/trial_01.log is already taken by "
        "experiments[0].trials[0].file",
    ),
    (
        "calibration as trial",
        lambda d: d["experiments"][0]["trials"][1].update(file="calibration/pre.log"),
        "file calibration/pre.log is already taken by calibration[0].file",
    ),
    (
        "order twice",
        lambda d: d["experiments"][0]["trials"][1].update(order=1),
        "trials[1].order: order 1 is already taken by experiments[0].trials[0].order",
    ),
    (
        "time against order",
        lambda d: d["experiments"][0]["trials"][1].update(started_s=-1),
        "experiments[0].trials[1].started_s: order 2 starts at -1 s, not after order 1 at 0 s",
    ),
    (
        "two at a time",
        lambda d: d["experiments"][0]["trials"][1].update(started_s=0.0),
        "experiments[0].trials[1].started_s: order 2 starts at 0 s, not after order 1 at 0 s",
    ),
    (
        "not finite",
        lambda d: d["experiments"][0]["trials"][1].update(started_s=float("nan")),
        "experiments[0].trials[1].started_s: is nan; expected a finite number",
    ),
    (
        "a file that is not there",
        lambda d: d["experiments"][0]["trials"][1].update(file="step_20/trial_07.log"),
        "small/step_20/trial_07.log: experiment 'step_20', trial 2: is not there",
    ),
    (
        "a file outside the folder",
        lambda d: d["experiments"][0]["trials"][1].update(file="../other.log"),
        "expected a plain path inside the folder",
    ),
    (
        "csv without columns",
        lambda d: d.update(log={"format": "csv"}),
        "log.columns: is missing",
    ),
    (
        "columns without csv",
        lambda d: d["log"].update(delimiter=";"),
        "log.delimiter: belongs to format csv only",
    ),
    (
        "a name without a header",
        lambda d: d.update(
            log={
                "format": "csv",
                "header": False,
                "columns": {
                    "time": {"column": "t", "unit": "s"},
                    "angle": {"column": 2, "unit": "deg"},
                },
            }
        ),
        "log.columns.time.column: is 't'; expected a 1-based index, as header is false",
    ),
    (
        "no output",
        lambda d: d.update(log={"format": "csv", "columns": {"time": {"column": 1, "unit": "s"}}}),
        "log.columns: expected a column 'angle' or 'flex_adc'",
    ),
    (
        "a unit of another kind",
        lambda d: d.update(
            log={
                "format": "csv",
                "columns": {
                    "time": {"column": 1, "unit": "kPa"},
                    "angle": {"column": 2, "unit": "deg"},
                },
            }
        ),
        "log.columns.time.unit: is 'kPa'; expected one of",
    ),
    (
        "column 0",
        lambda d: d.update(
            log={
                "format": "csv",
                "columns": {
                    "time": {"column": 0, "unit": "s"},
                    "angle": {"column": 2, "unit": "deg"},
                },
            }
        ),
        "log.columns.time.column: is 0; expected at least 1",
    ),
    (
        "flex without calibration",
        lambda d: (
            d.pop("calibration"),
            d.update(
                log={
                    "format": "csv",
                    "columns": {"time": {"column": 1, "unit": "s"}, "flex_adc": {"column": 2}},
                }
            ),
        ),
        "calibration: is missing; the logs hold flex_adc, not an angle",
    ),
]


@pytest.mark.parametrize(
    ("change", "message"), [c[1:] for c in CHANGES], ids=[c[0] for c in CHANGES]
)
def test_a_wrong_description_is_refused(
    folder: Path, change: Callable[[Document], object], message: str
) -> None:
    rewrite(folder, change)
    assert message in refused(folder)


def test_a_name_may_be_written_with_dots(folder: Path) -> None:
    rewrite(
        folder,
        lambda d: d["experiments"][0]["trials"][1].update(file="./step_20//trial_02.log"),
    )
    assert read_campaign(folder).experiments[0].trials[1].file == "step_20/trial_02.log"


def test_no_folder_and_no_description(tmp_path: Path, folder: Path) -> None:
    assert "is not there; expected a campaign folder" in refused(tmp_path / "nothing")
    assert "is a file; expected a campaign folder" in refused(folder / "campaign.yaml")
    (folder / "campaign.yaml").unlink()
    assert "small/campaign.yaml: is missing" in refused(folder)


def emptied(folder: Path, *files: str) -> None:
    for file in files:
        (folder / file).write_bytes(b"")
    write_sums(folder)


def test_an_empty_trial_is_left_out_and_the_others_keep_their_numbers(folder: Path) -> None:
    before = {(e.name, number): file for e, number, file in read_campaign(folder).trial_files()}
    emptied(folder, "step_20/trial_01.log")
    campaign = read_campaign(folder)
    after = {(e.name, number): file for e, number, file in campaign.trial_files()}
    assert before.pop(("step_20", 1)).file == "step_20/trial_01.log"
    assert after == before
    assert campaign.warnings == ("step_20/trial_01.log is empty: left out",)


def test_an_experiment_of_empty_trials_is_left_out(folder: Path) -> None:
    def second_experiment(document: Document) -> None:
        own = document["experiments"][0]
        document["experiments"].append({**own, "name": "again", "trials": [own["trials"].pop()]})

    rewrite(folder, second_experiment)
    emptied(folder, "step_20/trial_02.log")
    campaign = read_campaign(folder)
    assert [experiment.name for experiment in campaign.experiments] == ["step_20"]
    assert campaign.warnings == ("step_20/trial_02.log is empty: left out",)


def test_empty_trials_of_two_experiments_are_no_copies_of_each_other(folder: Path) -> None:
    def more(document: Document) -> None:
        trials = document["experiments"][0]["trials"]
        empty = {"file": "again/trial_01.log", "order": 3, "started_s": 900.0}
        document["experiments"].append(
            {"name": "again", "protocol": "step", "setpoint_deg": 20, "trials": [empty]}
        )
        assert [trial["order"] for trial in trials] == [1, 2]

    rewrite(folder, more)
    (folder / "again").mkdir()
    emptied(folder, "again/trial_01.log", "step_20/trial_02.log")
    assert len(read_campaign(folder).warnings) == 2


def test_a_campaign_of_empty_trials_is_refused_by_name(folder: Path) -> None:
    emptied(folder, *(item.file for _, _, item in read_campaign(folder).trial_files()))
    text = refused(folder)
    assert text.startswith("small/step_20/trial_01.log: is empty, as are all trials; expected a")


def test_the_earliest_calibration_may_not_be_empty_a_later_one_may(folder: Path) -> None:
    first, later = read_campaign(folder).calibration
    emptied(folder, later.file)
    assert read_campaign(folder).calibration == (first,)
    assert f"{later.file} is empty: left out" in read_campaign(folder).warnings
    emptied(folder, first.file)
    assert refused(folder).startswith(f"small/{first.file}: is empty; expected a log: every angle")


def test_changed_bytes_are_refused(folder: Path) -> None:
    path = folder / "step_20/trial_02.log"
    path.write_bytes(path.read_bytes()[:-1])
    text = refused(folder)
    assert text.startswith("small/step_20/trial_02.log: its SHA-256 is ")


def test_one_log_for_two_experiments_is_refused(folder: Path) -> None:
    path = folder / "step_20/trial_02.log"
    path.write_bytes((folder / "calibration/pre.log").read_bytes())
    naive_rig.write_checksums(folder)
    assert "holds the same bytes as calibration/pre.log" in refused(folder)


def test_trials_without_noise_may_be_the_same_bytes(folder: Path) -> None:
    path = folder / "step_20/trial_02.log"
    path.write_bytes((folder / "step_20/trial_01.log").read_bytes())
    naive_rig.write_checksums(folder)
    warnings = read_campaign(folder).warnings
    assert warnings == (
        "step_20/trial_02.log holds the same bytes as step_20/trial_01.log: a copy?",
    )


def test_checksums_that_are_missing_say_how_to_make_them(folder: Path) -> None:
    (folder / "SHA256SUMS").unlink()
    text = refused(folder)
    assert "sha256sum calibration/*.log step_20/*.log > SHA256SUMS" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("step_20/trial_02.log", "step_20/other.log"), "does not list step_20"),
        (lambda t: t + "0" * 64 + "  gone.log\n", "lists gone.log, which is not there"),
        (lambda t: t + t.splitlines()[0] + "\n", "line 5: lists calibration/post.log twice"),
        (lambda t: t + "what\n", "line 5: expected 64 hex digits, two spaces and a file"),
        (lambda t: "", "does not list calibration/pre.log"),
    ],
)
def test_wrong_checksum_files(folder: Path, change: Callable[[str], str], message: str) -> None:
    path = folder / "SHA256SUMS"
    path.write_text(change(path.read_text()))
    assert message in refused(folder)


def test_a_stray_log_is_refused(folder: Path) -> None:
    (folder / "step_20/trial_03.log").write_bytes(b"x")
    assert "small/step_20/trial_03.log: is not listed in SHA256SUMS" in refused(folder)


def test_a_listed_file_that_nobody_names_is_a_warning(folder: Path) -> None:
    (folder / "notes.txt").write_bytes(b"x")
    naive_rig.write_checksums(folder)
    assert read_campaign(folder).warnings == (
        "notes.txt is in SHA256SUMS, but campaign.yaml does not name it",
    )


def test_sha256sum_writes_in_several_ways(folder: Path) -> None:
    path = folder / "SHA256SUMS"
    text = path.read_text()
    path.write_text(text.replace("  ", " *").replace("\n", "\r\n"))
    assert read_checksums(folder) == {
        line.split("  ")[1]: line.split("  ")[0] for line in text.splitlines()
    }
    path.write_text(text.replace("  ", "  ./"))
    assert read_campaign(folder).name == "small"
