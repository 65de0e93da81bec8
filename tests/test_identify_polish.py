from __future__ import annotations

from dataclasses import replace

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import naive_identify
from identify_cases import TRUTH, steps
from spa_fo.fractional import step_map
from spa_fo.identify import (
    Bounds,
    Draws,
    fit_many,
    fit_optimum,
    free_bounds,
    printed_bounds,
    widened_bounds,
)
from spa_fo.identify.polish import _reweight

ALL_BOUNDS = [printed_bounds(), widened_bounds(), free_bounds()]


@pytest.mark.parametrize("bounds", ALL_BOUNDS, ids=lambda b: b.name)
def test_every_seed_reaches_the_same_optimum(bounds: Bounds) -> None:
    data = steps(2, seed=5)
    squares = [fit_optimum(data, bounds, seed).sum_squares for seed in range(30)]
    assert max(squares) < min(squares) * (1 + 1e-6)


@pytest.mark.parametrize("bounds", ALL_BOUNDS, ids=lambda b: b.name)
def test_scipy_finds_nothing_better(bounds: Bounds) -> None:
    data = steps(1, seed=6)
    found = fit_optimum(data, bounds)
    assert bounds.holds(found.x)
    assert found.sum_squares == pytest.approx(
        naive_identify.sum_of_squares(data, found.x), rel=1e-9
    )
    for start in (TRUTH, found.x, np.array([1.6, 1.05, 0.9, 1.2, 1.1])):
        other = naive_identify.least_squares_from(data, bounds, start)
        assert found.sum_squares <= other * (1 + 1e-7)


def test_without_noise_the_curve_comes_back() -> None:
    data = steps(1, noise_deg=0.0)
    found = fit_optimum(data)
    curve, truth = (step_map(data.t).response(x) for x in (found.x, TRUTH))
    np.testing.assert_allclose(curve, truth, atol=1e-6)


def test_with_noise_the_curve_and_the_gain_come_back() -> None:
    # Not the five parameters: the data do not determine them.
    errors = []
    for seed in range(20):
        data = steps(2, seed=100 + seed)
        found = fit_optimum(data, widened_bounds())
        difference = step_map(data.t).response(found.x) - step_map(data.t).response(TRUTH)
        errors.append(np.sqrt(np.mean(difference**2)))
        assert found.x[4] / found.x[3] == pytest.approx(TRUTH[4] / TRUTH[3], rel=0.02)
    # Four datasets of mean square height 2.5, at most five free parameters.
    theory = np.radians(0.5) * np.sqrt(5 / (50 * 4 * 2.5))
    assert 0.4 * theory < np.sqrt(np.mean(np.square(errors))) < 1.2 * theory


@given(st.permutations(range(6)))
@settings(max_examples=10, deadline=None)
def test_the_order_of_trials_leaves_the_fit_unchanged(order: list[int]) -> None:
    data = steps(3, seed=8)
    one, other = (fit_optimum(d, widened_bounds()) for d in (data, data.select(order)))
    assert other.sum_squares == pytest.approx(one.sum_squares, rel=1e-9)
    np.testing.assert_allclose(
        step_map(data.t).response(other.x), step_map(data.t).response(one.x), atol=1e-7
    )


def test_a_held_parameter_stays_and_a_held_gain_too() -> None:
    data = steps(2, seed=9)
    free = free_bounds()
    lower, upper = np.tile(free.lower, (2, 1)), np.tile(free.upper, (2, 1))
    lower[0, 2] = upper[0, 2] = 0.5
    found = fit_many(
        step_map(data.t),
        data,
        free,
        Draws.from_seed(1),
        lower=lower,
        upper=upper,
        gain=np.array([np.nan, 0.6]),
    )
    assert found.x[0, 2] == pytest.approx(0.5, rel=1e-12)
    assert found.x[1, 4] / found.x[1, 3] == pytest.approx(0.6, rel=1e-12)
    best = fit_optimum(data).sum_squares
    assert np.all(found.sum_squares >= best * (1 - 1e-9))


def test_counting_a_data_set_twice_is_having_it_twice() -> None:
    data = steps(2, seed=10)
    counts = np.array([[2.0, 0.0, 1.0, 1.0]])
    bounds = widened_bounds()
    found = fit_many(step_map(data.t), data, bounds, Draws.from_seed(1), counts=counts)
    twice = fit_optimum(data.select([0, 0, 2, 3]), bounds)
    assert found.sum_squares[0] == pytest.approx(twice.sum_squares, rel=1e-9)


@pytest.mark.parametrize("loss", ["huber", "soft_l1"])
def test_a_robust_loss_sees_past_spikes(loss: str) -> None:
    clean = steps(2, seed=11)
    generator = np.random.default_rng(1)
    spikes = np.radians(20.0) * (generator.random(clean.angle_rad.shape) < 0.08)
    data = replace(clean, angle_rad=clean.angle_rad + spikes)
    truth = step_map(data.t).response(TRUTH)

    def error(kind: str) -> float:
        found = fit_optimum(data, widened_bounds(), loss=kind)
        return float(np.sqrt(np.mean((step_map(data.t).response(found.x) - truth) ** 2)))

    assert error(loss) < 0.3 * error("linear")


def test_hubers_weights() -> None:
    data = steps(1, seed=12)
    y = step_map(data.t).response(TRUTH)
    w = np.empty_like(data.angle_rad)
    _reweight(data.angle_rad, data.u, np.ones(2), y, 1, w)
    residual = data.angle_rad - data.u[:, np.newaxis] * y
    limit = 1.345 * 1.4826 * float(np.median(np.abs(residual)))
    expected = [[naive_identify.huber_weight(float(r), limit) for r in row] for row in residual]
    np.testing.assert_allclose(w, expected, rtol=1e-12)
    assert 0.0 < np.mean(w < 1.0) < 0.4


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="needs two threads to compare")
def test_one_and_two_threads_give_the_same_bits() -> None:
    data = steps(3, seed=13)
    counts = np.random.default_rng(1).multinomial(6, [1 / 6] * 6, size=12).astype(float)
    before = numba.get_num_threads()
    results = []
    for threads in (1, 2):
        numba.set_num_threads(threads)
        found = fit_many(
            step_map(data.t), data, free_bounds(), Draws.from_seed(1), counts=counts, loss="huber"
        )
        results.append(found.x.tobytes() + found.sum_squares.tobytes())
    numba.set_num_threads(before)
    assert results[0] == results[1]


def test_an_unknown_loss_is_refused() -> None:
    with pytest.raises(ValueError, match="soft_l1"):
        fit_optimum(steps(1), loss="cauchy")


@pytest.mark.parametrize("x", [[1.0, 0.5, 1e-3, 2.0, 1.0], [0.8, 0.4, 0.5, 0.7, 1.5]])
def test_degenerate_truths_are_fitted(x: list[float]) -> None:
    data = steps(1, noise_deg=0.1, x=np.array(x))
    found = fit_optimum(data)
    assert found.valid
    assert np.degrees(found.rmse) < 0.11
