"""A campaign, named effects and a free-form law beside them, as a least-squares problem.

The law's coefficients stand among the nuisances, with a variance of their own; about a law that is
not 0 the problem is made linear anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.searched import to_x
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.fit.least_squares import Linear
from spa_fo.gap.fit.problem import AngleProblem
from spa_fo.gap.noise.whitening import Factor
from spa_fo.gap.places.law_basis import Basis, without
from spa_fo.plant.chain import Chain
from spa_fo.plant.law import Law
from spa_fo.plant.lawful import with_law

Floats = NDArray[np.float64]
Ids = tuple[str, ...]

_ROUNDS = 4  # of Gauss and Newton
_STEP = 0.02  # of what a law is beforehand, for a slope


class LawProblem(AngleProblem):
    """An explanation of a campaign with a law about some coefficients.

    Parameters
    ----------
    bench : Bench
        The campaign.
    ids : sequence of str
        Named effects.
    changed : bool
        See `AngleProblem`; a law of the reading then holds of later calibrations too.
    basis : Basis
        The law's.
    e : array
        Its coefficients.
    scale : float
        Their size beforehand.
    """

    def __init__(
        self, bench: Bench, ids: Ids, changed: bool, basis: Basis, e: Floats, scale: float
    ) -> None:
        bare = bench.chain
        # A law's straight part is the coefficients': they may have shifted.
        own = replace(bench.shifted(), chain=with_law(bare, basis.law(e)))
        super().__init__(own, ids, changed)
        self.basis, self.e, self.bare = basis, e, bare
        self.step = _STEP * scale
        self.group = np.append(self.group, np.full(basis.size, self.scales.size))
        self.variance = np.append(self.variance, np.ones(basis.size))
        self.scales, self.most = np.append(self.scales, scale), np.append(self.most, np.inf)
        self._tangents: tuple[Floats, Floats] | None = None

    def tangents(self, z: Floats) -> Floats:
        """Slopes of the prediction over the law's coefficients, (all rows, coefficients)."""
        if self._tangents is None or not np.array_equal(self._tangents[0], z):
            self._tangents = z.copy(), self._slopes_of_law(z)
        return self._tangents[1]

    def _slopes_of_law(self, z: Floats) -> Floats:
        here, _ = self.predict(z)
        moved = []
        for k in range(self.basis.size):
            e = self.e.copy()
            e[k] += self.step
            moved.append(self._angle(with_law(self.bare, self.basis.law(e)), z) - here)
        rows = self.rows.merged(np.column_stack(moved)) / self.step
        drift = None
        if self.changed and self.basis.place == "reading":
            drift = self.basis.curve(self.evidence.drift_angle_deg)
        return self.stacked(rows, drift=drift)

    def _angle(self, chain: Chain, z: Floats) -> Floats:
        effects = self.effects(z)
        return chain.mounted(self._in_fixture(effects)[1]).run(to_x(z[:5]), effects)[0]

    def columns(self, z: Floats) -> Floats:
        """Columns of the nuisances about a point, the law's last."""
        return np.hstack([super().columns(z), self.tangents(z)])

    def left(self, z: Floats) -> Floats:
        """Measured less predicted without what the law's columns say."""
        return super().left(z) + self.tangents(z) @ self.e


@dataclass(frozen=True)
class LawFit:
    """A law fitted beside named effects.

    Attributes
    ----------
    basis : Basis
        Its place, knots and shapes.
    changed : bool
        Whether it holds of later calibrations too.
    e, covariance : arrays
        Its coefficients and their covariance.
    z : array
        Searched coefficients and parameters beside it.
    effects : array
        Parameters of all effects, NaN where absent.
    predicted_deg : (n,) array
        At the grid's samples.
    logs : array
        Log evidence by factor.
    """

    basis: Basis
    changed: bool
    e: Floats
    covariance: Floats
    z: Floats
    effects: Floats
    predicted_deg: Floats
    logs: Floats

    @property
    def law(self) -> Law:
        """The law itself."""
        return self.basis.law(self.e)


def fit_law(
    bench: Bench,
    ids: Ids,
    changed: bool,
    z: Floats,
    variances: Floats,
    basis: Basis,
    factors: Sequence[Factor],
    rounds: int = _ROUNDS,
) -> LawFit:
    """Fit a law with all that stands beside it.

    Parameters
    ----------
    bench : Bench
        The campaign.
    ids, changed
        Named effects beside it; see `LawProblem`.
    z, variances : arrays
        Where these begin, and the nuisances' variances.
    basis : Basis
        The law's.
    factors : sequence of Factor
        The first is that of the fit, the evidence is given for all.
    rounds : int
        How often the problem is made linear; once is a screening.
    """
    scale = _scale(bench, ids, changed, z, basis)
    variances, e = np.append(variances, scale**2), np.zeros(basis.size)
    while True:
        at = _settled(bench, ids, changed, z, variances, basis, e, scale, factors[0], rounds)
        if basis.place != "relaxation" or basis.size == 1 or at.e.min() >= 0.0:
            break
        # An actuator does not push by itself: what is negative leaves the spectrum.
        worst = int(np.argmin(at.e))
        basis, e = without(basis, worst), np.maximum(np.delete(at.e, worst), 0.0)
    problem = at.problem
    weighed = [problem.weigh(at.linear, factor, at.variances, rounds=3)[0] for factor in factors]
    return LawFit(
        basis=basis,
        changed=changed,
        e=at.e,
        covariance=at.covariance,
        z=at.z,
        effects=problem.effects(at.z),
        predicted_deg=problem.predict(at.linear.z)[0],
        logs=np.array(weighed),
    )


@dataclass(frozen=True)
class _Point:
    """A linear problem and where it has its top."""

    problem: LawProblem
    linear: Linear
    z: Floats
    e: Floats
    covariance: Floats
    variances: Floats


def _settled(
    bench: Bench,
    ids: Ids,
    changed: bool,
    z: Floats,
    variances: Floats,
    basis: Basis,
    e: Floats,
    scale: float,
    factor: Factor,
    rounds: int,
) -> _Point:
    """Go on from a point to where the linear problem's top is the point itself."""
    point: _Point | None = None
    start = z
    for _ in range(rounds):
        good = (point.problem.e, point.linear.z) if point else (np.zeros_like(e), start)
        problem, linear, e, z = _made(bench, ids, changed, basis, scale, (e, z), good)
        _, solution, top = problem.weigh(linear, factor, variances)
        k = basis.size
        z, e = np.clip(top, problem.low, problem.high), solution.coefficients[-k:]
        covariance = solution.covariance()[-k:, -k:]
        variances = solution.variances
        point = _Point(problem, linear, z, e, covariance, variances)
    assert point is not None
    return point


def _made(
    bench: Bench,
    ids: Ids,
    changed: bool,
    basis: Basis,
    scale: float,
    there: tuple[Floats, Floats],
    good: tuple[Floats, Floats],
) -> tuple[LawProblem, Linear, Floats, Floats]:
    """Make the problem linear about a point, or nearer to a good one where no motion agrees."""
    for share in (1.0, 0.5, 0.25, 0.0):
        e, z = (share * a + (1.0 - share) * b for a, b in zip(there, good, strict=True))
        problem = LawProblem(bench, ids, changed, basis, e, scale)
        try:
            return problem, problem.linear(z), e, z
        except ValueError:
            if share == 0.0:
                raise
    raise AssertionError


def _scale(bench: Bench, ids: Ids, changed: bool, z: Floats, basis: Basis) -> float:
    """How large a law is beforehand: as large as it takes to move the angle by the gap."""
    problem = LawProblem(bench, ids, changed, basis, np.zeros(basis.size), _span(basis))
    moved = problem.tangents(z)[: problem.rows.size]
    size = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
    # A gap that is smaller than the noise says nothing of it.
    gap_deg = max(bench.gap_deg, bench.noise.spectrum.deviation_deg)
    return gap_deg / max(size, 1e-12)


def _span(basis: Basis) -> float:
    return 0.01 * max(abs(basis.low), abs(basis.high))
