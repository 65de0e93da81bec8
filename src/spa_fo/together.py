"""Independent work side by side.

Much of a fit is Python between short kernels, which threads of one process wait for: two of them
took 22 s where one took 23 s, and two processes 14 s. So the work is done in copies of this
process, where the system makes them at once (`fork`), and elsewhere in threads. No fit sees
another's result: the answer is the same for any number of either.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

import numba

Item = TypeVar("Item")
Result = TypeVar("Result")
Team = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], list[Any]]
"""From a function and its further arguments to the results, in the order of these."""

_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of prctl(2)
_shared: Any  # what a worker's functions are of


def each(
    function: Callable[[Item], Result], items: Sequence[Item], *, threads: bool = True
) -> list[Result]:
    """Call a function for every item, side by side on as many processors as Numba may use.

    `function` must not change what other calls read, nor run a kernel that is parallel in itself.
    `threads` says whether threads may do it where processes cannot; else it is done one by one. The
    results are in the order of the items; `RuntimeError` where a process ended before its work.
    """
    workers = min(numba.get_num_threads(), len(items))
    if workers > 1 and _can_fork():
        return _in_processes(function, items, workers)
    if workers > 1 and threads:
        with ThreadPoolExecutor(workers) as pool:
            return list(pool.map(function, items))
    return [function(item) for item in items]


def _can_fork() -> bool:
    """Whether a copy of this process works: a lock that another thread held would never open."""
    return sys.platform == "linux" and threading.active_count() == 1


@contextmanager
def team(shared: Any) -> Iterator[Team]:
    """Yield what calls functions of `shared` and further arguments side by side, as `each` does.

    Its processes stay until the end of the block: to copy one that holds 300 MB takes 30 ms. What
    they are given, but for `shared`, is pickled; within the block `each` has no processes.
    """
    workers = numba.get_num_threads()
    if workers < 2 or not _can_fork():
        yield lambda function, items: each(lambda item: function(shared, *item), items)
        return
    with _processes(workers, shared) as pool:
        yield partial(_all, pool)


def _in_processes(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> list[Result]:
    with _processes(workers, (function, items)) as pool:
        return _all(pool, _numbered, [(index,) for index in range(len(items))])


def _numbered(job: tuple[Callable[[Any], Any], Sequence[Any]], index: int) -> Any:
    function, items = job
    return function(items[index])


@contextmanager
def _processes(workers: int, shared: Any) -> Iterator[ProcessPoolExecutor]:
    """Yield copies of this process that hold `shared`, and end them however the block ends."""
    context = multiprocessing.get_context("fork")  # which hands it over without pickling it
    pool = ProcessPoolExecutor(workers, context, _begin, (shared,))
    try:
        yield pool
    except BaseException as error:
        for process in list((pool._processes or {}).values()):
            process.kill()
        if isinstance(error, BrokenProcessPool):
            raise RuntimeError(
                "a process that worked for this one ended before it was done"
            ) from None
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _all(
    pool: ProcessPoolExecutor, function: Callable[..., Any], items: Sequence[tuple[Any, ...]]
) -> list[Any]:
    with _interrupts_later(), warnings.catch_warnings():
        # Python 3.12 warns of threads outside Python too. Those of OpenMP and of the linear
        # algebra hold no lock between two calls.
        warnings.simplefilter("ignore", DeprecationWarning)
        calls = [pool.submit(_call, function, item) for item in items]
    return [call.result() for call in calls]


def _begin(shared: Any) -> None:
    """Make a copy of this process ready: it leaves signals to the caller, and ends with it."""
    global _shared
    _shared = shared
    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _call(function: Callable[..., Any], item: tuple[Any, ...]) -> Any:
    return function(_shared, *item)


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Answer Ctrl-C after the block: what hooks of a fork raise, Python says and forgets."""
    heard: list[int] = []
    answer = signal.getsignal(signal.SIGINT)
    if not callable(answer):  # it is ignored, or not Python's to answer
        yield
        return
    signal.signal(signal.SIGINT, lambda number, _: heard.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, answer)
    if heard:
        signal.raise_signal(signal.SIGINT)
