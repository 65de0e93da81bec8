"""Fixtures shared by all tests."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from reduced_workflow import configure, snakemake

ROOT = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("SPA_FO_SHARED", ROOT.parent / "shared"))


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real measurements by others, kept beside the checkout and never in it."""
    folder = SHARED / "data"
    if not folder.is_dir():
        pytest.skip(f"needs the measured data in {folder} (set SPA_FO_SHARED)")
    return folder


@pytest.fixture(scope="session")
def golden_step() -> dict[str, dict[str, str]]:
    """Step responses of both rows of Table I to 30 digits, {row: {t_s: y}}."""
    path = SHARED / "golden" / "step_response.json"
    if not path.is_file():
        pytest.skip(f"needs {path} (set SPA_FO_SHARED)")
    table: dict[str, dict[str, str]] = json.loads(path.read_text())
    return table


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the reduced workflow; not to be changed."""
    folder = tmp_path_factory.mktemp("reduced")
    (folder / "raw").symlink_to(ROOT / "raw")
    configure(folder)
    run = snakemake(folder)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder
