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

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo._jit import njit
from spa_fo.fractional._elementary import fast_exp
from spa_fo.fractional.characteristic import (
    check_parameters,
)
from spa_fo.fractional.intervals import Array, input_intervals, step_intervals
from spa_fo.fractional.map_kernels import WORK_ROWS, MapArrays, jacobian_on_map, response_on_map

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
