"""What `make release` builds, installed where nothing of the checkout is to be seen."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest

import campaigns
import spa_fo

ROOT = Path(__file__).resolve().parent.parent
VERSION = spa_fo.__version__


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder


@pytest.fixture(scope="module")
def environment(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment of its own: the package from the wheel, its dependencies from where we are."""
    folder = tmp_path_factory.mktemp("clean") / "venv"
    # The environment of the tests may have no pip; the Python that it was made with has.
    python = sys._base_executable  # type: ignore[attr-defined]
    make = [python, "-m", "venv", "--without-pip", str(folder)]
    wheel = built / f"spa_fo-{VERSION}-py3-none-any.whl"
    install = [python, "-m", "pip", "--python", str(folder / "bin" / "python"), "install"]
    options = ["--quiet", "--disable-pip-version-check", "--no-index", "--no-deps"]
    for command in (make, [*install, *options, str(wheel)]):
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert run.returncode == 0, run.stdout + run.stderr
    packages = next((folder / "lib").glob("python*/site-packages"))
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder


def run_in(environment: Path, folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    return subprocess.run(
        [str(environment / "bin" / command[0]), *command[1:]],
        cwd=folder,
        env=inherited | {"XDG_CACHE_HOME": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_wheel_holds_every_file_of_the_package_and_the_licence(built: Path) -> None:
    with zipfile.ZipFile(built / f"spa_fo-{VERSION}-py3-none-any.whl") as wheel:
        names = set(wheel.namelist())
        metadata = wheel.read(f"spa_fo-{VERSION}.dist-info/METADATA").decode()
    sources = {path for path in (ROOT / "src" / "spa_fo").rglob("*") if path.is_file()}
    written = {path.relative_to(ROOT / "src").as_posix() for path in sources}
    assert {name for name in written if "__pycache__" not in name} - names == set()
    assert not {name for name in names if name.startswith("blind/")}
    assert {"spa_fo/report/spa_fo.mplstyle", "spa_fo/rig/campaign.schema.yaml"} <= names
    assert f"spa_fo-{VERSION}.dist-info/licenses/LICENSE" in names
    assert f"\nVersion: {VERSION}\n" in metadata
    assert "\nLicense-Expression: MIT\n" in metadata


def test_the_source_archive_can_be_worked_with(built: Path) -> None:
    with tarfile.open(built / f"spa_fo-{VERSION}.tar.gz") as archive:
        names = {name.split("/", 1)[1] for name in archive.getnames()}
    assert {
        "Makefile",
        "Snakefile",
        "config.yaml",
        "requirements.lock",
        "CITATION.cff",
        "raw/fx_pro/campaign.yaml",
        "tests/test_release.py",
        "workflow/profiles/slurm/config.yaml",
    } <= names
    assert not {name for name in names if name.startswith(("results/", ".venv/", ".snakemake/"))}


def test_the_package_comes_from_the_wheel(environment: Path, tmp_path: Path) -> None:
    run = run_in(environment, tmp_path, "python", "-c", "import spa_fo; print(spa_fo.__file__)")
    assert Path(run.stdout.strip()).is_relative_to(environment)


def test_the_command_says_its_version_and_its_help(environment: Path, tmp_path: Path) -> None:
    assert VERSION in run_in(environment, tmp_path, "spa-fo", "--version").stdout
    run = run_in(environment, tmp_path, "spa-fo", "--help")
    assert run.returncode == 0
    assert "fit" in run.stdout


@pytest.mark.workflow
def test_a_campaign_is_fitted(environment: Path, tmp_path: Path) -> None:
    """With the package's own schemas, and kernels compiled anew."""
    campaign = tmp_path / "my_arm"
    campaign.mkdir()
    campaigns.step_campaign(campaign, trials=2)
    model = tmp_path / "model.json"
    run = run_in(environment, tmp_path, "spa-fo", "fit", str(campaign), "--out", str(model))
    assert run.returncode == 0, run.stderr
    assert json.loads(model.read_text())["schema"] == "spa-fo/model/1"
