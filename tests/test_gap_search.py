"""The search against scipy's, on a small curved problem with a nuisance of unknown size."""

import numpy as np
import pytest
from scipy.optimize import minimize

from spa_fo.gap.mixed import Block, Prior
from spa_fo.gap.search import climb, point_at

TIME = np.linspace(0.0, 5.0, 60)
SIGMA = 0.02


class Decay:
    """y = size e^{-rate t} with a wobble of unknown variance; z = (size, ln rate)."""

    parameters = 2
    size = 2 + 8
    spread = np.array([2.0, 1.5])
    scales = np.array([0.05])
    centre = np.array([1.0, 0.0])
    low, high = np.array([0.0, -4.0]), np.array([20.0, 4.0])

    def __init__(self, measured):
        self.measured = measured
        self.hats = np.array(
            [np.interp(TIME, np.linspace(0, 5, 8), row) for row in np.eye(8)]
        ).T  # fmt: skip
        self.calls = self.slopes_taken = 0

    def predict(self, z):
        return z[0] * np.exp(-np.exp(z[1]) * TIME)

    def blocks(self, z):
        self.calls += 1
        y = self.predict(z)
        weight = np.full(TIME.size, SIGMA**-2)
        return [Block(self.measured - y, weight, self.hats, np.arange(2, self.size))], y

    def slopes(self, z):
        self.slopes_taken += 1
        y = self.predict(z)
        return [np.column_stack([y / z[0] if z[0] else y, -TIME * np.exp(z[1]) * y])]

    def prior(self, z):
        mean = np.concatenate([self.centre - z, np.zeros(8)])
        variance = np.concatenate([self.spread**2, np.ones(8)])
        return Prior(mean, variance, np.r_[-1, -1, np.zeros(8, int)], self.scales)

    def inside(self, z):
        return np.clip(z, self.low, self.high)


def measured(size=3.0, rate=0.7, seed=1):
    return size * np.exp(-rate * TIME) + SIGMA * np.random.default_rng(seed).normal(size=TIME.size)


@pytest.mark.parametrize("start", [[1.0, 0.0], [0.5, 2.5], [12.0, -3.5]])
def test_it_ends_where_scipy_ends(start):
    problem = Decay(measured())
    point, solution = climb(problem, np.array(start), 40)

    def loss(z):
        return -point_at(problem, problem.inside(z), point.variances).log_posterior

    slow = minimize(loss, [3.0, np.log(0.7)], method="Nelder-Mead", options={"xatol": 1e-5})
    assert point.log_posterior >= -slow.fun - 0.1
    np.testing.assert_allclose(point.z, slow.x, atol=0.01)
    assert solution.log_evidence < point.log_posterior + 5.0


def test_a_step_that_overshoots_is_damped():
    problem = Decay(measured(rate=8.0))
    point, _ = climb(problem, np.array([0.3, -3.0]), 40)
    assert np.exp(point.z[1]) == pytest.approx(8.0, rel=0.1)


def test_it_stays_within_the_bounds():
    problem = Decay(measured(size=30.0))
    point, _ = climb(problem, np.array([1.0, 0.0]), 40)
    assert 15.0 < point.z[0] <= problem.high[0]


def test_few_steps_are_few_looks():
    problem = Decay(measured())
    climb(problem, np.array([1.0, 0.0]), 3)
    assert problem.calls <= 4


def test_slopes_are_taken_of_points_that_are_kept_alone():
    problem, kept = Decay(measured(rate=8.0)), []
    climb(problem, np.array([0.3, -3.0]), 40)
    looked = problem.calls
    assert problem.slopes_taken < looked  # some steps were refused

    class Watched(Decay):
        def slopes(self, z):
            kept.append(point_at(self, z, self.scales**2).log_posterior)
            return super().slopes(z)

    climb(Watched(measured(rate=8.0)), np.array([0.3, -3.0]), 40)
    assert len(kept) == problem.slopes_taken
    assert kept[-1] == max(kept)
