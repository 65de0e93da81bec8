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
from spa_fo.arrays import Floats
from spa_fo.fractional import (
    WORK_ROWS,
    MapArrays,
    ResponseMap,
    response_on_map,
    step_map,
)
from spa_fo.identify.bounds import Bounds, free_bounds
from spa_fo.identify.fitness import reduce_data
from spa_fo.identify.levenberg_marquardt import levenberg_marquardt, parameters_at
from spa_fo.identify.protocol import StepData
from spa_fo.identify.small_swarm import small_swarm
from spa_fo.plant.paper import SWARM_ATTRACTION
from spa_fo.plant.transfer_function import TransferFunction

PARTICLES = 40
ITERATIONS = 10
LOSSES = ("linear", "huber", "soft_l1")
"""Least squares, and two robust losses by iteratively reweighted least squares."""
HUBER_TUNING = 1.345
"""Residuals beyond this many standard deviations count less: 95 % efficiency on normal errors."""

_REWEIGHTINGS = 20


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
    evaluations = small_swarm(
        lower, upper, gain, swarm_start, swarm_moves, mean, weight, arrays, work, y, z
    )
    squares, used, valid = levenberg_marquardt(
        z, lower, upper, gain, mean, weight, arrays, work, y, jacobian
    )
    evaluations += used
    if not np.isnan(start[0]):
        other = start.copy()
        other_squares, used, other_valid = levenberg_marquardt(
            other, lower, upper, gain, mean, weight, arrays, work, y, jacobian
        )
        evaluations += used
        if other_squares < squares:
            z[:] = other
            squares, valid = other_squares, other_valid

    if loss > 0:
        for _ in range(_REWEIGHTINGS):
            before = z.copy()
            parameters_at(z, x)
            response_on_map(x, arrays, work, y)
            _reweight(angle, u, counts, y, loss, w)
            constant = reduce_data(angle, u, w, mean, weight)
            squares, used, valid = levenberg_marquardt(
                z, lower, upper, gain, mean, weight, arrays, work, y, jacobian
            )
            evaluations += used + 1
            if np.max(np.abs(z - before)) < 1e-6:
                break
    parameters_at(z, x)
    return squares + constant, evaluations, valid


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
