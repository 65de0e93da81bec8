"""Commanded pressure over time: what an operator types into the pump."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spa_fo.virtual_rig.arrays import Array


@dataclass(frozen=True)
class Profile:
    """A commanded pressure, straight between its corners (two corners at one time are a jump).

    Parameters
    ----------
    protocol : str
        The contract's word for it.
    time_s, pressure_kpa : tuple of float
        The corners; the first lies at 0 s and 0 kPa.
    """

    protocol: str
    time_s: tuple[float, ...]
    pressure_kpa: tuple[float, ...]

    @property
    def duration_s(self) -> float:
        """Length of the trial, s."""
        return self.time_s[-1]

    def sampled(self, rate_hz: float) -> Array:
        """Command of each sample, kPa, to the two decimals that the log holds."""
        samples = round(self.duration_s * rate_hz)
        # A jump belongs to the sample that falls on it: look just after each instant.
        time = (np.arange(samples) + 1e-6) / rate_hz
        return np.asarray(np.round(np.interp(time, self.time_s, self.pressure_kpa), 2))


def step(level_kpa: float, rest_s: float = 1.5, up_s: float = 10.0) -> Profile:
    """Rest, then a constant pressure to the end."""
    return plateaus("step", [level_kpa], rest_s, up_s, release_s=0.0)


def step_release(
    level_kpa: float, rest_s: float = 1.5, up_s: float = 10.0, release_s: float = 8.0
) -> Profile:
    """Rest, a constant pressure, and vented again."""
    return plateaus("step_release", [level_kpa], rest_s, up_s, release_s)


def staircase(
    levels_kpa: list[float], rest_s: float = 1.5, dwell_s: float = 5.0, release_s: float = 5.0
) -> Profile:
    """Rest, each level for `dwell_s`, vented."""
    return plateaus("staircase", levels_kpa, rest_s, dwell_s, release_s)


def hold(
    level_kpa: float, rest_s: float = 1.5, up_s: float = 60.0, release_s: float = 15.0
) -> Profile:
    """Rest, one long constant pressure, vented."""
    return plateaus("hold", [level_kpa], rest_s, up_s, release_s)


def triangle(
    peak_kpa: float,
    cycles: int = 2,
    rest_s: float = 1.5,
    ramp_s: float = 8.0,
    release_s: float = 4.0,
) -> Profile:
    """Rest, `cycles` ramps up and down, rest."""
    time, pressure = [0.0, rest_s], [0.0, 0.0]
    for _ in range(cycles):
        time += [time[-1] + ramp_s, time[-1] + 2 * ramp_s]
        pressure += [peak_kpa, 0.0]
    return Profile("triangle", (*time, time[-1] + release_s), (*pressure, 0.0))


def plateaus(
    protocol: str, levels_kpa: list[float], rest_s: float, dwell_s: float, release_s: float
) -> Profile:
    """Rest, each level for `dwell_s`, and vented for `release_s`."""
    time, pressure = [0.0, rest_s], [0.0, 0.0]
    for level in levels_kpa:
        time += [time[-1], time[-1] + dwell_s]
        pressure += [level, level]
    if release_s > 0:
        time += [time[-1], time[-1] + release_s]
        pressure += [0.0, 0.0]
    return Profile(protocol, tuple(time), tuple(pressure))
