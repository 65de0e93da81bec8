"""Step response point by point, with relative accuracy, and its Jacobian.

Each time has its own hyperbola in the s-plane (Weideman & Trefethen 2007,
doi:10.1090/S0025-5718-07-01945-X), s = c_k/t with fixed c_k, so that the powers c_k^α are taken
once for all times.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo._jit import njit
from spa_fo.fractional.characteristic import (
    CIRCLE,
    ON_CIRCLE,
    cexp,
    check_parameters,
    circle_radius,
    find_pole,
    over,
    transform_on_circle,
)

_LONGEST = 1e100  # squares of times still fit a double
_N = 18
HYPERBOLA_PHI = 1.1721
_H = 1.0818 / _N
HYPERBOLA_MU = 4.4921 * _N

_U = (np.arange(_N) + 0.5) * _H
NODES = HYPERBOLA_MU * (1.0 + np.sin(1j * _U - HYPERBOLA_PHI))
_LOG_NODES = np.log(NODES)
# Re sum WEIGHTS_k F(s_k) is the inverse transform of F at t, with s_k = NODES_k / t (times 1/t).
WEIGHTS = np.exp(NODES) * HYPERBOLA_MU * np.cos(1j * _U - HYPERBOLA_PHI) * _H / math.pi


@njit
def inverse_kernel(
    t: np.ndarray,
    power: float,
    alpha2: float,
    alpha1: float,
    a1: float,
    a0: float,
    out: np.ndarray,
) -> None:
    """Inverse transform of s^power / D(s) at every t > 0; 0 at t = 0."""
    log_pole = find_pole(alpha2, alpha1, a1, a0)
    has_pole = log_pole.imag > 0.0
    p = 0j
    residue = 0j
    reach = 0.0
    modulus = 0.0
    if has_pole:
        p = cexp(log_pole)
        modulus = abs(p)
        derivative = alpha2 * cexp((alpha2 - 1.0) * log_pole) + alpha1 * a1 * cexp(
            (alpha1 - 1.0) * log_pole
        )
        residue = over(cexp(power * log_pole), derivative)
        reach = 0.5 * circle_radius(p)
    powers2 = np.empty(_N, np.complex128)
    powers1 = np.empty(_N, np.complex128)
    weights = np.empty(_N, np.complex128)
    for k in range(_N):
        powers2[k] = cexp(alpha2 * _LOG_NODES[k])
        powers1[k] = a1 * cexp(alpha1 * _LOG_NODES[k])
        weights[k] = WEIGHTS[k] * cexp(power * _LOG_NODES[k])
    for j in range(t.size):
        if t[j] == 0.0:
            out[j] = 0.0
            continue
        log_t = math.log(t[j])
        # D(c/t) t^(α2 or 0): the factor keeps every term bounded at either end.
        lift = alpha2 * min(log_t, 0.0)
        scale2 = math.exp(lift - alpha2 * log_t)
        scale1 = math.exp(lift - alpha1 * log_t)
        constant = a0 * math.exp(lift)
        scale = math.exp(lift - (power + 1.0) * log_t)
        total = 0.0
        if has_pole and modulus * t[j] > 1.0:
            pole = p * t[j]
            near = (reach * t[j]) ** 2
            part = 0.0
            for k in range(_N):
                gap = NODES[k] - pole
                conjugate = NODES[k] - pole.conjugate()
                if gap.real * gap.real + gap.imag * gap.imag > near:
                    value = over(weights[k], scale2 * powers2[k] + scale1 * powers1[k] + constant)
                    total += value.real
                    pair = over(residue, gap) + over(residue.conjugate(), conjugate)
                    part += (WEIGHTS[k] * pair).real
                else:
                    mean = transform_on_circle(
                        NODES[k] * (1.0 / t[j]), power, alpha2, alpha1, a1, a0, p, residue
                    )
                    part -= (WEIGHTS[k] * mean).real / t[j]
            out[j] = scale * total - part + 2.0 * (residue * cexp(pole)).real
        else:
            for k in range(_N):
                value = over(weights[k], scale2 * powers2[k] + scale1 * powers1[k] + constant)
                total += value.real
            out[j] = scale * total


@njit
def _jacobian_points(
    t: np.ndarray,
    alpha2: float,
    alpha1: float,
    a1: float,
    a0: float,
    b0: float,
    out: np.ndarray,
) -> None:
    """Differentiate the step response in (α2, α1, a1, a0, b0): out[j, i]."""
    log_pole = find_pole(alpha2, alpha1, a1, a0)
    has_pole = log_pole.imag > 0.0
    p = 0j
    reach = 0.0
    modulus = 0.0
    single = np.zeros(5, np.complex128)
    double = np.zeros(5, np.complex128)
    if has_pole:
        p = cexp(log_pole)
        modulus = abs(p)
        reach = 0.5 * circle_radius(p)
        pole_derivatives(log_pole, alpha2, alpha1, a1, b0, single, double)
    powers2 = np.empty(_N, np.complex128)
    powers1 = np.empty(_N, np.complex128)
    for k in range(_N):
        powers2[k] = cexp(alpha2 * _LOG_NODES[k])
        powers1[k] = cexp(alpha1 * _LOG_NODES[k])
    gradient = np.empty(5, np.complex128)
    for j in range(t.size):
        for i in range(5):
            out[j, i] = 0.0
        if t[j] == 0.0:
            continue
        log_t = math.log(t[j])
        if alpha2 * log_t < -230.0:
            continue  # t^α2 < 1e-100
        scale2 = math.exp(-alpha2 * log_t)
        scale1 = math.exp(-alpha1 * log_t)
        subtract = has_pole and modulus * t[j] > 1.0
        near = reach * reach if subtract else -1.0
        for k in range(_N):
            s = NODES[k] * (1.0 / t[j])
            gap = s - p
            if gap.real * gap.real + gap.imag * gap.imag > near:
                step_gradient(
                    s,
                    _LOG_NODES[k] - log_t,
                    scale2 * powers2[k],
                    scale1 * powers1[k],
                    a1,
                    a0,
                    b0,
                    gradient,
                )
                if subtract:
                    subtract_pole(s, p, single, double, gradient)
                weight = WEIGHTS[k] * (1.0 / t[j])
                for i in range(5):
                    out[j, i] += (weight * gradient[i]).real
            else:
                weight = WEIGHTS[k] * (1.0 / (t[j] * CIRCLE))
                for m in range(CIRCLE):
                    z = s + 2.0 * reach * ON_CIRCLE[m]
                    log_z = complex(math.log(abs(z)), math.atan2(z.imag, z.real))
                    step_gradient(
                        z, log_z, cexp(alpha2 * log_z), cexp(alpha1 * log_z), a1, a0, b0, gradient
                    )
                    subtract_pole(z, p, single, double, gradient)
                    for i in range(5):
                        out[j, i] += (weight * gradient[i]).real
        if subtract:
            decay = cexp(p * t[j])
            for i in range(5):
                out[j, i] += 2.0 * ((single[i] + double[i] * t[j]) * decay).real


@njit
def step_gradient(
    s: complex,
    log_s: complex,
    power2: complex,
    power1: complex,
    a1: float,
    a0: float,
    b0: float,
    out: np.ndarray,
) -> None:
    """Differentiate Y = b0/(s D(s)) in (α2, α1, a1, a0, b0) at one point."""
    inverse = over(1.0 + 0j, power2 + a1 * power1 + a0)
    unit = over(inverse, s)
    slope = -b0 * unit * inverse
    out[0] = slope * power2 * log_s
    out[2] = slope * power1
    out[1] = a1 * out[2] * log_s
    out[3] = slope
    out[4] = unit


@njit
def pole_derivatives(
    log_p: complex,
    alpha2: float,
    alpha1: float,
    a1: float,
    b0: float,
    single: np.ndarray,
    double: np.ndarray,
) -> complex:
    """Laurent coefficients at the pole p of the derivatives of Y in the five parameters.

    The derivative of R/(s − p) is R'/(s − p) + R p'/(s − p)²: `single` receives R', `double` R p'.

    Returns
    -------
    complex
        The residue R of Y at p.
    """
    inverse = cexp(-log_p)
    power2 = cexp(alpha2 * log_p)
    power1 = cexp(alpha1 * log_p)
    first = (alpha2 * power2 + alpha1 * a1 * power1) * inverse
    second = (alpha2 * (alpha2 - 1.0) * power2 + alpha1 * (alpha1 - 1.0) * a1 * power1) * (
        inverse * inverse
    )
    residue = b0 * over(inverse, first)
    values = (power2 * log_p, a1 * power1 * log_p, power1, 1.0 + 0j)
    slopes = (
        power2 * inverse * (1.0 + alpha2 * log_p),
        a1 * power1 * inverse * (1.0 + alpha1 * log_p),
        alpha1 * power1 * inverse,
        0j,
    )
    for i in range(4):
        move = -over(values[i], first)
        double[i] = residue * move
        single[i] = -residue * (move * inverse + over(slopes[i] + second * move, first))
    single[4] = over(inverse, first)
    double[4] = 0j
    return residue


@njit
def subtract_pole(
    s: complex, p: complex, single: np.ndarray, double: np.ndarray, gradient: np.ndarray
) -> None:
    """Subtract the Laurent parts at p and at its conjugate."""
    upper = over(1.0 + 0j, s - p)
    lower = over(1.0 + 0j, s - p.conjugate())
    for i in range(5):
        gradient[i] -= (single[i] + double[i] * upper) * upper
        gradient[i] -= (single[i].conjugate() + double[i].conjugate() * lower) * lower


def check_times(t: ArrayLike) -> NDArray[np.float64]:
    """Return times as a float64 array; refuse with ValueError what is not within 0 … 1e100 s."""
    times = np.asarray(t, dtype=np.float64)
    if not np.all((times >= 0.0) & (times <= _LONGEST)):
        raise ValueError("times must be finite and not negative (and at most 1e100 s)")
    return times


def inverse_points(
    t: ArrayLike, power: float, alpha2: float, alpha1: float, a1: float, a0: float, b0: float
) -> NDArray[np.float64]:
    """Inverse transform of b0 s^power/D(s), same shape as t."""
    parameters = check_parameters(alpha2, alpha1, a1, a0, b0)
    times = check_times(t)
    out = np.empty(times.size)
    inverse_kernel(np.ascontiguousarray(times).ravel(), power, *parameters[:4], out)
    return parameters[4] * out.reshape(times.shape)


def step_response(
    t: ArrayLike, alpha2: float, alpha1: float, a1: float, a0: float, b0: float
) -> NDArray[np.float64]:
    """Unit-step response of G(s) = b0/(s^α2 + a1 s^α1 + a0), at rest before t = 0.

    Parameters
    ----------
    t : array_like
        Times in s, not negative and at most 1e100, in any order and shape.
    alpha2, alpha1 : float
        Orders, 0 < alpha1 < alpha2 <= 2.
    a1, a0, b0 : float
        Coefficients; a1 >= 0, a0 > 0.

    Returns
    -------
    ndarray
        y(t), same shape as t (zero-dimensional for a scalar); 0 at t = 0, tends to b0/a0.

    Raises
    ------
    ValueError
        If a time is negative or not finite, or a parameter is outside its domain.

    Notes
    -----
    The inverse Laplace transform of b0/(s D(s)) on one hyperbola for each time, 18 nodes, with
    the pair of poles taken out where |p| t > 1 (Weideman & Trefethen 2007,
    doi:10.1090/S0025-5718-07-01945-X). The relative error is some 1e-13 at any t.
    """
    return inverse_points(t, -1.0, alpha2, alpha1, a1, a0, b0)


def step_response_jacobian(
    t: ArrayLike, alpha2: float, alpha1: float, a1: float, a0: float, b0: float
) -> NDArray[np.float64]:
    """Differentiate the unit-step response in its five parameters.

    Parameters
    ----------
    t : array_like, shape (n,)
        Times in s, not negative.
    alpha2, alpha1, a1, a0, b0 : float
        As for `step_response`.

    Returns
    -------
    ndarray, shape (n, 5)
        Columns in the order (alpha2, alpha1, a1, a0, b0).

    Raises
    ------
    ValueError
        As for `step_response`, and if t is not one-dimensional.
    """
    parameters = check_parameters(alpha2, alpha1, a1, a0, b0)
    times = check_times(t)
    if times.ndim != 1:
        raise ValueError("times must be one-dimensional")
    out = np.empty((times.size, 5))
    _jacobian_points(np.ascontiguousarray(times), *parameters, out)
    return out
