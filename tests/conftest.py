"""What all tests share: which are slow, and what is made once for all processes of a run."""

from __future__ import annotations

import fcntl
import importlib.util
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import numba
import pytest

import campaigns
from reduced_workflow import reduced, small, snakemake
from spa_fo import Campaign
from spa_fo.plant.effects.library import IDS, LIBRARY

ROOT = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("SPA_FO_SHARED", ROOT.parent / "shared"))

# Left out of `make test` and run by `make test-slow`: a file or one of its tests, and why.
SLOW = {
    "test_profiles.py::test_a_cluster_gives_the_same_bytes": "starts a Slurm and runs on it",
    "test_real_data.py": "diagnoses measured campaigns with the whole library",
    "test_release.py::test_a_campaign_is_fitted": "compiles every kernel anew",
    "test_workflow.py::test_a_killed_run_started_again_gives_the_same_bytes": "two runs a moment",
    "test_workflow.py::test_the_real_soft_arm_goes_through_by_configuration_alone": (
        "the workflow on a measured campaign"
    ),
}

# They talk to a board that keeps time: beside other work on all processors they would come late.
REALTIME = (
    "test_firmware.py",
    "test_rig_full_campaign.py",
    "test_rig_live_check.py",
    "test_rig_recorder.py",
    "test_virtual_board.py",
)

# Which of several processes this is, where there are several (`pytest -n 2`).
PROCESS = os.environ.get("PYTEST_XDIST_WORKER")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        file = item.path.name
        for place in (file, f"{file}::{getattr(item, 'originalname', item.name)}"):
            if place in SLOW:
                item.add_marker(pytest.mark.slow(SLOW[place]))
        if file in REALTIME:
            item.add_marker(pytest.mark.realtime)
    # What takes longest begins first, that the processes end together.
    items.sort(key=lambda item: "workflow" not in item.keywords)


def of_the_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that all processes of this run share."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if PROCESS else own


@contextmanager
def alone(tmp_path_factory: pytest.TempPathFactory, name: str) -> Iterator[Path]:
    """Whoever comes first makes what has this name; the other processes wait, and find it made."""
    path = of_the_run(tmp_path_factory) / name
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield path


@pytest.fixture(autouse=True)
def only_the_library() -> Iterator[None]:
    """Effects of a test's own campaign leave the library with it."""
    yield
    LIBRARY.hold(())


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Real measurements by others, kept beside the checkout and never in it."""
    folder = SHARED / "data"
    if not folder.is_dir():
        pytest.skip(f"needs the measured data in {folder} (set SPA_FO_SHARED)")
    return folder


@pytest.fixture(scope="module")
def measured() -> Iterator[ModuleType]:
    """The benchmark that knows the pairs, as a module; its neighbours are found as when it runs."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        import measured_changes

        yield measured_changes
    finally:
        sys.path.remove(str(ROOT / "benchmarks"))
        for name in ("measured_changes", "repeated_commands", "real_data"):
            sys.modules.pop(name, None)


@pytest.fixture(scope="session")
def golden_step() -> dict[str, dict[str, str]]:
    """Step responses of both rows of Table I to 30 digits, {row: {t_s: y}}."""
    path = SHARED / "golden" / "step_response.json"
    if not path.is_file():
        pytest.skip(f"needs {path} (set SPA_FO_SHARED)")
    table: dict[str, dict[str, str]] = json.loads(path.read_text())
    return table


@pytest.fixture(scope="session", autouse=True)
def kernels(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Let one process compile what most tests need, once for a state of the sources.

    Two that compile at once do it twice, and Numba's cache is not made for it.
    """
    if not PROCESS:
        return
    compiled = Path(numba.config.CACHE_DIR) / "compiled"
    with alone(tmp_path_factory, "kernels") as folder:
        if not compiled.exists():
            campaigns.step_campaign(folder, trials=2)
            campaign = Campaign.load(folder)
            campaign.fit().model.diagnose(campaign, exclude=IDS[1:])
            compiled.touch()


def run_once(
    tmp_path_factory: pytest.TempPathFactory, name: str, prepare: Callable[[Path], None]
) -> Path:
    """A finished run of the workflow in a folder prepared for it, each process's copy of it."""
    with alone(tmp_path_factory, name) as made:
        if not made.is_dir():
            folder = tmp_path_factory.mktemp("made")
            prepare(folder)
            run = snakemake(folder)
            assert run.returncode == 0, run.stdout + run.stderr
            folder.rename(made)
    own = tmp_path_factory.mktemp(name)
    shutil.copytree(made, own, symlinks=True, dirs_exist_ok=True)
    return own


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the reduced workflow; not to be changed."""
    return run_once(tmp_path_factory, "finished", reduced)


@pytest.fixture(scope="session")
def finished_small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same of two small campaigns, for what does not depend on what they hold."""
    return run_once(tmp_path_factory, "finished_small", small)


@pytest.fixture(scope="session")
def examples(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The documentation's examples, run and kept: the tests of the pages need not run them."""
    spec = importlib.util.spec_from_file_location("examples", ROOT / "docs" / "example_pages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    with alone(tmp_path_factory, "examples"):
        for path in module.EXAMPLES:
            module.executed(path)
    return module
