"""Grünwald-Letnikov scheme: the plain, slow, first-order twin of the transform methods.

Podlubny, Fractional Differential Equations (Academic Press 1999), chapter 8.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo.fractional.characteristic import check_parameters
from spa_fo.fractional.intervals import check_samples


def binomial_weights(alpha: float, count: int) -> NDArray[np.float64]:
    """Return (−1)^j binomial(alpha, j) for j = 0 … count − 1."""
    factors = 1.0 - (alpha + 1.0) / np.arange(1, count)
    return np.concatenate(([1.0], np.cumprod(factors)))[:count]


def grunwald_letnikov_simulate(
    t: ArrayLike, u: ArrayLike, alpha2: float, alpha1: float, a1: float, a0: float, b0: float
) -> NDArray[np.float64]:
    """Response to samples u at equally spaced times t, at rest before t[0], in O(n²).

    Parameters
    ----------
    t, u : array_like, shape (n,)
        Equally spaced sample times in s, and the input there.
    alpha2, alpha1, a1, a0, b0 : float
        As for `step_response`.

    Returns
    -------
    ndarray, shape (n,)
        y(t) with an error proportional to the spacing.

    Raises
    ------
    ValueError
        As for `simulate`, and if the times are not equally spaced.
    """
    alpha2, alpha1, a1, a0, b0 = check_parameters(alpha2, alpha1, a1, a0, b0)
    times, values = check_samples(t, u)
    n = times.size
    y = np.zeros(n)
    if n < 2:
        return y
    h = (times[-1] - times[0]) / (n - 1)
    if h == 0.0 or np.max(np.abs(np.diff(times) - h)) > 1e-6 * h:
        raise ValueError("the Grünwald-Letnikov scheme needs equally spaced times")
    memory = h**-alpha2 * binomial_weights(alpha2, n) + a1 * h**-alpha1 * binomial_weights(
        alpha1, n
    )
    for j in range(1, n):
        y[j] = (b0 * values[j] - memory[1 : j + 1] @ y[j - 1 :: -1]) / (memory[0] + a0)
    return y


def grunwald_letnikov_step(
    t: ArrayLike,
    alpha2: float,
    alpha1: float,
    a1: float,
    a0: float,
    b0: float,
    steps: int = 2000,
) -> NDArray[np.float64]:
    """Unit-step response by the scheme with `steps` equal steps up to the latest time.

    Parameters
    ----------
    t : array_like
        Times in s, not negative; values between the steps are interpolated.
    alpha2, alpha1, a1, a0, b0 : float
        As for `step_response`.
    steps : int
        Number of steps.

    Returns
    -------
    ndarray
        y(t), same shape as t.

    Raises
    ------
    ValueError
        As for `step_response`.
    """
    times = np.asarray(t, dtype=np.float64)
    if not np.all(np.isfinite(times)) or np.any(times < 0.0):
        raise ValueError("times must be finite and not negative")
    last = float(times.max(initial=0.0))
    if last == 0.0:
        return np.zeros(times.shape)
    grid = np.linspace(0.0, last, steps + 1)
    y = grunwald_letnikov_simulate(grid, np.ones(grid.size), alpha2, alpha1, a1, a0, b0)
    return np.interp(times, grid, y)
