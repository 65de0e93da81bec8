"""Plain slow twins of the fractional-calculus kernels."""

from __future__ import annotations

import mpmath as mp
import numpy as np
from numpy.typing import NDArray

from spa_fo.fractional import ResponseMap, step_response
from spa_fo.fractional.step import inverse_points


def invert(transform, t: float, degree: int = 100):
    """Inverse Laplace transform by the fixed Talbot contour in multiple precision."""
    with mp.workdps(15 + 2 * degree):
        t = mp.mpf(t)
        r = mp.mpf(2) * degree / (5 * t)
        total = transform(r) * mp.exp(r * t) / 2
        for k in range(1, degree):
            theta = k * mp.pi / degree
            cot = mp.cot(theta)
            s = r * theta * (cot + 1j)
            sigma = theta + (theta * cot - 1) * cot
            total += (mp.exp(s * t) * transform(s) * (1 + 1j * sigma)).real
        return +(r / degree * total)


def naive_step_response(t: float, x, power: int = -1):
    """Inverse of b0 s^power / D(s) in multiple precision."""
    alpha2, alpha1, a1, a0, b0 = (mp.mpf(value) for value in x)
    return invert(lambda s: b0 * s**power / (s**alpha2 + a1 * s**alpha1 + a0), t)


def naive_jacobian(t: float, x):
    """Central differences of `naive_step_response` at 200 digits, hence right to 40."""
    gradient = []
    with mp.workdps(215):
        h = mp.mpf(10) ** -30
        for i in range(5):
            ahead = [mp.mpf(value) + (h if i == k else 0) for k, value in enumerate(x)]
            behind = [mp.mpf(value) - (h if i == k else 0) for k, value in enumerate(x)]
            gradient.append(
                (naive_step_response(t, ahead) - naive_step_response(t, behind)) / h / 2
            )
    return gradient


def naive_mittag_leffler(z: float, alpha: float, beta: float, gamma: float):
    """Sum the power series with as many digits as its largest terms cost."""
    size = float(abs(z)) ** (1.0 / alpha)
    with mp.workdps(int(50 + size)):
        z, alpha, beta, gamma = mp.mpf(z), mp.mpf(alpha), mp.mpf(beta), mp.mpf(gamma)
        total, factor, k = mp.mpf(0), mp.mpf(1), 0
        while True:
            term = factor * mp.rgamma(alpha * k + beta)
            total += term
            if alpha * k + beta > size + 2 and k > 10 and abs(term) < mp.mpf(10) ** -35:
                return +total
            factor *= (gamma + k) / (k + 1) * z
            k += 1


def naive_series_step(t: float, x, printed: bool, terms: int = 60):
    """The series of Prabhakar functions, corrected or as printed in arXiv:2512.18213, Eq. 15."""
    alpha2, alpha1, a1, a0, b0 = x
    total = mp.mpf(0)
    for k in range(terms):
        exponent = (alpha2 - alpha1) * k + (1.0 if printed else alpha2)
        total += (
            (-mp.mpf(a1)) ** k
            * mp.mpf(t) ** exponent
            * naive_mittag_leffler(-a0 * t**alpha2, alpha2, exponent + 1, k + 1)
        )
    return b0 * total


def naive_simulate(t, u, x, hold: str) -> NDArray[np.float64]:
    """Superpose step responses (hold "zero") or ramp responses ("linear"), in O(n²)."""
    t, u = np.asarray(t, dtype=float), np.asarray(u, dtype=float)
    y = np.zeros(t.size)
    for j in range(1, t.size):
        lag = t[j] - t[: j + 1]
        if hold == "zero":
            y[j] = np.diff(u[:j], prepend=0.0) @ step_response(lag[:-1], *x)
        else:
            ramp = inverse_points(lag, -2.0, *x)
            slope = np.diff(u[: j + 1]) / np.diff(t[: j + 1])
            y[j] = u[0] * step_response(lag[0], *x) + slope @ (ramp[:-1] - ramp[1:])
    return y


def naive_map_response(response_map: ResponseMap, x) -> NDArray[np.float64]:
    """Weights times transform, for parameters without poles on the principal sheet."""
    alpha2, alpha1, a1, a0, b0 = x
    s = response_map.nodes
    weights = response_map.arrays.weight_real + 1j * response_map.arrays.weight_imag
    transform = b0 / (s * (s**alpha2 + a1 * s**alpha1 + a0))
    return (transform @ weights).real
