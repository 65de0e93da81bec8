from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from spa_fo import _jit


def cache_folder(**environment: str) -> Path:
    """Where another process keeps its compiled kernels."""
    inherited = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    run = subprocess.run(
        [sys.executable, "-c", "import spa_fo._jit, numba; print(numba.config.CACHE_DIR)"],
        env=inherited | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return Path(run.stdout.strip())


def test_what_the_cache_is_not_named_after_holds_no_kernel() -> None:
    """Nor feeds one: by the contracts of imports no module with kernels may import these."""
    package = Path(_jit.__file__).parent
    for name in _jit._NO_KERNELS:
        place = package / name
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            assert "njit" not in path.read_text(), path


def test_kernels_are_kept_in_the_users_cache(tmp_path: Path) -> None:
    folder = cache_folder(XDG_CACHE_HOME=str(tmp_path))
    assert folder.is_relative_to(tmp_path)
    assert folder.is_dir()


def test_without_a_place_to_keep_them_they_last_as_long_as_the_process(tmp_path: Path) -> None:
    occupied = tmp_path / "file"
    occupied.touch()
    folder = cache_folder(XDG_CACHE_HOME=str(occupied), TMPDIR=str(tmp_path))
    assert folder.parent == tmp_path
    assert not folder.exists()


def test_a_cache_folder_of_ones_own_is_left_alone(tmp_path: Path) -> None:
    assert cache_folder(NUMBA_CACHE_DIR=str(tmp_path)) == tmp_path
