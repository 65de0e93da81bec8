"""An explanation as a least-squares problem: parameters searched, nuisances solved.

    y = f(z) + Z b + e,   z ~ N(c, Π) within bounds,   b ~ N(0, Γ),   e ~ N(0, V)

Within a search Z, Γ and V are held, so that its gradient is exact. The evidence is Laplace's, the
variances Γ at their most probable; bounds change it where they cut a prior or a posterior.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, solve_triangular
from scipy.special import erfcx, log_ndtr

from spa_fo.gap.data.searched import Slot
from spa_fo.gap.fit.minimise import Minimum, Quadratic, free_of, minimise
from spa_fo.gap.fit.mixed import Normal, Prior, Solution, solve
from spa_fo.gap.noise.whitening import Factor

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_SLOPE_STEP = 5e-4
_BEND = 0.1  # of a step, for the second derivative along it


@dataclass(frozen=True)
class Linear:
    """A problem made linear about a point: what is left there, and all columns."""

    z: Floats
    left: Floats
    slopes: Floats
    columns: Floats


class Explained(ABC):
    """What is searched of an explanation, and what its rows say.

    Parameters
    ----------
    slots : sequence of Slot
        The effects' parameters.
    centre, spread : arrays
        Prior of the parameters searched before them: mean (k,), covariance (k, k).
    low, high : (k,) arrays
        Their bounds.
    scales : array
        Typical standard deviations of the groups of nuisances.
    log_noise : float
        Logarithm of the determinant of the noise beyond the whitening's.
    """

    group: Integers
    variance: Floats

    def __init__(
        self,
        slots: Sequence[Slot],
        centre: Floats,
        spread: Floats,
        low: Floats,
        high: Floats,
        scales: Floats,
        log_noise: float = 0.0,
    ) -> None:
        self.slots, self.scales, self.log_noise = list(slots), scales, log_noise
        self.most = np.full(scales.size, np.inf)
        self.free = k = centre.size
        p = k + len(self.slots)
        self.parameters = p
        self.centre = np.concatenate([centre, [s.centre for s in self.slots]])
        self.sd = np.array([s.parameter.spread for s in self.slots])
        covariance = np.zeros((p, p))
        covariance[:k, :k] = spread
        covariance[np.arange(k, p), np.arange(k, p)] = self.sd**2
        self.root = np.linalg.cholesky(covariance)
        self.precision = cho_solve((self.root, True), np.eye(p))
        self.low = np.concatenate([low, [s.limits[0] for s in self.slots]])
        self.high = np.concatenate([high, [s.limits[1] for s in self.slots]])

    @abstractmethod
    def left(self, z: Floats) -> Floats:
        """Measured less predicted, (rows,)."""

    @abstractmethod
    def slopes(self, z: Floats) -> Floats:
        """Slopes of the prediction over the searched parameters, (rows, parameters)."""

    @abstractmethod
    def columns(self, z: Floats) -> Floats:
        """Columns of the nuisances about a point, (rows, size)."""

    @abstractmethod
    def white(self, factor: Factor, values: Floats) -> Floats:
        """Whiten what stands at all rows."""

    def linear(self, z: Floats) -> Linear:
        """Make the problem linear about a point."""
        return Linear(z, self.left(z), self.slopes(z), self.columns(z))

    def slope_step(self, z: Floats, k: int) -> float:
        """How far an effect's parameter is moved for a slope."""
        step = _SLOPE_STEP * min(self.sd[k - self.free], 0.3 * max(abs(z[k]), 0.3))
        return float(step if z[k] + step <= self.high[k] else -step)

    # --- search ----------------------------------------------------------------------------------

    def search(
        self, start: Floats, factor: Factor, spread: Floats, enough: float, most: int
    ) -> Minimum:
        """Search with the nuisances' columns about `start` and their prior variances `spread`."""
        start = np.clip(start, self.low, self.high)
        nuisances = self.white(factor, self.columns(start))
        matrix = nuisances.T @ nuisances
        matrix[np.diag_indices_from(matrix)] += 1.0 / spread
        root = np.linalg.cholesky(matrix)
        half = solve_triangular(root, nuisances.T, lower=True)

        last: dict[str, Floats] = {}

        def value(z: Floats) -> float:
            r = self.white(factor, self.left(z))
            away = z - self.centre
            taken = half @ r
            return 0.5 * float(r @ r - taken @ taken + away @ self.precision @ away)

        def quadratic(z: Floats) -> Quadratic:
            r = self.white(factor, self.left(z))
            j = self.white(factor, self.slopes(z))
            r_taken, j_taken = half @ r, half @ j
            last.update(r=r, j=j, j_taken=j_taken)
            away = z - self.centre
            pull = self.precision @ away
            return Quadratic(
                0.5 * float(r @ r - r_taken @ r_taken + away @ pull),
                pull - (j.T @ r - j_taken.T @ r_taken),
                j.T @ j - j_taken.T @ j_taken + self.precision,
            )

        def bend(z: Floats, step: Floats) -> Floats:
            near = self.white(factor, self.left(z + _BEND * step))
            second = 2.0 / _BEND * ((near - last["r"]) / _BEND + last["j"] @ step)
            return np.asarray(last["j_taken"].T @ (half @ second) - last["j"].T @ second)

        return minimise(
            value, quadratic, start, self.low, self.high, enough, most, self.precision, bend
        )

    def spread(self, variances: Floats) -> Floats:
        """Prior variances of all nuisances for variances of their groups."""
        out = self.variance.copy()
        grouped = self.group >= 0
        out[grouped] = variances[self.group[grouped]]
        return out

    def misfit(self, z: Floats, factor: Factor) -> float:
        """Half the squared misfit at a point, nothing of it taken by nuisances."""
        z = np.clip(z, self.low, self.high)
        r = self.white(factor, self.left(z))
        away = z - self.centre
        return 0.5 * float(r @ r + away @ self.precision @ away)

    # --- evidence --------------------------------------------------------------------------------

    def weigh(
        self, linear: Linear, factor: Factor, variances: Floats, rounds: int = 6
    ) -> tuple[float, Solution, Floats]:
        """Log evidence about a point, the nuisances' variances at their most probable.

        Returns
        -------
        evidence : float
            Of all rows, the bounds' part of each prior and posterior taken into account.
        solution : Solution
            Its columns are the searched parameters, in units of their prior's root, and the
            nuisances.
        z : array
            Where the linear problem has its top.
        """
        p = self.parameters
        every = np.column_stack([linear.left, linear.slopes @ self.root, linear.columns])
        whitened = self.white(factor, every)
        gram = whitened.T @ whitened
        z = linear.z
        inner = gram[p + 1 :, p + 1 :].copy()
        inner[np.diag_indices_from(inner)] += 1.0 / self.spread(variances)
        taken = np.linalg.solve(inner, gram[p + 1 :, 0]) if inner.size else np.zeros(0)
        pull = gram[1 : p + 1, 0] - gram[1 : p + 1, p + 1 :] @ taken
        gradient = self.precision @ (z - self.centre)
        gradient -= solve_triangular(self.root, pull, lower=True, trans=1)
        held = ~free_of(z, gradient, self.low, self.high)
        held[: self.free] = False
        use = np.concatenate([~held, np.ones(self.group.size, dtype=bool)])
        normal = Normal(
            gram[1:, 1:][np.ix_(use, use)],
            gram[1:, 0][use],
            float(gram[0, 0]),
            2.0 * factor.half_log + self.log_noise,
            linear.left.size,
        )
        mean = np.concatenate(
            [
                solve_triangular(self.root, self.centre - z, lower=True),
                np.zeros(self.group.size),
            ]
        )
        prior = Prior(
            mean[use],
            np.concatenate([np.ones(p), self.variance])[use],
            np.concatenate([np.full(p, -1), self.group])[use],
            self.scales,
            self.most,
        )
        solution = solve(normal, prior, variances, rounds)
        moved = np.zeros(p)
        free = np.flatnonzero(~held)
        moved[free] = solution.coefficients[: free.size]
        top = z + self.root @ moved
        total = solution.log_evidence + self._of_bounds(
            z, top, held, use, gram[1:, 1:], gram[1:, 0], solution
        )
        return total, solution, top

    def remaining(self, linear: Linear, solution: Solution, top: Floats) -> Floats:
        """Give what parameters and nuisances leave at the top of a linear problem, (rows,)."""
        b = solution.coefficients[-self.group.size :]
        return linear.left - linear.slopes @ (top - linear.z) - linear.columns @ b

    def errors(self, linear: Linear, factor: Factor, variances: Floats | None = None) -> Floats:
        """Errors of the searched parameters about a point, 1 sigma, nuisances free."""
        return np.sqrt(np.diag(self.posterior(linear, factor, variances)))

    def posterior(self, linear: Linear, factor: Factor, variances: Floats | None = None) -> Floats:
        """Covariance of the searched parameters about a point, nuisances free."""
        j, own = self.white(factor, linear.slopes), self.white(factor, linear.columns)
        inner = own.T @ own
        spread = self.spread(self.scales**2 if variances is None else variances)
        inner[np.diag_indices_from(inner)] += 1.0 / spread
        cross = own.T @ j
        normal = j.T @ j - cross.T @ np.linalg.solve(inner, cross) + self.precision
        return np.asarray(np.linalg.inv(normal))

    def _of_bounds(
        self,
        z: Floats,
        top: Floats,
        held: NDArray[np.bool_],
        use: NDArray[np.bool_],
        matrix: Floats,
        vector: Floats,
        solution: Solution,
    ) -> float:
        """Say what bounds change of the evidence: a prior cut there is larger inside."""
        if self.parameters == self.free:
            return 0.0
        total = 0.0
        covariance = solution.covariance()
        free = np.flatnonzero(use)
        for k in range(self.free, self.parameters):
            sd = float(self.sd[k - self.free])
            low = (self.low[k] - self.centre[k]) / sd
            high = (self.high[k] - self.centre[k]) / sd
            total -= float(np.log(max(_between(low, high), 1e-12)))
            if held[k]:
                # A one-sided Gaussian integral, in units of its prior, all others following.
                away = (z[k] - self.centre[k]) / sd
                beside = matrix[k, use]
                curvature = matrix[k, k] + 1.0 - float(beside @ covariance @ beside)
                slope = abs(away - vector[k] + float(beside @ solution.coefficients))
                total += float(
                    -0.5 * np.log(2.0 * np.pi)
                    - 0.5 * away**2
                    + 0.5 * np.log(np.pi / (2.0 * curvature))
                    + np.log(erfcx(slope / np.sqrt(2.0 * curvature)))
                )
            else:
                at = int(np.searchsorted(free, k))
                error = sd * float(np.sqrt(covariance[at, at]))
                total += float(log_ndtr((top[k] - self.low[k]) / error))
                total += float(log_ndtr((self.high[k] - top[k]) / error))
        return total


def _between(low: float, high: float) -> float:
    return float(np.exp(log_ndtr(high)) - np.exp(log_ndtr(low)))
