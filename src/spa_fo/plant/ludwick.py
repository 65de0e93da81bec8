"""The nonlinear baseline: a second-order model with Ludwick's material law.

Eq. 5 and 22 of arXiv:2512.18213: theta'' + 2 zeta wn theta' + wn² theta^(n + dn) = F/M, with F/M
proportional to the pressure. For angles below zero the restoring term is odd.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo._jit import njit

STEP_LIMIT = 0.05
"""Longest Runge-Kutta step, in units of 1/wn (1e-7 of the final angle at the paper's values)."""


@dataclass(frozen=True)
class Ludwick:
    """Parameters of the baseline.

    Parameters
    ----------
    exponent : float
        n + dn of Ludwick's law, positive.
    damping_ratio : float
        zeta, positive.
    natural_frequency : float
        wn in rad/s, positive.
    force : float
        F/M in rad/s² for u = 1.

    Raises
    ------
    ValueError
        A parameter is not finite, or one that must be positive is not.
    """

    exponent: float
    damping_ratio: float
    natural_frequency: float
    force: float

    def __post_init__(self) -> None:
        for name in ("exponent", "damping_ratio", "natural_frequency", "force"):
            value = getattr(self, name)
            if not np.isfinite(value) or (name != "force" and value <= 0):
                raise ValueError(f"{name} must be a positive number, not {value}")


def ludwick_step(t: ArrayLike, u: float, model: Ludwick) -> NDArray[np.float64]:
    """Response at rest before t = 0 to a step of height `u`.

    Parameters
    ----------
    t : array_like
        Sorted times in s, none below zero, shape (n,).
    u : float
        Height of the step, pressure / reference pressure.
    model : Ludwick
        The parameters.

    Returns
    -------
    numpy.ndarray
        Angles in rad, shape (n,).
    """
    times = np.ascontiguousarray(t, dtype=np.float64)
    if times.ndim != 1 or np.any(np.diff(times, prepend=0.0) < 0):
        raise ValueError("the times must be sorted and none below zero")
    return _runge_kutta(
        times, u * model.force, model.exponent, model.damping_ratio, model.natural_frequency
    )


@njit
def _runge_kutta(
    t: NDArray[np.float64], force: float, exponent: float, zeta: float, omega: float
) -> NDArray[np.float64]:
    """Classical Runge-Kutta of fourth order, steps of equal length between two output times."""
    out = np.empty(t.size)
    angle, rate, now = 0.0, 0.0, 0.0
    for j in range(t.size):
        steps = int(np.ceil((t[j] - now) * omega / STEP_LIMIT))
        h = (t[j] - now) / max(steps, 1)
        for _ in range(steps):
            k1 = _acceleration(angle, rate, force, exponent, zeta, omega)
            v2 = rate + 0.5 * h * k1
            k2 = _acceleration(angle + 0.5 * h * rate, v2, force, exponent, zeta, omega)
            v3 = rate + 0.5 * h * k2
            k3 = _acceleration(angle + 0.5 * h * v2, v3, force, exponent, zeta, omega)
            v4 = rate + h * k3
            k4 = _acceleration(angle + h * v3, v4, force, exponent, zeta, omega)
            angle += h * (rate + 2.0 * v2 + 2.0 * v3 + v4) / 6.0
            rate += h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
        now = t[j]
        out[j] = angle
    return out


@njit
def _acceleration(
    angle: float, rate: float, force: float, exponent: float, zeta: float, omega: float
) -> float:
    restoring = np.sign(angle) * abs(angle) ** exponent
    return float(force - 2.0 * zeta * omega * rate - omega * omega * restoring)


def second_moment(exponent: float, width: float, height: float) -> float:
    """Second moment of area of a rectangle under Ludwick's law, (1/2)^(n+1) b h^(n+2)/(n+2).

    At n = 1 this is b h³/12. Eq. 3 prints the factor (1/2)^n: see `second_moment_as_printed`.
    """
    return 0.5 * second_moment_as_printed(exponent, width, height)


def second_moment_as_printed(exponent: float, width: float, height: float) -> float:
    """Second moment of area as Eq. 3 prints it: twice the right one, b h³/6 at n = 1."""
    return float(0.5**exponent * width * height ** (exponent + 2) / (exponent + 2))
