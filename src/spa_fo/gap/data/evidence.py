"""What a campaign offers as evidence: angles, measured pressure, calibrations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.fixture import Fixture, fixture_of
from spa_fo.plant.chain import Chain, Usual, chain_for, static_gain
from spa_fo.plant.effects.sensor_nonlinearity import CURVE_KNOTS_DEG
from spa_fo.plant.grid import CampaignGrid, campaign_grid
from spa_fo.plant.memory import STEPS_S
from spa_fo.plant.stages import true_pressure
from spa_fo.rig import Calibration, CampaignData

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_LONGEST_LEVEL = 4  # of a step: 0.32 s resolves what is slow, and a diagnosis takes many runs
_BINNING_DEG = 0.03  # error of averaging a curve over a step
_TIMING_S = 0.003  # error of one sample's time
_CURVE_FLOOR_DEG, _BARE_CURVE_DEG = 0.08, 0.25


@dataclass(frozen=True)
class Evidence:
    """A campaign made ready for diagnosis.

    Attributes
    ----------
    data : CampaignData
        The campaign.
    grid : CampaignGrid
        Its trials on the simulator's grid.
    experiment : (trials,) array
        Index of each trial's experiment.
    noise_deg : float
        White noise of one sample's angle.
    variance : (n,) array
        Of each averaged sample, deg².
    alike : (trials,) array
        Number of the first trial of the same experiment and command.
    curve_sigma_deg : (knots,) array
        Error of the calibrated curve at `CURVE_KNOTS_DEG`.
    bare_curve_sigma_deg : (knots,) array
        The same once an explanation says what the film made of the calibration.
    fixture : Fixture or None
        Dwells of all calibrations.
    drift_deg, drift_sigma_deg : (m,) arrays
        What later calibrations read through the first curve, less what it read.
    drift_angle_deg : (m,) array
        At which angles.
    drift_after : (m,) array
        How many trials came before that calibration.
    pressure_noise_kpa : float
        White noise of one pressure sample; NaN without.
    rows : list of arrays
        By trial, its averaged samples.
    takes_part : (trials,) bool array
        Trials that explanations are chosen and fitted by; the others are held out.
    usual : Usual or None
        What a reference says that the model misses.
    """

    data: CampaignData
    grid: CampaignGrid
    experiment: Integers
    noise_deg: float
    variance: Floats
    alike: Integers
    curve_sigma_deg: Floats
    bare_curve_sigma_deg: Floats
    fixture: Fixture | None
    drift_deg: Floats
    drift_sigma_deg: Floats
    drift_angle_deg: Floats
    drift_after: Integers
    pressure_noise_kpa: float
    rows: list[Integers] = field(default_factory=list)
    takes_part: NDArray[np.bool_] = field(default_factory=lambda: np.ones(0, dtype=bool))
    usual: Usual | None = None

    @property
    def used(self) -> NDArray[np.bool_]:
        """Averaged samples of the trials that take part, (n,)."""
        return np.asarray(self.takes_part[self.grid.sample_trial])

    @property
    def has_pressure(self) -> bool:
        """Whether the pressure was measured in every trial."""
        return self.grid.measured_kpa is not None and self.grid.command_kpa is not None


def collect(data: CampaignData) -> Evidence:
    """Gather the evidence of a campaign."""
    grid = campaign_grid(data.trials, data.campaign.folder, longest=_LONGEST_LEVEL)
    names = list(dict.fromkeys(trial.experiment for trial in grid.trials))
    experiment = np.array([names.index(trial.experiment) for trial in grid.trials])
    noise = _white([trial.angle_deg for trial in grid.trials])
    pressure_noise = float("nan")
    if grid.measured_kpa is not None:
        pressure_noise = _white(
            [trial.pressure_kpa for trial in grid.trials if trial.pressure_kpa is not None]
        )
    rows = [np.flatnonzero(grid.sample_trial == i) for i in range(len(grid.trials))]
    drift, sigma, angles, after = _drifts(data, grid)
    return Evidence(
        data=data,
        grid=grid,
        experiment=experiment,
        noise_deg=noise,
        variance=noise**2 / grid.counts + _BINNING_DEG**2 + (_TIMING_S * _rates(grid, rows)) ** 2,
        alike=_run_alike(grid, experiment),
        curve_sigma_deg=_curve_sigma(data.calibration),
        bare_curve_sigma_deg=_curve_sigma(data.calibration, bare=True),
        fixture=fixture_of(
            data.calibrations, grid.trials[0].started_s, [d.angles_deg for d in data.drifts]
        ),
        drift_deg=drift,
        drift_sigma_deg=sigma,
        drift_angle_deg=angles,
        drift_after=after,
        pressure_noise_kpa=pressure_noise,
        rows=rows,
        takes_part=np.ones(len(grid.trials), dtype=bool),
    )


def _white(signals: Sequence[Floats]) -> float:
    """White noise by second differences, which a smooth signal hardly enters."""
    squares = [np.diff(signal, 2) ** 2 / 6.0 for signal in signals if signal.size > 3]
    every = np.concatenate(squares)
    # Jumps of the signal are outliers: a trimmed mean, scaled for normal noise.
    kept = every[every <= np.quantile(every, 0.95)]
    return max(float(np.sqrt(kept.mean() / 0.7588)), 1e-3)


def _rates(grid: CampaignGrid, rows: list[Integers]) -> Floats:
    """How fast the angle changes at each averaged sample, deg/s, over a quarter second."""
    rates = np.zeros(grid.angle_deg.size)
    for own in rows:
        time, angle = grid.time_s[own], grid.angle_deg[own]
        area = np.concatenate([[0.0], np.cumsum(0.5 * (angle[1:] + angle[:-1]) * np.diff(time))])
        ahead = np.interp(time + 0.12, time, area) - np.interp(time, time, area)
        behind = np.interp(time, time, area) - np.interp(time - 0.12, time, area)
        rates[own] = np.abs(ahead - behind) / 0.12**2
    return rates


def _run_alike(grid: CampaignGrid, experiment: Integers) -> Integers:
    """Give each trial the number of the first one of the same experiment and command."""
    number = np.empty(experiment.size, dtype=np.int64)
    first_of: dict[int, int] = {}
    for i, group in enumerate(experiment.tolist()):
        first = first_of.setdefault(group, i)
        number[i] = first if _alike(_drive(grid, first), _drive(grid, i)) else i
    return number


def _drive(grid: CampaignGrid, trial: int) -> Floats:
    cells = grid.command_kpa if grid.command_kpa is not None else grid.pressure_kpa
    assert cells is not None
    return cells[grid.cell_starts[trial] : grid.cell_starts[trial + 1]]


def _alike(one: Floats, other: Floats) -> bool:
    n = min(one.size, other.size)
    if n < 0.9 * max(one.size, other.size):
        return False
    size = max(float(np.abs(one).max()), 1e-9)
    return float(np.mean(np.abs(one[:n] - other[:n]))) < 0.03 * size


def curve_columns(angle_deg: Floats) -> Floats:
    """Hats of the sensor curve's knots at these angles; shape (n, knots), none at 0 degrees."""
    knots = np.array(CURVE_KNOTS_DEG)
    first, last = knots[0], knots[-1]
    inside = np.clip(angle_deg, first, last)
    columns = np.array([np.interp(inside, knots, row) for row in np.eye(knots.size)]).T
    # Beyond the knots the curve goes on straight.
    for below, edge, other in ((True, 0, 1), (False, -1, -2)):
        far = angle_deg < first if below else angle_deg > last
        share = (angle_deg - knots[edge]) / (knots[edge] - knots[other])
        columns[far, edge] += share[far]
        columns[far, other] -= share[far]
    return np.delete(columns, CURVE_KNOTS_DEG.index(0.0), axis=1)


def _curve_sigma(calibration: Calibration | None, bare: bool = False) -> Floats:
    """Error of the curve at its knots; `bare` is without what a film's hysteresis does to it."""
    knots = np.delete(np.array(CURVE_KNOTS_DEG), CURVE_KNOTS_DEG.index(0.0))
    if calibration is None:
        return np.full(knots.size, _CURVE_FLOOR_DEG)
    at_knots = calibration.sigma_knots_deg
    if bare:
        # Its hysteresis makes the curve look as rough as it is wide.
        at_knots = np.minimum(at_knots, _BARE_CURVE_DEG)
    rising = np.argsort(calibration.angles_deg)  # counts may fall with the angle
    sigma = np.interp(knots, calibration.angles_deg[rising], at_knots[rising])
    low, high = calibration.range_deg
    # The curve is a line beyond its ends, and real sensors are not.
    sigma = np.where(knots < low, 0.3 * (low - knots), sigma)
    sigma = np.where(knots > high, np.hypot(sigma, 0.2 * (knots - high)), sigma)
    return np.asarray(np.hypot(sigma, _CURVE_FLOOR_DEG))


def _drifts(data: CampaignData, grid: CampaignGrid) -> tuple[Floats, Floats, Floats, Integers]:
    curve = data.calibration
    if not data.drifts or curve is None:
        return np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64)
    drift = np.concatenate([item.drift_deg for item in data.drifts])
    angle = np.concatenate([item.angles_deg for item in data.drifts])
    rising = np.argsort(curve.angles_deg)  # counts may fall with the angle
    sigma = np.interp(angle, curve.angles_deg[rising], curve.sigma_knots_deg[rising])
    before = [
        sum(trial.started_s < item.started_s for trial in grid.trials) for item in data.drifts
    ]
    after = np.repeat(before, [item.drift_deg.size for item in data.drifts])
    return drift, np.hypot(sigma, 0.1), angle, after


def angle_chain(evidence: Evidence, x: Floats, pressure_kpa: Floats | None) -> Chain:
    """Prepare the simulator for this campaign, driven by the command or by a known pressure."""
    if pressure_kpa is None and evidence.grid.command_kpa is None:
        pressure_kpa = evidence.grid.pressure_kpa
    reference_kpa = evidence.data.campaign.reference_kpa
    chain = chain_for(evidence.grid, x, reference_kpa, pressure_kpa)
    return replace(chain, usual=evidence.usual)


def with_usual(
    evidence: Evidence, usual: Sequence[tuple[Floats, Floats]], given: Floats
) -> Evidence:
    """Let the simulator start from what the given model is known to miss.

    Where that is hardly known, as no trial of a reference went there, a sample says little.

    Parameters
    ----------
    evidence : Evidence
        A campaign.
    usual : sequence of pairs of (rows,) arrays
        By trial of the campaign's data, at its rows: what is missed, and its standard deviation.
    given : (5,) array
        Coefficients of the model.
    """
    grid = evidence.grid
    angle = np.zeros(grid.level.size)
    squares = []
    by_order = {t.order: each for t, each in zip(evidence.data.trials, usual, strict=True)}
    for i, trial in enumerate(grid.trials):
        mean, deviation = by_order[trial.order]
        squares.append(deviation[~trial.after_reset] ** 2)
        own = slice(grid.step_starts[i], grid.step_starts[i] + grid.trial_steps[i])
        ends_s = np.cumsum(STEPS_S[grid.level[own]])
        angle[own] = np.interp(ends_s, trial.t_s, mean)
    return replace(
        evidence,
        usual=Usual(angle, static_gain(given)),
        variance=evidence.variance + grid.averaged(np.concatenate(squares)),
    )


def modelled_pressure(evidence: Evidence, effects: Floats) -> Floats:
    """Return the true pressure on the grid's cells with these drive effects, kPa."""
    command = evidence.grid.command_kpa
    assert command is not None
    return true_pressure(command, evidence.grid.cell_starts, effects, np.zeros(2))
