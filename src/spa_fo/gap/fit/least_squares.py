"""An explanation as a least-squares problem: parameters searched, nuisances solved.

    y = f(z) + Z b + e,   z ~ N(c, Π) within bounds,   b ~ N(0, Γ),   e ~ N(0, V)

Within a search Γ and V are held, and of Z what hardly goes with z. The evidence is Laplace's, the
variances Γ at their most probable; bounds change it where they cut a prior or a posterior.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, cho_solve
from scipy.special import erfcx, log_ndtr

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.data.searched import HIGHEST, LOWEST, Slot
from spa_fo.gap.fit.coefficients import Coefficients
from spa_fo.gap.noise.whitening import Factor, Whitening
from spa_fo.numeric.lapack import forward
from spa_fo.numeric.minimise import Minimum, Quadratic, free_of, minimise
from spa_fo.numeric.mixed import WEAK, Normal, Prior, Solution, solve
from spa_fo.plant.effects.effect import Reach
from spa_fo.plant.effects.library import LIBRARY, absent

Made = TypeVar("Made")

_COEFFICIENT_STEP = 1e-4
_SLOPE_STEP = 5e-4
_BEND = 0.1  # of a step, for the second derivative along it
_REMEMBERED = 64  # simulations of a problem


@dataclass(frozen=True)
class Linear:
    """A problem made linear about a point: what is left there, and all columns."""

    z: Floats
    left: Floats
    slopes: Floats
    columns: Floats


@dataclass(frozen=True)
class _Seen:
    """A point of a search: what is left there, and the nuisances' columns, whitened."""

    z: Floats
    left: Floats
    columns: Floats
    root: Floats  # of their coefficients' precision, lower

    def taken(self, values: Floats) -> Floats:
        """Give what the nuisances take of whitened values, in units of their root."""
        return forward(self.root, self.columns.T @ values)


class Explained(ABC):
    """What is searched of an explanation, and what its rows say.

    `group` and `variance` are those of the nuisances, as a `Prior` has them. `measured` stands at
    all rows: those of `whitening`, and further ones whose errors are `sigma`, 1 sigma.

    Parameters
    ----------
    slots : sequence of Slot
        The effects' parameters.
    scales : array
        Typical standard deviations of the groups of nuisances.
    known : Coefficients, optional
        What is known of coefficients that are searched before them; its response, whitened, stands
        at the last rows.
    """

    group: Integers
    variance: Floats
    measured: Floats
    whitening: Whitening
    sigma: Floats

    def __init__(
        self, slots: Sequence[Slot], scales: Floats, known: Coefficients | None = None
    ) -> None:
        self.slots, self.scales, self.most = list(slots), scales, np.full(scales.size, np.inf)
        self.strength = np.full(scales.size, WEAK)
        mean, spread, self.response = np.zeros(0), np.zeros((0, 0)), None
        if known is not None:
            mean, spread, self.response = known.mean, known.spread, known.response
        self.free, self.parameters = mean.size, mean.size + len(self.slots)
        self.sd = np.array([s.parameter.spread for s in self.slots])
        covariance = block_diag(spread, np.diag(self.sd**2))
        self.root = np.linalg.cholesky(covariance)
        self.precision = cho_solve((self.root, True), np.eye(self.parameters))
        self.centre = np.append(mean, [s.centre for s in self.slots])
        self.moving = np.zeros(0, dtype=np.int64)
        self._moments = self.free + np.flatnonzero([s.parameter.is_moment for s in self.slots])
        self.low = np.append(LOWEST[: self.free], [s.limits[0] for s in self.slots])
        self.high = np.append(HIGHEST[: self.free], [s.limits[1] for s in self.slots])
        places = np.array([s.place for s in self.slots], dtype=np.int64)
        self._placed = np.flatnonzero(places >= 0)
        self._places = places[self._placed]
        self._log = np.flatnonzero([s.parameter.log for s in self.slots])
        self._known: dict[tuple[str, bytes], Any] = {}

    @abstractmethod
    def at_rows(self, z: Floats) -> Floats:
        """Predict what is measured, (rows,); of the response 0."""

    @abstractmethod
    def columns(self, z: Floats) -> Floats:
        """Columns of the nuisances about a point, (rows, size)."""

    def moved(self, factor: Factor, z: Floats) -> Floats:
        """Whiten those columns of the nuisances that go with a search's point, (rows, moving)."""
        return self.white(factor, self.columns(z)[:, self.moving])

    def slopes_beside(self, z: Floats, b: Floats) -> Floats:
        """Slopes of the prediction and of what nuisances `b` make of it, (rows, parameters)."""
        return self.slopes(z)

    def white(self, factor: Factor, values: Floats) -> Floats:
        """Whiten what stands at all rows."""
        n = self.whitening.rows.size
        rest = (values[n:].T / self.sigma).T
        return np.concatenate([self.whitening.white(factor, values[:n]), rest])

    def effects(self, z: Floats) -> Floats:
        """Parameters of all effects, NaN where absent."""
        # As `Slot.value`, of all at once: every point asks for it.
        e, own = absent(), z[self.free :].copy()
        own[self._log] = np.exp(own[self._log])
        e[self._places] = own[self._placed]
        return e

    def left(self, z: Floats) -> Floats:
        """Measured less predicted, (rows,)."""
        left = self.measured - self.at_rows(z)
        if self.response is not None:
            left[-self.response.values.size :] = self._known_left(z[: self.free])
        return left

    def _known_left(self, coefficients: Floats) -> Floats:
        """Give what coefficients leave of the response that is known, (k,)."""
        assert self.response is not None
        return self.once("response", coefficients, partial(self.response.left, coefficients))

    def slopes(self, z: Floats) -> Floats:
        """Slopes of the prediction over the searched parameters, (rows, parameters)."""
        return self.once("slopes", z, lambda: self._slopes(z))

    def _slopes(self, z: Floats) -> Floats:
        here, steps = self.at_rows(z), self._slope_steps(z)
        moved = [(self.at_rows(z + d) - here) / d.sum() for d in np.diag(steps)]
        slopes = np.column_stack(moved)
        if self.response is not None:
            known = slice(-self.response.values.size, None)
            slopes[known, : self.free] = self.response.slopes(z)
        return slopes

    def _slope_steps(self, z: Floats) -> Floats:
        """How far each parameter is moved for a slope."""
        own, high = z[self.free :], self.high[self.free :]
        steps = _SLOPE_STEP * np.minimum(self.sd, 0.3 * np.maximum(np.abs(own), 0.3))
        steps *= np.where(own + steps <= high, 1.0, -1.0)
        return np.append(np.full(self.free, _COEFFICIENT_STEP), steps)

    def once(self, what: str, of: Floats, make: Callable[[], Made]) -> Made:
        """Make what depends on some numbers alone once, while they are among the last."""
        key = what, of.tobytes()
        if key not in self._known:
            if len(self._known) >= _REMEMBERED:
                self._known.clear()
            self._known[key] = make()
        found: Made = self._known[key]
        return found

    def linear(self, z: Floats) -> Linear:
        """Make the problem linear about a point."""
        return Linear(z, self.left(z), self.slopes(z), self.columns(z))

    # --- search ----------------------------------------------------------------------------------

    def search(
        self,
        start: Floats,
        factor: Factor,
        spread: Floats,
        enough: float,
        most: int,
        worth: float = -np.inf,
    ) -> Minimum:
        """Search with the nuisances' prior variances `spread`; for the others see `minimise`.

        Their columns are those about `start`, but for those of `moving`, which go with the point.
        A moment stays: what happens at once has no slope over it.
        """
        start = np.clip(start, self.low, self.high)
        low, high = self.low.copy(), self.high.copy()
        low[self._moments] = high[self._moments] = start[self._moments]
        held, precision, moving = self.white(factor, self.columns(start)), 1.0 / spread, self.moving
        inner = held.T @ held + np.diag(precision)
        seen = _Seen(np.zeros(0), held, held, held)  # the last point that was looked at
        kept, j, j_taken = seen, held, held  # the last one that was kept

        def look(z: Floats, left: Floats) -> _Seen:
            columns, matrix = held, inner
            if moving.size:  # most do not: their part of the matrix stays
                columns, matrix = held.copy(), inner.copy()
                columns[:, moving] = self.moved(factor, z)
                matrix[moving] = columns[:, moving].T @ columns
                matrix[:, moving] = matrix[moving].T
                matrix[moving, moving] += precision[moving]
            root = np.asarray(np.linalg.cholesky(matrix), np.float64)
            return _Seen(z, self.white(factor, left), columns, root)

        def of(at: _Seen, taken: Floats) -> float:
            away = at.z - self.centre
            return 0.5 * float(at.left @ at.left - taken @ taken + away @ self.precision @ away)

        def value(z: Floats) -> float:
            nonlocal seen
            if not np.isfinite(left := self.left(z)).all():
                return np.inf  # no motion agrees with it
            try:
                seen = look(z, left)
            except np.linalg.LinAlgError:
                return np.inf  # so large a motion that the nuisances' matrix is lost to rounding
            return of(seen, seen.taken(seen.left))

        def quadratic(z: Floats) -> Quadratic:
            nonlocal kept, j, j_taken
            # A point that is kept has been valued before.
            kept = seen if np.array_equal(z, seen.z) else look(z, self.left(z))
            r, taken = kept.left, kept.taken(kept.left)
            b = forward(kept.root, taken, transposed=True)
            j = self.white(factor, self.slopes_beside(z, b))
            j_taken = kept.taken(j)
            pull = self.precision @ (z - self.centre)
            gradient = pull - (j.T @ r - j_taken.T @ taken)
            hessian = j.T @ j - j_taken.T @ j_taken + self.precision
            return Quadratic(of(kept, taken), gradient, hessian)

        def bend(z: Floats, step: Floats) -> Floats:
            near = self.white(factor, self.left(z + _BEND * step))
            second = 2.0 / _BEND * ((near - kept.left) / _BEND + j @ step)
            return np.asarray(j_taken.T @ kept.taken(second) - j.T @ second)

        metric = self.precision
        return minimise(value, quadratic, start, low, high, enough, most, metric, bend, worth)

    def spread(self, variances: Floats) -> Floats:
        """Prior variances of all nuisances for variances of their groups."""
        return self._prior(np.zeros(0)).spread(variances)

    def _prior(self, mean: Floats) -> Prior:
        """Prior of parameters, in units of their prior's root and with this mean, and nuisances."""
        return Prior(
            np.append(mean, np.zeros(self.group.size)),
            np.append(np.ones(mean.size), self.variance),
            np.append(np.full(mean.size, -1), self.group),
            self.scales,
            self.most,
            self.strength,
        )

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
        p, z = self.parameters, linear.z
        beside = self.white(factor, np.column_stack([linear.left, linear.columns]))
        left, columns = beside[:, 0], beside[:, 1:]
        inner = columns.T @ columns + np.diag(1.0 / self.spread(variances))
        b = np.asarray(np.linalg.solve(inner, columns.T @ left), dtype=np.float64)
        slopes = self.white(factor, self.slopes_beside(z, b) @ self.root)
        whitened = np.column_stack([left, slopes, columns])
        gram = whitened.T @ whitened
        square, vector, matrix = float(gram[0, 0]), gram[1:, 0], gram[1:, 1:]
        pull = vector[:p] - matrix[:p, p:] @ b
        gradient = self.precision @ (z - self.centre)
        gradient -= forward(self.root, pull, transposed=True)
        held = ~free_of(z, gradient, self.low, self.high)
        held[: self.free] = False
        use = np.append(~held, np.ones(self.group.size, dtype=bool))
        log_noise = 2.0 * factor.half_log
        if self.response is not None:
            log_noise += self.response.log_noise
        normal = Normal(matrix[np.ix_(use, use)], vector[use], square, log_noise, left.size)
        prior = self._prior(forward(self.root, self.centre - z)).of(use)
        solution = solve(normal, prior, variances, rounds)
        moved = np.zeros(p)
        moved[~held] = solution.coefficients[: p - held.sum()]
        top = z + self.root @ moved
        bounds = self._of_bounds(z, top, held, use, matrix, vector, solution)
        return solution.log_evidence + bounds, solution, top

    def remaining(self, linear: Linear, solution: Solution, top: Floats) -> Floats:
        """Give what parameters and nuisances leave at the top of a linear problem, (rows,)."""
        b = solution.coefficients[-self.group.size :]
        return linear.left - linear.slopes @ (top - linear.z) - linear.columns @ b

    def posterior(self, linear: Linear, factor: Factor, variances: Floats) -> Floats:
        """Covariance of the searched parameters about a point, nuisances free."""
        j, own = self.white(factor, linear.slopes), self.white(factor, linear.columns)
        inner = own.T @ own + np.diag(1.0 / self.spread(variances))
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
        if not self.slots:
            return 0.0
        k = slice(self.free, self.parameters)
        low, high = ((edge[k] - self.centre[k]) / self.sd for edge in (self.low, self.high))
        inside = np.exp(log_ndtr(high)) - np.exp(log_ndtr(low))
        total = -float(np.sum(np.log(np.maximum(inside, 1e-12))))
        covariance, free = solution.covariance(), ~held[k]
        at = np.cumsum(use)[k][free] - 1
        error = self.sd[free] * np.sqrt(np.diag(covariance)[at])
        for room in (top - self.low)[k][free], (self.high - top)[k][free]:
            total += float(np.sum(log_ndtr(room / error)))
        # Of what is held a one-sided integral, in units of its prior, all others following.
        away = ((z - self.centre)[k] / self.sd)[held[k]]
        mine = np.flatnonzero(held)
        beside = matrix[mine][:, use]
        curvature = np.diag(matrix)[mine] + 1.0 - np.sum(beside @ covariance * beside, axis=1)
        curvature = np.maximum(curvature, 1.0)  # the prior's: less is rounding
        slope = np.abs(away - vector[mine] + beside @ solution.coefficients)
        logs = 0.5 * np.log(np.pi / (2.0 * curvature)) - 0.5 * np.log(2.0 * np.pi) - 0.5 * away**2
        return total + float(np.sum(logs + np.log(erfcx(slope / np.sqrt(2.0 * curvature)))))


def slots_of(ids: Sequence[str], reach: Reach) -> list[Slot]:
    """List what is searched of some effects."""
    return [
        Slot(parameter.at(reach), LIBRARY[name].first + k)
        for name in ids
        if LIBRARY[name].port == "chain"
        for k, parameter in enumerate(LIBRARY[name].parameters)
    ]


def starts(problem: Explained, first: Floats, delays: Sequence[float] = ()) -> list[Floats]:
    """List starting points: each effect's own beside what is searched before; `delays` of a delay.

    Parameters
    ----------
    problem : Explained
        The problem.
    first : array
        What begins with the parameters that are searched before the effects'.
    delays : sequence of float, optional
        Where a delay may begin, s.
    """
    points = [first[: problem.free]]
    for slot in problem.slots:
        every = slot.parameter.starts
        if delays and slot.parameter.is_delay:
            every = (*(v for v in every if v == 0.0), *delays)
        points = [np.append(point, slot.searched(v)) for point in points for v in every]
    return points
