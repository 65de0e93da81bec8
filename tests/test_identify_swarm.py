from __future__ import annotations

import numba
import numpy as np
import pytest

from identify_cases import steps
from spa_fo.identify import Bounds, fit_optimum, paper_swarm, printed_bounds, widened_bounds

DATA = steps(2, seed=4)


@pytest.mark.parametrize("bounds", [printed_bounds(), widened_bounds()], ids=lambda b: b.name)
def test_the_swarm_stays_within_its_bounds_and_only_gets_better(bounds: Bounds) -> None:
    for seed in range(5):
        found = paper_swarm(DATA, bounds, seed)
        assert bounds.holds(found.x)
        assert found.x[1] < found.x[0]
        assert np.all(np.diff(found.history) <= 0)
        assert found.rmse == found.history[-1]
        assert found.evaluations == 200 * 11


def test_it_is_not_better_than_the_optimum() -> None:
    best = fit_optimum(DATA, widened_bounds()).rmse
    for seed in range(5):
        assert paper_swarm(DATA, widened_bounds(), seed).rmse >= best * (1 - 1e-9)


def test_ten_times_the_iterations_come_near_the_optimum() -> None:
    best = fit_optimum(DATA, widened_bounds()).rmse
    found = [paper_swarm(DATA, widened_bounds(), s, iterations=100).rmse for s in range(5)]
    assert np.median(found) < 1.01 * best


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="needs two threads to compare")
def test_one_and_two_threads_give_the_same_bits() -> None:
    before = numba.get_num_threads()
    results = []
    for threads in (1, 2):
        numba.set_num_threads(threads)
        results.append(paper_swarm(DATA, widened_bounds(), 7))
    numba.set_num_threads(before)
    assert results[0].x.tobytes() == results[1].x.tobytes()
    assert results[0].history.tobytes() == results[1].history.tobytes()


def test_another_seed_gives_another_result() -> None:
    assert (
        paper_swarm(DATA, printed_bounds(), 1).rmse != paper_swarm(DATA, printed_bounds(), 2).rmse
    )
