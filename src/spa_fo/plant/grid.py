"""A campaign on the simulator's grid: steps, cells of the input, and the samples that fall in them.

Steps are fine after a jump of the input and grow as the response slows; the rests between the
trials are steps too, so that damage, friction and creep run through the whole campaign; in them the
fractional memory fades.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.errors import BadInput
from spa_fo.plant.grid_steps import rest_levels, step_levels
from spa_fo.plant.lost_rows import command_times
from spa_fo.plant.memory import FINEST_STEP_S, LEVELS, STEPS_S, means_over, read_rows
from spa_fo.rig import Trial
from spa_fo.rig.held_readings import holds_of

_LONGEST = 3  # level of the longest step within a trial: 0.16 s
_REST_S = 1.0  # what is shorter between two trials is no rest. Assumed
_NEARLY_OVER = 1e-6  # of a cell: what rounding makes of a row at its end


@dataclass(frozen=True)
class CampaignGrid:
    """All trials of a campaign in the order they were run.

    Attributes
    ----------
    trials : tuple of Trial
        In that order.
    command_kpa, pressure_kpa : (cells,) arrays or None
        Means over cells of `FINEST_STEP_S`, all trials one after the other; None where a trial's
        log lacks the column.
    cell_starts : (trials + 1,) array
        First cell of each trial.
    level, first_cell, cells : (steps,) arrays
        Step lengths as levels; the cells of the input in each step, none in a rest.
    middle_s : (steps,) array
        Campaign time at each step's middle.
    step_starts : (trials + 1,) array
        First step of each trial; its rest follows it. A rest may come before the first one.
    trial_steps : (trials,) array
        Number of steps before the rest.
    sample_step, sample_share : (n,) arrays
        Of each averaged sample: its step, and where in it its mean time lies (0 to 1).
    sample_trial : (n,) array
        Its trial, as an index into `trials`.
    row_cell, row_starts : (rows,), (n,) arrays
        Of each row of the logs its cell; where in these the rows of each averaged sample begin.
    time_s, angle_deg, counts : (n,) arrays
        Mean time within the trial, mean angle, samples averaged.
    measured_kpa : (n,) array or None
        Mean measured pressure.
    """

    trials: tuple[Trial, ...]
    command_kpa: Floats | None
    pressure_kpa: Floats | None
    cell_starts: Integers
    level: Integers
    first_cell: Integers
    cells: Integers
    middle_s: Floats
    step_starts: Integers
    trial_steps: Integers
    sample_step: Integers
    sample_share: Floats
    sample_trial: Integers
    row_cell: Integers
    row_starts: Integers
    time_s: Floats
    angle_deg: Floats
    counts: Floats
    measured_kpa: Floats | None

    @cached_property
    def fading(self) -> Integers:
        """Step lengths, as levels, of the fractional memory: by the end of a rest it has faded.

        Campaigns promise as much of their rests, and do not always say their true length. What is
        shorter than `_REST_S` is a log that was cut in two.
        """
        trial = np.searchsorted(self.step_starts[1:], np.arange(self.level.size), side="right")
        rest_s = np.bincount(trial, np.where(self.cells > 0, 0.0, STEPS_S[self.level]))
        is_last = np.isin(np.arange(1, self.level.size + 1), self.step_starts)
        fades = (self.cells == 0) & is_last & (rest_s[trial] >= _REST_S)
        return np.where(fades, LEVELS - 1, self.level)

    @property
    def orders(self) -> Integers:
        """Each trial's place in the campaign."""
        return np.array([trial.order for trial in self.trials])

    @property
    def ends_s(self) -> float:
        """Campaign time at the end of the last step."""
        last = self.trials[-1]
        cells = self.cell_starts[-1] - self.cell_starts[-2]
        return float(last.started_s + cells * FINEST_STEP_S)

    def locate(self, trial: int, t_s: Floats) -> tuple[Integers, Floats]:
        """Find times within a trial: the step of each, and where in it the time lies (0 to 1)."""
        first = self.step_starts[trial]
        level = self.level[first : first + self.trial_steps[trial]]
        ends_s = _ends_s(level)
        step = _step_at(ends_s, t_s)
        return first + step, _share(ends_s, level, step, t_s)

    def slopes(self, values: Floats) -> Floats:
        """Slope over time of a signal at the averaged samples; 0 where a trial has but one."""
        inverse, before, after = self._differences
        step = np.diff(values) * inverse
        return np.asarray(before * np.append(0.0, step) + after * np.append(step, 0.0))

    @cached_property
    def _differences(self) -> tuple[Floats, Floats, Floats]:
        """Inverse distances of samples, and the weights of the slopes to either neighbour.

        A parabola through three samples; at either end of a trial a line through two.
        """
        inside = np.diff(self.sample_trial) == 0
        distance = np.where(inside, np.diff(self.time_s), np.inf)
        last, following = np.append(np.inf, distance), np.append(distance, np.inf)
        alone = np.isinf(last) & np.isinf(following)
        share = 1.0 / (1.0 + np.where(alone, 1.0, last) / following)
        return 1.0 / distance, share, 1.0 - share

    def step_means(self, cells: Floats) -> Floats:
        """Average a signal given on cells over the steps; 0 in the rests."""
        return np.asarray(means_over(cells, self.first_cell, self.cells))

    def sampled(self, cells: Floats) -> Floats:
        """Average a signal given on cells over the rows of each averaged sample."""
        return self.averaged(cells[self.row_cell])

    def read(self, cells: Floats) -> Floats:
        """Read a signal given on cells at the time of each row, the rows then averaged.

        A row logs what is there before its own command acts: the mean of its cell, which goes
        on after it, would be ahead. So the cell that is over counts, and by the smaller of the
        slopes to either side how far the row is from its middle (van Leer 1977,
        doi:10.1016/0021-9991(77)90095-X).
        """
        return np.asarray(read_rows(cells, *self._about_rows, self.row_starts) / self.counts)

    @cached_property
    def _about_rows(self) -> tuple[Integers, Integers, Integers, Floats]:
        """The cell that is over at each row, its neighbours, and cells from its middle on."""
        t_s = np.concatenate([trial.t_s[~trial.after_reset] for trial in self.trials])
        trial = np.searchsorted(self.cell_starts, self.row_cell, side="right") - 1
        first, last = self.cell_starts[trial], self.cell_starts[trial + 1] - 1
        ended = np.floor(t_s / FINEST_STEP_S + _NEARLY_OVER).astype(np.int64) - 1
        over = np.clip(first + ended, first, last)
        cells_on = t_s / FINEST_STEP_S - (over - first + 0.5)
        return np.maximum(over - 1, first), over, np.minimum(over + 1, last), cells_on

    def zeroed(self, values: Floats) -> Floats:
        """Give values at the averaged samples, (n,) or (n, k), each log's own zero taken off."""
        if self._zero_weights is None:
            return values
        starts = np.flatnonzero(np.diff(self.sample_trial, prepend=-1))
        zeros = np.add.reduceat((self._zero_weights * values.T).T, starts, axis=0)
        size = np.diff(starts, append=self.sample_trial.size)
        return np.asarray(values - np.repeat(zeros, size, axis=0))

    @cached_property
    def _zero_weights(self) -> Floats | None:
        """How much each averaged sample counts for its log's zero; None where no log has one."""
        if not any(trial.zero_until_s > 0.0 for trial in self.trials):
            return None
        rows = [t.t_s[~t.after_reset] < t.zero_until_s for t in self.trials]
        weights = np.add.reduceat(np.concatenate(rows).astype(np.float64), self.row_starts)
        total = np.bincount(self.sample_trial, weights, minlength=len(self.trials))
        return np.asarray(weights / np.maximum(total, 1.0)[self.sample_trial])

    @cached_property
    def held_s(self) -> Floats | None:
        """How long after the middle of its hold each averaged sample was logged, (n,), s.

        None where the angle is read anew for every row (`spa_fo.rig.held_readings`).
        """
        holds = holds_of(self.trials)
        if holds is None:
            return None
        rows = [holds.since_middle(trial)[~trial.after_reset] for trial in self.trials]
        return self.averaged(np.concatenate(rows))

    def averaged(self, rows: Floats) -> Floats:
        """Average what stands at the rows of all trials, those after a reset left out."""
        return np.asarray(np.add.reduceat(rows, self.row_starts) / self.counts)


def campaign_grid(
    trials: Sequence[Trial],
    source: object = "campaign",
    rested_from_s: float | None = None,
    longest: int = _LONGEST,
) -> CampaignGrid:
    """Lay the trials of a campaign on the simulator's grid.

    Parameters
    ----------
    trials : sequence of Trial
        In any order.
    source : object
        What the messages name.
    rested_from_s : float, optional
        Campaign time since which a specimen with a past has rested before the first trial.
    longest : int
        Level of the longest step within a trial.

    Raises
    ------
    BadInput
        A trial has neither command nor pressure, or no duration.
    """
    ordered = tuple(sorted(trials, key=lambda trial: trial.order))
    held_from = command_times(ordered)
    laid = [_lay(trial, source, t_s) for trial, t_s in zip(ordered, held_from, strict=True)]
    largest = max(float(np.abs(item.drive).max()) for item in laid)
    steps = [step_levels(item.drive, largest, longest) for item in laid]

    lead = _NO_REST
    if rested_from_s is not None:
        # One step at least: nothing is then read where the state before it would be needed.
        lead = rest_levels(max(ordered[0].started_s - rested_from_s, FINEST_STEP_S))
    lengths = STEPS_S[lead]
    level, starts = [lead], [lead.size]
    first_cell, cells = [np.zeros_like(lead)], [np.zeros_like(lead)]
    middle = [ordered[0].started_s - np.cumsum(lengths[::-1])[::-1] + 0.5 * lengths]
    samples: list[_Samples] = []
    cell_starts = np.concatenate([[0], np.cumsum([item.drive.size for item in laid])])
    for i, (trial, item, own) in enumerate(zip(ordered, laid, steps, strict=True)):
        widths = 2**own
        ends = np.cumsum(widths)
        samples.append(_average(trial, own, starts[-1]))
        finish = trial.started_s + item.drive.size * FINEST_STEP_S
        rest = rest_levels(ordered[i + 1].started_s - finish) if i + 1 < len(ordered) else _NO_REST
        level += [own, rest]
        first_cell += [cell_starts[i] + ends - widths, np.zeros(rest.size, dtype=np.int64)]
        cells += [widths, np.zeros(rest.size, dtype=np.int64)]
        lengths = STEPS_S[np.concatenate([own, rest])]
        middle.append(trial.started_s + np.cumsum(lengths) - 0.5 * lengths)
        starts.append(starts[-1] + own.size + rest.size)

    measured = [item.measured_kpa for item in samples]
    counts = np.concatenate([item.counts for item in samples])
    return CampaignGrid(
        trials=ordered,
        command_kpa=_joined([item.command for item in laid]),
        pressure_kpa=_joined([item.pressure for item in laid]),
        cell_starts=cell_starts.astype(np.int64),
        level=np.concatenate(level),
        first_cell=np.concatenate(first_cell),
        cells=np.concatenate(cells),
        middle_s=np.concatenate(middle),
        step_starts=np.array(starts),
        trial_steps=np.array([own.size for own in steps]),
        sample_step=np.concatenate([item.step for item in samples]),
        sample_share=np.concatenate([item.share for item in samples]),
        sample_trial=np.concatenate([np.full(s.step.size, i) for i, s in enumerate(samples)]),
        row_cell=np.concatenate([s.cell + n for s, n in zip(samples, cell_starts, strict=False)]),
        row_starts=np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64),
        time_s=np.concatenate([item.time_s for item in samples]),
        angle_deg=np.concatenate([item.angle_deg for item in samples]),
        counts=counts,
        measured_kpa=_joined(measured),
    )


_NO_REST = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class _Laid:
    """One trial's input on cells; `drive` is what there is of command and pressure."""

    drive: Floats
    command: Floats | None
    pressure: Floats | None


@dataclass(frozen=True)
class _Samples:
    """One trial's samples averaged over steps."""

    step: Integers
    share: Floats
    cell: Integers
    time_s: Floats
    angle_deg: Floats
    counts: Floats
    measured_kpa: Floats | None


def _lay(trial: Trial, source: object, held_from_s: Floats | None = None) -> _Laid:
    keep = np.append(np.diff(trial.t_s) > 0, True)
    t = trial.t_s[keep]
    cells = int(np.ceil(t[-1] / FINEST_STEP_S - 1e-6)) if t.size > 1 else 0
    if cells < 2:
        raise BadInput(str(source), f"{trial.label} lasts {t[-1]:g} s; expected a longer log")
    edges = np.asarray(FINEST_STEP_S * np.arange(cells + 1), dtype=np.float64)
    command = pressure = None
    if trial.command_kpa is not None:
        held_from = t if held_from_s is None else held_from_s[keep]
        command = _held(held_from, trial.command_kpa[keep], edges)
    if trial.pressure_kpa is not None:
        middle = 0.5 * (edges[1:] + edges[:-1])
        pressure = np.interp(middle, t, trial.pressure_kpa[keep])
    drive = command if command is not None else pressure
    if drive is None:
        raise BadInput(str(source), f"{trial.label} holds neither command nor pressure")
    return _Laid(drive, command, pressure)


def _held(t_s: Floats, command_kpa: Floats, edges_s: Floats) -> Floats:
    """Average a command that holds from row to row over cells."""
    at = np.append(t_s, max(t_s[-1] + FINEST_STEP_S, edges_s[-1]))
    area = np.concatenate([[0.0], np.cumsum(command_kpa * np.diff(at))])
    return np.asarray(np.diff(np.interp(edges_s, at, area)) / FINEST_STEP_S)


def acting_command(trial: Trial, source: object = "campaign") -> Floats:
    """Return the command that acts on what each row of a trial logs, (rows,), kPa.

    Mostly that of the row before: the mean over the cell that the row lies in.

    Raises
    ------
    BadInput
        The trial has no command, or no duration.
    """
    command = _lay(trial, source).command
    if command is None:
        raise BadInput(str(source), f"{trial.label} holds no command")
    return np.asarray(command[_cell_at(command.size, trial.t_s)])


def _average(trial: Trial, level: Integers, first: int) -> _Samples:
    ends_s = _ends_s(level)
    good = ~trial.after_reset
    t = trial.t_s[good]
    step = _step_at(ends_s, t)
    counts = np.bincount(step, minlength=ends_s.size).astype(np.float64)
    used = np.flatnonzero(counts)

    def mean(values: Floats) -> Floats:
        sums = np.bincount(step, weights=values, minlength=ends_s.size)
        return np.asarray(sums[used] / counts[used])

    time = mean(t)
    measured = trial.pressure_kpa
    return _Samples(
        step=used + first,
        share=_share(ends_s, level, used, time),
        cell=_cell_at(int(np.sum(2**level)), t),
        time_s=time,
        angle_deg=mean(trial.angle_deg[good]),
        counts=counts[used],
        measured_kpa=None if measured is None else mean(measured[good]),
    )


def _ends_s(level: Integers) -> Floats:
    """Time at the end of each step of a trial."""
    return np.asarray(np.cumsum(2**level) * FINEST_STEP_S, dtype=np.float64)


def _step_at(ends_s: Floats, t_s: Floats) -> Integers:
    return np.minimum(np.searchsorted(ends_s, t_s, side="left"), ends_s.size - 1)


def _cell_at(cells: int, t_s: Floats) -> Integers:
    return _step_at(np.asarray(FINEST_STEP_S * np.arange(1, cells + 1), dtype=np.float64), t_s)


def _share(ends_s: Floats, level: Integers, step: Integers, t_s: Floats) -> Floats:
    return np.clip(1.0 - (ends_s[step] - t_s) / STEPS_S[level[step]], 0.0, 1.0)


def _joined(parts: Sequence[Floats | None]) -> Floats | None:
    found = [part for part in parts if part is not None]
    return np.concatenate(found) if len(found) == len(parts) else None
