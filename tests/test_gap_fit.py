"""The search: Levenberg-Marquardt with bounds, held against scipy's on fifty drawn problems."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from spa_fo.numeric.minimise import Minimum, Quadratic, decrement, free_of, minimise

Floats = NDArray[np.float64]
T = np.linspace(0.0, 4.0, 60)
NOISE = 0.05
ENOUGH = 0.01
"""Where the fits of a diagnosis end: nats that a full step would still gain."""


class Drawn:
    """A sum of two decays with a prior, its bounds tight in some problems."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.centre = np.array([1.0, 0.0, 0.5, 1.0])
        self.spread = np.array([0.7, 0.5, 0.6, 0.5])
        truth = self.centre + 0.7 * self.spread * rng.standard_normal(4)
        self.low = np.array([0.0, -1.5, 0.0, -0.5])
        self.high = np.array([3.0, 1.5, 2.0, 2.5])
        if seed % 2:  # the top lies beyond a bound
            self.high[seed % 4] = truth[seed % 4] - 0.2 * self.spread[seed % 4]
            self.low = np.minimum(self.low, self.high - 0.5)
        self.y = self.model(truth) + NOISE * rng.standard_normal(T.size)
        self.start = np.clip(self.centre, self.low, self.high)

    def model(self, z: Floats) -> Floats:
        return z[0] * np.exp(-np.exp(z[1]) * T) + z[2] * np.exp(-np.exp(z[3]) * T)

    def residual(self, z: Floats) -> Floats:
        data = (self.model(z) - self.y) / NOISE
        return np.concatenate([data, (z - self.centre) / self.spread])

    def slopes(self, z: Floats) -> Floats:
        one, two = np.exp(-np.exp(z[1]) * T), np.exp(-np.exp(z[3]) * T)
        rates = -np.exp(z[1]) * T, -np.exp(z[3]) * T
        data = np.column_stack([one, z[0] * one * rates[0], two, z[2] * two * rates[1]]) / NOISE
        return np.vstack([data, np.diag(1.0 / self.spread)])

    def value(self, z: Floats) -> float:
        r = self.residual(z)
        return 0.5 * float(r @ r)

    def quadratic(self, z: Floats) -> Quadratic:
        r, j = self.residual(z), self.slopes(z)
        return Quadratic(0.5 * float(r @ r), j.T @ r, j.T @ j)

    def search(self, enough: float = ENOUGH, most: int = 60) -> Minimum:
        metric = np.diag(1.0 / self.spread**2)
        return minimise(
            self.value,
            self.quadratic,
            self.start,
            self.low,
            self.high,
            enough,
            most,
            metric,
            self.bend,
        )

    def bend(self, z: Floats, step: Floats) -> Floats:
        near = (self.residual(z + 0.1 * step) - self.residual(z)) / 0.1
        j = self.slopes(z)
        return j.T @ (near - j @ step) * 20.0

    def oracle(self) -> float:
        """Value where scipy's search ends from the same start."""
        return float(
            least_squares(
                self.residual,
                np.clip(self.start, self.low + 1e-9, self.high - 1e-9),
                jac=self.slopes,
                bounds=(self.low, self.high),
                method="trf",
                xtol=1e-14,
                ftol=1e-14,
                gtol=1e-12,
                max_nfev=2000,
            ).cost
        )


@pytest.fixture(scope="module")
def searched() -> list[tuple[Drawn, Minimum]]:
    problems = [Drawn(seed) for seed in range(50)]
    return [(problem, problem.search()) for problem in problems]


def test_it_ends_where_scipy_ends(searched: list[tuple[Drawn, Minimum]]) -> None:
    """The decrement is Gauss and Newton's estimate of what is left, which may be more."""
    held = 0
    for problem, found in searched:
        least = problem.oracle()
        assert found.at.value == pytest.approx(problem.value(found.z), abs=1e-12)
        assert -1e-4 < found.at.value - least < 3.0 * ENOUGH
        sharper = problem.search(enough=1e-4)
        assert sharper.at.value < least + 1e-3
        assert np.all((sharper.z >= problem.low) & (sharper.z <= problem.high))
        held += bool(np.any((sharper.z == problem.low) | (sharper.z == problem.high)))
    assert held >= 10  # bounds were active in many of them


def test_every_search_ends_below_the_decrement(searched: list[tuple[Drawn, Minimum]]) -> None:
    for problem, found in searched:
        assert found.decrement < ENOUGH
        at = problem.quadratic(found.z)
        free = free_of(found.z, at.gradient, problem.low, problem.high)
        assert decrement(at, free) == pytest.approx(found.decrement)


def test_few_points_are_rejected(searched: list[tuple[Drawn, Minimum]]) -> None:
    tried = sum(found.tried for _, found in searched)
    assert sum(found.rejected for _, found in searched) < 0.1 * tried


def test_a_parameter_that_a_bound_holds_leaves_the_solve() -> None:
    hessian = np.array([[2.0, 1.0], [1.0, 2.0]])
    low, high = np.array([0.0, -9.0]), np.array([9.0, 9.0])

    def quadratic(z: Floats) -> Quadratic:
        away = z - np.array([-1.0, 3.0])
        return Quadratic(0.5 * float(away @ hessian @ away), hessian @ away, hessian)

    found = minimise(
        lambda z: quadratic(z).value,
        quadratic,
        np.array([4.0, 0.0]),
        low,
        high,
        1e-9,
        50,
        np.eye(2),
    )
    # With the first at 0 the second's best is 3 - 1/2.
    np.testing.assert_allclose(found.z, [0.0, 2.5], atol=1e-4)


def test_it_stops_after_as_many_points_as_it_may() -> None:
    assert Drawn(0).search(most=2).tried == 2


def test_a_search_without_hope_is_given_up() -> None:
    problem = Drawn(0)
    whole = problem.value(problem.start) - problem.oracle()

    def searched(worth: float) -> Minimum:
        limits = problem.low, problem.high, ENOUGH, 60, np.diag(1.0 / problem.spread**2)
        return minimise(
            problem.value, problem.quadratic, problem.start, *limits, problem.bend, worth
        )

    assert searched(0.5 * whole).decrement < ENOUGH
    given_up = searched(1e3 * whole)
    assert given_up.tried == 0
    assert given_up.z.tolist() == problem.start.tolist()


@pytest.mark.parametrize(("enough", "given_up"), [(0.1, True), (0.01, False)])
def test_a_search_that_gains_nothing_is_given_up(enough: float, given_up: bool) -> None:
    """Its slopes promise half a nat that is not there, as those of a kink do.

    Where that is far more than is enough it goes on, until its steps are none.
    """
    found = minimise(
        lambda z: 1.0,
        lambda z: Quadratic(1.0, np.ones(1), np.eye(1)),
        np.zeros(1),
        np.full(1, -9.0),
        np.full(1, 9.0),
        enough,
        20,
        np.eye(1),
    )
    assert found.rejected == found.tried
    assert (found.tried == 6) is given_up
    assert found.decrement == pytest.approx(0.5)


def test_slopes_are_taken_of_points_that_are_kept_alone() -> None:
    problem, looked = Drawn(0), []
    found = minimise(
        problem.value,
        lambda z: looked.append(z) or problem.quadratic(z),
        problem.start,
        problem.low,
        problem.high,
        ENOUGH,
        60,
        np.diag(1.0 / problem.spread**2),
    )
    assert len(looked) == 1 + found.tried - found.rejected
    values = [problem.value(z) for z in looked]
    assert values == sorted(values, reverse=True)
