"""What a campaign offers as evidence: angles, pressure, calibrations, and trials run alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import median_filter

from spa_fo.arrays import Floats, Integers
from spa_fo.errors import BadInput
from spa_fo.plant.alike import began_vented, let_go, run_alike
from spa_fo.plant.chain import Chain, Usual, chain_for, static_gain
from spa_fo.plant.effects.effect import USUAL_DEG, USUAL_KPA, USUAL_RISE_S, Reach
from spa_fo.plant.fixture import Fixture, fixture_of
from spa_fo.plant.grid import CampaignGrid, campaign_grid
from spa_fo.plant.grid_parts import only
from spa_fo.plant.memory import STEPS_S
from spa_fo.plant.sensor_curve import SHORTEST, curve_sigma, curve_stretch_of, sigma_at
from spa_fo.plant.stages import true_pressure
from spa_fo.rig import Calibration, CampaignData, Trial

_LONGEST_LEVEL = 4  # of a step: 0.32 s resolves what is slow, and a diagnosis takes many runs
_BINNING_DEG = 0.03  # error of averaging a curve over a step
_TIMING_S = 0.003  # error of one sample's time
# Times the usual time between samples, and times a ramp; of the range of the command; samples that
# say how it slopes. Assumed.
A_GAP, _CHANGES, _SLOPE = 3.0, 0.02, 11
_RATE_OVER_S = 0.12
_NEAR_S = 0.4
_TOP = 0.99  # quantile
_SHORTEST_S = 60.0  # of a campaign, as how fast it may drift goes. Assumed
_SLOWEST = 10.0  # times the usual; what is plausible of a quick rig is as of a usual one
_A_STEP = 0.1  # quantile of the distances of neighbouring values: some counts are never read


@dataclass(frozen=True)
class Evidence:
    """A campaign made ready for diagnosis; n averaged samples, m angles of later calibrations."""

    data: CampaignData
    grid: CampaignGrid
    rows: list[Integers]  # by trial, its averaged samples
    alike: Integers  # (trials,): number of the first trial of the same experiment and command
    late_s: Floats  # (trials,): by how much later than that one its command begins
    takes_part: NDArray[np.bool_]  # (trials,): explanations are fitted by these, others held out
    noise_deg: float  # white noise of one sample's angle
    pressure_noise_kpa: float  # the same of its pressure; NaN without
    variance: Floats  # (n,): of each averaged sample, deg²
    curve_stretch: float  # knots of an unknown sensor curve, as multiples of `CURVE_KNOTS_DEG`
    curve_sigma_deg: Floats  # (knots,): error of the calibrated curve there
    curve_apart_deg: Floats  # (knots,): the same where an effect is the calibration's loop
    fixture: Fixture | None  # dwells of all calibrations
    drift_deg: Floats  # (m,): what later ones read through the first curve, less what it read
    drift_sigma_deg: Floats  # (m,)
    drift_angle_deg: Floats  # (m,): at which angles
    drift_after: Integers  # (m,): how many trials came before
    usual: Usual | None = None  # what a reference says that the model misses
    foreseen_deg: Floats | None = None  # (n,): how well a reference knows that, 1 sigma
    late_deg: Floats | None = None  # (n,): what times that are off make of it, as there, 1 sigma
    read_deg: float = 0.0  # largest angle that a reference has read
    step_deg: float = 0.0  # of the converter, as an angle; 0 where none shows
    line_deg: float = 0.0  # RMS of an interference that was taken off the angles
    rise_s: float = USUAL_RISE_S  # in which the given model makes most of a step
    vented: NDArray[np.bool_] | None = None  # (trials,): began at rest as their pressure came
    let_go: bool = False  # whether all began at rest, whatever a pump had left

    @cached_property
    def reach(self) -> Reach:
        """How far it goes, which says what is plausible of an effect's parameters."""
        grid = self.grid
        kpa = grid.pressure_kpa if grid.command_kpa is None else grid.command_kpa
        assert kpa is not None
        # A rig that is blocked, or whose sensor came off, goes as far as it did before.
        angle = max(largest_deg(grid.trials), self.read_deg)
        pressure = float(np.abs(kpa).max())
        return Reach(
            max(angle, SHORTEST * USUAL_DEG) / USUAL_DEG,
            max(pressure, SHORTEST * USUAL_KPA) / USUAL_KPA,
            self.read_deg,
            float(np.clip(self.rise_s / USUAL_RISE_S, 1.0, _SLOWEST)),
            max(float(np.ptp(grid.middle_s)), _SHORTEST_S) / 3600.0,
            np.unique(self.alike).size < self.alike.size,
        )

    @cached_property
    def course_s(self) -> Floats:
        """Time of each averaged sample as that of the first trial alike has it, (n,)."""
        return np.asarray(self.grid.time_s - self.late_s[self.grid.sample_trial])

    @cached_property
    def interval_s(self) -> float:
        """Usual time between two samples of a log."""
        return float(np.median(np.concatenate([np.diff(t.t_s) for t in self.grid.trials])))

    @property
    def curve_share(self) -> float:
        """How far its knots reach of what is plausible of a curve's errors, which goes further."""
        return self.curve_stretch / curve_stretch_of(self.reach.angle * USUAL_DEG)

    @property
    def lasted_s(self) -> list[float]:
        """How long each trial was sampled, s."""
        return [float(np.ptp(self.grid.time_s[own])) for own in self.rows]

    @property
    def horizon_s(self) -> float:
        """About how long a trial's first step lasted, s; of a log cut at its start nobody knows."""
        return 0.5 * float(np.median([lasted for lasted in self.lasted_s if lasted > 0.0]))

    @property
    def used(self) -> NDArray[np.bool_]:
        """Averaged samples of the trials that take part, (n,)."""
        return np.asarray(self.takes_part[self.grid.sample_trial])

    def only(self, trials: NDArray[np.bool_]) -> Evidence:
        """Leave trials out, as if they had not been run; what a reference misses stays unsaid."""
        if trials.all():
            return self
        grid, samples = only(self.grid, trials), trials[self.grid.sample_trial]
        alike = np.unique(self.alike[trials], return_index=True, return_inverse=True)
        made = replace(
            self,
            grid=grid,
            rows=[np.flatnonzero(grid.sample_trial == i) for i in range(len(grid.trials))],
            alike=alike[1][alike[2]],
            late_s=self.late_s[trials],
            takes_part=self.takes_part[trials],
            variance=self.variance[samples],
            usual=None,
            foreseen_deg=None,
            late_deg=None,
            vented=None if self.vented is None else self.vented[trials],
        )
        made.__dict__["reach"] = self.reach  # what is plausible stays
        return made

    @property
    def has_pressure(self) -> bool:
        """Whether command and pressure were logged in every trial."""
        return self.grid.measured_kpa is not None and self.grid.command_kpa is not None


def largest_deg(trials: Sequence[Trial]) -> float:
    """Return what angle is reached in any trial but for a moment, which may be a dropout."""
    return max(float(np.quantile(np.abs(t.angle_deg), _TOP)) for t in trials)


def collect(data: CampaignData) -> Evidence:
    """Gather the evidence of a campaign; `BadInput` where no trial has any."""
    grid = campaign_grid(data.trials, data.campaign.folder, longest=_LONGEST_LEVEL)
    if np.unique(grid.sample_trial).size == grid.sample_trial.size:
        text = "no trial has samples at times that are known; expected some before a reset"
        raise BadInput(data.campaign.folder, text)
    rows = [np.flatnonzero(grid.sample_trial == i) for i in range(len(grid.trials))]
    noise = _white([trial.angle_deg for trial in grid.trials])
    pressures = [t.pressure_kpa for t in grid.trials if t.pressure_kpa is not None]
    drift, sigma, angles, after = _drifts(data, grid)
    alike, late_s = run_alike(grid)
    stretch = curve_stretch_of(max(largest_deg(grid.trials), np.abs(angles).max(initial=0.0)))
    return Evidence(
        data=data,
        grid=grid,
        rows=rows,
        alike=alike,
        late_s=late_s,
        takes_part=np.ones(len(rows), dtype=bool),
        noise_deg=noise,
        pressure_noise_kpa=float("nan") if grid.measured_kpa is None else _white(pressures),
        variance=noise**2 / grid.counts
        + _BINNING_DEG**2
        + (np.hypot(_TIMING_S, _unsure_s(grid, rows)) * _rates(grid, rows)) ** 2,
        curve_stretch=stretch,
        curve_sigma_deg=curve_sigma(data.calibration, stretch),
        curve_apart_deg=curve_sigma(data.calibration, stretch, loop=False),
        fixture=fixture_of(data.calibrations, grid.trials[0].started_s),
        drift_deg=drift,
        drift_sigma_deg=sigma,
        drift_angle_deg=angles,
        drift_after=after,
        step_deg=step_deg_of(grid.trials),
        vented=began_vented(grid),
        let_go=let_go(grid),
    )


def step_deg_of(trials: Sequence[Trial]) -> float:
    """Say how far neighbouring values of the angle are apart."""
    steps = [np.diff(np.unique(np.round(trial.angle_deg, 6))) for trial in trials]
    seen = [float(np.quantile(each, _A_STEP)) for each in steps if each.size]
    return float(np.median(seen)) if seen else 0.0


def _white(signals: Sequence[Floats]) -> float:
    """White noise by second differences, which a smooth signal hardly enters."""
    every = np.concatenate([np.diff(signal, 2) ** 2 / 6.0 for signal in signals])
    # Jumps of the signal are outliers: a trimmed mean, scaled for normal noise.
    kept = every[every <= np.quantile(every, 0.95)]
    return max(float(np.sqrt(kept.mean() / 0.7588)), 1e-3)


def _rates(grid: CampaignGrid, rows: list[Integers]) -> Floats:
    """How fast the angle changes at each averaged sample, deg/s, over a quarter second."""
    rates = np.zeros(grid.angle_deg.size)
    for own in rows:
        time = grid.time_s[own]
        area = cumulative_trapezoid(grid.angle_deg[own], time, initial=0)
        about = np.interp(time + _RATE_OVER_S * np.array([[-1.0], [0.0], [1.0]]), time, area)
        rates[own] = np.abs(np.diff(about, 2, axis=0)[0]) / _RATE_OVER_S**2
    return rates


def _unsure_s(grid: CampaignGrid, rows: list[Integers]) -> Floats:
    """How unsure it is when the command last jumped, at each averaged sample, 1 sigma, s.

    What jumped within a gap of the log did so at any time in it. Trials alike may say when, but
    not what else happened meanwhile.
    """
    unsure = np.zeros(grid.time_s.size)
    for own, trial in zip(rows, grid.trials, strict=True):
        if trial.command_kpa is None or trial.t_s.size < 2:
            continue
        interval_s, change = np.diff(trial.t_s), np.abs(np.diff(trial.command_kpa))
        usual_s, slowest = float(np.median(interval_s)), _CHANGES * np.ptp(trial.command_kpa)
        # A ramp is where it was, and where it is after a gap.
        sloped = median_filter(change / np.maximum(interval_s, usual_s), _SLOPE, mode="nearest")
        at = np.flatnonzero((change > slowest) & (change > A_GAP * sloped * interval_s))
        sigma_s = np.where(interval_s > A_GAP * usual_s, interval_s, 0.0)[at] / np.sqrt(12.0)
        last = np.searchsorted(trial.t_s[at], grid.time_s[own])
        unsure[own] = np.append(0.0, sigma_s)[last]
    return unsure


def _drifts(data: CampaignData, grid: CampaignGrid) -> tuple[Floats, Floats, Floats, Integers]:
    """Drifts of all later calibrations, their errors, angles, and the trials before them."""
    if not data.drifts or data.calibration is None:
        return np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64)
    drift = np.concatenate([item.drift_deg for item in data.drifts])
    angle = np.concatenate([item.angles_deg for item in data.drifts])
    before = [sum(t.started_s < item.started_s for t in grid.trials) for item in data.drifts]
    after = np.repeat(before, [item.drift_deg.size for item in data.drifts])
    # What goes both ways again has the loop's middle again.
    alike = [_goes_alike(data.calibration, later) for later in data.calibrations[1:]]
    sigma = np.concatenate(
        [
            sigma_at(data.calibration, item.angles_deg, not same)
            for item, same in zip(data.drifts, alike, strict=True)
        ]
    )
    return drift, np.hypot(sigma, 0.1), angle, after


def _goes_alike(first: Calibration, later: Calibration) -> bool:
    """Whether a later calibration has the same dwells in the same order as the first."""
    one, other = ([(d.angle_deg, d.direction) for d in each.dwells] for each in (first, later))
    return one == other


@dataclass(frozen=True)
class Repeats:
    """Trials that were run alike, on the n averaged samples of the longest of them."""

    rows: Integers  # (n,): the averaged samples of that trial
    weight: Floats  # (n,): samples averaged in each
    values: Floats  # (trials, n): of all of them at its times; NaN where one has no sample near
    trials: Integers  # (trials,): which they are, as an index into the grid's


def repeats(evidence: Evidence, values: Floats, which: NDArray[np.bool_]) -> list[Repeats]:
    """Align a signal at the averaged samples, (n,), over trials run alike; `which`: (trials,)."""
    grid, found, times = evidence.grid, [], evidence.course_s
    for first in np.unique(evidence.alike[which]):
        trials = np.flatnonzero(which & (evidence.alike == first))
        # The longest trial says when: a board's reset may have cut others.
        rows = evidence.rows[max(trials, key=lambda trial: evidence.rows[trial].size)]
        time = times[rows]
        aligned = np.full((trials.size, rows.size), np.nan)
        for k, trial in enumerate(trials):
            own = times[evidence.rows[trial]]
            after = np.minimum(np.searchsorted(own, time), own.size - 1)
            before = np.maximum(after - 1, 0)
            near = np.minimum(np.abs(own[after] - time), np.abs(own[before] - time)) < _NEAR_S
            aligned[k, near] = np.interp(time, own, values[evidence.rows[trial]])[near]
        found.append(Repeats(rows, grid.counts[rows], aligned, trials))
    return found


def noise_floor(
    evidence: Evidence, explained_deg: Floats | None = None, otherwise: float | None = None
) -> float:
    """RMS by which trials of one experiment deviate from their expected mean, deg.

    Scatter in gain, rest angle and rate and the noise of single samples included; pooled over the
    experiments, so one with a single trial borrows it. Where trials drift with their order, the
    differences of successive ones count (von Neumann 1941, doi:10.1214/aoms/1177731677), or the
    drift would hide itself in the floor.

    Parameters
    ----------
    explained_deg : (n,) array, optional
        What an explanation predicts: by how much it lets trials differ is no scatter.
    otherwise : float, optional
        What is returned where nothing was repeated; by default the noise of single samples.
    """
    values = evidence.grid.angle_deg
    if explained_deg is not None:
        values = values - explained_deg
    squares, weights = np.zeros(2), np.zeros(2)  # about the mean; of successive trials
    for repeated in repeats(evidence, values, np.ones(len(evidence.grid.trials), dtype=bool)):
        seen = np.isfinite(repeated.values)
        angle = np.where(seen, repeated.values, 0.0)
        count, both = seen.sum(axis=0), seen[1:] & seen[:-1]
        centred = np.where(seen, angle - angle.sum(axis=0) / np.maximum(count, 1), 0.0)
        steps = np.where(both, np.diff(angle, axis=0), 0.0)
        freedom = np.array([np.maximum(count - 1, 0), both.sum(axis=0)])
        square = np.array([np.sum(centred**2, axis=0), np.sum(steps**2, axis=0) / 2.0])
        # Averaging over a step took white noise away; it is given back below.
        squares += (square - freedom * evidence.noise_deg**2 / repeated.weight) @ repeated.weight
        weights += freedom @ repeated.weight
    if not weights[0]:
        return evidence.noise_deg if otherwise is None else otherwise
    # Successive repeats may have no sample in common.
    between = float(np.min(squares[weights > 0.0] / weights[weights > 0.0]))
    return float(np.sqrt(max(between, 0.0) + evidence.noise_deg**2))


def angle_chain(evidence: Evidence, x: Floats, pressure_kpa: Floats | None) -> Chain:
    """Prepare the simulator for this campaign, driven by the command or by a known pressure."""
    if pressure_kpa is None and evidence.grid.command_kpa is None:
        pressure_kpa = evidence.grid.pressure_kpa
    reference_kpa = evidence.data.campaign.reference_kpa
    chain = chain_for(evidence.grid, x, reference_kpa, pressure_kpa)
    return replace(chain, usual=evidence.usual, vented=evidence.vented, let_go=evidence.let_go)


@dataclass(frozen=True)
class Foreseen:
    """What a reference says of one trial, at its rows."""

    missed_deg: Floats  # by the model, in both campaigns
    deviation_deg: Floats  # of that, 1 sigma
    unvisited: NDArray[np.bool_]  # where the reference never was: nobody knows
    late_deg: Floats  # by times that are off, as the reference's were, 1 sigma


def with_usual(
    evidence: Evidence, usual: Sequence[Foreseen], given: Floats, read_deg: float
) -> Evidence:
    """Let the simulator start from what the given model is known to miss.

    Where that is not known, as no trial of a reference went there, a sample says next to nothing.

    Parameters
    ----------
    evidence, given : Evidence, (5,) array
        A campaign, and the model's coefficients.
    usual : sequence of Foreseen
        By trial of the campaign's data.
    read_deg : float
        Largest angle that the reference has read.
    """
    grid = evidence.grid
    anything = max(largest_deg(grid.trials), read_deg)
    angle = np.zeros(grid.level.size)
    squares, doubt, late = [], [], []
    by_order = {t.order: each for t, each in zip(evidence.data.trials, usual, strict=True)}
    # An actuator rests where its next trial begins.
    begins = [float(by_order[trial.order].missed_deg[0]) for trial in grid.trials]
    for i, trial in enumerate(grid.trials):
        own, kept = by_order[trial.order], ~trial.after_reset
        squares.append(own.deviation_deg[kept] ** 2)
        doubt.append(np.where(own.unvisited, anything, 0.0)[kept] ** 2)
        late.append(own.late_deg[kept] ** 2)
        steps = slice(grid.step_starts[i], grid.step_starts[i] + grid.trial_steps[i])
        ends_s = np.cumsum(STEPS_S[grid.level[steps]])
        angle[steps] = np.interp(ends_s, trial.t_s, own.missed_deg)
        rest = slice(grid.step_starts[i - 1] + grid.trial_steps[i - 1] if i else 0, steps.start)
        angle[rest] = begins[i]
    return replace(
        evidence,
        usual=Usual(angle, static_gain(given), begins[0]),
        read_deg=read_deg,
        foreseen_deg=np.sqrt(grid.averaged(np.concatenate(squares))),
        late_deg=np.sqrt(grid.averaged(np.concatenate(late))),
        variance=evidence.variance + grid.averaged(np.concatenate(doubt)),
    )


def modelled_pressure(evidence: Evidence, effects: Floats) -> Floats:
    """Return the true pressure on the grid's cells with these drive effects, kPa."""
    command = evidence.grid.command_kpa
    assert command is not None
    return true_pressure(command, evidence.grid.cell_starts, effects, np.zeros(2))
