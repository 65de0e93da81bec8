"""Coefficients and parameters as they are searched, and what nuisances look like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import Parameter

LN_GAIN = 4
"""Place of the static gain's logarithm among the searched coefficients."""
LOWEST = np.array([0.05, 0.01, -8.0, -8.0, -8.0])
HIGHEST = np.array([1.995, 0.9995, 8.0, 8.0, 8.0])
"""Bounds of the searched coefficients."""


def to_z(x: Floats) -> Floats:
    """Take coefficients to where they are searched: alpha2, alpha1/alpha2, ln a1, ln a0, ln K.

    The ratio keeps alpha1 below alpha2 by a bound of its own.
    """
    return np.array([x[0], x[1] / x[0], np.log(x[2]), np.log(x[3]), np.log(x[4] / x[3])])


def to_x(z: Floats) -> Floats:
    """Take searched coefficients back."""
    a0 = np.exp(z[3])
    return np.array([z[0], z[1] * z[0], np.exp(z[2]), a0, a0 * np.exp(z[4])])


def searched_spread(z: Floats, orders: float, logs: float, gain: float) -> Floats:
    """Covariance of searched coefficients about `z`, (5, 5).

    Given are the standard deviations of both orders, of ln a1 and ln a0, and of ln K.
    """
    slopes = np.eye(5)
    slopes[1, :2] = -z[1] / z[0], 1.0 / z[0]
    spread = np.diag(np.square([orders, orders, logs, logs, gain]))
    return np.asarray(slopes @ spread @ slopes.T)


def at_rate(x: Floats, factor: float) -> Floats:
    """Give the coefficients of an actuator that runs `factor` times as fast."""
    fast = factor ** x[0]
    return np.array([x[0], x[1], x[2] * factor ** (x[0] - x[1]), x[3] * fast, x[4] * fast])


def quicker(z: Floats) -> Floats:
    """Give how searched coefficients, (5,), go with the logarithm of an actuator's rate."""
    return np.array([0.0, 0.0, z[0] * (1.0 - z[1]), z[0], 0.0])


def wave(hz: float | Floats, time_s: Floats, width_s: Floats | float = 0.0) -> Floats:
    """Cosine and sine averaged over windows, (n, 2), or (n, k, 2) of k frequencies."""
    phase = 2.0 * np.pi * np.multiply.outer(time_s, hz)
    blur = np.sinc(np.multiply.outer(width_s, hz))
    return np.stack([np.cos(phase), np.sin(phase)], axis=-1) * blur[..., None]


@dataclass(frozen=True)
class Slot:
    """One searched parameter of an effect and its place in the vector of all."""

    parameter: Parameter
    place: int

    def value(self, z: float) -> float:
        """Value of the searched number."""
        return float(np.exp(z)) if self.parameter.log else z

    def searched(self, value: float) -> float:
        """Give the searched number of a value."""
        return float(np.log(value)) if self.parameter.log else value

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds of the searched number."""
        return self.searched(self.parameter.low), self.searched(self.parameter.high)

    @property
    def centre(self) -> float:
        """Prior mean of the searched number."""
        return self.searched(self.parameter.centre)
