"""Evaluate a response map: nodes and poles to a response and its slopes, compiled.

What a map is, and how one is made: `spa_fo.fractional.response_map`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spa_fo._jit import njit
from spa_fo.fractional._elementary import fast_exp, fast_sincos
from spa_fo.fractional.characteristic import (
    CIRCLE,
    ON_CIRCLE,
    cexp,
    circle_radius,
    find_pole,
    over,
    transform_on_circle,
)
from spa_fo.fractional.intervals import Array
from spa_fo.fractional.step import pole_derivatives, step_gradient, subtract_pole

WORK_ROWS = 10
"""Rows, as long as the nodes, of the scratch space that the kernels need."""

_RECIPROCALS = tuple(1.0 / (k + 1.0) for k in range(15))  # of k + 1


class MapArrays(NamedTuple):
    """What the kernels need of a map; N nodes, n times."""

    log_modulus: Array  # (N,) ln|s_k|
    angle: Array  # (N,) arg s_k
    real: Array  # (N,) Re s_k
    imag: Array  # (N,) Im s_k
    weight_real: Array  # (N, n)
    weight_imag: Array  # (N, n)
    dt: Array  # (n,) intervals before each time, for the state of the pole
    jump: Array  # (n,)
    ramp: Array  # (n,)
    uniform: float  # common length of all intervals, 0 if they differ
    has_ramp: bool


@njit
def phi1(z: complex, exp_z: complex) -> complex:
    """(e^z − 1)/z."""
    if z.real * z.real + z.imag * z.imag > 0.01:
        return over(exp_z - 1.0, z)
    total = 1.0 + 0j
    for k in range(9, 0, -1):
        total = 1.0 + total * z * _RECIPROCALS[k]
    return total


@njit
def phi1_derivative(z: complex, exp_z: complex) -> complex:
    """Differentiate (e^z − 1)/z."""
    if z.real * z.real + z.imag * z.imag > 0.1:
        return over(exp_z - over(exp_z - 1.0, z), z)
    # sum (k + 1)/(k + 2)! z^k
    total = 13.0 + 0j
    for k in range(11, -1, -1):
        total = (k + 1.0) + total * z * _RECIPROCALS[k + 2]
    return 0.5 * total


@njit
def _decay(p: complex, dt: float) -> complex:
    modulus = fast_exp(p.real * dt)
    sine, cosine = fast_sincos(p.imag * dt)
    return complex(modulus * cosine, modulus * sine)


@njit
def response_on_map(x: np.ndarray, arrays: MapArrays, work: np.ndarray, out: np.ndarray) -> None:
    """Response for the parameters x = (α2, α1, a1, a0, b0); `out` (n,), `work` of ResponseMap.work.

    The parameters are not checked.
    """
    alpha2, alpha1, a1, a0, b0 = x[0], x[1], x[2], x[3], x[4]
    real, imag = arrays.real, arrays.imag
    log_modulus, angle = arrays.log_modulus, arrays.angle
    value_real, value_imag = work[0], work[1]
    count = real.size
    for k in range(count):
        modulus2 = fast_exp(alpha2 * log_modulus[k])
        modulus1 = a1 * fast_exp(alpha1 * log_modulus[k])
        sine2, cosine2 = fast_sincos(alpha2 * angle[k])
        sine1, cosine1 = fast_sincos(alpha1 * angle[k])
        d_real = modulus2 * cosine2 + modulus1 * cosine1 + a0
        d_imag = modulus2 * sine2 + modulus1 * sine1
        # s D
        real_part = real[k] * d_real - imag[k] * d_imag
        imag_part = real[k] * d_imag + imag[k] * d_real
        scale = b0 / (real_part * real_part + imag_part * imag_part)
        value_real[k] = real_part * scale
        value_imag[k] = -imag_part * scale

    log_pole = find_pole(alpha2, alpha1, a1, a0)
    if log_pole.imag > 0.0:
        p = cexp(log_pole)
        derivative = alpha2 * cexp(alpha2 * log_pole) + alpha1 * a1 * cexp(alpha1 * log_pole)
        unit = over(1.0 + 0j, derivative)
        residue = b0 * unit
        near = (0.5 * circle_radius(p)) ** 2
        slope = 2.0 * residue.real
        constant = -2.0 * (residue.real * p.real + residue.imag * p.imag)
        square = p.real * p.real + p.imag * p.imag
        collisions = 0
        for k in range(count):
            # R/(s - p) + conjugate as one fraction of real coefficients
            upper_real = slope * real[k] + constant
            upper_imag = slope * imag[k]
            lower_real = real[k] * real[k] - imag[k] * imag[k] - 2.0 * p.real * real[k] + square
            lower_imag = 2.0 * imag[k] * (real[k] - p.real)
            scale = 1.0 / (lower_real * lower_real + lower_imag * lower_imag)
            value_real[k] -= (upper_real * lower_real + upper_imag * lower_imag) * scale
            value_imag[k] -= (upper_imag * lower_real - upper_real * lower_imag) * scale
            gap = (real[k] - p.real) ** 2 + (imag[k] - p.imag) ** 2
            collisions += 1 if gap < near else 0
        if collisions > 0:
            _smooth_values(x, arrays, p, unit, near, value_real, value_imag)
        _pole_response(arrays, p, residue, out)
    else:
        for j in range(out.size):
            out[j] = 0.0
    # Node by node, so that the inner loop runs along memory and needs no reordered sum.
    for k in range(0, count, 4):
        r0, i0 = value_real[k], value_imag[k]
        r1, i1 = value_real[k + 1], value_imag[k + 1]
        r2, i2 = value_real[k + 2], value_imag[k + 2]
        r3, i3 = value_real[k + 3], value_imag[k + 3]
        for j in range(out.size):
            out[j] += (
                arrays.weight_real[k, j] * r0
                - arrays.weight_imag[k, j] * i0
                + arrays.weight_real[k + 1, j] * r1
                - arrays.weight_imag[k + 1, j] * i1
                + arrays.weight_real[k + 2, j] * r2
                - arrays.weight_imag[k + 2, j] * i2
                + arrays.weight_real[k + 3, j] * r3
                - arrays.weight_imag[k + 3, j] * i3
            )


@njit
def _smooth_values(
    x: np.ndarray,
    arrays: MapArrays,
    p: complex,
    unit: complex,
    near: float,
    value_real: np.ndarray,
    value_imag: np.ndarray,
) -> None:
    """Where a node is so near the pole that Y − R/(s − p) cancels, take the mean on a circle."""
    for k in range(arrays.real.size):
        node = complex(arrays.real[k], arrays.imag[k])
        gap = node - p
        if gap.real * gap.real + gap.imag * gap.imag < near:
            mean = x[4] * transform_on_circle(node, -1.0, x[0], x[1], x[2], x[3], p, unit)
            value_real[k] = mean.real
            value_imag[k] = mean.imag


@njit
def _pole_response(arrays: MapArrays, p: complex, residue: complex, out: np.ndarray) -> None:
    """2 Re(R S_j) with S the response of the mode e^{pt} to the input."""
    dt, jump, ramp = arrays.dt, arrays.jump, arrays.ramp
    state = 0j
    decay = 1.0 + 0j
    mean = 1.0 + 0j
    length = 0.0
    if arrays.uniform > 0.0:
        length = arrays.uniform
        decay = _decay(p, length)
        mean = phi1(p * length, decay) if arrays.has_ramp else 0j
    for j in range(dt.size):
        if arrays.uniform == 0.0 and dt[j] != length:
            length = dt[j]
            decay = _decay(p, length)
            if arrays.has_ramp:
                mean = phi1(p * length, decay)
        state = decay * (state + jump[j]) + ramp[j] * mean
        out[j] = 2.0 * (residue.real * state.real - residue.imag * state.imag)


@njit
def jacobian_on_map(x: np.ndarray, arrays: MapArrays, work: np.ndarray, out: np.ndarray) -> None:
    """Differentiate `response_on_map` in the five parameters: `out` (5, n), in their order."""
    alpha2, alpha1, a1, a0, b0 = x[0], x[1], x[2], x[3], x[4]
    count = arrays.real.size
    log_pole = find_pole(alpha2, alpha1, a1, a0)
    has_pole = log_pole.imag > 0.0
    p = 0j
    near = -1.0
    single = np.zeros(5, np.complex128)
    double = np.zeros(5, np.complex128)
    gradient = np.empty(5, np.complex128)
    if has_pole:
        p = cexp(log_pole)
        near = (0.5 * circle_radius(p)) ** 2
        pole_derivatives(log_pole, alpha2, alpha1, a1, b0, single, double)
    radius = 2.0 * math.sqrt(max(near, 0.0))
    for k in range(count):
        s = complex(arrays.real[k], arrays.imag[k])
        gap = s - p
        if gap.real * gap.real + gap.imag * gap.imag > near:
            log_s = complex(arrays.log_modulus[k], arrays.angle[k])
            step_gradient(
                s, log_s, _power(alpha2, log_s), _power(alpha1, log_s), a1, a0, b0, gradient
            )
            if has_pole:
                subtract_pole(s, p, single, double, gradient)
            for i in range(5):
                work[2 * i, k] = gradient[i].real
                work[2 * i + 1, k] = gradient[i].imag
        else:
            for i in range(5):
                work[2 * i, k] = 0.0
                work[2 * i + 1, k] = 0.0
            for m in range(CIRCLE):
                z = s + radius * ON_CIRCLE[m]
                log_z = complex(math.log(abs(z)), math.atan2(z.imag, z.real))
                step_gradient(
                    z, log_z, cexp(alpha2 * log_z), cexp(alpha1 * log_z), a1, a0, b0, gradient
                )
                subtract_pole(z, p, single, double, gradient)
                for i in range(5):
                    work[2 * i, k] += gradient[i].real / CIRCLE
                    work[2 * i + 1, k] += gradient[i].imag / CIRCLE
    if has_pole:
        _pole_jacobian(arrays, p, single, double, out)
    else:
        for i in range(5):
            for j in range(out.shape[1]):
                out[i, j] = 0.0
    # The loop of `response_on_map` once more: as a function of its own it costs a tenth.
    for i in range(5):
        row = out[i]
        for k in range(0, count, 4):
            r0, i0 = work[2 * i, k], work[2 * i + 1, k]
            r1, i1 = work[2 * i, k + 1], work[2 * i + 1, k + 1]
            r2, i2 = work[2 * i, k + 2], work[2 * i + 1, k + 2]
            r3, i3 = work[2 * i, k + 3], work[2 * i + 1, k + 3]
            for j in range(row.size):
                row[j] += (
                    arrays.weight_real[k, j] * r0
                    - arrays.weight_imag[k, j] * i0
                    + arrays.weight_real[k + 1, j] * r1
                    - arrays.weight_imag[k + 1, j] * i1
                    + arrays.weight_real[k + 2, j] * r2
                    - arrays.weight_imag[k + 2, j] * i2
                    + arrays.weight_real[k + 3, j] * r3
                    - arrays.weight_imag[k + 3, j] * i3
                )


@njit
def _power(alpha: float, log_s: complex) -> complex:
    modulus = fast_exp(alpha * log_s.real)
    sine, cosine = fast_sincos(alpha * log_s.imag)
    return complex(modulus * cosine, modulus * sine)


@njit
def _pole_jacobian(
    arrays: MapArrays, p: complex, single: np.ndarray, double: np.ndarray, out: np.ndarray
) -> None:
    """2 Re(R' S_j + R p' ∂S_j/∂p) for the five parameters."""
    dt, jump, ramp = arrays.dt, arrays.jump, arrays.ramp
    state = 0j
    slope = 0j
    decay = 1.0 + 0j
    mean = 1.0 + 0j
    mean_slope = 0j
    length = -1.0
    for j in range(dt.size):
        following = arrays.uniform if arrays.uniform > 0.0 else dt[j]
        if following != length:
            length = following
            decay = _decay(p, length)
            if arrays.has_ramp:
                mean = phi1(p * length, decay)
                mean_slope = length * phi1_derivative(p * length, decay)
        start = decay * (state + jump[j])
        slope = decay * slope + length * start + ramp[j] * mean_slope
        state = start + ramp[j] * mean
        for i in range(5):
            out[i, j] = 2.0 * (
                single[i].real * state.real
                - single[i].imag * state.imag
                + double[i].real * slope.real
                - double[i].imag * slope.imag
            )
