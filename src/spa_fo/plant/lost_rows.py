"""When a command changed whose row was lost: trials that were run alike say it.

A command holds from its row until the next one that is there. Where rows are missing about a jump,
it seems to come late, by as many rows as were lost.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.rig import Trial

_LOST = 1.5  # intervals between two rows with one missing in between
_JUMP = 0.03  # of the largest command
_NEAR = 3.0  # intervals by which jumps of trials run alike may differ


@dataclass(frozen=True)
class _Jump:
    """A change of the command at row `at`: in the log between `after_s` and `by_s`."""

    at: int
    after_s: float
    by_s: float
    change_kpa: float
    lost: bool


def command_times(trials: Sequence[Trial]) -> list[Floats]:
    """Give the times from which each row's command holds, by trial, s.

    Parameters
    ----------
    trials : sequence of Trial
        Those with a command.

    Returns
    -------
    list of (rows,) arrays
        The rows' own times; of a jump whose row was lost the time at which that row was due, if
        trials of the same experiment say that it was the first one after the jump.
    """
    jumps = [list(_jumps(trial)) for trial in trials]
    times = [trial.t_s for trial in trials]
    for i, (trial, own) in enumerate(zip(trials, jumps, strict=True)):
        alike = [
            jump
            for other, theirs in zip(trials, jumps, strict=True)
            if other is not trial and other.experiment == trial.experiment
            for jump in theirs
        ]
        for jump in own:
            if jump.lost:
                moved = _due(jump, alike, _interval(trial))
                if moved < jump.by_s:
                    times[i] = times[i].copy()
                    times[i][jump.at] = moved
    return times


def _interval(trial: Trial) -> float:
    return float(np.median(np.diff(trial.t_s))) if trial.t_s.size > 1 else 0.0


def _jumps(trial: Trial) -> Iterator[_Jump]:
    """Find the jumps of a trial's command."""
    command = trial.command_kpa
    if command is None or command.size < 2:
        return
    interval, t = _interval(trial), trial.t_s
    change = np.diff(command)
    for k in np.flatnonzero(np.abs(change) > _JUMP * np.abs(command).max()).tolist():
        lost = t[k + 1] - t[k] > _LOST * interval
        yield _Jump(k + 1, float(t[k]), float(t[k + 1]), float(change[k]), lost)


def _due(jump: _Jump, alike: Sequence[_Jump], interval: float) -> float:
    """Say when the first row after a jump was due, by the same jump of trials run alike."""
    same = [
        other
        for other in alike
        if not other.lost
        and jump.after_s - _NEAR * interval < other.by_s < jump.by_s + _NEAR * interval
        and abs(other.change_kpa - jump.change_kpa) < 0.1 * abs(jump.change_kpa)
    ]
    # Of several jumps that a gap hides nobody knows which is which.
    if not same or np.ptp([other.by_s for other in same]) > _NEAR * interval:
        return jump.by_s
    between = max(other.after_s for other in same), min(other.by_s for other in same)
    rows = np.arange(jump.after_s + interval, jump.by_s - 0.5 * interval, interval)
    due = rows[rows >= 0.5 * sum(between)]
    return float(due[0]) if due.size else jump.by_s
