"""The blind benchmark's workflow end to end, with a stand-in for the diagnosis itself."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from blind.judge.check import main as check
from reduced_workflow import ROOT, snakemake

# Knows what every diagnosis knows: campaign, model, effects to withhold. Always sure of creep,
# but for one case, which it cannot cope with.
STAND_IN = f"""
import json
import shutil
import sys
from types import ModuleType


def diagnose_campaign(campaign_folder, model_path, out_dir, exclude, seed):
    assert (campaign_folder / "campaign.yaml").is_file()
    if campaign_folder.parent.name == "case_0002":
        raise IndexError("no such trial")
    shutil.copy(model_path, out_dir / "augmented_model.json")
    document = {{
        "schema": "spa-fo/diagnosis/1",
        "where": {{"stage": {{"drive": 0, "actuator": 1, "sensor": 0, "acquisition": 0}}}},
        "causes": [
            {{"set": ["creep"], "probability": 0.9}},
            {{"set": ["none"], "probability": 0.05}},
            {{"set": ["unknown"], "probability": 0.05}},
        ],
        "verdict": {{"kind": "cause", "sets": [["creep"]], "next_experiment": None}},
        "shrink": {{"fraction_closed": 0.5, "ci95": [0.4, 0.6]}},
    }}
    (out_dir / "diagnosis.json").write_text(json.dumps(document))


stand_in = ModuleType("spa_fo.gap")
stand_in.__path__ = [{str(ROOT / "src" / "spa_fo" / "gap")!r}]
stand_in.diagnose_campaign = diagnose_campaign
sys.modules["spa_fo.gap"] = stand_in
"""

pytestmark = pytest.mark.workflow


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Every interpreter finds the stand-in where the diagnosis is; all else is the package's."""
    folder = tmp_path_factory.mktemp("stand_in")
    (folder / "sitecustomize.py").write_text(STAND_IN)
    return {"PYTHONPATH": f"{folder}:{ROOT / 'src'}"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("blind")
    (folder / "raw").symlink_to(ROOT / "raw")
    shutil.copy(ROOT / "tests" / "reduced" / "config.yaml", folder)
    return folder


@pytest.fixture(scope="module")
def run(folder: Path, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    return snakemake(folder, "blind", environment=environment)


@pytest.fixture(scope="module")
def finished(folder: Path, run: subprocess.CompletedProcess[str]) -> Path:
    assert run.returncode == 0, run.stdout + run.stderr
    return folder / "results" / "blind"


def test_the_whole_benchmark_is_planned() -> None:
    run = snakemake(ROOT, "--dry-run", "--forceall", "blind")
    assert run.returncode == 0, run.stdout + run.stderr
    for rule in ("blind_cases", "blind_seals", "blind_diagnose", "blind_unseal", "blind_score"):
        assert f"{rule} " in run.stdout + run.stderr


def test_a_small_benchmark_has_a_folder_of_its_own() -> None:
    small = "tests/reduced/blind_small.yaml"
    run = snakemake(ROOT, "--dry-run", "--forceall", "--configfile", small, "--", "blind")
    assert run.returncode == 0, run.stdout + run.stderr
    assert "build/blind_small/blind/scores.json" in run.stdout + run.stderr


def test_the_benchmark_stands_beside_the_main_workflow() -> None:
    run = snakemake(ROOT, "--dry-run", "--forceall")
    assert run.returncode == 0, run.stdout + run.stderr
    assert "blind_" not in run.stdout + run.stderr


def test_every_case_is_judged(finished: Path) -> None:
    scores = json.loads((finished / "scores.json").read_text())
    assert scores["cases"] == len((finished / "seals.txt").read_text().splitlines()) == 2
    for rig in ("virtual_rig", "second_rig"):
        assert scores["rigs"][rig]["kinds"] == {"no_effect": 1}
        alarms = next(mark for mark in scores["marks"] if mark["rig"] == rig)
        assert (alarms["estimate"]["value"], alarms["reached"]) == (1.0, False)
    for name in ("table.md", "classes.csv", "surroundings.png", "shrink.png"):
        assert (finished / name).is_file()


def test_an_error_in_one_case_is_its_answer_and_stops_no_other(finished: Path) -> None:
    (told,) = finished.glob("diagnoses/*/*/error.txt")
    assert told.parent.name == "case_0002"
    assert told.read_text() == "IndexError: no such trial\n"
    scores = json.loads((finished / "scores.json").read_text())
    (failure,) = [entry for rig in scores["rigs"].values() for entry in rig["failures"]]
    assert (failure["case"], failure["step"]) == ("case_0002", "diagnosis")
    logs = (finished.parent / "logs" / "blind").glob("*_diagnose.log")
    assert any("Traceback" in path.read_text() for path in logs)


def test_progress_is_seen(run: subprocess.CompletedProcess[str]) -> None:
    for number in (1, 2):
        assert f"case_000{number}: 1 of 1 diagnosed" in run.stderr


def test_marks_that_fall_short_are_an_error(
    finished: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert check([str(finished / "scores.json")]) == 1
    assert "no effect: false alarms: expected ≤ 0.02, found 1.000" in capsys.readouterr().out


def test_a_model_that_changes_nothing_closes_nothing(finished: Path) -> None:
    realised = [
        entry
        for path in sorted((finished / "realised").glob("*.json"))
        for entry in json.loads(path.read_text()).values()
    ]
    first, second = sorted(realised, key=len, reverse=True)
    assert first["after_deg"] == first["before_deg"] > 0
    assert second == {"error": "there is no diagnosis"}


def test_a_label_changed_after_the_diagnosis_is_refused(
    finished: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    shutil.copytree(finished.parent.parent, tmp_path, symlinks=True, dirs_exist_ok=True)
    results = tmp_path / "results" / "blind"
    label = next(iter(sorted((results / "labels").rglob("*.json"))))
    label.write_text(label.read_text().replace("no_effect", "closed"))
    (results / "labels.json").unlink()
    run = snakemake(
        tmp_path,
        "results/blind/labels.json",
        "--rerun-triggers",
        "mtime",
        environment=environment,
    )
    assert run.returncode != 0
    lines = [line for line in run.stderr.splitlines() if line.startswith("spa-fo: ")]
    assert len(lines) == 1, run.stdout + run.stderr
    assert "is not the label that was sealed" in lines[0]
    assert not (results / "labels.json").exists()
