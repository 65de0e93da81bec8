"""A small swarm that finds where Levenberg-Marquardt begins, compiled.

It moves in (alpha2, alpha1, ln a1, ln a0); b0 enters linearly and is projected out.
"""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.fractional import MapArrays, response_on_map
from spa_fo.identify.bounds import ORDER_GAP
from spa_fo.plant.paper import SWARM_INERTIA


@njit
def small_swarm(
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
