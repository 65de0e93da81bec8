"""How large an effect is: against the noise floor, in the angle as logged.

All of it runs on noise-free benches with coarse steps, without any scatter: two campaigns that
differ in one effect differ by that effect alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from blind.first_rig.doses import Dose
from spa_fo.virtual_rig.actuator import FractionalCore, ParameterShift
from spa_fo.virtual_rig.actuators import CampaignPlan
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.bench import Bench, Scatter, Specimen
from spa_fo.virtual_rig.campaign_writer import (
    PRE_CALIBRATION_S,
    board_rate_hz,
    fixture_angles,
    schedule,
    stream,
)

LARGEST_ANGLE_DEG = 85.0  # the fixture ends at 90°
_STEPS_PER_SECOND = 200.0
_PACE = 0.005
_CLOSE_ENOUGH = 0.02


@dataclass(frozen=True)
class Reading:
    """A whole campaign as it would be logged without noise.

    Parameters
    ----------
    angle_deg : ndarray (n,)
        Angles of all samples of all trials, through the first calibration.
    deg_per_volt : ndarray (n,)
        The calibration's slope at each.
    """

    angle_deg: Array
    deg_per_volt: Array


def exact_reading(
    plan: CampaignPlan, seed: int, steps_per_second: float = _STEPS_PER_SECOND
) -> Reading:
    """Run a campaign without noise and without scatter; slips are those of the seed."""
    specimen = replace(plan.specimen, scatter=Scatter())
    bench = Bench(specimen, board_rate_hz(plan), PRE_CALIBRATION_S, steps_per_second)
    curve = _calibrated(plan, bench)
    volts = []
    for trial in schedule(plan, seed):
        bench.rest(trial.started_s)
        bench.begin_trial(stream(plan, seed, trial.file))
        command = trial.experiment.profile.sampled(plan.rate_hz)
        volts.append(bench.drive_exactly(command)[2])
    return curve(np.concatenate(volts))


def _calibrated(plan: CampaignPlan, bench: Bench) -> Callable[[Array], Reading]:
    """Calibrate as a reader would: the settled half of each dwell, up and down averaged."""
    angle, still = fixture_angles(plan)
    volts = bench.hold_exactly(angle)[2]
    dwells = np.array(plan.calibration_deg)
    settled = volts[still].reshape(dwells.size, -1)
    settled = settled[:, settled.shape[1] // 2 :].mean(axis=1)
    angles = np.unique(dwells)
    knots = np.array([settled[dwells == at].mean() for at in angles])
    curve = PchipInterpolator(knots, angles)
    slope = curve.derivative()

    def read(at: Array) -> Reading:
        inside = np.clip(at, knots[0], knots[-1])
        steepness = np.asarray(slope(inside))
        return Reading(np.asarray(curve(inside)) + steepness * (at - inside), steepness)

    return read


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def noise_floor_deg(plan: CampaignPlan, seed: int) -> float:
    """RMS by which repeated trials differ from their expected mean, deg, to first order.

    Scatter of gain, rest offset and pace, the converter's noise and its rounding, each by its own
    sensitivity, over all samples of all trials.
    """
    return _floor(plan, seed, exact_reading(plan, seed))


def _floor(plan: CampaignPlan, seed: int, plain: Reading) -> float:
    scatter = plan.specimen.scatter
    converter = plan.specimen.acquisition.converter
    core = plan.specimen.actuator.core
    faster = _with_core(plan, at_pace(core, 1.0 + _PACE))
    by_pace = (exact_reading(faster, seed).angle_deg - plain.angle_deg) / _PACE
    noise = np.hypot(converter.noise_counts, np.sqrt(1.0 / 12.0)) * converter.volts_per_count
    parts = (
        scatter.gain * plain.angle_deg,
        np.full_like(plain.angle_deg, scatter.offset_deg),
        scatter.pace * by_pace,
        noise * plain.deg_per_volt,
    )
    return float(np.sqrt(sum(np.mean(part**2) for part in parts)))


def at_pace(core: FractionalCore, pace: float) -> FractionalCore:
    """Give the core whose responses run `pace` times as fast."""
    return ParameterShift(
        a1=pace ** (core.alpha2 - core.alpha1), a0=pace**core.alpha2, b0=pace**core.alpha2
    ).shifted(core)


def _with_core(plan: CampaignPlan, core: FractionalCore) -> CampaignPlan:
    actuator = replace(plan.specimen.actuator, core=core)
    return replace(plan, specimen=replace(plan.specimen, actuator=actuator))


@dataclass(frozen=True)
class Sized:
    """An effect's amplitude, and the size it has with it (multiples of the noise floor)."""

    amplitude: float
    size: float


class Scale:
    """Weighs effects on one specimen in one campaign against its noise floor.

    Parameters
    ----------
    plan : CampaignPlan
        The campaign, its specimen without the effect.
    seed : int
        Seed of the campaign.
    """

    def __init__(self, plan: CampaignPlan, seed: int) -> None:
        self._plan = plan
        self._seed = seed
        self._plain = exact_reading(plan, seed)
        self.floor_deg = _floor(plan, seed, self._plain)

    def weigh(self, specimen: Specimen) -> tuple[float, bool]:
        """Size of what this specimen does otherwise; and whether it keeps within the fixture."""
        angle = exact_reading(replace(self._plan, specimen=specimen), self._seed).angle_deg
        keeps = bool(np.all(np.isfinite(angle)) and angle.max() <= LARGEST_ANGLE_DEG)
        return rms(angle - self._plain.angle_deg) / self.floor_deg, keeps

    def amplitude_for(self, dose: Dose, size: float, besides: Specimen | None = None) -> Sized:
        """Find the amplitude that has this size; the largest sensible one where none has.

        A specimen with another effect, `besides`, has to keep within the fixture as well.
        """

        def weigh(amplitude: float) -> tuple[float, bool]:
            reached, keeps = self.weigh(dose.given_to(self._plan.specimen, amplitude))
            if keeps and besides is not None:
                keeps = self.weigh(dose.given_to(besides, amplitude))[1]
            return reached, keeps

        return solve(weigh, size, dose.typical, dose.largest)


def solve(
    weigh: Callable[[float], tuple[float, bool]], size: float, start: float, largest: float
) -> Sized:
    """Find where a rising function reaches `size`, by secants in logarithms within a bracket.

    Amplitudes that `weigh` does not allow lie beyond the end of the bracket.
    """
    low, high, end_is_known = 0.0, largest, False
    amplitude = min(start, largest)
    best = Sized(0.0, 0.0)
    last: Sized | None = None
    for _ in range(14):
        reached, allowed = weigh(amplitude)
        now = Sized(amplitude, reached)
        if allowed and abs(reached - size) < abs(best.size - size):
            best = now
        if abs(best.size - size) <= _CLOSE_ENOUGH * size:
            break
        if allowed and reached < size:
            low = amplitude
        else:
            high, end_is_known = amplitude, True
        if high - low <= 0.01 * high:
            break
        amplitude = _guess(now, last, size)
        if not low < amplitude < high:
            amplitude = 0.5 * (low + high) if end_is_known else high
        last = now
    return best


def _guess(now: Sized, last: Sized | None, size: float) -> float:
    """Extrapolate the power law through the last two weighings."""
    exponent = 1.0
    if last is not None and min(last.size, now.size) > 0 and last.size != now.size:
        slope = np.log(now.size / last.size) / np.log(now.amplitude / last.amplitude)
        exponent = float(np.clip(slope, 0.25, 4.0))
    return float(now.amplitude * (size / max(now.size, 1e-3)) ** (1.0 / exponent))
