"""How large an effect is: against the noise floor, in the angle as logged.

All of it runs without noise and without scatter: two campaigns that differ in one effect differ by
that effect alone. Errors of the fixture are no noise: they are in both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from blind.first_rig.campaign import Plan, PlannedTrial, run_fixture
from blind.first_rig.channel import Channel
from blind.first_rig.doses import Dose
from blind.first_rig.station import Station
from spa_fo.virtual_rig.actuator import FractionalCore, ParameterShift
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.bench import Scatter, Specimen
from spa_fo.virtual_rig.converter import Converter

LARGEST_ANGLE_DEG = 85.0  # the fixture ends at 90°
# It begins at 0°: no larger share of a trial may lie below an angle, or no one would read it.
_BELOW = ((-18.0, 0.005), (-6.0, 0.2))
_RATE = 0.005
_CLOSE_ENOUGH = 0.02


@dataclass(frozen=True)
class Reading:
    """A trial as it would be logged without noise.

    Parameters
    ----------
    angle_deg : ndarray (n,)
        Angle of each sample, through the first calibration.
    step_deg : ndarray (n,)
        Step of the converter there.
    """

    angle_deg: Array
    step_deg: Array

    @property
    def readable(self) -> bool:
        """Whether it keeps within what the fixture can calibrate."""
        angle = self.angle_deg
        if not np.all(np.isfinite(angle)) or angle.max() > LARGEST_ANGLE_DEG:
            return False
        return all(np.mean(angle < limit) <= share for limit, share in _BELOW)


class _NoCurve(ValueError):
    """Two known angles that read alike: nobody calibrates such a sensor."""


def exact_readings(specimen: Specimen, plan: Plan, *later: Plan) -> list[Reading]:
    """Run a campaign, and what continues it, without noise and scatter; slips are as drawn.

    Returns
    -------
    list of Reading
        Of each trial in the order they are run.
    """
    around = plan.asked.surroundings
    still = replace(specimen, scatter=Scatter())
    station = Station(still, plan.pre_calibration_s)
    direct = around.calibration.kind == "none"
    channel = Channel(specimen.sensor.curve, Converter(bits=around.bits), direct)
    read = _directly(channel) if direct else _calibrated(plan, station, channel)

    def run(part: Plan, trial: PlannedTrial) -> Reading:
        profile = trial.experiment.profile
        exact = station.run_trial(trial.started_s, profile, around.sampling, part.draws(trial))
        return read(channel.exact(exact.volts, exact.reader))

    return [run(part, trial) for part in (plan, *later) for trial in part.schedule()]


def exact_angles(specimen: Specimen, plan: Plan) -> Array:
    """Angles of all samples of all trials of a campaign, run as `exact_readings` does."""
    return _angles(exact_readings(specimen, plan))


def _angles(readings: Sequence[Reading]) -> Array:
    return np.concatenate([reading.angle_deg for reading in readings])


def _directly(channel: Channel) -> Callable[[Array], Reading]:
    return lambda volts: Reading(channel.felt_deg(volts), np.full(volts.size, channel.step_deg))


def _calibrated(plan: Plan, station: Station, channel: Channel) -> Callable[[Array], Reading]:
    """Calibrate as a reader would: the settled half of each dwell, up and down averaged."""
    dwells = plan.fixture("pre").said_deg
    settled = run_fixture(plan, station, "pre", plan.pre_calibration_s).volts.reshape(
        dwells.size, -1
    )
    settled = settled[:, settled.shape[1] // 2 :].mean(axis=1)
    angles = np.unique(dwells)
    knots = np.array([settled[dwells == at].mean() for at in angles])
    if np.any(np.diff(knots) <= 0.0):
        raise _NoCurve
    curve = PchipInterpolator(knots, angles)
    slope = curve.derivative()

    def read(at: Array) -> Reading:
        inside = np.clip(at, knots[0], knots[-1])
        steepness = np.asarray(slope(inside))
        angle = np.asarray(curve(inside)) + steepness * (at - inside)
        return Reading(angle, steepness * channel.converter.volts_per_count)

    return read


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def noise_floor_deg(specimen: Specimen, plan: Plan) -> float:
    """RMS by which repeated trials differ from their expected mean, deg, to first order.

    Scatter of gain, rest angle and time scale, coloured and white noise, and the converter's
    rounding, each by its own sensitivity, over all samples of all trials.
    """
    return _floor_deg(specimen, plan, exact_readings(specimen, plan))


def _floor_deg(specimen: Specimen, plan: Plan, plain: Sequence[Reading]) -> float:
    noise, scatter = plan.asked.surroundings.noise, specimen.scatter
    faster = with_core(specimen, at_rate(specimen.actuator.core, 1.0 + _RATE))
    by_rate = (exact_angles(faster, plan) - _angles(plain)) / _RATE
    parts = (
        scatter.gain * rms(_angles(plain)),
        scatter.offset_deg,
        scatter.rate * rms(by_rate),
        noise.coloured_deg,
        noise.white_deg,
        rms(np.concatenate([reading.step_deg for reading in plain])) / np.sqrt(12.0),
    )
    return float(np.sqrt(sum(part**2 for part in parts)))


def at_rate(core: FractionalCore, rate_factor: float) -> FractionalCore:
    """Give the core whose responses run `rate_factor` times as fast."""
    return ParameterShift(
        a1=rate_factor ** (core.alpha2 - core.alpha1),
        a0=rate_factor**core.alpha2,
        b0=rate_factor**core.alpha2,
    ).shifted(core)


def with_core(specimen: Specimen, core: FractionalCore) -> Specimen:
    """Give the same specimen with another core."""
    return replace(specimen, actuator=replace(specimen.actuator, core=core))


@dataclass(frozen=True)
class Sized:
    """An effect's amplitude, and the size it has with it (multiples of the noise floor)."""

    amplitude: float
    size: float


class Scale:
    """Weighs effects on one specimen in one campaign against its noise floor.

    Parameters
    ----------
    bare : Specimen
        The specimen without any effect.
    plan : Plan
        The campaign.
    later : Plan
        What continues it: that has to be readable as well.
    """

    def __init__(self, bare: Specimen, plan: Plan, later: Plan) -> None:
        self._bare = bare
        self._plan = plan
        self._later = later
        plain = exact_readings(bare, plan)
        self._plain_deg = _angles(plain)
        self.floor_deg = _floor_deg(bare, plan, plain)

    def weigh(self, specimen: Specimen) -> tuple[float, bool]:
        """Size of what this specimen does otherwise; and whether all of it can be read."""
        try:
            readings = exact_readings(specimen, self._plan, self._later)
        except _NoCurve:
            return np.inf, False
        change = _angles(readings)[: self._plain_deg.size] - self._plain_deg
        return rms(change) / self.floor_deg, all(reading.readable for reading in readings)

    def amplitude_for(self, dose: Dose, size: float, besides: Specimen | None = None) -> Sized:
        """Find the amplitude that has this size; the largest sensible one where none has.

        A specimen with another effect, `besides`, has to be readable as well.
        """

        def weigh(amplitude: float) -> tuple[float, bool]:
            reached, keeps = self.weigh(dose.given_to(self._bare, amplitude))
            if keeps and besides is not None:
                keeps = self.weigh(dose.given_to(besides, amplitude))[1]
            return reached, keeps

        return solve(weigh, size, dose.typical, dose.largest, dose.uneven)


def solve(
    weigh: Callable[[float], tuple[float, bool]],
    size: float,
    start: float,
    largest: float,
    halving: bool = False,
) -> Sized:
    """Find where a rising function reaches `size`, by secants in logarithms within a bracket.

    Amplitudes that `weigh` does not allow lie beyond the end of the bracket. By `halving` it, where
    the slope says nothing and what is not allowed may lie anywhere.
    """
    low, high, end_is_known = 0.0, largest, False
    amplitude = min(start, largest)
    best = Sized(0.0, 0.0)
    last: Sized | None = None
    for _ in range(20 if halving else 14):
        reached, allowed = weigh(amplitude)
        now = Sized(amplitude, reached)
        if allowed and abs(reached - size) < abs(best.size - size):
            best = now
        if abs(best.size - size) <= _CLOSE_ENOUGH * size:
            break
        if (allowed or halving) and reached < size:
            low = amplitude
        else:
            high, end_is_known = amplitude, True
        if high - low <= (1e-4 if halving else 0.01) * high:
            break
        amplitude = high  # nothing to go by where nothing can be read
        if np.isfinite(reached) and not halving:
            amplitude, last = _guess(now, last, size), now
        if not low < amplitude < high:
            amplitude = 0.5 * (low + high) if end_is_known else high
    return best


def _guess(now: Sized, last: Sized | None, size: float) -> float:
    """Extrapolate the power law through the last two weighings."""
    exponent = 1.0
    if last is not None and min(last.size, now.size) > 0 and last.size != now.size:
        slope = np.log(now.size / last.size) / np.log(now.amplitude / last.amplitude)
        exponent = float(np.clip(slope, 0.25, 4.0))
    return float(now.amplitude * (size / max(now.size, 1e-3)) ** (1.0 / exponent))
