"""The only njit factory: compilation flags are decided here and nowhere else."""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite.binding  # type: ignore[import-untyped]
import numba
import platformdirs

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent
_NO_KERNELS = (
    *("api", "export", "gap", "report", "rig"),
    *("cli.py", "cli_numbers.py", "export_cli.py", "rig_cli.py"),
)


def _kernel_hash() -> str:
    """Hash the processor's name and every source file that may hold or feed a kernel.

    Nodes of a cluster share a home, and Numba's cache is not made for two processors that write
    the same kernel at the same moment.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    digest.update(llvmlite.binding.get_host_cpu_name().encode())
    for path in sorted(_PACKAGE.rglob("*.py")):
        if path.parts[len(_PACKAGE.parts)] not in _NO_KERNELS:
            digest.update(path.relative_to(_PACKAGE).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    """Return the folder of this source state's kernels: the user's, or one of this process alone.

    Numba itself would fall back to ``__pycache__`` beside the sources, where kernels go stale.
    """
    name = _kernel_hash()
    user = Path(platformdirs.user_cache_dir("spa-fo")) / "numba" / name
    with contextlib.suppress(OSError):
        user.mkdir(parents=True, exist_ok=True)
    if os.access(user, os.W_OK):
        return user
    temporary = tempfile.mkdtemp(prefix="spa-fo-numba-")
    atexit.register(shutil.rmtree, temporary, ignore_errors=True)
    return Path(temporary)


# Numba's cache looks at one file at a time: a kernel inlined from another module goes stale.
# A cache folder a source state cannot.
if "NUMBA_CACHE_DIR" not in os.environ:
    numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]

# OpenMP launches a parallel loop in 1 µs, workqueue in 80 µs (200 evaluations: 97 against 260 µs).
# Where the system has no libgomp, workqueue, which is always there, takes its place; it must not
# be entered by two Python threads at once. Results are the same. TBB comes last: an old one
# makes numba warn.
if "NUMBA_THREADING_LAYER_PRIORITY" not in os.environ:
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "workqueue", "tbb"]  # type: ignore[attr-defined]


def njit(function: Function) -> Function:
    """Compile a serial kernel: cached, releases the GIL, IEEE arithmetic as written.

    No fastmath: results are bit-identical from run to run and for any number of threads, and
    NaN and infinity keep their meaning.
    """
    return cast("Function", numba.njit(cache=True, nogil=True, error_model="numpy")(function))


def njit_inlined(function: Function) -> Function:
    """Compile a few lines into every kernel that calls them.

    For the innermost loops only: as a function of its own a step of the modes takes 2.5 times as
    long, as each call counts references to its arrays.
    """
    return cast("Function", numba.njit(inline="always", error_model="numpy")(function))


def njit_parallel(function: Function) -> Function:
    """Compile a kernel whose `prange` iterations write to disjoint places, each computed serially.

    Never reduce a scalar over `prange`, nor draw random numbers in it: both depend on the number
    of threads.
    """
    return cast("Function", numba.njit(cache=True, parallel=True, error_model="numpy")(function))
