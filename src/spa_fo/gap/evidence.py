"""What a campaign offers as evidence: angles, measured pressure, calibrations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from spa_fo.plant.chain import Chain, Mounting, chain_for, log_delays
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.sensor_nonlinearity import CURVE_KNOTS_DEG
from spa_fo.plant.effects.shared import CREEP_TIMES_S
from spa_fo.plant.grid import CampaignGrid, campaign_grid
from spa_fo.plant.memory import STEPS_S
from spa_fo.plant.stages import felt_angle, true_pressure
from spa_fo.rig import Calibration, CampaignData, Dwell

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_LONGEST_LEVEL = 4  # of a step: 0.32 s resolves what is slow, and a diagnosis takes many runs
_BINNING_DEG = 0.03  # error of averaging a curve over a step
_TIMING_S = 0.003  # error of one sample's time
_CURVE_FLOOR_DEG, _BARE_CURVE_DEG = 0.08, 0.25
_WINDOWS = 4  # of a calibration dwell
_FIXTURE_LEVEL = 1  # steps of the fixture's simulation: 0.04 s
_RELAX_LEVEL = 7  # and of the time the sensor lies flat: 2.6 s
_FIXTURE_FLOOR_DEG = 0.06
_FORGOTTEN = 10.0  # times the longest time of a creep: nothing is left of it


@dataclass(frozen=True)
class Fixture:
    """The sensor in the calibration fixture: readings that only its own effects explain.

    Attributes
    ----------
    deviation_deg, sigma_deg : (rows,) arrays
        What the first curve reads in each window of a dwell, less the settled mean at that angle.
    angle_deg, level : (steps,) arrays
        Angle of the fixture on the simulation's steps, and their lengths as levels.
    step_of : (rows, 2) array
        First and last step of each window.
    average : (rows, rows) array
        Takes the settled mean at each angle away.
    time_s, window_s : (rows,) arrays
        Middle of each window in its log, and its length.
    log : (rows,) array
        Which calibration it is from.
    known_deg : (rows,) array
        The fixture's angle.
    log_starts : (logs + 1,) array
        First step of each calibration; the time the sensor lies flat after it belongs to it.
    dwell : (rows,) array
        Which dwell each window is of, all calibrations counted through.
    drifted : (m, dwells) array
        What an error of each dwell's known angle makes of the later calibrations' drift.
    """

    deviation_deg: Floats
    sigma_deg: Floats
    angle_deg: Floats
    level: Integers
    step_of: Integers
    average: Floats
    time_s: Floats
    window_s: Floats
    log: Integers
    known_deg: Floats
    log_starts: Integers
    dwell: Integers
    drifted: Floats

    @property
    def of_dwell(self) -> Floats:
        """Which dwell each row is of, (rows, dwells)."""
        return np.eye(int(self.dwell.max()) + 1)[self.dwell]

    def misread(self, angle_deg: Floats) -> Floats:
        """Give what an error of each dwell's known angle makes of readings, (n, dwells)."""
        out = np.zeros((angle_deg.size, int(self.dwell.max()) + 1))
        first = self.log == 0
        angles = np.unique(self.known_deg[first])
        hats = np.array([np.interp(angle_deg, angles, row) for row in np.eye(angles.size)]).T
        for j, angle in enumerate(angles):
            at = np.unique(self.dwell[first & (self.known_deg == angle)])
            out[:, at] = -hats[:, j : j + 1] / at.size
        return out

    def simulate(self, effects: Floats, film_turned: float = 0.0) -> tuple[Floats, Mounting]:
        """Simulate what the sensor's effects make of the fixture.

        Parameters
        ----------
        effects : array
            Parameters of all effects, NaN where absent.
        film_turned : float
            State, -1 to 1, in which a sensor with hysteresis comes to the later calibrations.

        Returns
        -------
        predicted_deg : (rows,) array
            Of `deviation_deg`.
        mounting : Mounting
            What the first calibration leaves the sensor with.
        """
        own = effects.copy()
        for effect in LIBRARY.values():
            if not effect.in_fixture:
                own[effect.slots] = np.nan  # of the mounting: the fixture does not show it
        if np.isnan(own).all():
            return np.zeros(self.deviation_deg.size), Mounting()
        film = np.zeros(4 + CREEP_TIMES_S.size)
        read = np.empty(self.angle_deg.size)
        start = film
        for log, (first, end) in enumerate(pairwise(self.log_starts.tolist())):
            if log > 0:
                film[0] = film_turned  # by what happened to it since
            read[first:end] = felt_angle(
                self.angle_deg[first:end], self.level[first:end], own, film
            )
            if log == 0:
                start = film.copy()
        delays = log_delays(effects)
        over_step = 0.5 * (read + np.concatenate([read[:1], read[:-1]]))
        total = np.concatenate([[0.0], np.cumsum(over_step)])
        at = np.arange(total.size)
        mean = np.zeros(self.step_of.shape[0])
        delays = np.zeros(1) if delays is None else delays
        for late in delays / STEPS_S[_FIXTURE_LEVEL]:
            first, last = self.step_of[:, 0] - late, self.step_of[:, 1] - late
            rise = np.interp(last, at, total) - np.interp(first, at, total)
            mean += rise / (last - first) / delays.size
        raw = mean - self.known_deg
        known, rows = np.unique(self.known_deg[self.log == 0], return_index=True)
        # Each row less itself centred is the settled mean at its angle: what the curve took up.
        bias = (raw - self.average @ raw)[self.log == 0][rows]
        mounting = Mounting(start, known, bias)
        return self.average @ (mounting.logged_deg(mean) - self.known_deg), mounting


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
        fixture=_fixture(
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


def _drifted(
    dwell: Integers, log: Integers, known: Floats, drift_angles: Sequence[Floats]
) -> Floats:
    """Give what an error of each dwell's known angle makes of the later calibrations' drift."""
    total = int(dwell.max()) + 1
    rows = []
    for number, angles in enumerate(drift_angles, start=1):
        for angle in angles:
            row = np.zeros(total)
            for sign, which in ((1.0, number), (-1.0, 0)):
                here = (log == which) & (np.abs(known - angle) < 1e-6)
                at = np.unique(dwell[here])
                row[at] += sign / max(at.size, 1)
            rows.append(row)
    return np.array(rows).reshape(-1, total)


def _fixture(
    calibrations: Sequence[Calibration], starts_s: float, drift_angles: Sequence[Floats] = ()
) -> Fixture | None:
    """Lay every calibration's dwells on a common time line, the curve being the first one's."""
    if not calibrations:
        return None
    curve = calibrations[0]
    step = STEPS_S[_FIXTURE_LEVEL]
    angle: list[Floats] = []
    level: list[Integers] = []
    windows, deviation, sigma, groups, settled, times, lengths = [], [], [], [], [], [], []
    dwell_of: list[int] = []
    counted = -1
    at, log_starts = 0, [0]
    for number, calibration in enumerate(calibrations):
        before, start = 0.0, at
        for k, dwell in enumerate(calibration.dwells):
            gap = 2.0 if k == 0 else _pause(calibration.dwells[k - 1], dwell)
            move = max(1, round(gap / step))
            stay = max(_WINDOWS, round(float(dwell.t_s[-1]) / step))
            angle.append(np.linspace(before, dwell.angle_deg, move + 1)[1:])
            angle.append(np.full(stay, dwell.angle_deg))
            slope = float(curve.angle_deg(dwell.mean + 0.5) - curve.angle_deg(dwell.mean - 0.5))
            edges = np.linspace(0.0, float(dwell.t_s[-1]) + 1e-9, _WINDOWS + 1)
            counted += 1
            for w in range(_WINDOWS):
                inside = (dwell.t_s >= edges[w]) & (dwell.t_s < edges[w + 1])
                count = int(np.count_nonzero(inside))
                if count < 2:
                    continue
                mean = float(dwell.counts[inside].mean())
                deviation.append(float(curve.angle_deg(mean)) - dwell.angle_deg)
                noise = max(dwell.noise, 0.3) * slope / np.sqrt(count)
                sigma.append(float(np.hypot(noise, _FIXTURE_FLOOR_DEG)))
                first = at + move + round(edges[w] / step)
                windows.append((first, max(first + 1, at + move + round(edges[w + 1] / step))))
                groups.append((number, dwell.angle_deg))
                dwell_of.append(counted)
                times.append(dwell.started_s + 0.5 * float(edges[w] + edges[w + 1]))
                lengths.append(float(edges[w + 1] - edges[w]))
                settled.append(w >= _WINDOWS // 2)
            at += move + stay
            before = dwell.angle_deg
        # Until the trials begin the sensor lies flat; after them its past hardly matters.
        last = calibration.dwells[-1]
        finish = calibration.started_s + last.started_s - calibration.dwells[0].started_s
        rest = max(starts_s - finish - float(last.t_s[-1]), 100.0) if number == 0 else 100.0
        rest = min(rest, _FORGOTTEN * CREEP_TIMES_S[-1])
        relax = round(rest / STEPS_S[_RELAX_LEVEL])
        level.append(np.full(at - start, _FIXTURE_LEVEL))
        level.append(np.full(relax, _RELAX_LEVEL))
        angle.append(np.zeros(relax))
        at += relax
        log_starts.append(at)
    average = np.eye(len(groups))
    for key in set(groups):
        members = [i for i, group in enumerate(groups) if group == key]
        still = [i for i in members if settled[i]] or members
        for i in members:
            average[i, still] -= 1.0 / len(still)
    centred = average @ np.array(deviation)
    dwell_rows = np.array(dwell_of)
    log = np.array([number for number, _ in groups])
    known = np.array([angle for _, angle in groups])
    return Fixture(
        deviation_deg=centred,
        sigma_deg=np.array(sigma),
        angle_deg=np.concatenate(angle),
        level=np.concatenate(level),
        step_of=np.array(windows),
        average=average,
        time_s=np.array(times),
        window_s=np.array(lengths),
        log=log,
        known_deg=known,
        log_starts=np.array(log_starts),
        dwell=dwell_rows,
        drifted=_drifted(dwell_rows, log, known, drift_angles),
    )


def _pause(earlier: Dwell, later: Dwell) -> float:
    return float(np.clip(later.started_s - earlier.started_s - earlier.t_s[-1], 0.1, 30.0))


def angle_chain(evidence: Evidence, x: Floats, pressure_kpa: Floats | None) -> Chain:
    """Prepare the simulator for this campaign, driven by the command or by a known pressure."""
    if pressure_kpa is None and evidence.grid.command_kpa is None:
        pressure_kpa = evidence.grid.pressure_kpa
    return chain_for(evidence.grid, x, evidence.data.campaign.reference_kpa, pressure_kpa)


def modelled_pressure(evidence: Evidence, effects: Floats) -> Floats:
    """Return the true pressure on the grid's cells with these drive effects, kPa."""
    command = evidence.grid.command_kpa
    assert command is not None
    return true_pressure(command, evidence.grid.cell_starts, effects, np.zeros(2))
