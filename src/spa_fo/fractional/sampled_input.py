"""Response to a sampled input by recursive convolution on one hyperbola.

The step response is Re Σ V_k e^{s_k t} plus the pair of poles, with nodes s_k that serve all lags
from the shortest interval to the whole length (Weideman & Trefethen 2007, section 5,
doi:10.1090/S0025-5718-07-01945-X). So every node carries one state, advanced exactly through each
interval (convolution by Laplace inversion as in Lubich & Schädler 2002,
doi:10.1137/S1064827501388741). The newest interval, whose lags go down to zero, is added by the
ramp response at its full length.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo._jit import njit
from spa_fo.fractional._elementary import fast_exp, fast_sincos
from spa_fo.fractional.characteristic import (
    cexp,
    check_parameters,
    circle_radius,
    find_pole,
    over,
    transform_less_poles,
    transform_on_circle,
)
from spa_fo.fractional.intervals import Hold, input_intervals
from spa_fo.fractional.map_kernels import phi1
from spa_fo.fractional.step import inverse_kernel

# Error exp(-25.5) = 8e-12 of the contour integral.
_LOG_TOLERANCE = 25.5

# States below this are nothing; they are looked for every so many samples.
_NOTHING = 1e-250
_SWEEP = 16


@njit
def _hyperbola(spread: float) -> tuple[float, float]:
    """Best angle φ of the hyperbola for lags up to `spread` times the shortest, and A(φ).

    The error falls as exp(−N (π² − 2πφ)/A(φ)) with N nodes.
    """
    best_rate = 0.0
    best_phi = 0.0
    best_a = 1.0
    for i in range(48):
        phi = 0.25 * math.pi * (1.01 + 0.02 * i)
        a = math.acosh(
            ((math.pi - 2.0 * phi) * spread + 4.0 * phi - math.pi)
            / ((4.0 * phi - math.pi) * math.sin(phi))
        )
        rate = (math.pi**2 - 2.0 * math.pi * phi) / a
        if rate > best_rate:
            best_rate, best_phi, best_a = rate, phi, a
    return best_phi, best_a


@njit
def _simulate(
    dt: np.ndarray,
    jump: np.ndarray,
    ramp: np.ndarray,
    alpha2: float,
    alpha1: float,
    a1: float,
    a0: float,
    shortest: float,
    longest: float,
    tolerance: float,
    out: np.ndarray,
) -> None:
    """Response with b0 = 1; intervals that differ by less than `tolerance` count as equal."""
    phi, a = _hyperbola(longest / shortest)
    count = 8 * math.ceil(_LOG_TOLERANCE * a / (math.pi**2 - 2.0 * math.pi * phi) / 8.0)
    h = a / count
    mu = (4.0 * math.pi * phi - math.pi**2) / a * count / longest

    log_pole = find_pole(alpha2, alpha1, a1, a0)
    p = 0j
    residue = 0j
    reach = 0.0
    if log_pole.imag > 0.0:
        p = cexp(log_pole)
        power = alpha2 * cexp(alpha2 * log_pole) + alpha1 * a1 * cexp(alpha1 * log_pole)
        residue = over(1.0 + 0j, power)
        reach = 0.5 * circle_radius(p)

    node = np.empty((2, count))
    value = np.empty((2, count))
    for k in range(count):
        u = (k + 0.5) * h
        s = complex(mu * (1.0 - math.sin(phi) * math.cosh(u)), mu * math.cos(phi) * math.sinh(u))
        # ds/du / i = mu cos(iu - phi)
        slope = complex(math.cos(phi) * math.cosh(u), math.sin(phi) * math.sinh(u))
        if reach > 0.0 and abs(s - p) < reach:
            z = transform_on_circle(s, -1.0, alpha2, alpha1, a1, a0, p, residue)
        else:
            z = transform_less_poles(s, -1.0, alpha2, alpha1, a1, a0, p, residue)
        v = z * slope * (mu * h / math.pi)
        node[0, k], node[1, k] = s.real, s.imag
        value[0, k], value[1, k] = v.real, v.imag

    decay = np.empty((2, count))
    gain = np.empty((2, count))
    state = np.zeros((3, count))
    pole_state = 0j
    starts = _runs(dt, tolerance)
    ramps = np.empty(starts.size - 1)
    inverse_kernel(dt[starts[:-1]], -2.0, alpha2, alpha1, a1, a0, ramps)
    for run in range(starts.size - 1):
        start, stop = starts[run], starts[run + 1]
        length = dt[start]
        if length > 0.0:
            _prepare(length, node[0], node[1], value[0], value[1], decay, gain)
            # The pole's part of the newest ramp is in its own state below.
            pole_decay = cexp(p * length)
            pole_mean = phi1(p * length, pole_decay)
            newest = ramps[run] / length - 2.0 * (residue * pole_mean).real
            _advance(
                jump[start:stop],
                ramp[start:stop],
                newest,
                value,
                decay,
                gain,
                state,
                out[start:stop],
            )
            for j in range(start, stop):
                pole_state = pole_decay * (pole_state + jump[j]) + ramp[j] * pole_mean
                out[j] += 2.0 * (residue.real * pole_state.real - residue.imag * pole_state.imag)
        else:
            for j in range(start, stop):
                out[j] = out[j - 1] if j > 0 else 0.0


@njit
def _runs(dt: np.ndarray, tolerance: float) -> np.ndarray:
    """First index of every run of equal intervals, and the end of the last."""
    starts = np.empty(dt.size + 1, np.int64)
    count = 0
    for j in range(dt.size):
        if j == 0 or abs(dt[j] - dt[starts[count - 1]]) > tolerance:
            starts[count] = j
            count += 1
    starts[count] = dt.size
    return starts[: count + 1]


@njit
def _prepare(
    length: float,
    node_real: np.ndarray,
    node_imag: np.ndarray,
    value_real: np.ndarray,
    value_imag: np.ndarray,
    decay: np.ndarray,
    gain: np.ndarray,
) -> None:
    """Factors that carry the states through an interval: e^z and V (e^z − 1)/z with z = s dt."""
    decay_real, decay_imag = decay[0], decay[1]
    gain_real, gain_imag = gain[0], gain[1]
    # Two loops: one that held all of this would not vectorise.
    for k in range(node_real.size):
        modulus = fast_exp(node_real[k] * length)
        sine, cosine = fast_sincos(node_imag[k] * length)
        decay_real[k] = modulus * cosine
        decay_imag[k] = modulus * sine
    for k in range(node_real.size):
        x = node_real[k] * length
        y = node_imag[k] * length
        e_real = decay_real[k] - 1.0
        e_imag = decay_imag[k]
        square = x * x + y * y
        scale = 1.0 / square
        m_real = (e_real * x + e_imag * y) * scale
        m_imag = (e_imag * x - e_real * y) * scale
        # Series 1 + z/2 (1 + z/3 (...)), where the difference would cancel.
        t_real = 1.0
        t_imag = 0.0
        for factor in (1 / 10, 1 / 9, 1 / 8, 1 / 7, 1 / 6, 1 / 5, 1 / 4, 1 / 3, 1 / 2):
            r = 1.0 + (t_real * x - t_imag * y) * factor
            t_imag = (t_real * y + t_imag * x) * factor
            t_real = r
        m_real = t_real if square < 0.01 else m_real
        m_imag = t_imag if square < 0.01 else m_imag
        gain_real[k] = value_real[k] * m_real - value_imag[k] * m_imag
        gain_imag[k] = value_real[k] * m_imag + value_imag[k] * m_real


@njit
def _advance(
    jump: np.ndarray,
    ramp: np.ndarray,
    newest: float,
    value: np.ndarray,
    decay: np.ndarray,
    gain: np.ndarray,
    state: np.ndarray,
    out: np.ndarray,
) -> None:
    """Advance all states through intervals of one length.

    The sum over the nodes is written out in eight strands, so that it vectorises in a fixed
    order; together with the loop over nodes that makes 25 ns a sample.
    """
    decay_real, decay_imag = decay[0], decay[1]
    gain_real, gain_imag = gain[0], gain[1]
    state_real, state_imag, part = state[0], state[1], state[2]
    value_real, value_imag = value[0], value[1]
    count = part.size
    for j in range(ramp.size):
        rise, leap = ramp[j], jump[j]
        if leap != 0.0:
            for k in range(count):
                x = state_real[k] + leap * value_real[k]
                y = state_imag[k] + leap * value_imag[k]
                real = decay_real[k] * x - decay_imag[k] * y
                imag = decay_real[k] * y + decay_imag[k] * x
                part[k] = real
                state_real[k] = real + rise * gain_real[k]
                state_imag[k] = imag + rise * gain_imag[k]
        else:
            for k in range(count):
                real = decay_real[k] * state_real[k] - decay_imag[k] * state_imag[k]
                imag = decay_real[k] * state_imag[k] + decay_imag[k] * state_real[k]
                part[k] = real
                state_real[k] = real + rise * gain_real[k]
                state_imag[k] = imag + rise * gain_imag[k]
        if j % _SWEEP == 0:
            # Left to fade, states become subnormal, which costs half as much time again.
            for k in range(count):
                state_real[k] = state_real[k] if abs(state_real[k]) > _NOTHING else 0.0
                state_imag[k] = state_imag[k] if abs(state_imag[k]) > _NOTHING else 0.0
        s0, s1, s2, s3, s4, s5, s6, s7 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(0, count, 8):
            s0 += part[k]
            s1 += part[k + 1]
            s2 += part[k + 2]
            s3 += part[k + 3]
            s4 += part[k + 4]
            s5 += part[k + 5]
            s6 += part[k + 6]
            s7 += part[k + 7]
        out[j] = ((s0 + s4) + (s1 + s5)) + ((s2 + s6) + (s3 + s7)) + rise * newest


def simulate(
    t: ArrayLike,
    u: ArrayLike,
    alpha2: float,
    alpha1: float,
    a1: float,
    a0: float,
    b0: float,
    hold: Hold = "linear",
) -> NDArray[np.float64]:
    """Response of G(s) = b0/(s^α2 + a1 s^α1 + a0) to a sampled input, at rest before t[0].

    Parameters
    ----------
    t : array_like, shape (n,)
        Sample times in s, not decreasing, of any spacing. The input is 0 before t[0].
        Samples that share a time are a jump of the input there.
    u : array_like, shape (n,)
        Input at these times.
    alpha2, alpha1, a1, a0, b0 : float
        As for `step_response`.
    hold : {"linear", "zero"}
        Input between samples: straight lines, or each value held until the next.

    Returns
    -------
    ndarray, shape (n,)
        y(t), right to some 1e-11 b0/a0 max|u|.

    Raises
    ------
    ValueError
        If t and u differ in shape, are not one-dimensional or not finite, if times decrease, if
        hold is neither of the two, or if a parameter is outside its domain.
    """
    parameters = check_parameters(alpha2, alpha1, a1, a0, b0)
    dt, jump, ramp = input_intervals(t, u, hold)
    out = np.zeros(dt.size)
    moving = dt[dt > 0.0]
    if moving.size:
        longest = float(moving.sum())
        tolerance = 8.0 * np.finfo(float).eps * float(np.max(np.abs(np.asarray(t, dtype=float))))
        _simulate(dt, jump, ramp, *parameters[:4], float(moving.min()), longest, tolerance, out)
    return parameters[4] * out
