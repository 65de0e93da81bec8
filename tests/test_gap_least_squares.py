"""Evidence of an explanation, held against the full covariance and against integrals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.optimize import least_squares, minimize_scalar
from scipy.stats import multivariate_normal, norm

from spa_fo.gap.data.searched import Slot
from spa_fo.gap.fit import least_squares as least_squares_module
from spa_fo.gap.fit.coefficients import Coefficients
from spa_fo.gap.fit.least_squares import Explained
from spa_fo.gap.noise.whitening import Factor
from spa_fo.numeric.minimise import Quadratic, minimise
from spa_fo.plant.effects.effect import Parameter

Floats = NDArray[np.float64]
NOISE = 0.3


class Line(Explained):
    """A straight model: free parameters, one effect's size, and two nuisances."""

    def __init__(self, size: float, low: float, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.j = rng.standard_normal((30, 3))
        self.own = rng.standard_normal((30, 2))
        parameter = Parameter("size", "1", 0.0, 0.8, low, 50.0, starts=(0.1,))
        super().__init__(
            [Slot(parameter, 0)],
            np.array([0.6]),
            Coefficients(np.array([0.3, -0.2]), np.array([[0.5, 0.2], [0.2, 0.4]])),
        )
        self.low[:2], self.high[:2] = -50.0, 50.0
        self.group = np.array([-1, 0])
        self.variance = np.array([0.2, np.nan])
        truth = np.array([0.1, 0.4, size])
        self.measured = self.j @ truth + NOISE * rng.standard_normal(30)

    def at_rows(self, z: Floats) -> Floats:
        return self.j @ z

    def columns(self, z: Floats) -> Floats:
        return self.own

    def white(self, factor: Factor, values: Floats) -> Floats:
        return values / NOISE


ROWS = 30
FACTOR = Factor((), ROWS * np.log(NOISE))
OF_THE_ROWS = 0.5 * ROWS * np.log(2.0 * np.pi)
"""What `weigh` leaves out of every evidence: it depends on nothing but the number of rows."""
CENTRE = np.array([0.3, -0.2])
SPREAD = np.array([[0.5, 0.2], [0.2, 0.4]])
OWN = np.array([0.2, 0.6**2])
SIZE_DEVIATION = 0.8


def weighed(problem: Line, z: Floats) -> float:
    """Evidence by the engine, the nuisances' variances held."""
    found, _, _ = problem.weigh(problem.linear(z), FACTOR, OWN[1:], rounds=0)
    return found - OF_THE_ROWS


def searched(problem: Line, size: float = 0.2) -> Floats:
    start = np.array([0.0, 0.0, size])
    return problem.search(start, FACTOR, problem.spread(OWN[1:]), 1e-9, 80).z


def of_a_known_size(problem: Line, size: float) -> float:
    """Log density of the data where the effect is so large: log N(y; ., V + J P J' + Z G Z')."""
    covariance = (
        NOISE**2 * np.eye(ROWS)
        + problem.j[:, :2] @ SPREAD @ problem.j[:, :2].T
        + problem.own @ np.diag(OWN) @ problem.own.T
    )
    mean = problem.j[:, :2] @ CENTRE + size * problem.j[:, 2]
    return float(multivariate_normal(mean, covariance).logpdf(problem.measured))


def with_half_a_prior(problem: Line) -> float:
    """Evidence where the size has a half-normal prior, by integration."""
    top = minimize_scalar(
        lambda a: -of_a_known_size(problem, a), bounds=(0.0, 5.0), method="bounded"
    ).x
    shift = of_a_known_size(problem, top)

    def density(size: float) -> float:
        prior = 2.0 * float(norm(0.0, SIZE_DEVIATION).pdf(size))
        return prior * float(np.exp(of_a_known_size(problem, size) - shift))

    integral, _ = quad(density, 0.0, 5.0, points=[top, top + 0.1, top + 0.3], limit=200)
    return shift + float(np.log(integral))


@pytest.mark.parametrize("low", [-50.0, -8.0])
def test_of_a_straight_model_it_is_the_exact_one(low: float) -> None:
    """Wherever it is made linear, and whether the bound is far away or farther."""
    problem = Line(1.0, low=low)
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[2, 2] = SPREAD, SIZE_DEVIATION**2
    covariance = NOISE**2 * np.eye(ROWS) + problem.j @ whole @ problem.j.T
    covariance += problem.own @ np.diag(OWN) @ problem.own.T
    exact = multivariate_normal(problem.j[:, :2] @ CENTRE, covariance).logpdf(problem.measured)
    for z in (np.zeros(3), np.array([0.1, 0.4, 1.0])):
        assert weighed(problem, z) == pytest.approx(exact, abs=1e-9)


def test_the_top_of_the_linear_problem_is_where_a_search_ends() -> None:
    problem = Line(1.0, low=-50.0)
    _, _, top = problem.weigh(problem.linear(np.zeros(3)), FACTOR, OWN[1:], rounds=0)
    np.testing.assert_allclose(top, searched(problem), atol=1e-6)


class Runaway(Line):
    """The same up to a size of 0.5; beyond, its motion and what nuisances make of it explode."""

    tried_beyond = False

    def __init__(self) -> None:
        super().__init__(1.0, low=-50.0)
        self.moving = np.array([0, 1])

    def at_rows(self, z: Floats) -> Floats:
        return super().at_rows(z) * self._growth(z)

    def columns(self, z: Floats) -> Floats:
        # All of them alike: nothing tells them apart but their priors, lost to rounding.
        growth = self._growth(z)
        return self.own if growth == 1.0 else growth * np.ones_like(self.own)

    def _growth(self, z: Floats) -> float:
        self.tried_beyond |= z[2] > 0.5
        return 1e12 if z[2] > 0.5 else 1.0


def test_a_search_turns_back_from_where_a_motion_explodes() -> None:
    problem = Runaway()
    found = searched(problem)
    assert problem.tried_beyond
    assert 0.2 < found[2] <= 0.5


@pytest.mark.parametrize("size", [1.0, 0.3, 0.1])
def test_a_posterior_that_a_bound_cuts_is_integrated_as_it_is(size: float) -> None:
    problem = Line(size, low=0.0)
    z = searched(problem)
    assert z[2] > 0.0
    assert weighed(problem, z) == pytest.approx(with_half_a_prior(problem), abs=1e-4)


@pytest.mark.parametrize("size", [0.05, -0.1, -0.3, -1.0])
def test_a_size_that_its_bound_holds_is_integrated_too(size: float) -> None:
    problem = Line(size, low=0.0)
    z = searched(problem)
    assert z[2] == 0.0
    assert weighed(problem, z) == pytest.approx(with_half_a_prior(problem), abs=0.05)


def test_a_size_that_its_bound_holds_is_integrated_beside_a_nuisance_like_it() -> None:
    problem = Line(-0.1, low=0.0)
    problem.own[:, 1] = 0.8 * problem.j[:, 2] + 0.6 * problem.own[:, 1]
    problem.measured = problem.measured + 0.8 * problem.own[:, 1]
    z = searched(problem)
    assert z[2] == 0.0
    assert weighed(problem, z) == pytest.approx(with_half_a_prior(problem), abs=0.05)


def test_a_search_ends_where_the_gradient_of_the_marginal_vanishes() -> None:
    problem = Line(1.0, low=-50.0)
    spread = problem.spread(np.array([0.36]))
    z = problem.search(np.zeros(3), FACTOR, spread, 1e-12, 60).z
    covariance = NOISE**2 * np.eye(30) + problem.own @ np.diag(spread) @ problem.own.T
    pull = problem.j.T @ np.linalg.solve(covariance, problem.left(z))
    np.testing.assert_allclose(pull, problem.precision @ (z - problem.centre), atol=1e-4)


def test_the_covariance_is_that_of_the_posterior() -> None:
    problem = Line(1.0, low=-50.0)
    linear = problem.linear(np.zeros(3))
    spread = problem.spread(np.array([0.36]))
    covariance = NOISE**2 * np.eye(30) + problem.own @ np.diag(spread) @ problem.own.T
    normal = problem.j.T @ np.linalg.solve(covariance, problem.j) + problem.precision
    found = problem.posterior(linear, FACTOR, np.array([0.36]))
    np.testing.assert_allclose(found, np.linalg.inv(normal))


class Misread(Line):
    """The same, where a nuisance's column is a bent function of the prediction, as a curve's is."""

    def __init__(self, size: float, low: float, seed: int = 1) -> None:
        super().__init__(size, low, seed)
        self.moving = np.array([1])

    def columns(self, z: Floats) -> Floats:
        return np.column_stack([self.own[:, 0], np.sin(self.at_rows(z))])

    def slopes_beside(self, z: Floats, b: Floats) -> Floats:
        return (1.0 + b[1] * np.cos(self.at_rows(z)))[:, None] * self.slopes(z)

    def together(self) -> Floats:
        """Search parameters and nuisances at once, by scipy."""
        away = np.linalg.cholesky(self.precision).T

        def left(x: Floats) -> Floats:
            z, b = x[:3], x[3:]
            rows = (self.measured - self.at_rows(z) - self.columns(z) @ b) / NOISE
            return np.concatenate([rows, away @ (z - self.centre), b / np.sqrt(OWN)])

        return least_squares(left, np.zeros(5), xtol=1e-12, ftol=1e-12, gtol=1e-12).x


@pytest.mark.parametrize("seed", range(6))
def test_a_search_knows_how_nuisances_go_with_the_parameters(seed: int) -> None:
    problem = Misread(1.0, low=-50.0, seed=seed)
    expected = problem.together()
    found = searched(problem)
    np.testing.assert_allclose(found, expected[:3], atol=2e-4)
    assert abs(expected[4]) > 0.05  # the prediction is misread by some
    # So it stays there, and so does the linear problem about it.
    again = problem.search(found, FACTOR, problem.spread(OWN[1:]), 1e-9, 80)
    np.testing.assert_allclose(again.z, found, atol=1e-5)
    _, _, top = problem.weigh(problem.linear(found), FACTOR, OWN[1:], rounds=0)
    np.testing.assert_allclose(top, found, atol=1e-3)
    held = Misread(1.0, low=-50.0, seed=seed)
    held.moving = np.zeros(0, dtype=np.int64)
    assert np.abs(searched(held) - expected[:3]).max() > 1e-2


def test_a_point_that_was_rejected_leaves_no_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step is bent by what is at the last point that was kept, whatever was tried since."""
    step = np.array([0.3, -0.2, 0.4])

    def asked(value, quadratic, start, *others):
        bend = others[-2]
        before = quadratic(start)
        first = bend(start, step)
        value(start + step)
        np.testing.assert_array_equal(bend(start, step), first)
        again = quadratic(start)
        np.testing.assert_array_equal(again.gradient, before.gradient)
        value(start + step)
        return quadratic(start + step)

    monkeypatch.setattr(least_squares_module, "minimise", asked)
    problem = Misread(1.0, low=-50.0)
    spread = problem.spread(OWN[1:])
    found = problem.search(np.zeros(3), FACTOR, spread, 1e-9, 80)
    monkeypatch.undo()
    alone = problem.search(step, FACTOR, spread, np.inf, 0)
    # The columns that are held are those about each search's start, so those that move say it all.
    assert found.value == pytest.approx(alone.at.value)
    np.testing.assert_allclose(found.gradient, alone.at.gradient)


def test_a_search_does_not_go_where_the_misfit_has_no_slopes() -> None:
    """A value without slopes is no place to go on from; from such a start there is no search."""

    def value(z: Floats) -> float:
        return 0.5 * float((z - 3.0) @ (z - 3.0))

    def quadratic(z: Floats) -> Quadratic:
        slope = z - 3.0 if z[0] < 2.0 else np.array([np.nan])
        return Quadratic(value(z), slope, np.eye(1))

    low, high, metric = np.array([-10.0]), np.array([10.0]), np.eye(1)
    found = minimise(value, quadratic, np.array([0.0]), low, high, 1e-6, 60, metric)
    assert 1.0 < found.z[0] < 2.0
    assert found.at.is_finite
    nowhere = minimise(value, quadratic, np.array([2.5]), low, high, 1e-6, 60, metric)
    assert nowhere.at.value == np.inf
    assert nowhere.tried == 0
