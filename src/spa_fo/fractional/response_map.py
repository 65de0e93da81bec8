r"""Response to a fixed input as a matrix times the transform at fixed nodes.

The step response of G(s) = b0/D(s) is a pair of modes e^{pt} plus ∫ρ(r) e^{-rt} dr, and its
transform Y = b0/(s D(s)) the same with 1/(s − p) and 1/(s + r). A linear map that takes
1/(s_k + r) at fixed nodes s_k to the response of the mode e^{-rt}, for all r >= 0, therefore
takes Y(s_k), less its poles, to the response of G. The map depends on the times and the input
alone; it is found once by least squares over r, and every evaluation for new parameters is one
matrix-vector product. The nodes lie on a hyperbola as in Weideman & Trefethen 2007
(doi:10.1090/S0025-5718-07-01945-X), here fixed for all times from the shortest lag to the
longest: about nine nodes a decade.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo._jit import njit
from spa_fo.fractional._elementary import fast_exp, fast_sincos
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
from spa_fo.fractional.intervals import Array, input_intervals, step_intervals
from spa_fo.fractional.step import pole_derivatives, step_gradient, subtract_pole

# Hyperbola s = mu (1 + sin(iu - phi)) with mu = _VERTEX / (longest lag), found by search: the
# error of the map is flat around these values and independent of the range of lags.
_PHI = 0.3866
_VERTEX = 10.9
_REACH = 4.22
_LEAST_RANGE = 20.0
_STEP_SPACING = 0.24
_INPUT_SPACING = 0.22
# Samples of r for the least squares: a decade's worth, and how far beyond the range of lags.
_RATES_PER_DECADE = 24
_BLOCK = 512
_DAMPING = 1e-14

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


@dataclass(frozen=True, eq=False)
class ResponseMap:
    """Response to one fixed input at fixed times, for any parameters.

    Made by `step_map` and `input_map`. `arrays` is what the kernels `response_on_map` and
    `jacobian_on_map` take.
    """

    arrays: MapArrays

    @property
    def size(self) -> int:
        """Number of times."""
        return int(self.arrays.dt.size)

    @property
    def nodes(self) -> NDArray[np.complex128]:
        """Nodes in the s-plane, 1/s."""
        return self.arrays.real + 1j * self.arrays.imag

    def work(self) -> Array:
        """Return scratch space for the kernels, one for each thread."""
        return np.empty((WORK_ROWS, self.arrays.real.size))

    def response(self, x: ArrayLike) -> Array:
        """Return the response for x = (alpha2, alpha1, a1, a0, b0), shape (n,).

        Raises
        ------
        ValueError
            If x is outside the domain of `step_response`.
        """
        out = np.empty(self.size)
        response_on_map(_parameters(x), self.arrays, self.work(), out)
        return out

    def jacobian(self, x: ArrayLike) -> Array:
        """Return the derivatives of the response in the five parameters, shape (n, 5).

        Raises
        ------
        ValueError
            If x is outside the domain of `step_response`.
        """
        out = np.empty((5, self.size))
        jacobian_on_map(_parameters(x), self.arrays, self.work(), out)
        return out.T


def step_map(t: ArrayLike) -> ResponseMap:
    """Map for the unit-step response at fixed times.

    Parameters
    ----------
    t : array_like, shape (n,)
        Sorted times in s, none negative, at least one positive.

    Returns
    -------
    ResponseMap
        Right to some 1e-11 b0/a0.

    Raises
    ------
    ValueError
        If the times are not as described.
    """
    dt, jump, ramp = step_intervals(t)
    times = np.cumsum(dt)
    if not np.any(times > 0.0):
        raise ValueError("at least one time must be positive")
    return _fold(dt, jump, ramp, float(times[times > 0.0][0]), float(times[-1]), _STEP_SPACING)


def input_map(t: ArrayLike, u: ArrayLike, hold: str = "linear") -> ResponseMap:
    """Map for the response to a fixed sampled input at its own sample times.

    Parameters
    ----------
    t, u, hold
        As for `simulate`; t must span a positive time.

    Returns
    -------
    ResponseMap
        Right to some 1e-11 b0/a0 max|u|. It holds 16 N n bytes, N about ten nodes a decade of
        the range from the shortest interval to the whole length.

    Raises
    ------
    ValueError
        As for `simulate`, and if all samples share one time.
    """
    dt, jump, ramp = input_intervals(t, u, hold)
    if not np.any(dt > 0.0):
        raise ValueError("the samples must span a positive time")
    return _fold(dt, jump, ramp, float(dt[dt > 0.0].min()), float(dt.sum()), _INPUT_SPACING)


def _parameters(x: ArrayLike) -> Array:
    values = np.asarray(x, dtype=np.float64)
    if values.shape != (5,):
        raise ValueError(f"x must hold (alpha2, alpha1, a1, a0, b0), got shape {values.shape}")
    return np.array(check_parameters(*values))


def _fold(
    dt: Array, jump: Array, ramp: Array, shortest: float, longest: float, spacing: float
) -> ResponseMap:
    """Fit the weights for lags from `shortest` to `longest`."""
    # A multiple of eight nodes, so that vector loops have no remainder.
    reach = math.log(_REACH * max(longest / shortest, _LEAST_RANGE))
    count = 8 * math.ceil(reach / (8.0 * spacing))
    u = (np.arange(count) + 0.5) * spacing
    nodes = _VERTEX / longest * (1.0 + np.sin(1j * u - _PHI))
    decades = math.log10(longest / shortest) + 6.5
    samples = 4 * math.ceil(_RATES_PER_DECADE * decades / 4.0)
    rates = np.append(0.0, np.geomspace(1e-3 / longest, 3e3 / shortest, samples - 1))
    # Unknowns are the weights over s_k: the transform grows like 1/s, so they are of order one.
    modes = nodes / (nodes + rates[:, np.newaxis])
    columns = np.hstack([modes.real, -modes.imag]).T
    basis, upper = _orthogonalise(np.ascontiguousarray(columns))
    project = np.ascontiguousarray(basis[:, : rates.size].T)
    weights = np.empty((count, dt.size), dtype=np.complex128)
    state = np.zeros(rates.size)
    for start in range(0, dt.size, _BLOCK):
        block = slice(start, start + _BLOCK)
        targets = np.empty((dt[block].size, rates.size))
        _mode_responses(rates, dt[block], jump[block], ramp[block], state, targets)
        components = np.zeros((targets.shape[0], project.shape[1]))
        _add_product(targets, project, components)
        halves = components.T.copy()
        _solve_upper(upper, halves)
        weights[:, block] = (halves[:count] + 1j * halves[count:]) * nodes[:, np.newaxis]
    # Until the first interval that is not empty the states are 0 whatever the length.
    used = dt[np.flatnonzero(dt)[0] :]
    equal = np.ptp(used) < 8.0 * np.finfo(float).eps * longest
    return ResponseMap(
        MapArrays(
            log_modulus=np.log(np.abs(nodes)),
            angle=np.angle(nodes),
            real=nodes.real.copy(),
            imag=nodes.imag.copy(),
            weight_real=weights.real.copy(),
            weight_imag=weights.imag.copy(),
            dt=dt,
            jump=jump,
            ramp=ramp,
            uniform=float(np.mean(used)) if equal else 0.0,
            has_ramp=bool(np.any(ramp != 0.0)),
        )
    )


@njit
def _mode_responses(
    rates: np.ndarray,
    dt: np.ndarray,
    jump: np.ndarray,
    ramp: np.ndarray,
    state: np.ndarray,
    out: np.ndarray,
) -> None:
    """Response of each mode e^{-rt} to the input, out[j, i]; carries `state` on."""
    for j in range(dt.size):
        for i in range(rates.size):
            z = rates[i] * dt[j]
            decay = fast_exp(-z)
            # (1 - e^-z)/z, by its series where the difference would cancel
            series = 1.0 - z * (0.5 - z * (1.0 / 6.0 - z * (1.0 / 24.0 - z * (1.0 / 120.0))))
            mean = (1.0 - decay) / z if z > 1e-3 else series
            state[i] = decay * (state[i] + jump[j]) + ramp[j] * mean
            out[j, i] = state[i]


@njit
def _orthogonalise(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """QR decomposition by Gram-Schmidt, every column orthogonalised twice.

    Of the matrix with the given columns on top of 1e-14 times the identity, which bounds the
    least-squares solution where the columns are nearly dependent. Serial like `_add_product`,
    and for the same reason.

    Returns
    -------
    basis : ndarray, shape (columns, rows + columns)
        Q^T.
    upper : ndarray, shape (columns, columns)
        R.
    """
    n, rows = columns.shape
    basis = np.zeros((n, rows + n))
    upper = np.zeros((n, n))
    for k in range(n):
        column = basis[k]
        for j in range(rows):
            column[j] = columns[k, j]
        column[rows + k] = _DAMPING
        for _ in range(2):
            for i in range(k):
                other = basis[i]
                s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
                for j in range(0, rows + n, 4):
                    s0 += other[j] * column[j]
                    s1 += other[j + 1] * column[j + 1]
                    s2 += other[j + 2] * column[j + 2]
                    s3 += other[j + 3] * column[j + 3]
                part = (s0 + s1) + (s2 + s3)
                upper[i, k] += part
                for j in range(rows + n):
                    column[j] -= part * other[j]
        square = 0.0
        for j in range(rows + n):
            square += column[j] * column[j]
        norm = math.sqrt(square)
        upper[k, k] = norm
        for j in range(rows + n):
            column[j] /= norm
    return basis, upper


@njit
def _solve_upper(upper: np.ndarray, right: np.ndarray) -> None:
    """Replace the right-hand sides, side by side, by the solutions of R x = b."""
    for k in range(upper.shape[0] - 1, -1, -1):
        solution = right[k]
        scale = 1.0 / upper[k, k]
        for j in range(solution.size):
            solution[j] *= scale
        for i in range(k):
            row = right[i]
            factor = upper[i, k]
            for j in range(row.size):
                row[j] -= factor * solution[j]


@njit
def _add_product(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    """Add a·b to out, the number of columns of a a multiple of four.

    Serial on purpose: with its own threads, BLAS takes from 40 ms up to 2 s for a log of 5000
    samples while other processes keep the cores busy; this takes 40 ms always.
    """
    for i in range(a.shape[0]):
        row = out[i]
        for k in range(0, a.shape[1], 4):
            f0, f1, f2, f3 = a[i, k], a[i, k + 1], a[i, k + 2], a[i, k + 3]
            for j in range(row.size):
                row[j] += (f0 * b[k, j] + f1 * b[k + 1, j]) + (f2 * b[k + 2, j] + f3 * b[k + 3, j])


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
