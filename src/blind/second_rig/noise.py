"""Noise of the angle reading."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

Floats = npt.NDArray[np.float64]


def coloured(noise: dict[str, Any], times: Floats, rng: np.random.Generator) -> Floats:
    """Draw coloured noise at the times of a trial's samples, stationary from the first.

    Parameters
    ----------
    noise : dict
        Of the case document: colour, coloured_deg, correlation_s.
    times : ndarray, shape (n,)
        Rising (s).
    rng : Generator
        Draws it.
    """
    size = float(noise["coloured_deg"])
    if size == 0.0 or times.size == 0:
        return np.zeros(times.size)
    if noise["colour"] == "exponential":
        kept = np.exp(-np.diff(times) / float(noise["correlation_s"]))
        relaxing: Floats = _ornstein_uhlenbeck(kept, rng.normal(size=times.size))
        return size * relaxing
    return size * pink(times.size, rng)


def white(noise: dict[str, Any], count: int, rng: np.random.Generator) -> Floats:
    """Draw the white noise of `count` samples."""
    return float(noise["white_deg"]) * rng.normal(size=count)


@njit(cache=True)
def _ornstein_uhlenbeck(kept: Floats, shocks: Floats) -> Floats:
    out = np.empty(shocks.size)
    out[0] = shocks[0]
    for n in range(1, shocks.size):
        r = kept[n - 1]
        out[n] = r * out[n - 1] + np.sqrt(1.0 - r * r) * shocks[n]
    return out


def pink(count: int, rng: np.random.Generator) -> Floats:
    """Draw noise of power ∝ 1/f from 1/(its length) to half the sampling rate, variance 1."""
    lines = np.arange(count // 2 + 1, dtype=np.float64)
    power = np.zeros(lines.size)
    power[1:] = 1.0 / lines[1:]
    if power.sum() == 0.0:
        return rng.normal(size=count)
    amplitude = np.sqrt(power / power.sum())
    if count % 2 == 0:
        amplitude[-1] /= np.sqrt(2.0)  # the last line has no imaginary part
        amplitude /= np.sqrt(np.sum(amplitude[:-1] ** 2) + 2.0 * amplitude[-1] ** 2)
    gauss = rng.normal(size=(2, lines.size))
    spectrum = amplitude * (gauss[0] + 1j * gauss[1]) / 2.0
    if count % 2 == 0:
        spectrum[-1] = amplitude[-1] * gauss[0, -1]
    return np.fft.irfft(spectrum * count, count)
