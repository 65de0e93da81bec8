"""The flex sensor's curve, the fixture it is calibrated in, and the converters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from blind.second_rig.effect import Effect
from blind.second_rig.noise import white
from blind.second_rig.sensor import Skin, When, log, see

Floats = npt.NDArray[np.float64]
Rng = np.random.Generator

_STEP_S = 0.005
_WAIT_S = 4.0  # at the first angle, before the log


@dataclass(frozen=True)
class Curve:
    """Angle to counts: a resistor that bends, in a divider, behind an amplifier.

    Attributes
    ----------
    bits : int
        Of the converter.
    rise, bow : float
        Relative change of the resistor at 90 deg, and its quadratic part.
    divider : float
        Fixed resistor over the straight sensor's.
    low, high : float
        Shares of the converter's range at 0 and 90 deg.
    """

    bits: int
    rise: float
    bow: float
    divider: float
    low: float
    high: float

    @property
    def full(self) -> int:
        """The largest count."""
        return int(2**self.bits - 1)

    def level(self, angle_deg: Floats) -> Floats:
        """Return what the converter is given, in counts, not rounded."""
        x = np.clip(angle_deg, -60.0, 150.0) / 90.0
        volts = self._volts(x)
        zero, full = self._volts(np.array([0.0, 1.0]))
        share = self.low + (self.high - self.low) * (volts - zero) / (full - zero)
        return np.asarray(share * self.full, dtype=np.float64)

    def counts(self, angle_deg: Floats) -> npt.NDArray[np.int64]:
        """Return the counts of angles."""
        return np.clip(np.rint(self.level(angle_deg)), 0, self.full).astype(np.int64)

    def resolution_deg(self, angle_deg: Floats) -> Floats:
        """Return how many degrees a count is worth at angles."""
        slope = (self.level(angle_deg + 0.05) - self.level(angle_deg - 0.05)) / 0.1
        return np.asarray(1.0 / np.abs(slope), dtype=np.float64)

    def _volts(self, x: Floats) -> Floats:
        resistance = 1.0 + self.rise * (x + self.bow * x * np.abs(x))
        return np.asarray(resistance / (resistance + self.divider), dtype=np.float64)


def draw_curve(bits: int, rng: Rng) -> Curve:
    """Draw a sensor and its amplifier, rising or falling."""
    low, high = rng.uniform(0.12, 0.2), rng.uniform(0.7, 0.85)
    if rng.random() < 0.4:
        low, high = high, low
    return Curve(
        bits, rng.uniform(0.6, 1.0), rng.uniform(-0.12, 0.2), rng.uniform(1.0, 2.5), low, high
    )


@dataclass(frozen=True)
class CalibrationLog:
    """A calibration as it was logged: times (s), known angles (deg) and counts."""

    started_s: float
    times: Floats
    known: Floats
    counts: npt.NDArray[np.int64]


@dataclass(frozen=True)
class Fixture:
    """How a sensor is calibrated: known angles in the order they are visited."""

    angles: tuple[float, ...]
    dwell_s: float
    travel_s: float
    error_deg: float

    @property
    def length_s(self) -> float:
        """From the first dwell to the end of the last."""
        return len(self.angles) * (self.dwell_s + self.travel_s)


def draw_fixture(surroundings: dict[str, Any], top_deg: float, rng: Rng) -> Fixture:
    """Draw the known angles of a calibration: from below rest to beyond the largest angle."""
    settings = surroundings["calibration"]
    low, high = -float(rng.integers(11, 16)), float(np.ceil(top_deg) + rng.integers(8, 14))
    up = np.round(np.linspace(low, high, int(settings["angles"])) * 2.0) / 2.0
    visited = [*up, *up[::-1]] if int(settings["directions"]) == 2 else [*up]
    return Fixture(
        tuple(float(x) for x in visited),
        float(settings["dwell_s"]),
        rng.uniform(1.2, 2.5),
        float(surroundings["fixture"]["error_deg"]),
    )


def calibrate(
    fixture: Fixture,
    curve: Curve,
    effects: Sequence[Effect],
    surroundings: dict[str, Any],
    when: When,
    rng: Rng,
) -> CalibrationLog:
    """Dwell at known angles and log the sensor from the moment the fixture stands still.

    Parameters
    ----------
    fixture : Fixture
        Angles and dwells.
    curve : Curve
        Of the sensor and its converter.
    effects : sequence of Effect
        Those of sensor and acquisition show.
    surroundings : dict
        Of the case document: noise and sampling.
    when : When
        Start, and how many trials have begun.
    rng : Generator
        Draws each dwell's error, times and noise.
    """
    true = np.array(fixture.angles) + fixture.error_deg * rng.normal(size=len(fixture.angles))
    cycle = fixture.dwell_s + fixture.travel_s
    # The first dwell is made longer by what goes before the log; travel follows each dwell.
    begins = _WAIT_S + cycle * np.arange(true.size)
    corners = np.concatenate([[0.0], np.ravel(np.column_stack([begins, begins + fixture.dwell_s]))])
    path = np.concatenate([true[:1], np.repeat(true, 2)])
    clock = _STEP_S * np.arange(int(np.ceil(corners[-1] / _STEP_S)) + 1, dtype=np.float64)
    started = When(when.started_s - _WAIT_S, when.order)
    angle = np.interp(clock, corners, path)
    shown = see(effects, angle, np.zeros_like(angle), _STEP_S, Skin(), started)
    period = 1.0 / float(surroundings["sampling"]["rate_hz"])
    jitter = float(surroundings["sampling"]["jitter"])
    count = max(12, int(fixture.dwell_s / period))
    within = period * np.arange(count, dtype=np.float64)
    times = np.concatenate([begin + jittered(within, period, jitter, rng) for begin in begins])
    read = log(effects, shown, _STEP_S, times, started)
    read = read + white(surroundings["noise"], times.size, rng)
    known = np.repeat(np.array(fixture.angles), count)
    return CalibrationLog(when.started_s, times - _WAIT_S, known, curve.counts(read))


def jittered(times: Floats, period: float, share: float, rng: Rng) -> Floats:
    """Return true times of samples: late or early by a share of the period, never out of order."""
    shift = np.clip(share * rng.normal(size=times.size), -0.45, 0.45) * period
    return np.asarray(np.maximum(times + shift, times[0]), dtype=np.float64)
