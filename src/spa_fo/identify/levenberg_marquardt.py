"""Levenberg-Marquardt in a box, compiled: the last steps of a fit (Marquardt 1963, Nielsen 1999).

doi:10.1137/0111030. All five coefficients move, as orders and logarithms, with the analytic
Jacobian. The box is kept by an active set: a parameter on its bound whose gradient points outwards
stays there.
"""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.fractional import MapArrays, jacobian_on_map, response_on_map
from spa_fo.identify.bounds import ORDER_GAP
from spa_fo.identify.fitness import weighted_squares

_LM_ITERATIONS = 300
# A step that lowers the sum of squares by less than this fraction is the last.
_LAST_GAIN = 1e-10
# Geodesic acceleration (Transtrum and Sethna 2012, arXiv:1201.5885): where along the step the
# curvature is probed, and how large the acceleration may be beside the step.
_PROBE = 0.1
_BEND = 0.75


@njit
def parameters_at(z: np.ndarray, x: np.ndarray) -> None:
    """Turn searched coordinates into the five coefficients, in place."""
    x[0], x[1] = z[0], z[1]
    for i in range(2, 5):
        x[i] = np.exp(z[i])


@njit
def into_box(z: np.ndarray, lower: np.ndarray, upper: np.ndarray, gain: float) -> None:
    """Move `z` to the nearest place that the bounds, the order of orders and the gain allow."""
    for i in range(5):
        z[i] = min(max(z[i], lower[i]), upper[i])
    if z[1] > z[0] - ORDER_GAP:
        z[1] = max(z[0] - ORDER_GAP, lower[1])
        z[0] = max(z[0], z[1] + ORDER_GAP)
    if not np.isnan(gain):
        z[4] = z[3] + np.log(gain)


@njit
def levenberg_marquardt(
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
    into_box(z, lower, upper, gain)
    parameters_at(z, x)
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
            parameters_at(trial, x)
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
            into_box(trial, lower, upper, gain)
            parameters_at(trial, x)
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
            parameters_at(z, x)
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
