"""A campaign, named effects and a free-form law beside them, as a least-squares problem.

The law's coefficients stand among the nuisances, with a variance of their own; about a law that is
not 0 the problem is made linear anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.data.searched import to_x
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.fit.least_squares import Linear
from spa_fo.gap.fit.problem import AngleProblem
from spa_fo.gap.fit.repeated import repeats_say, rest_of
from spa_fo.gap.noise.whitening import Factor
from spa_fo.gap.places.law_basis import Basis
from spa_fo.gap.search.fitted import Fitted
from spa_fo.numeric.mixed import WEAK
from spa_fo.plant.law import Law
from spa_fo.plant.lawful import TooSteep, with_law

ROUNDS = 4
"""How often a problem is made linear; once is a screening."""

_STEP = 0.02  # of what a law is beforehand, for a slope
_MOST = 30.0  # times that: what is larger moves nothing, as the rest takes it back


class LawProblem(AngleProblem):
    """An explanation with a law about coefficients `e`, (m,), which are `scale` beforehand.

    A law of the reading holds of later calibrations too where `base`, the named effects beside it,
    shows it there (`Calibrated.later`).
    """

    def __init__(self, bench: Bench, base: Fitted, basis: Basis, e: Floats, scale: float) -> None:
        self.basis, self.e, self.bare = basis, e, bench.chain
        self.step = _STEP * scale
        # A law's straight part is the coefficients': they may have shifted.
        own = replace(bench.freed(), chain=with_law(bench.chain, basis.law(e)))
        super().__init__(own, base.ids, base.calibrated)
        self.group = np.append(self.group, np.full(basis.size, self.scales.size))
        self.variance = np.append(self.variance, np.ones(basis.size))
        self.scales, self.most = np.append(self.scales, scale), np.append(self.most, _MOST * scale)
        self.strength = np.append(self.strength, WEAK)

    def tangents(self, z: Floats) -> Floats:
        """Slopes of the prediction over the law's coefficients, (all rows, m)."""
        (here, _), effects = self.predict(z), self.effects(z)
        mounting = self.in_fixture(effects)[1]
        moved = []
        for step in self.step * np.eye(self.basis.size):
            chain = with_law(self.bare, self.basis.law(self.e + step)).mounted(mounting)
            moved.append(chain.run(to_x(z[:5]), effects)[0] - here)
        rows = self.rows.merged(np.column_stack(moved)) / self.step
        drift = None
        if self.calibrated.later and self.basis.place == "reading":
            drift = self.basis.curve(self.evidence.drift_angle_deg)
        return self.stacked(rows, drift=drift)

    def linear(self, z: Floats) -> Linear:
        """Make the problem linear about a point, the law's columns last."""
        bare, own = super().linear(z), self.tangents(z)
        return replace(bare, left=bare.left + own @ self.e, columns=np.hstack([bare.columns, own]))


@dataclass(frozen=True)
class LawFit:
    """A law fitted beside what is known."""

    basis: Basis
    e: Floats  # (m,), its coefficients
    covariance: Floats  # (m, m)
    beside: Fitted  # what is known, as it stands beside the law: `z`, `effects`, `predicted_deg`
    logs: Floats  # log evidence by factor
    probability: float = 1.0  # of its place, all places and no law at all together 1
    nats: float = 0.0  # log evidence against no law

    @property
    def law(self) -> Law:
        """The law itself."""
        return self.basis.law(self.e)


def fit_law(
    bench: Bench,
    base: Fitted,
    basis: Basis,
    factors: Sequence[Factor],
    rounds: int = ROUNDS,
    begin: tuple[float, Floats] | None = None,
) -> LawFit:
    """Fit a law with all that stands beside it, by Gauss and Newton.

    What stands beside it begins at `base`, the law at `begin`, its scale and coefficients. The
    first factor is that of the fit, the evidence is given for all. The problem is made linear
    `rounds` times; once is a screening. `TooSteep` where the law is too steep for any motion.
    """
    scale, e = begin or (_scale(bench, base, basis), np.zeros(basis.size))
    z, variances = base.z, np.append(base.variances, scale**2)
    good = np.zeros_like(e), z
    for _ in range(rounds):
        problem, linear = _linear(bench, base, basis, scale, (e, z), good)
        _, solution, top = problem.weigh(linear, factors[0], variances)
        good = problem.e, linear.z
        z, e = np.clip(top, problem.low, problem.high), solution.coefficients[-basis.size :]
        variances = solution.variances
    if basis.place == "relaxation" and basis.size > 1 and e.min() < 0.0:
        # An actuator does not push by itself: what is negative leaves the spectrum.
        worst = int(np.argmin(e))
        begin = scale, np.maximum(np.delete(e, worst), 0.0)
        return fit_law(bench, base, basis.without(worst), factors, rounds, begin)
    predicted, effects = problem.predict(linear.z)[0], problem.effects(z)
    logs = np.array([problem.weigh(linear, f, variances, rounds=3)[0] for f in factors])
    return LawFit(
        basis=basis,
        e=e,
        covariance=solution.covariance()[-basis.size :, -basis.size :],
        beside=replace(base, z=z, effects=effects, predicted_deg=predicted),
        logs=logs + rest_of(repeats_say(problem, solution)),
    )


def _linear(
    bench: Bench,
    base: Fitted,
    basis: Basis,
    scale: float,
    there: tuple[Floats, Floats],
    good: tuple[Floats, Floats],
) -> tuple[LawProblem, Linear]:
    """Make the problem linear about a point, or nearer to a good one where no motion agrees."""
    for share in (1.0, 0.5, 0.25, 0.0):
        e, z = (share * a + (1.0 - share) * b for a, b in zip(there, good, strict=True))
        problem = LawProblem(bench, base, basis, e, scale)
        with suppress(TooSteep):
            return problem, problem.linear(z)
    raise TooSteep(basis.place)


def _scale(bench: Bench, base: Fitted, basis: Basis) -> float:
    """How large a law is beforehand: as large as it takes to move the angle by the gap."""
    span = 0.01 * float(np.abs(basis.over).max())
    problem = LawProblem(bench, base, basis, np.zeros(basis.size), span)
    moved = problem.tangents(base.z)[: problem.rows.size]
    size = float(np.sqrt(np.mean(np.sum(moved**2, axis=1))))
    # A gap that is smaller than the noise says nothing of it.
    gap_deg = max(bench.gap_deg, bench.noise.spectrum.deviation_deg)
    return gap_deg / max(size, 1e-12)
