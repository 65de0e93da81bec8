r"""The three-parameter Mittag-Leffler (Prabhakar) function of a real argument.

.. math:: E^γ_{α,β}(z) = \sum_k \frac{(γ)_k z^k}{k! Γ(αk + β)}
          = \frac{1}{2πi} \int e^s \frac{s^{αγ-β}}{(s^α - z)^γ} ds

by the trapezoidal rule on contours around the branch points, as Garrappa (2015,
doi:10.1137/140971191) does for α < 1. For α > 1 and z < 0 the integrand has a further pair of
branch points at p = |z|^{1/α} e^{±iπ/α}. Where no contour encloses them without losing digits,
each has a parabola of its own around a cut that leads away from the other branch points.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo._jit import njit, njit_parallel
from spa_fo.fractional.characteristic import cexp
from spa_fo.fractional.step import HYPERBOLA_MU, HYPERBOLA_PHI, NODES, WEIGHTS

_HALF_PLANE = 2j * math.pi
# In the plane of sqrt(s) contours are vertical lines. Between a contour and a branch point of
# some strength lie this many steps: exp(-2 pi 5.25) = 5e-15, and more for the integrand's rise.
_CLEARANCE = 5.25
_CLEARANCE_STRENGTH = 0.6
# Distance in that plane below which p is enclosed rather than given a contour of its own
_GAP = 0.79
_COARSE = 0.3
_NEGLIGIBLE = -33.0
_TILT = math.pi / 6.0


@njit
def _log(s: complex) -> complex:
    return complex(math.log(abs(s)), math.atan2(s.imag, s.real))


@njit
def _integrand(
    s: complex, z: float, alpha: float, beta: float, gamma: float, outside: bool
) -> complex:
    """s^(αγ−β) (s^α − z)^(−γ) for Im s >= 0.

    `outside`: continued from the positive axis around the outside of every branch point of the
    upper half plane; otherwise on the principal sheet, cut outwards from p.
    """
    log_s = _log(s)
    power = cexp(alpha * log_s)
    log_base = _log(power - z)
    if outside and log_base.imag < 0.0:
        log_base += _HALF_PLANE
    return cexp((alpha * gamma - beta) * log_s - gamma * log_base)


@njit
def _on_hyperbola(z: float, shift: float, alpha: float, beta: float, gamma: float) -> float:
    """Σ without the factor e^shift; the contour encloses (−∞, shift]."""
    total = 0.0
    for k in range(NODES.size):
        total += (WEIGHTS[k] * _integrand(shift + NODES[k], z, alpha, beta, gamma, True)).real
    return total


@njit
def _on_parabola(
    z: float,
    shift: float,
    m: float,
    step: float,
    alpha: float,
    beta: float,
    gamma: float,
    outside: bool,
) -> float:
    """Σ without the factor e^shift, on s = shift + (m + iy)²."""
    count = math.ceil(math.sqrt(m * m + 37.0) / step)
    total = 0.0
    for k in range(count):
        v = complex(m, (k + 0.5) * step)
        s = v * v
        total += (v * cexp(s) * _integrand(shift + s, z, alpha, beta, gamma, outside)).real
    return total * 2.0 * step / math.pi


@njit
def _around_axis(z: float, shift: float, alpha: float, beta: float, gamma: float) -> float:
    """Σ where every branch point lies on or next to (−∞, shift].

    The hyperbola needs half the nodes; but it starts 6 to the right of `shift`, where
    e^s s^(−β) is so large for β < 0 that digits are lost.
    """
    if beta >= 0.0:
        return _on_hyperbola(z, shift, alpha, beta, gamma)
    step = _GAP / (_CLEARANCE + _CLEARANCE_STRENGTH * gamma)
    return _on_parabola(z, shift, _GAP, step, alpha, beta, gamma, True)


@njit
def _around_pole(
    z: float, p: complex, clearance: float, alpha: float, beta: float, gamma: float
) -> float:
    """Parabolas around p and its conjugate, their cuts tilted away from the negative axis."""
    tilt = min(_TILT, math.pi - math.pi / alpha)
    rotation = complex(math.cos(tilt), -math.sin(tilt))
    # Re sqrt of the distance to the negative axis, in the tilted frame
    distance = math.sqrt(p.imag * math.sin(tilt))
    step = min(0.5 * distance / clearance, _COARSE)
    m = clearance * step
    count = math.ceil((math.sqrt(43.0 + 1.4 * m * m) + 0.6 * m) / step)
    total = 0.0
    for k in range(-count, count):
        v = complex(m, (k + 0.5) * step)
        s = p + rotation * (v * v)
        value = rotation * v * cexp(s) * _integrand(s, z, alpha, beta, gamma, k >= 0)
        total += value.real
    return total * 2.0 * step / math.pi


@njit
def _prabhakar(z: float, alpha: float, beta: float, gamma: float) -> float:
    if z > 0.0:
        shift = math.exp(math.log(z) / alpha)
        # Two factors, so that the product overflows only where the result does.
        half = math.exp(0.5 * shift)
        if half == math.inf:
            return half
        return half * (half * _around_axis(z, shift, alpha, beta, gamma))
    if alpha <= 1.0:
        return _around_axis(z, 0.0, alpha, beta, gamma)
    p = cexp(complex(math.log(-z) / alpha, math.pi / alpha))
    # Place of p between the hyperbola (at its φ) and the cut (at π/2), in the strip that
    # asin(s/μ − 1) maps the region between them to
    scaled = p * (1.0 / HYPERBOLA_MU)
    sine = 0.5 * (abs(scaled - 2.0) - abs(scaled))
    if beta >= 0.0 and math.asin(max(-1.0, min(1.0, sine))) > HYPERBOLA_PHI + 0.3:
        return _on_hyperbola(z, 0.0, alpha, beta, gamma)
    strength = max(gamma, 2.0 * (beta - alpha * gamma))
    clearance = _CLEARANCE + _CLEARANCE_STRENGTH * strength
    root = math.sqrt(0.5 * (abs(p) + p.real))
    if root < 2.0 * _GAP:
        return _on_parabola(z, 0.0, root + _GAP, _GAP / clearance, alpha, beta, gamma, True)
    step = min(0.5 * root / clearance, _COARSE)
    total = _on_parabola(z, 0.0, clearance * step, step, alpha, beta, gamma, False)
    # What p adds is e^p p^(γ-β) / (α^γ Γ(γ)) and smaller terms.
    if p.real + max(gamma - beta, 0.0) * math.log(abs(p)) > _NEGLIGIBLE:
        total += _around_pole(z, p, clearance, alpha, beta, gamma)
    return total


@njit_parallel
def _prabhakar_array(
    z: np.ndarray, alpha: float, beta: float, gamma: float, out: np.ndarray
) -> None:
    at_zero = 0.0 if beta <= 0.0 and beta == math.floor(beta) else 1.0 / math.gamma(beta)
    for j in numba.prange(z.size):
        out[j] = _prabhakar(z[j], alpha, beta, gamma) if z[j] != 0.0 else at_zero


def mittag_leffler(
    z: ArrayLike, alpha: float, beta: float = 1.0, gamma: float = 1.0
) -> NDArray[np.float64]:
    """Three-parameter Mittag-Leffler (Prabhakar) function E^γ_{α,β}(z) of a real argument.

    Parameters
    ----------
    z : array_like
        Real arguments of either sign.
    alpha : float
        0 < alpha <= 2.
    beta : float
        -3 <= beta <= 10.
    gamma : float
        0 < gamma <= 5; with 1 it is the two-parameter function.

    Returns
    -------
    ndarray
        Same shape as z; infinite where the result overflows. For z <= 0 the error is below
        5e-11 max(1, |E|), mostly 1e-14; where beta < 0 the integrand is as large as
        |z|^((1 - beta) / alpha), and 1e-15 times that comes on top. For z > 0 it is relative, of
        the order 1e-13 times 1 + z^(1/alpha) (the condition of the function), as long as E is not
        much smaller than 1.

    Raises
    ------
    ValueError
        If z is not finite or a parameter is outside its domain.
    """
    alpha, beta, gamma = float(alpha), float(beta), float(gamma)
    values = np.asarray(z, dtype=np.float64)
    if not 0.0 < alpha <= 2.0:
        raise ValueError(f"alpha must lie in (0, 2], got {alpha}")
    if not -3.0 <= beta <= 10.0:
        raise ValueError(f"beta must lie in [-3, 10], got {beta}")
    if not 0.0 < gamma <= 5.0:
        raise ValueError(f"gamma must lie in (0, 5], got {gamma}")
    if not np.all(np.isfinite(values)):
        raise ValueError("z must be finite")
    # At 2 the branch points would meet the imaginary axis; the function is smooth in alpha.
    alpha = min(alpha, math.nextafter(2.0, 0.0))
    out = np.empty(values.size)
    _prabhakar_array(np.ascontiguousarray(values).ravel(), alpha, beta, gamma, out)
    return out.reshape(values.shape)[()]
