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
from typing import Any, TypeVar

import numba

Item = TypeVar("Item")
Result = TypeVar("Result")

_DIE_WITH_PARENT = 1  # PR_SET_PDEATHSIG of prctl(2)
_job: tuple[Callable[[Any], Any], Sequence[Any]]  # a worker's function and all items


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


def _in_processes(
    function: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> list[Result]:
    context = multiprocessing.get_context("fork")  # which hands the job over without pickling it
    pool = ProcessPoolExecutor(workers, context, _begin, (function, items))
    try:
        with _interrupts_later(), warnings.catch_warnings():
            # Python 3.12 warns of threads outside Python too. Those of OpenMP and of the linear
            # algebra hold no lock between two calls.
            warnings.simplefilter("ignore", DeprecationWarning)
            calls = [pool.submit(_call, index) for index in range(len(items))]
        return [call.result() for call in calls]
    except BaseException as error:
        for process in list(pool._processes.values()):
            process.kill()
        if isinstance(error, BrokenProcessPool):
            raise RuntimeError(
                "a process that worked for this one ended before it was done"
            ) from None
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(function: Callable[[Any], Any], items: Sequence[Any]) -> None:
    """Make a copy of this process ready: it leaves signals to the caller, and ends with it."""
    global _job
    _job = function, items
    ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _call(index: int) -> Any:
    function, items = _job
    return function(items[index])


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
