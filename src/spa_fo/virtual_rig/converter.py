"""Voltages -> counts: the pressure sensor, the board's 10-bit converters and their pick-up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from spa_fo.virtual_rig.arrays import Array, Effect, Process
from spa_fo.virtual_rig.syringe_pump import delay

Counts = NDArray[np.int64]


@dataclass(frozen=True)
class Converter:
    """An analog-to-digital converter.

    With 10 bits over 5 V one count of the pressure channel is 0.67 kPa and one of the flex
    channel about 0.35°. Counts are rounded from a wide continuum, so the last digits of the
    simulation, which may differ between machines, do not reach the log.

    Parameters
    ----------
    bits : int
        Resolution.
    reference_volt : float
        Full scale.
    noise_counts : float
        Standard deviation of the white noise ahead of the rounding, counts.
    """

    bits: int = 10
    reference_volt: float = 5.0
    noise_counts: float = 0.6

    @property
    def maximum(self) -> int:
        """Largest count."""
        return int(2**self.bits - 1)

    @property
    def volts_per_count(self) -> float:
        """Voltage of one count."""
        return self.reference_volt / self.maximum

    def counts(self, volts: Array, rng: np.random.Generator) -> Counts:
        """Sample the voltages."""
        ideal = volts / self.reference_volt * self.maximum
        noisy = ideal + self.noise_counts * rng.standard_normal(volts.shape)
        return np.clip(np.rint(noisy), 0, self.maximum).astype(np.int64)


@dataclass(frozen=True)
class PressureSensor:
    """A ratiometric gauge sensor, 0-80 psi, straight between its end points."""

    volts_at_ends: tuple[float, float] = (0.5, 4.5)
    kpa_at_ends: tuple[float, float] = (0.0, 551.6)

    def volts(self, pressure_kpa: Array) -> Array:
        """Output voltage."""
        low, high = self.volts_at_ends
        empty, full = self.kpa_at_ends
        return np.asarray(low + (high - low) * (pressure_kpa - empty) / (full - empty))


@dataclass(frozen=True)
class ChannelLatency:
    """The flex channel is stored `delay_s` late against command and pressure."""

    delay_s: float

    def begin(self, step_s: float) -> Process:
        """Start with an empty buffer."""
        return delay(self.delay_s / step_s)


@dataclass(frozen=True)
class MainsPickup:
    """Interference on the flex channel, with a share of the third harmonic.

    Sampled at a multiple of its period it would stand still; a mains that is off by a fraction
    of a hertz beats slowly.
    """

    amplitude_volt: float
    frequency_hz: float = 50.03
    third_harmonic: float = 0.2

    def volts(self, time_s: Array) -> Array:
        """Interference at campaign times."""
        phase = 2.0 * np.pi * self.frequency_hz * time_s
        wave = np.sin(phase) + self.third_harmonic * np.sin(3.0 * phase)
        return np.asarray(self.amplitude_volt * wave)


class Pickup(Protocol):
    """Interference by campaign time."""

    def volts(self, time_s: Array) -> Array:
        """Interference at campaign times."""


class Coupling(Protocol):
    """What the drive does to the flex channel's wire."""

    def begin(self, step_s: float) -> Callable[[Array, Array], Array]:
        """Start at rest: commanded and true pressure in, volts out, every `step_s`."""


@dataclass(frozen=True)
class Acquisition:
    """The board's analog side; None is an effect that is absent.

    `couplings` add to the flex channel: what no library of effects knows.
    """

    pressure_sensor: PressureSensor = PressureSensor()
    converter: Converter = Converter()
    channel_latency: Effect | None = None
    mains_pickup: Pickup | None = None
    couplings: tuple[Coupling, ...] = ()
