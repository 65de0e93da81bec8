"""The workflow end to end, as its user runs it, at a reduced size."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

import campaigns
from reduced_workflow import REDUCED, SMALL, SNAKEMAKE, configure, digests, small, snakemake
from spa_fo.atomic import TEMPORARY

ROOT = Path(__file__).resolve().parent.parent

pytestmark = pytest.mark.workflow


def jobs(run: subprocess.CompletedProcess[str]) -> set[str]:
    """Names of the rules that a dry run would execute."""
    return {
        line.split()[-1].rstrip(":")
        for line in run.stdout.splitlines()
        if line.startswith(("rule ", "localrule "))
    }


def test_every_result_is_there_and_says_where_its_data_come_from(finished: Path) -> None:
    results = finished / "results"
    summary = (results / "summary.md").read_text()
    assert "synthetic" in summary
    assert "by construction" in summary
    for stem in ("table_1", "rms", "audit", "ablation", "baselines"):
        for suffix in ("csv", "tex", "md"):
            assert "synthetic" in (results / "tables" / f"{stem}.{suffix}").read_text()
    for material in REDUCED["materials"]:
        figures = results / material / "figures"
        for stem in (
            "step_responses",
            "calibration",
            "whole_logs",
            "ablation",
            "identifiability",
        ):
            assert (figures / f"{stem}.png").read_bytes().startswith(b"\x89PNG")
            assert (figures / f"{stem}.pdf").read_bytes().startswith(b"%PDF")
        model = json.loads((results / material / "model.json").read_text())
        assert model["schema"] == "spa-fo/model/1"
        diagnosis = json.loads((results / material / "diagnosis" / "diagnosis.json").read_text())
        assert diagnosis["campaign"] == model["campaign"]
        assert f"({material}/diagnosis/diagnosis.md)" in summary
        assert f"({material}/diagnosis/diagnosis.html)" in summary
        augmented = results / material / "diagnosis" / "augmented_model.json"
        explained = diagnosis["shrink"] is not None
        assert bool(json.loads(augmented.read_text())["effects"]) == explained


def test_every_picture_and_file_the_summary_names_is_there(finished: Path) -> None:
    summary = (finished / "results" / "summary.md").read_text()
    links = [part.split(")")[0] for part in summary.split("](")[1:]]
    assert links
    for link in links:
        assert (finished / "results" / link).is_file(), link


def test_a_second_run_has_nothing_to_do(finished: Path) -> None:
    before = digests(finished / "results")
    run = snakemake(finished)
    assert run.returncode == 0
    assert "Nothing to be done" in run.stdout + run.stderr
    assert digests(finished / "results") == before


def test_raw_files_are_never_modified(finished: Path) -> None:
    for campaign in sorted((ROOT / "raw").iterdir()):
        if campaign.is_dir():
            run = subprocess.run(
                ["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=campaign, check=False
            )
            assert run.returncode == 0


def test_a_new_material_is_one_entry_and_its_folder(finished: Path, tmp_path: Path) -> None:
    shutil.copytree(finished, tmp_path, symlinks=True, dirs_exist_ok=True)
    (tmp_path / "raw").unlink()
    (tmp_path / "raw").mkdir()
    for campaign in REDUCED["materials"]:
        (tmp_path / "raw" / campaign).symlink_to(ROOT / "raw" / campaign)
    folder = tmp_path / "raw" / "my_arm"
    folder.mkdir()
    campaigns.step_campaign(folder)
    configure(tmp_path, materials=REDUCED["materials"] | {"my_arm": None})
    run = snakemake(tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "test rubber" in (tmp_path / "results" / "tables" / "rms.md").read_text()
    assert (tmp_path / "results" / "my_arm" / "figures" / "step_responses.png").is_file()
    # What was there already was not made again, but for what shows all materials together.
    before, after = digests(finished / "results"), digests(tmp_path / "results")
    together = ("tables/", "pages/tables/", "report_texts/", "summary.md")
    assert {name for name in before if before[name] != after[name]} <= {
        name for name in before if name.startswith(together)
    }


def test_a_campaign_without_steps_goes_through(tmp_path: Path) -> None:
    folder = tmp_path / "raw" / "stairs"
    folder.mkdir(parents=True)
    campaigns.free_campaign(folder)
    configure(tmp_path, materials={"stairs": None})
    run = snakemake(tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    figures = tmp_path / "results" / "stairs" / "figures"
    assert {path.name for path in figures.glob("*.png")} == {"whole_logs.png"}
    assert "test rubber" in (tmp_path / "results" / "summary.md").read_text()


def test_the_real_soft_arm_goes_through_by_configuration_alone(
    shared_data: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "raw" / "soft_arm"
    shutil.copytree(shared_data / "soft_arm_steps", folder)
    shutil.copy(ROOT / "examples" / "soft_arm_steps" / "campaign.yaml", folder)
    campaigns.write_sums(folder)
    configure(tmp_path, materials={"soft_arm": None})
    run = snakemake(tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    summary = (tmp_path / "results" / "summary.md").read_text()
    assert "measured data" in summary
    assert "synthetic" not in summary
    assert (tmp_path / "results" / "soft_arm" / "figures" / "whole_logs.png").is_file()


@pytest.fixture
def own_sources(finished: Path, tmp_path: Path) -> tuple[Path, dict[str, str]]:
    """A finished run whose package is a copy that a test may edit."""
    package = tmp_path / "src"
    shutil.copytree(ROOT / "src", package, ignore=shutil.ignore_patterns("__pycache__"))
    environment = {"PYTHONPATH": str(package)}
    assert jobs(snakemake(finished, "--dry-run", environment=environment)) == set()
    return package / "spa_fo", environment


@pytest.mark.parametrize(
    ("source", "rules"),
    [
        ("report/figures.py", {"all", "compare", "figures", "publish"}),
        ("gap/data/hold_out.py", {"all", "diagnose", "compare", "publish"}),
        ("compare/fading_memory.py", {"all", "compare", "publish"}),
        ("compare/learning.py", {"all", "compare", "publish"}),
        (
            "rig/calibration.py",
            {
                "all",
                "raw_to_angle",
                "identify",
                "diagnose",
                "compare",
                "ablation",
                "figures",
                "publish",
            },
        ),
        ("virtual_rig/actuator.py", set()),
    ],
)
def test_an_edit_reruns_what_depends_on_it(
    own_sources: tuple[Path, dict[str, str]], finished: Path, source: str, rules: set[str]
) -> None:
    package, environment = own_sources
    path = package / source
    path.write_text(path.read_text() + "\n# edited\n")
    assert jobs(snakemake(finished, "--dry-run", environment=environment)) == rules


@pytest.mark.parametrize("moment", ["*/trials.csv", "*/figures/*.png"])
def test_a_killed_run_started_again_gives_the_same_bytes(
    finished_small: Path, tmp_path: Path, moment: str
) -> None:
    """Killed as soon as a first such file is there: between two steps, and within one."""
    small(tmp_path)
    process = subprocess.Popen(
        [*SNAKEMAKE, "--directory", str(tmp_path)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    results = tmp_path / "results"
    while not any(results.glob(moment)) and process.poll() is None:
        time.sleep(0.02)
    assert process.poll() is None
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    (results / SMALL[1]).mkdir(exist_ok=True)
    (results / SMALL[1] / f"{TEMPORARY}1234.csv").write_text("half a li")
    assert snakemake(tmp_path, "--unlock").returncode == 0
    run = snakemake(tmp_path)
    assert run.returncode == 0, run.stdout + run.stderr
    assert digests(results) == digests(finished_small / "results")


def test_a_bad_config_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    configure(tmp_path, ablatoin={})
    run = snakemake(tmp_path)
    assert run.returncode == 2
    lines = [line for line in run.stderr.splitlines() if line.startswith("spa-fo: ")]
    assert lines == ["spa-fo: config.yaml: ablatoin: unknown key; did you mean 'ablation'?"]


def test_a_key_given_twice_is_refused(tmp_path: Path) -> None:
    configure(tmp_path)
    with (tmp_path / "config.yaml").open("a") as stream:
        stream.write("seed: 2\n")
    run = snakemake(tmp_path)
    assert run.returncode == 2
    lines = [line for line in run.stderr.splitlines() if line.startswith("spa-fo: ")]
    assert len(lines) == 1
    assert "key 'seed' is given twice" in lines[0]


def test_a_material_without_a_folder_is_one_clear_line(tmp_path: Path) -> None:
    configure(tmp_path, materials={"nowhere": None})
    run = snakemake(tmp_path)
    assert run.returncode != 0
    lines = [line for line in run.stderr.splitlines() if line.startswith("spa-fo: ")]
    assert len(lines) == 1
    assert "raw/nowhere" in lines[0]
    assert not list((tmp_path / "results").rglob("*.csv"))
