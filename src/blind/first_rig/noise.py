"""Noise of the angle reading: coloured, stationary from a trial's first sample, and white."""

from __future__ import annotations

import numpy as np

from blind.first_rig.asked import Noise
from spa_fo._jit import njit
from spa_fo.virtual_rig.arrays import Array


def reading_noise(noise: Noise, time_s: Array, rng: np.random.Generator) -> Array:
    """Draw a trial's noise at its sample times, deg."""
    if noise.colour == "exponential":
        assert noise.correlation_s is not None
        coloured = exponential(time_s / noise.correlation_s, rng)
    else:
        coloured = one_over_f(time_s.size, rng)
    return noise.coloured_deg * coloured + white(noise, time_s.size, rng)


def white(noise: Noise, count: int, rng: np.random.Generator) -> Array:
    """Draw the white noise alone, deg."""
    return noise.white_deg * rng.standard_normal(count)


def exponential(time: Array, rng: np.random.Generator) -> Array:
    """Draw an Ornstein-Uhlenbeck process of unit variance; `time` in correlation times."""
    return _autoregressive(np.exp(-np.diff(time)), rng.standard_normal(time.size))


def one_over_f(count: int, rng: np.random.Generator) -> Array:
    """Draw noise of unit variance with power ∝ 1/f from one period a trial up to half the rate.

    Twice as long a one is drawn and half of it taken: else its end would run into its beginning.
    """
    cycles = 0.5 * np.arange(count + 1)  # in the trial
    power = np.zeros(count + 1)
    power[2:] = 1.0 / cycles[2:]
    parts = rng.standard_normal((2, count + 1)) * np.sqrt(power)
    parts[1, -1] = 0.0  # half the sampling rate has no phase
    wave = np.fft.irfft(parts[0] + 1j * parts[1], 2 * count)
    # Every frequency but the last is there twice, with its conjugate, and has two parts.
    variance = (4.0 * power[:-1].sum() + power[-1]) / (2 * count) ** 2
    return np.asarray(wave[:count] / np.sqrt(variance))


@njit
def _autoregressive(keep: Array, normal: Array) -> Array:
    out = np.empty_like(normal)
    out[0] = normal[0]
    for i in range(keep.size):
        out[i + 1] = keep[i] * out[i] + np.sqrt(1.0 - keep[i] ** 2) * normal[i + 1]
    return out
