"""Campaigns whose logs hold no angle in the workflow: compared, and nothing else."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import campaigns
from reduced_workflow import ROOT, configure, snakemake
from test_compare_pressure import sines
from test_workflow import jobs

pytestmark = pytest.mark.workflow

MAY, JUNE = "regulator_in_may", "regulator_in_june"
PAIR = {MAY: None, JUNE: {"reference": MAY}}


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive that was late by 0.1 s in May, and in June by 0.2 s; not to be changed."""
    folder = tmp_path_factory.mktemp("drives")
    sines(folder / "raw" / MAY, 0.1, 5)
    sines(folder / "raw" / JUNE, 0.2, 7)
    configure(folder, materials=PAIR)
    return folder


@pytest.fixture(scope="module")
def changed(drives: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with the change asked for, and nothing else."""
    folder = tmp_path_factory.mktemp("changed")
    shutil.copytree(drives, folder, dirs_exist_ok=True)
    run = snakemake(folder, f"results/{JUNE}/changed")
    assert run.returncode == 0, run.stdout + run.stderr
    return folder


def test_they_are_compared_and_nothing_else(drives: Path) -> None:
    run = snakemake(drives, "--dry-run")
    assert run.returncode == 0, run.stdout + run.stderr
    assert jobs(run) == {"all", "compare", "publish"}


def test_beside_them_a_campaign_with_an_angle_is_diagnosed(drives: Path, tmp_path: Path) -> None:
    shutil.copytree(drives, tmp_path, dirs_exist_ok=True)
    (tmp_path / "raw" / "arm").mkdir()
    campaigns.step_campaign(tmp_path / "raw" / "arm", trials=2)
    configure(tmp_path, materials={"arm": None} | PAIR)
    run = snakemake(tmp_path, "--dry-run")
    assert {"raw_to_angle", "diagnose", "compare"} < jobs(run)
    for made in ("trials.csv", "model.json", "diagnosis"):
        assert f"results/arm/{made}" in run.stdout
        assert f"results/{MAY}/{made}" not in run.stdout
        assert f"results/{JUNE}/{made}" not in run.stdout


def test_a_reference_without_an_angle_is_compared_by_its_pressure(
    drives: Path, tmp_path: Path
) -> None:
    shutil.copytree(drives, tmp_path, dirs_exist_ok=True)
    (tmp_path / "raw" / "arm").mkdir()
    campaigns.step_campaign(tmp_path / "raw" / "arm", trials=2)
    configure(tmp_path, materials={MAY: None, "arm": {"reference": MAY}})
    assert jobs(snakemake(tmp_path, "--dry-run", "results/arm/changed")) == {"compare"}


def test_what_changed_is_what_the_command_says(changed: Path) -> None:
    folder = changed / "results" / JUNE / "changed"
    document = json.loads((folder / "comparison.json").read_text())
    assert (document["compared"], document["reference"]) == ("pressure", MAY)
    assert document["verdict"]["kind"] != "nothing_changed"
    assert document["where"]["stage"]["drive"] == 1.0
    assert "No angle was logged" in (folder / "comparison.md").read_text()
    for name in ("measured.png", "change.png"):
        assert (folder / name).stat().st_size > 1000
    made = {path.name for path in (changed / "results").iterdir()}
    assert made == {JUNE, "logs"}


def test_summary_and_report_hold_what_there_is_to_say(changed: Path, tmp_path: Path) -> None:
    shutil.copytree(changed, tmp_path, dirs_exist_ok=True)
    run = snakemake(tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    results = tmp_path / "results"
    answer, _ = json.loads((results / JUNE / "changed" / "comparison.json").read_text())["answer"]
    summary = (results / "summary.md").read_text()
    assert summary.count(answer) == 2
    assert f"`{MAY}`" in summary
    assert "° " not in summary
    assert "tables" not in summary
    for link in (part.split(")")[0] for part in summary.split("](")[1:]):
        assert (results / link).is_file(), link
    pages = {
        path.relative_to(results / "pages").as_posix()
        for path in results.rglob("*.html")
        if "pages" in path.parts
    }
    assert pages == {f"{JUNE}/changed.html"}
    style = str(ROOT / "workflow" / "report" / "report.css")
    run = snakemake(tmp_path, "--report", "report.html", "--report-stylesheet", style)
    assert run.returncode == 0, run.stdout + run.stderr
    report = (tmp_path / "report.html").read_text()
    assert "Pressure above, command below" in report
    assert "Angle above" not in report


@pytest.mark.parametrize(
    ("materials", "said"),
    [
        (
            {JUNE: None},
            f"materials.{JUNE}.reference: is missing; raw/{JUNE}/campaign.yaml names no column "
            "'angle' or 'flex_adc', so it can only be compared; expected another entry, an earlier "
            "campaign of the actuator",
        ),
        (
            PAIR | {MAY: {"input": "pressure"}},
            f"materials.{MAY}.input: belongs to a campaign with an angle; "
            f"raw/{MAY}/campaign.yaml names none",
        ),
    ],
)
def test_what_cannot_be_done_without_an_angle_is_one_line(
    drives: Path, tmp_path: Path, materials: dict[str, object], said: str
) -> None:
    shutil.copytree(drives, tmp_path, dirs_exist_ok=True)
    configure(tmp_path, materials=materials)
    run = snakemake(tmp_path)
    assert run.returncode == 2
    lines = [line for line in run.stderr.splitlines() if line.startswith("spa-fo: ")]
    assert lines == [f"spa-fo: config.yaml: {said}"]
    assert not (tmp_path / "results").exists()
