from __future__ import annotations

import threading
from collections.abc import Iterator

import numba
import pytest

from spa_fo.gap.together import each


@pytest.fixture
def threads() -> Iterator[int]:
    usual = numba.get_num_threads()
    yield usual
    numba.set_num_threads(usual)


def test_results_keep_the_order_of_the_items() -> None:
    assert each(lambda item: item**2, range(40)) == [item**2 for item in range(40)]
    assert each(str, []) == []


def test_one_thread_is_the_callers_own(threads: int) -> None:
    numba.set_num_threads(1)
    assert set(each(lambda _: threading.current_thread(), range(5))) == {threading.current_thread()}


def test_two_run_at_the_same_time(threads: int) -> None:
    if threads < 2:
        pytest.skip("Numba may use one thread only")
    both = threading.Barrier(2, timeout=20.0)  # broken, and an error, if the second never comes
    assert len(each(lambda _: both.wait(), range(2))) == 2


def test_an_error_reaches_the_caller() -> None:
    with pytest.raises(ZeroDivisionError):
        each(lambda item: 1 / item, [1, 0, 2])
