"""The blind benchmark's workflow end to end, with a stand-in for the diagnosis itself."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from reduced_workflow import ROOT, snakemake

# Knows what every diagnosis knows: campaign, model, effects to withhold. Always sure of creep.
STAND_IN = f"""
import json
import shutil
import sys
from types import ModuleType


def diagnose_campaign(campaign_folder, model_path, out_dir, exclude, seed):
    assert (campaign_folder / "campaign.yaml").is_file()
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
        "baselines": {{"smallest_bic": ["creep"], "commonest": ["creep"]}},
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
    return {"PYTHONPATH": str(folder)}


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, environment: dict[str, str]) -> Path:
    folder = tmp_path_factory.mktemp("blind")
    (folder / "raw").symlink_to(ROOT / "raw")
    shutil.copy(ROOT / "tests" / "reduced" / "config.yaml", folder)
    run = snakemake(folder, "blind", environment=environment)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder / "results" / "blind"


def test_the_whole_benchmark_is_planned() -> None:
    run = snakemake(ROOT, "--dry-run", "--forceall", "blind")
    assert run.returncode == 0, run.stdout + run.stderr
    for rule in ("blind_cases", "blind_seals", "blind_diagnose", "blind_unseal", "blind_score"):
        assert f"{rule} " in run.stdout + run.stderr


def test_the_benchmark_stands_beside_the_main_workflow() -> None:
    run = snakemake(ROOT, "--dry-run", "--forceall")
    assert run.returncode == 0, run.stdout + run.stderr
    assert "blind_" not in run.stdout + run.stderr


def test_every_case_is_judged(finished: Path) -> None:
    scores = json.loads((finished / "scores.json").read_text())
    assert scores["cases"] == len((finished / "seals.txt").read_text().splitlines()) == 4
    assert scores["kinds"] == {"no_effect": 2, "pair": 2}
    alarms = next(mark for mark in scores["marks"] if "false alarms" in mark["name"])
    assert (alarms["estimate"]["value"], alarms["reached"]) == (1.0, False)
    assert (finished / "table.md").is_file()
    assert (finished / "shrink.png").is_file()


def test_a_model_that_changes_nothing_closes_nothing(finished: Path) -> None:
    realised = [
        entry
        for path in sorted((finished / "realised").glob("*.json"))
        for entry in json.loads(path.read_text()).values()
    ]
    assert len(realised) == 4
    assert all(entry["after_deg"] == entry["before_deg"] > 0 for entry in realised)
    scores = json.loads((finished / "scores.json").read_text())
    assert [point["realised"] for point in scores["shrink"]] == [0.0] * len(scores["shrink"])


def test_a_label_changed_after_the_diagnosis_is_refused(
    finished: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    shutil.copytree(finished.parent.parent, tmp_path, symlinks=True, dirs_exist_ok=True)
    results = tmp_path / "results" / "blind"
    label = next(iter(sorted((results / "labels").rglob("*.json"))))
    label.write_text(label.read_text().replace("no_effect", "closed").replace("pair", "closed"))
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
    assert len(lines) == 1
    assert "is not the label that was sealed" in lines[0]
    assert not (results / "labels.json").exists()
