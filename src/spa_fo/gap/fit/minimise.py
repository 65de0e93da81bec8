"""Least squares with bounds, to the end: Levenberg-Marquardt with an active set.

A parameter on its bound whose gradient points outward leaves the solve; a step is cut at the first
bound that it meets. The damping follows the gain ratio (Nielsen 1999), against what is plausible
beforehand. A step is bent along the valley that it follows (geodesic acceleration,
doi:10.1103/PhysRevE.83.036701), as coefficients of one response lie in a narrow and curved one. The
search ends where the Newton decrement of the free parameters, half of what a full step would gain,
is below a limit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Floats = NDArray[np.float64]

_DAMPING = 5.0  # where it starts, against the prior: few points are rejected, and few needed
_MOST_BENT = 0.75
"""Longest acceleration, as a share of its step, that is still to be trusted (there, section IV)."""


@dataclass(frozen=True)
class Quadratic:
    """Half the squared misfit at a point: its value, gradient and Gauss-Newton Hessian."""

    value: float
    gradient: Floats
    hessian: Floats


@dataclass(frozen=True)
class Minimum:
    """Where a search ended.

    Attributes
    ----------
    z : (p,) array
        The point.
    at : Quadratic
        There.
    decrement : float
        What a full step of the free parameters would still gain.
    tried, rejected : int
        Points that were tried, and that were no better.
    """

    z: Floats
    at: Quadratic
    decrement: float
    tried: int
    rejected: int


def free_of(z: Floats, gradient: Floats, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Say which parameters may move: those that no bound holds against the gradient."""
    return ~(((z <= low) & (gradient > 0.0)) | ((z >= high) & (gradient < 0.0)))


def decrement(at: Quadratic, free: NDArray[np.bool_]) -> float:
    """Half the squared Newton decrement of the free parameters."""
    if not free.any():
        return 0.0
    g = at.gradient[free]
    h = at.hessian[np.ix_(free, free)]
    return 0.5 * float(g @ cho_solve(cho_factor(h, lower=True), g))


def minimise(
    value: Callable[[Floats], float],
    quadratic: Callable[[Floats], Quadratic],
    start: Floats,
    low: Floats,
    high: Floats,
    enough: float,
    most: int,
    metric: Floats,
    bend: Callable[[Floats, Floats], Floats] | None = None,
) -> Minimum:
    """Search from `start`, which is moved to within the bounds first.

    Parameters
    ----------
    value : callable
        Half the squared misfit at a point.
    quadratic : callable
        The same with its slopes.
    start, low, high : (p,) arrays
        Where to begin, and the bounds.
    enough : float
        The search ends where a full step would gain less.
    most : int
        Points that may be tried.
    metric : (p, p) array
        What is plausible of the parameters, as a precision: steps are damped by it.
    bend : callable, optional
        From the last point that was looked at and a step: slopes of the residual, transposed, times
        its second derivative along that step.
    """
    z = np.clip(start, low, high)
    at = quadratic(z)
    damping, growth, tried, rejected = _DAMPING, 2.0, 0, 0
    while True:
        free = free_of(z, at.gradient, low, high)
        left = decrement(at, free)
        if left < enough or tried >= most:
            return Minimum(z, at, left, tried, rejected)
        step = _step(z, at, free, damping, metric, low, high)
        moved = np.clip(z + step, low, high) - z
        if bend is not None:
            moved = _bent(z, moved, bend(z, moved), at, damping, metric, low, high)
        there = z + moved
        predicted = -float(at.gradient @ moved) - 0.5 * float(moved @ at.hessian @ moved)
        tried += 1
        gained = at.value - value(there)
        if gained > 0.0 and np.isfinite(gained):
            ratio = gained / max(predicted, 1e-12)
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * min(ratio, 2.0) - 1.0) ** 3)
            growth = 2.0
            z, at = there, quadratic(there)
        else:
            rejected += 1
            damping *= growth
            growth *= 2.0
            if float(np.max(np.abs(moved))) < 1e-9:
                return Minimum(z, at, left, tried, rejected)


def _bent(
    z: Floats,
    step: Floats,
    pull: Floats,
    at: Quadratic,
    damping: float,
    metric: Floats,
    low: Floats,
    high: Floats,
) -> Floats:
    """Add half the acceleration to a step, where it is small against it."""
    open_ = (step != 0.0) & (z + step > low) & (z + step < high)
    if not open_.any():
        return step
    h = at.hessian[np.ix_(open_, open_)].copy()
    h += damping * metric[np.ix_(open_, open_)]
    bent = -0.5 * cho_solve(cho_factor(h, lower=True), pull[open_])
    along = step[open_]
    if bent @ h @ bent > (_MOST_BENT / 2.0) ** 2 * (along @ h @ along):
        return step
    out = step.copy()
    out[open_] += bent
    return np.asarray(np.clip(z + out, low, high) - z)


def _step(
    z: Floats,
    at: Quadratic,
    free: NDArray[np.bool_],
    damping: float,
    metric: Floats,
    low: Floats,
    high: Floats,
) -> Floats:
    """Solve for a damped step; what meets its bound stops there, and the others are solved anew."""
    step = np.zeros_like(z)
    open_ = free.copy()
    for _ in range(z.size):
        h = at.hessian[np.ix_(open_, open_)].copy()
        h += damping * metric[np.ix_(open_, open_)]
        right = -at.gradient[open_] - at.hessian[np.ix_(open_, ~open_)] @ step[~open_]
        trial = step.copy()
        trial[open_] = cho_solve(cho_factor(h, lower=True), right)
        there = z + trial
        beyond = open_ & ((there < low) | (there > high))
        if not beyond.any():
            return trial
        step[beyond] = np.clip(there, low, high)[beyond] - z[beyond]
        open_ &= ~beyond
        if not open_.any():
            break
    return step
