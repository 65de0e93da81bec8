"""The optimum of the least squares: a small swarm, then Levenberg-Marquardt, all compiled.

The swarm (40 x 10) moves in (alpha2, alpha1, ln a1, ln a0); b0 enters linearly and is projected
out. Levenberg-Marquardt (Marquardt 1963, doi:10.1137/0111030, with Nielsen's damping) takes the
best position on in all five, coefficients as logarithms, with the analytic Jacobian. The box is
kept by an active set: a parameter on its bound whose gradient points outwards stays there.
Many fits (subsets, bootstrap, profiles) run in one kernel, one fit an iteration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from spa_fo._jit import njit, njit_parallel
from spa_fo.fractional import (
    WORK_ROWS,
    MapArrays,
    ResponseMap,
    jacobian_on_map,
    response_on_map,
    step_map,
)
from spa_fo.identify.bounds import ORDER_GAP, Bounds, free_bounds
from spa_fo.identify.fitness import reduce_data, weighted_squares
from spa_fo.identify.protocol import StepData
from spa_fo.plant.paper import SWARM_ATTRACTION, SWARM_INERTIA
from spa_fo.plant.transfer_function import TransferFunction

Floats = NDArray[np.float64]

PARTICLES = 40
ITERATIONS = 10
LOSSES = ("linear", "huber", "soft_l1")
"""Least squares, and two robust losses by iteratively reweighted least squares."""
HUBER_TUNING = 1.345
"""Residuals beyond this many standard deviations count less: 95 % efficiency on normal errors."""

_LM_ITERATIONS = 300
_REWEIGHTINGS = 20
# A step that lowers the sum of squares by less than this fraction is the last.
_LAST_GAIN = 1e-10
# Geodesic acceleration (Transtrum and Sethna 2012, arXiv:1201.5885): where along the step the
# curvature is probed, and how large the acceleration may be beside the step.
_PROBE = 0.1
_BEND = 0.75


@dataclass(frozen=True)
class Optimum:
    """The least squares of one dataset.

    Attributes
    ----------
    x : (5,) array
        In the order of `PARAMETERS`.
    rmse : float
        Over all samples, rad; with a robust loss, over the samples as weighted.
    sum_squares : float
        rad², weighted likewise.
    evaluations : int
        Responses and Jacobians computed.
    at_bounds : tuple of str
        Bounds that the optimum lies on, such as ``"a0 upper"``.
    valid : bool
        Whether the iteration ended because nothing was left to gain.
    bounds : Bounds
        Of the search.
    """

    x: Floats
    rmse: float
    sum_squares: float
    evaluations: int
    at_bounds: tuple[str, ...]
    valid: bool
    bounds: Bounds

    @property
    def transfer_function(self) -> TransferFunction:
        """The model."""
        return TransferFunction.from_array(self.x)


@dataclass(frozen=True)
class Fits:
    """Results of many fits: x (fits, 5), sum of squares (fits,), evaluations, valid."""

    x: Floats
    sum_squares: Floats
    evaluations: NDArray[np.int64]
    valid: NDArray[np.bool_]


@dataclass(frozen=True)
class Draws:
    """Random numbers of the small swarm: start (p, 4), moves (iterations, 2, p, 4)."""

    start: Floats
    moves: Floats

    @classmethod
    def from_seed(
        cls, seed: int, particles: int = PARTICLES, iterations: int = ITERATIONS
    ) -> Draws:
        """Draw them all at once, before anything runs in parallel."""
        generator = np.random.default_rng(seed)
        return cls(
            generator.random((particles, 4)),
            SWARM_ATTRACTION * generator.random((iterations, 2, particles, 4)),
        )


def fit_optimum(
    data: StepData, bounds: Bounds | None = None, seed: int = 1, loss: str = "linear"
) -> Optimum:
    """Find the least squares (or robust) fit of step responses.

    Parameters
    ----------
    data : StepData
        Step responses.
    bounds : Bounds, optional
        `free_bounds` unless given.
    seed : int
        Of the small swarm.
    loss : {"linear", "huber", "soft_l1"}
        Robust losses downweight residuals beyond 1.345 robust standard deviations.
    """
    bounds = free_bounds() if bounds is None else bounds
    fits = fit_many(step_map(data.t), data, bounds, Draws.from_seed(seed), loss=loss)
    # Searched as logarithms, a coefficient on its bound comes back a last digit beside it.
    x = np.clip(fits.x[0], bounds.lower, bounds.upper)
    squares = float(fits.sum_squares[0])
    return Optimum(
        x=x,
        rmse=float(np.sqrt(squares / data.angle_rad.size)),
        sum_squares=squares,
        evaluations=int(fits.evaluations[0]),
        at_bounds=bounds.touched(x),
        valid=bool(fits.valid[0]),
        bounds=bounds,
    )


def fit_many(
    response: ResponseMap,
    data: StepData,
    bounds: Bounds,
    draws: Draws,
    *,
    counts: Floats | None = None,
    angles: Floats | None = None,
    variant: NDArray[np.int64] | None = None,
    lower: Floats | None = None,
    upper: Floats | None = None,
    gain: Floats | None = None,
    start: Floats | None = None,
    loss: str = "linear",
) -> Fits:
    """Run many fits of the same datasets at once.

    Parameters
    ----------
    response : ResponseMap
        `step_map` of the data's times.
    data : StepData
        Step responses.
    bounds : Bounds
        Of every fit unless `lower` and `upper` say otherwise.
    draws : Draws
        Shared by all fits.
    counts : (fits, datasets) array, optional
        How often each dataset counts in each fit; all once.
    angles : (variants, datasets, points) array, optional
        Angles in rad in place of the data's own.
    variant : (fits,) int array, optional
        Which of `angles` each fit takes; the first.
    lower, upper : (fits, 5) arrays, optional
        Bounds of each fit. Where both are equal, the parameter is held.
    gain : (fits,) array, optional
        Static gain b0/a0 to hold, NaN where it is free; held, the bounds of b0 do not apply.
    start : (fits, 5) array, optional
        A further starting point for each fit.
    loss : {"linear", "huber", "soft_l1"}
        See `fit_optimum`.
    """
    if loss not in LOSSES:
        raise ValueError(f"expected a loss of {', '.join(LOSSES)}, not {loss!r}")
    given = [a.shape[0] for a in (counts, variant, lower, upper, gain, start) if a is not None]
    fits = max(given, default=1)
    counts = np.ones((fits, data.datasets)) if counts is None else counts
    angles = data.angle_rad[np.newaxis] if angles is None else angles
    variant = np.zeros(fits, dtype=np.int64) if variant is None else variant
    lower = np.tile(bounds.lower, (fits, 1)) if lower is None else lower
    upper = np.tile(bounds.upper, (fits, 1)) if upper is None else upper
    gain = np.full(fits, np.nan) if gain is None else gain
    start = np.full((fits, 5), np.nan) if start is None else start
    x = np.empty((fits, 5))
    squares = np.empty(fits)
    evaluations = np.empty(fits, dtype=np.int64)
    valid = np.empty(fits, dtype=np.bool_)
    angles = np.ascontiguousarray(angles, dtype=np.float64)
    counts = np.ascontiguousarray(counts, dtype=np.float64)
    lower, upper, start = _coordinates(lower), _coordinates(upper), _coordinates(start)
    common = (draws.start, draws.moves, LOSSES.index(loss), response.arrays)
    if fits == 1:
        # Without waking the other threads, which may take longer than the fit.
        squares[0], evaluations[0], valid[0] = _fit_one(
            angles[variant[0]],
            data.u,
            counts[0],
            lower[0],
            upper[0],
            gain[0],
            start[0],
            *common,
            x[0],
        )
    else:
        _fit_many(
            angles,
            data.u,
            counts,
            variant,
            lower,
            upper,
            gain,
            start,
            *common,
            x,
            squares,
            evaluations,
            valid,
        )
    return Fits(x, squares, evaluations, valid)


def _coordinates(x: Floats) -> Floats:
    """Orders as they are, coefficients as logarithms."""
    z = np.array(x, dtype=np.float64)
    z[..., 2:] = np.log(z[..., 2:])
    return z


@njit_parallel
def _fit_many(
    angles: np.ndarray,
    u: np.ndarray,
    counts: np.ndarray,
    variant: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    gain: np.ndarray,
    start: np.ndarray,
    swarm_start: np.ndarray,
    swarm_moves: np.ndarray,
    loss: int,
    arrays: MapArrays,
    x: np.ndarray,
    squares: np.ndarray,
    evaluations: np.ndarray,
    valid: np.ndarray,
) -> None:
    for f in numba.prange(x.shape[0]):
        squares[f], evaluations[f], valid[f] = _fit_one(
            angles[variant[f]],
            u,
            counts[f],
            lower[f],
            upper[f],
            gain[f],
            start[f],
            swarm_start,
            swarm_moves,
            loss,
            arrays,
            x[f],
        )


@njit
def _fit_one(
    angle: np.ndarray,
    u: np.ndarray,
    counts: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    gain: float,
    start: np.ndarray,
    swarm_start: np.ndarray,
    swarm_moves: np.ndarray,
    loss: int,
    arrays: MapArrays,
    x: np.ndarray,
) -> tuple[float, int, bool]:
    """Swarm, polish and, for a robust loss, reweight; fills `x` (5,)."""
    datasets, n = angle.shape
    w = np.empty((datasets, n))
    mean, weight, y = np.empty(n), np.empty(n), np.empty(n)
    work = np.empty((WORK_ROWS, arrays.real.size))
    jacobian = np.empty((5, n))
    for d in range(datasets):
        w[d, :] = counts[d]
    constant = reduce_data(angle, u, w, mean, weight)

    z = np.empty(5)
    evaluations = _small_swarm(
        lower, upper, gain, swarm_start, swarm_moves, mean, weight, arrays, work, y, z
    )
    squares, used, valid = _levenberg_marquardt(
        z, lower, upper, gain, mean, weight, arrays, work, y, jacobian
    )
    evaluations += used
    if not np.isnan(start[0]):
        other = start.copy()
        other_squares, used, other_valid = _levenberg_marquardt(
            other, lower, upper, gain, mean, weight, arrays, work, y, jacobian
        )
        evaluations += used
        if other_squares < squares:
            z[:] = other
            squares, valid = other_squares, other_valid

    if loss > 0:
        for _ in range(_REWEIGHTINGS):
            before = z.copy()
            _parameters(z, x)
            response_on_map(x, arrays, work, y)
            _reweight(angle, u, counts, y, loss, w)
            constant = reduce_data(angle, u, w, mean, weight)
            squares, used, valid = _levenberg_marquardt(
                z, lower, upper, gain, mean, weight, arrays, work, y, jacobian
            )
            evaluations += used + 1
            if np.max(np.abs(z - before)) < 1e-6:
                break
    _parameters(z, x)
    return squares + constant, evaluations, valid


@njit
def _parameters(z: np.ndarray, x: np.ndarray) -> None:
    x[0], x[1] = z[0], z[1]
    for i in range(2, 5):
        x[i] = np.exp(z[i])


@njit
def _reweight(
    angle: np.ndarray,
    u: np.ndarray,
    counts: np.ndarray,
    y: np.ndarray,
    loss: int,
    w: np.ndarray,
) -> None:
    """Weights of Huber's loss (1) or the smooth l1 (2) on the scale of the residuals' MAD."""
    datasets, n = angle.shape
    sizes = np.empty(datasets * n)
    used = 0
    for d in range(datasets):
        if counts[d] > 0.0:
            for j in range(n):
                sizes[used] = abs(angle[d, j] - u[d] * y[j])
                used += 1
    limit = HUBER_TUNING * 1.4826 * np.median(sizes[:used]) + 1e-300
    for d in range(datasets):
        for j in range(n):
            r = abs(angle[d, j] - u[d] * y[j]) / limit
            factor = 1.0 / max(r, 1.0) if loss == 1 else 1.0 / np.sqrt(1.0 + r * r)
            w[d, j] = counts[d] * factor


@njit
def _small_swarm(
    lower: np.ndarray,
    upper: np.ndarray,
    gain: float,
    start: np.ndarray,
    moves: np.ndarray,
    mean: np.ndarray,
    weight: np.ndarray,
    arrays: MapArrays,
    work: np.ndarray,
    y: np.ndarray,
    z: np.ndarray,
) -> int:
    """Fill `z` (5,) with the best position of the swarm; return the number of evaluations."""
    particles = start.shape[0]
    position = np.empty((particles, 4))
    velocity = np.zeros((particles, 4))
    best = np.empty((particles, 4))
    best_squares = np.full(particles, np.inf)
    x = np.empty(5)
    evaluations = 0
    leader = 0
    for p in range(particles):
        for i in range(4):
            position[p, i] = lower[i] + start[p, i] * (upper[i] - lower[i])
        # Both orders from the triangle alpha1 < alpha2, where there is a choice.
        room = position[p, 0] - ORDER_GAP
        if position[p, 1] > room:
            position[p, 1] = lower[1] + start[p, 1] * max(min(room, upper[1]) - lower[1], 0.0)
        best[p] = position[p]
    z[4] = 0.5 * (lower[4] + upper[4])
    z[:4] = best[0]
    for k in range(moves.shape[0] + 1):
        for p in range(particles):
            if k > 0:
                for i in range(4):
                    velocity[p, i] = (
                        SWARM_INERTIA * velocity[p, i]
                        + moves[k - 1, 0, p, i] * (best[p, i] - position[p, i])
                        + moves[k - 1, 1, p, i] * (best[leader, i] - position[p, i])
                    )
                    position[p, i] += velocity[p, i]
            inside = position[p, 0] - position[p, 1] >= ORDER_GAP
            for i in range(4):
                inside = inside and lower[i] <= position[p, i] <= upper[i]
            if not inside:
                continue
            x[0], x[1] = position[p, 0], position[p, 1]
            x[2], x[3], x[4] = np.exp(position[p, 2]), np.exp(position[p, 3]), 1.0
            response_on_map(x, arrays, work, y)
            evaluations += 1
            top, bottom = 0.0, 0.0
            for j in range(y.size):
                top += weight[j] * y[j] * mean[j]
                bottom += weight[j] * y[j] * y[j]
            if np.isnan(gain):
                b0 = top / bottom if bottom > 0.0 else 0.0
                b0 = min(max(b0, np.exp(lower[4])), np.exp(upper[4]))
            else:
                b0 = gain * x[3]
            squares = 0.0
            for j in range(y.size):
                squares += weight[j] * (b0 * y[j] - mean[j]) ** 2
            if squares < best_squares[p]:
                best_squares[p] = squares
                best[p] = position[p]
                if squares <= best_squares[leader]:
                    leader = p
                    z[:4] = position[p]
                    z[4] = np.log(b0)
    return evaluations


@njit
def _into_box(z: np.ndarray, lower: np.ndarray, upper: np.ndarray, gain: float) -> None:
    """Move `z` to the nearest place that the bounds, the order of orders and the gain allow."""
    for i in range(5):
        z[i] = min(max(z[i], lower[i]), upper[i])
    if z[1] > z[0] - ORDER_GAP:
        z[1] = max(z[0] - ORDER_GAP, lower[1])
        z[0] = max(z[0], z[1] + ORDER_GAP)
    if not np.isnan(gain):
        z[4] = z[3] + np.log(gain)


@njit
def _levenberg_marquardt(
    z: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    gain: float,
    mean: np.ndarray,
    weight: np.ndarray,
    arrays: MapArrays,
    work: np.ndarray,
    y: np.ndarray,
    jacobian: np.ndarray,
) -> tuple[float, int, bool]:
    """Improve `z` (5,) in place; return the sum of squares, the evaluations, whether it ended."""
    n = y.size
    x, trial, step = np.empty(5), np.empty(5), np.empty(5)
    hessian, factor, gradient = np.empty((5, 5)), np.empty((5, 5)), np.empty(5)
    curvature, bent = np.empty(5), np.empty(5)
    trial_y, probe = np.empty(n), np.empty(n)
    free = np.empty(5, np.bool_)
    held = not np.isnan(gain)
    _into_box(z, lower, upper, gain)
    _parameters(z, x)
    response_on_map(x, arrays, work, y)
    squares = weighted_squares(y, mean, weight)
    evaluations = 1
    damping, growth = 1e-3, 2.0
    for _ in range(_LM_ITERATIONS):
        jacobian_on_map(x, arrays, work, jacobian)
        evaluations += 1
        for j in range(n):
            jacobian[2, j] *= x[2]
            jacobian[3, j] *= x[3]
            jacobian[4, j] *= x[4]
            if held:
                jacobian[3, j] += jacobian[4, j]
        for i in range(5):
            total = 0.0
            for j in range(n):
                total += weight[j] * jacobian[i, j] * (y[j] - mean[j])
            gradient[i] = total
        # alpha1 against alpha2: where it wants to pass, both move together.
        touching = z[1] >= z[0] - ORDER_GAP - 1e-12
        tied = touching and gradient[1] < 0.0
        if tied:
            gradient[0] += gradient[1]
            for j in range(n):
                jacobian[0, j] += jacobian[1, j]
        for i in range(5):
            free[i] = not (
                (z[i] <= lower[i] and gradient[i] >= 0.0)
                or (z[i] >= upper[i] and gradient[i] <= 0.0)
            )
        if held:
            free[4] = False
        if tied:
            free[1] = False
        for i in range(5):
            for k in range(i + 1):
                total = 0.0
                for j in range(n):
                    total += weight[j] * jacobian[i, j] * jacobian[k, j]
                hessian[i, k] = total
                hessian[k, i] = total

        improved = False
        gained = 0.0
        while damping < 1e15:
            _factorise(hessian, free, damping, factor)
            _solve(factor, gradient, free, step)
            # Geodesic acceleration: along a curved valley a straight step must be short.
            for i in range(5):
                trial[i] = z[i] + _PROBE * step[i]
            if tied:
                trial[1] = z[1] + _PROBE * step[0]
            if held:
                trial[4] = z[4] + _PROBE * step[3]
            _parameters(trial, x)
            response_on_map(x, arrays, work, probe)
            evaluations += 1
            for i in range(5):
                total = 0.0
                if free[i]:
                    for j in range(n):
                        bend = (probe[j] - y[j]) / _PROBE
                        for k in range(5):
                            bend -= jacobian[k, j] * step[k]
                        total += weight[j] * jacobian[i, j] * bend
                curvature[i] = total * 2.0 / _PROBE
            _solve(factor, curvature, free, bent)
            along, across = 0.0, 0.0
            for i in range(5):
                along += hessian[i, i] * step[i] ** 2
                across += hessian[i, i] * bent[i] ** 2
            share = 0.5 if 4.0 * across <= _BEND**2 * along else 0.0
            for i in range(5):
                trial[i] = z[i] + step[i] + share * bent[i]
            if tied:
                trial[1] = trial[0] - ORDER_GAP
            _into_box(trial, lower, upper, gain)
            _parameters(trial, x)
            response_on_map(x, arrays, work, trial_y)
            evaluations += 1
            new = weighted_squares(trial_y, mean, weight)
            if new < squares:
                # Gain against the quadratic model at the step really taken.
                expected = 0.0
                for i in range(5):
                    if free[i]:
                        move = trial[i] - z[i]
                        expected -= 2.0 * gradient[i] * move
                        for k in range(5):
                            if free[k]:
                                expected -= move * hessian[i, k] * (trial[k] - z[k])
                ratio = (squares - new) / expected if expected > 0.0 else 0.0
                damping *= max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3) if ratio < 1.0 else 0.1
                growth = 2.0
                gained = squares - new
                squares = new
                z[:] = trial
                y[:] = trial_y
                improved = True
                break
            damping *= growth
            growth *= 2.0
        if not improved:
            # Nothing lower along the gradient: a minimum, to rounding.
            _parameters(z, x)
            return squares, evaluations, True
        if gained <= _LAST_GAIN * squares and damping < 1.0:
            return squares, evaluations, True
    return squares, evaluations, False


@njit
def _factorise(hessian: np.ndarray, free: np.ndarray, damping: float, factor: np.ndarray) -> None:
    """Cholesky factor of H + damping diag H, over the free parameters."""
    for i in range(5):
        for k in range(i + 1):
            if not (free[i] and free[k]):
                continue
            total = hessian[i, k]
            if i == k:
                total += damping * hessian[i, i]
            for m in range(k):
                if free[m]:
                    total -= factor[i, m] * factor[k, m]
            if i == k:
                # Rounding may eat a tiny pivot.
                factor[i, i] = np.sqrt(max(total, 1e-16 * hessian[i, i] + 1e-300))
            else:
                factor[i, k] = total / factor[k, k]


@njit
def _solve(factor: np.ndarray, gradient: np.ndarray, free: np.ndarray, step: np.ndarray) -> None:
    """Solve for minus the gradient; the step of a parameter that is not free is 0."""
    for i in range(5):
        step[i] = 0.0
        if free[i]:
            total = -gradient[i]
            for m in range(i):
                if free[m]:
                    total -= factor[i, m] * step[m]
            step[i] = total / factor[i, i]
    for i in range(4, -1, -1):
        if free[i]:
            total = step[i]
            for m in range(i + 1, 5):
                if free[m]:
                    total -= factor[m, i] * step[m]
            step[i] = total / factor[i, i]
