"""The workflow at a reduced size, run as its user runs it."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

import campaigns

ROOT = Path(__file__).resolve().parent.parent
REDUCED = yaml.safe_load((ROOT / "tests" / "reduced" / "config.yaml").read_text())
SNAKEMAKE = [
    sys.executable,
    "-m",
    "snakemake",
    "--snakefile",
    str(ROOT / "Snakefile"),
    "--cores",
    "2",
]


def snakemake(
    folder: Path, *options: str, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*SNAKEMAKE, "--directory", str(folder), *options],
        capture_output=True,
        text=True,
        check=False,
        env=dict(os.environ) | dict(environment or {}),
    )


def configure(folder: Path, **changes: Any) -> None:
    (folder / "config.yaml").write_text(yaml.safe_dump(REDUCED | changes))


def reduced(folder: Path) -> None:
    """Prepare a run of the campaigns in raw/."""
    (folder / "raw").symlink_to(ROOT / "raw")
    configure(folder)


SMALL = ("one_arm", "other_arm")


def small(folder: Path) -> None:
    """Prepare a run of two small campaigns: every step of the workflow, in far less time."""
    for name, trials in zip(SMALL, (2, 3), strict=True):
        (folder / "raw" / name).mkdir(parents=True)
        campaigns.step_campaign(folder / "raw" / name, trials=trials)
    configure(folder, materials=dict.fromkeys(SMALL))


def digests(folder: Path) -> dict[str, str]:
    """Hash every result but the logs of the run."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and "logs" not in path.parts and not path.name.startswith(".snakemake")
    }
