"""The objective: root mean square error of the step responses, Eq. 17-19 of arXiv:2512.18213.

All datasets share the time grid and differ in the height u_d of the step, so that with weights w

    sum_dj w_dj (θ_dj − u_d y_j)² = sum_j W_j (y_j − m_j)² + const,
    W_j = sum_d w_dj u_d²,   m_j = sum_d w_dj u_d θ_dj / W_j:

one evaluation of the unit step response y serves all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

from spa_fo._jit import njit, njit_parallel
from spa_fo.arrays import Floats
from spa_fo.fractional import WORK_ROWS, MapArrays, response_on_map
from spa_fo.identify.protocol import StepData


class Target(NamedTuple):
    """Weighted mean response to a unit step: all that a fit needs of the data.

    Attributes
    ----------
    mean : (n,) array
        m_j in rad.
    weight : (n,) array
        W_j.
    constant : float
        Part of the sum of squares that no model can remove, rad².
    samples : float
        Number of samples, the sum of the weights w.
    """

    mean: Floats
    weight: Floats
    constant: float
    samples: float


def target_of(data: StepData) -> Target:
    """Reduce step responses of equal weight to one target."""
    mean, weight = np.empty(data.points), np.empty(data.points)
    ones = np.ones_like(data.angle_rad)
    constant = reduce_data(data.angle_rad, data.u, ones, mean, weight)
    return Target(mean, weight, float(constant), float(data.angle_rad.size))


@njit
def reduce_data(
    angle: np.ndarray, u: np.ndarray, w: np.ndarray, mean: np.ndarray, weight: np.ndarray
) -> float:
    """Fill `mean` and `weight` (n,) from `angle` and `w` (d, n); return the constant."""
    datasets, n = angle.shape
    constant = 0.0
    for j in range(n):
        top, bottom = 0.0, 0.0
        for d in range(datasets):
            top += w[d, j] * u[d] * angle[d, j]
            bottom += w[d, j] * u[d] * u[d]
        mean[j] = top / bottom if bottom > 0.0 else 0.0
        weight[j] = bottom
        for d in range(datasets):
            constant += w[d, j] * (angle[d, j] - u[d] * mean[j]) ** 2
    return constant


@njit
def weighted_squares(y: np.ndarray, mean: np.ndarray, weight: np.ndarray) -> float:
    """Sum W (y − m)²."""
    total = 0.0
    for j in range(y.size):
        total += weight[j] * (y[j] - mean[j]) ** 2
    return total


@njit
def rmse_at(
    x: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    target: Target,
    arrays: MapArrays,
    work: np.ndarray,
    y: np.ndarray,
) -> float:
    """Fitness of one particle in rad; infinite outside the box and where alpha1 >= alpha2."""
    for i in range(5):
        if not lower[i] <= x[i] <= upper[i]:
            return np.inf
    if x[1] >= x[0]:
        return np.inf
    response_on_map(x, arrays, work, y)
    squares = weighted_squares(y, target.mean, target.weight) + target.constant
    return float(np.sqrt(squares / target.samples))


@njit_parallel
def swarm_rmse(
    positions: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    target: Target,
    arrays: MapArrays,
    out: np.ndarray,
) -> None:
    """Fitness of a whole swarm, `positions` (p, 5) to `out` (p,): one particle an iteration."""
    for i in numba.prange(positions.shape[0]):
        work = np.empty((WORK_ROWS, arrays.real.size))
        y = np.empty(target.mean.size)
        out[i] = rmse_at(positions[i], lower, upper, target, arrays, work, y)
