"""Least squares with bounds, to the end: Levenberg-Marquardt with an active set.

A parameter on its bound whose gradient points outward leaves the solve; a step is cut at the first
bound that it meets. The damping follows the gain ratio (Nielsen 1999). The search ends where the
Newton decrement of the free parameters, half of what a full step would gain, is below a limit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

Floats = NDArray[np.float64]


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
    """
    z = np.clip(start, low, high)
    at = quadratic(z)
    damping, growth, tried, rejected = 1e-3, 2.0, 0, 0
    while True:
        free = free_of(z, at.gradient, low, high)
        left = decrement(at, free)
        if left < enough or tried >= most:
            return Minimum(z, at, left, tried, rejected)
        step = _step(z, at, free, damping, low, high)
        there = np.clip(z + step, low, high)
        moved = there - z
        predicted = -float(at.gradient @ moved) - 0.5 * float(moved @ at.hessian @ moved)
        tried += 1
        gained = at.value - value(there)
        if gained > 0.0 and np.isfinite(gained):
            ratio = gained / max(predicted, 1e-12)
            damping *= max(0.1, 1.0 - (2.0 * min(ratio, 2.0) - 1.0) ** 3)
            growth = 2.0
            z, at = there, quadratic(there)
        else:
            rejected += 1
            damping *= growth
            growth *= 2.0
            if float(np.max(np.abs(moved))) < 1e-9:
                return Minimum(z, at, left, tried, rejected)


def _step(
    z: Floats,
    at: Quadratic,
    free: NDArray[np.bool_],
    damping: float,
    low: Floats,
    high: Floats,
) -> Floats:
    """Solve for a damped step; what meets its bound stops there, and the others are solved anew."""
    step = np.zeros_like(z)
    open_ = free.copy()
    for _ in range(z.size):
        h = at.hessian[np.ix_(open_, open_)].copy()
        h[np.diag_indices_from(h)] *= 1.0 + damping
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
