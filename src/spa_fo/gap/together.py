"""Independent work side by side.

Much of a fit is Python between short kernels, which threads of one process wait for: two of them
took 22 s where one took 23 s, and two processes 14 s. So the work is done in copies of this
process, where the system makes them at once (`fork`), and elsewhere in threads. No fit sees
another's result: the answer is the same for any number of either.
"""

from __future__ import annotations

import multiprocessing
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, TypeVar

import numba

Item = TypeVar("Item")
Result = TypeVar("Result")

_ENDED = "a process that worked for this one ended before it was done"


def each(
    function: Callable[[Item], Result], items: Sequence[Item], *, threads: bool = True
) -> list[Result]:
    """Call a function for every item, side by side on as many processors as Numba may use.

    Parameters
    ----------
    function : callable
        Must not change what other calls read, nor run a kernel that is parallel in itself.
    items : sequence
        Its arguments.
    threads : bool
        Whether threads may do it where processes cannot; else it is done one by one.

    Returns
    -------
    list
        The results in the order of the items.

    Raises
    ------
    RuntimeError
        A process ended before its work was done.
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
    """Hand out the items one at a time, as they take unequally long."""
    staff: list[tuple[BaseProcess, Connection]] = []
    busy: list[Connection] = []
    results: dict[int, Result] = {}
    todo = iter(range(len(items)))
    try:
        with _interrupts_later():
            staff += [_hire(function, items) for _ in range(workers)]
            busy += [link for _, link in staff]
        for link in busy:
            _send(link, next(todo))
        while busy:
            ready = wait(busy)
            for link in [link for link in busy if link in ready]:
                index, result, failed = _receive(link)
                if failed is not None:
                    raise failed
                results[index] = result
                following = next(todo, None)
                _send(link, following)
                if following is None:
                    busy.remove(link)
    finally:
        for process, link in staff:
            if link in busy:
                process.kill()  # the caller may handle SIGTERM, and its copies then would too
            process.join()
            link.close()
    return [results[index] for index in range(len(items))]


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


def _send(link: Connection, index: int | None) -> None:
    try:
        link.send(index)
    except ConnectionError:
        raise RuntimeError(_ENDED) from None


def _receive(link: Connection) -> Any:
    try:
        return link.recv()
    except (EOFError, ConnectionError):
        raise RuntimeError(_ENDED) from None


def _hire(
    function: Callable[[Item], Result], items: Sequence[Item]
) -> tuple[BaseProcess, Connection]:
    """Copy this process for work that is asked for by index over the connection."""
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(function, items, ours, theirs))
    with warnings.catch_warnings():
        # Python 3.12 warns of threads outside Python too. Those of OpenMP and of the linear
        # algebra hold no lock between two calls.
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    theirs.close()
    return process, ours


def _work(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    ours: Connection,
    theirs: Connection,
) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the caller's to answer
    ours.close()  # or this process would not see the caller end
    try:
        while (index := theirs.recv()) is not None:
            result, failed = None, None
            try:
                result = function(items[index])
            except Exception as error:
                error.add_note(traceback.format_exc())  # which does not travel with it
                failed = error
            theirs.send((index, result, failed))
    except (EOFError, ConnectionError):
        pass  # the caller is gone
