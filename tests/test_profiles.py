"""The profiles: plain runs, an unwatched machine, and a cluster, which is a real Slurm here."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
import yaml

from reduced_workflow import ROOT, SMALL, digests
from slurm_cluster import NoCluster, find_programs, jobs, one_node_cluster

PROFILES = ROOT / "workflow" / "profiles"

pytestmark = pytest.mark.workflow


def snakemake(
    folder: Path, *options: str, environment: Mapping[str, str] = os.environ
) -> subprocess.CompletedProcess[str]:
    """Run with what the profiles say, and no more."""
    return subprocess.run(
        [
            *(sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")),
            *("--directory", str(folder), *options),
        ],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )


def test_plain_snakemake_finds_the_default_profile(finished: Path) -> None:
    run = snakemake(finished, "--dry-run", "-c2")
    assert "workflow specific profile profiles/default" in run.stdout + run.stderr


@pytest.mark.parametrize("name", ["ci", "slurm"])
def test_a_profile_changes_nothing_in_the_results(finished: Path, name: str) -> None:
    run = snakemake(finished, "--profile", str(PROFILES / name), "--dry-run")
    assert run.returncode == 0, run.stdout + run.stderr
    assert "Nothing to be done" in run.stdout + run.stderr


def test_every_rule_that_a_profile_groups_is_there() -> None:
    profile = yaml.safe_load((PROFILES / "slurm" / "config.yaml").read_text())
    rules = snakemake(ROOT, "--list-rules", "-c1").stdout.split()
    assert set(profile["groups"]) <= set(rules)
    assert set(profile["group-components"]) <= set(profile["groups"].values())


def test_a_cluster_gives_the_same_bytes(finished_small: Path, tmp_path: Path) -> None:
    """One campaign from its raw logs, a figure of the other, and what is made of both."""
    try:
        find_programs()
    except NoCluster as reason:
        pytest.skip(str(reason))
    shutil.copytree(finished_small, tmp_path, symlinks=True, dirs_exist_ok=True)
    results = tmp_path / "results"
    shutil.rmtree(results / SMALL[0])
    shutil.rmtree(results / SMALL[1] / "figures")
    (results / "summary.md").unlink()
    options = [
        *("--profile", str(PROFILES / "slurm")),
        *("--slurm-init-seconds-before-status-checks", "2", "--latency-wait", "5"),
    ]
    with one_node_cluster() as environment:
        run = snakemake(tmp_path, *options, environment=environment)
        submitted = jobs(environment)
    assert run.returncode == 0, run.stdout + run.stderr
    assert digests(results) == digests(finished_small / "results")
    # Two campaigns share one job; what waits for all of them is another.
    assert [job["JobState"] for job in submitted] == ["COMPLETED", "COMPLETED"]
    group, publish = (job["Comment"] for job in submitted)
    assert group.startswith("rule_campaign_")
    assert publish == "rule_publish"
    for job in submitted:
        assert f"SLURM jobid {job['JobId']} " in run.stdout + run.stderr
