from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing import active_children, get_context
from pathlib import Path

import numba
import numpy as np
import pytest

from spa_fo._jit import njit_parallel
from spa_fo.errors import BadInput
from spa_fo.together import each, team


@pytest.fixture
def threads() -> Iterator[int]:
    usual = numba.get_num_threads()
    yield usual
    numba.set_num_threads(usual)


@pytest.fixture
def two(threads: int) -> None:
    if threads < 2:
        pytest.skip("Numba may use one thread only")
    numba.set_num_threads(2)


forks = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux only")


@njit_parallel
def doubled(values):
    out = np.empty_like(values)
    for i in numba.prange(values.size):
        out[i] = 2.0 * values[i]
    return out


def is_running(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"  # ended, and nobody has asked how


def beside(action):
    """Run something while a second thread of Python's is alive."""
    done = threading.Event()
    other = threading.Thread(target=done.wait)
    other.start()
    try:
        return action()
    finally:
        done.set()
        other.join()


def threads_of(items: range, **options: bool) -> set[tuple[int, int]]:
    return set(each(lambda _: (os.getpid(), threading.get_ident()), items, **options))


def test_results_keep_the_order_of_the_items() -> None:
    squares = [item**2 for item in range(40)]
    assert each(lambda item: item**2, range(40)) == squares
    assert beside(lambda: each(lambda item: item**2, range(40))) == squares
    assert each(str, []) == []


def test_one_thread_is_the_callers_own(threads: int) -> None:
    numba.set_num_threads(1)
    assert threads_of(range(5)) == {(os.getpid(), threading.get_ident())}


def test_where_threads_may_not_the_caller_works_alone(two: None) -> None:
    here = (os.getpid(), threading.get_ident())
    assert beside(lambda: threads_of(range(5), threads=False)) == {here}


@forks
def test_two_run_at_the_same_time(two: None) -> None:
    both = get_context("fork").Barrier(2, timeout=20.0)  # broken if the second never comes
    assert len(each(lambda _: both.wait(), range(2))) == 2


def test_threads_run_at_the_same_time_too(two: None) -> None:
    both = threading.Barrier(2, timeout=20.0)
    assert len(beside(lambda: each(lambda _: both.wait(), range(2)))) == 2


def test_large_results_come_back_whole_after_a_parallel_kernel(two: None) -> None:
    assert doubled(np.arange(4.0))[-1] == 6.0  # OpenMP's threads are up
    for size, found in zip(range(5), each(lambda n: np.full(10**6, n), range(5)), strict=True):
        np.testing.assert_array_equal(found, np.full(10**6, size))


def times(shared: int, one: int, other: int) -> int:
    return shared * one * other


def raised(shared: int, item: int) -> int:
    return shared // item


def process(shared: int) -> int:
    time.sleep(0.05)
    return os.getpid()


def test_a_team_calls_functions_of_what_it_shares() -> None:
    def all_of_it() -> list[list[int]]:
        with team(3) as ours:
            return [ours(times, [(item, 2) for item in range(9)]), ours(times, [])]

    expected = [[6 * item for item in range(9)], []]
    assert all_of_it() == expected
    assert beside(all_of_it) == expected


def test_a_team_ends_with_an_error() -> None:
    with pytest.raises(ZeroDivisionError), team(3) as ours:
        ours(raised, [(1,), (0,)])
    assert not active_children()


@forks
def test_a_team_is_the_same_processes_all_the_time(two: None) -> None:
    with team(3) as ours:
        found = {*ours(process, [()] * 9), *ours(process, [()] * 9)}
    assert len(found) == 2
    assert os.getpid() not in found


@forks
def test_a_failure_ends_the_others_whatever_the_caller_does_with_signals(two: None) -> None:
    """The copies of a process that handles SIGTERM handle it too."""
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        with pytest.raises(ZeroDivisionError):
            each(lambda item: 1 / item and time.sleep(3600.0), [0, 1])
    finally:
        signal.signal(signal.SIGTERM, before)


def test_an_error_reaches_the_caller() -> None:
    with pytest.raises(ZeroDivisionError):
        each(lambda item: 1 / item, [1, 0, 2])
    with pytest.raises(ZeroDivisionError):
        beside(lambda: each(lambda item: 1 / item, [1, 0, 2]))


@forks
def test_bad_input_is_the_same_line_and_other_errors_say_where(two: None) -> None:
    def refused(item: int) -> None:
        raise BadInput("./raw//log.csv", "expected more", "line 7")

    def short_of(item: int) -> None:
        raise EOFError("the file is short")

    with pytest.raises(BadInput) as bad:
        each(refused, [1, 2])
    assert str(bad.value) == "./raw//log.csv: line 7: expected more"
    assert str(bad.value.path) == "raw/log.csv"
    # An error of the work itself is not mistaken for one of the connection.
    with pytest.raises(EOFError, match="the file"):
        each(short_of, [1, 2])
    with pytest.raises(ZeroDivisionError) as wrong:
        each(lambda item: 1 / item, [0, 0])
    assert "lambda item: 1 / item" in str(wrong.value.__cause__)


@forks
def test_after_an_error_nothing_is_left_running(two: None) -> None:
    def slow_or_wrong(item: int) -> None:
        time.sleep(60.0 if item else 0.0)
        raise ValueError(item)

    began = time.monotonic()
    with pytest.raises(ValueError, match="0"):
        each(slow_or_wrong, [0, 1])
    assert time.monotonic() - began < 30.0
    assert not active_children()


@forks
def test_a_process_that_is_killed_is_told_of(two: None) -> None:
    def killed(item: int) -> None:
        os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(RuntimeError, match="ended before it was done"):
        each(killed, [1, 2])
    assert not active_children()


@forks
def test_nothing_outlives_a_caller_that_is_killed(two: None, tmp_path: Path) -> None:
    def caller() -> None:
        each(lambda item: (tmp_path / f"{os.getpid()}").touch() or time.sleep(1.0), range(100))

    process = get_context("fork").Process(target=caller)
    process.start()
    deadline = time.monotonic() + 20.0
    while len(list(tmp_path.iterdir())) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    workers = [int(path.name) for path in tmp_path.iterdir()]
    assert len(workers) == 2
    process.kill()
    process.join()
    while any(map(is_running, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_running, workers))
