"""Plain slow twins of the identification's kernels: loops, formulas as printed, SciPy."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from spa_fo.fractional import step_response
from spa_fo.identify import Bounds, StepData
from spa_fo.plant import Ludwick


def sum_of_squares(data: StepData, x: np.ndarray) -> float:
    """Sum over every sample of every dataset, each with its own response."""
    total = 0.0
    for u, angle in zip(data.u, data.angle_rad, strict=True):
        for t, measured in zip(data.t, angle, strict=True):
            total += float(measured - u * step_response(np.array([t]), *x)[0]) ** 2
    return total


def rmse(data: StepData, bounds: Bounds, x: np.ndarray) -> float:
    inside = all(lo <= v <= hi for lo, v, hi in zip(bounds.lower, x, bounds.upper, strict=True))
    if not inside or x[1] >= x[0]:
        return float("inf")
    return float(np.sqrt(sum_of_squares(data, x) / data.angle_rad.size))


def least_squares_from(data: StepData, bounds: Bounds, start: np.ndarray) -> float:
    """Sum of squares that SciPy's trust region reaches from a start, in the parameters as given."""

    def residual(x: np.ndarray) -> np.ndarray:
        if x[1] >= x[0] - 0.02:
            return np.full(data.angle_rad.size, 10.0)
        model = np.asarray(step_response(data.t, *x))
        return (data.u[:, np.newaxis] * model - data.angle_rad).ravel()

    found = least_squares(
        residual,
        np.clip(start, bounds.lower * (1 + 1e-9), bounds.upper * (1 - 1e-9)),
        bounds=(bounds.lower, bounds.upper),
        x_scale="jac",
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
        max_nfev=400,
    )
    return float(2.0 * found.cost)


def ludwick(t: np.ndarray, u: float, model: Ludwick) -> np.ndarray:
    """Integrate Eq. 5 adaptively."""

    def rate(_: float, state: np.ndarray) -> list[float]:
        angle, speed = state
        restoring = np.sign(angle) * abs(angle) ** model.exponent
        return [
            speed,
            model.force * u
            - 2 * model.damping_ratio * model.natural_frequency * speed
            - model.natural_frequency**2 * restoring,
        ]

    found = solve_ivp(
        rate, (0.0, float(t[-1])), [0.0, 0.0], t_eval=t, rtol=1e-11, atol=1e-13, method="DOP853"
    )
    return np.asarray(found.y[0])


def huber_weight(residual: float, limit: float) -> float:
    return 1.0 if abs(residual) <= limit else limit / abs(residual)
