"""Which trials were run alike, and by how much later one runs its course than another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spa_fo.arrays import Bools, Floats, Integers
from spa_fo.plant.grid import CampaignGrid
from spa_fo.plant.memory import FINEST_STEP_S
from spa_fo.rig import Trial

# Of an input's range, by which a command has begun, and a measured pressure; what a delay of a
# trial's own tells, s; of the largest input, by which two courses, on average, and their begins may
# differ. Assumed.
_TOLD, _MEASURED, _AT_ONCE_S, _LIKE = 0.02, 0.05, 0.05, 0.03
# Of the largest command, from which one is more than a pump leaves; nearer to rest than to what is
# held; rows that say where a log begins; logs that tell what is left between them from noise, and
# deviations from which it is none. Assumed.
_HELD, _NEARER, _FIRST_ROWS, _FEWEST, _CLEARLY = 0.1, 0.5, 3, 3, 3.0


def run_alike(grid: CampaignGrid) -> tuple[Integers, Floats]:
    """Give each trial the number of the first one of the same experiment and course of its input.

    And by how much later than that one it began it, s: nobody starts a log and a pump at once.
    """
    cells = grid.pressure_kpa if grid.command_kpa is None else grid.command_kpa
    assert cells is not None
    drives = np.split(cells, grid.cell_starts[1:-1])
    begins = [_begins(drive, _MEASURED if grid.command_kpa is None else _TOLD) for drive in drives]
    number, late = np.arange(len(drives)), np.zeros(len(drives))
    for i, trial in enumerate(grid.trials):
        for first in range(i):
            if number[first] != first or grid.trials[first].experiment != trial.experiment:
                continue
            one, other = drives[first], drives[i]
            later = _later(one, other, begins[first], begins[i])
            if same_course(one[max(-later, 0) :], other[max(later, 0) :]):
                number[i], late[i] = first, later * FINEST_STEP_S
                break
    return number, late


def began_vented(grid: CampaignGrid) -> Bools:
    """Say which logs began as their pressure came, on an actuator that was at rest, (trials,).

    Their first angle is far from where such a command holds it, or they were let go (`let_go`) of a
    pressure that was measured. A log with a zero of its own does not say.
    """
    trials = grid.trials
    if grid.command_kpa is None:
        return np.zeros(len(trials), dtype=bool)
    held = np.abs(grid.command_kpa[grid.cell_starts[:-1]])
    held = held / max(float(np.abs(grid.command_kpa).max()), 1e-9)
    first_deg, farthest_deg = np.abs(_first_deg(trials)), float(np.abs(grid.angle_deg).max())
    vented = (held > _HELD) & (first_deg < _NEARER * held * farthest_deg)
    if not (held > _HELD).any() and _left_share(trials) is not None and let_go(grid):
        vented[1:] = True
    return np.asarray(vented & np.array([trial.zero_until_s == 0.0 for trial in trials]))


def let_go(grid: CampaignGrid) -> bool:
    """Say whether an actuator began each log at rest, whatever a pump with play had left in it.

    Where that was measured all first angles together are far from where it would hold them; else
    they are no farther from the first log's than they scatter.
    """
    trials = grid.trials
    if len(trials) < _FEWEST or any(trial.zero_until_s > 0.0 for trial in trials):
        return False
    first_deg, left = _first_deg(trials), _left_share(trials)
    moved_deg = first_deg[1:] - first_deg[0]
    if left is None:
        return not _is_clear(moved_deg)
    would_deg = left * float(np.abs(grid.angle_deg).max())
    return bool(moved_deg @ would_deg < _NEARER * (would_deg @ would_deg))


def _first_deg(trials: Sequence[Trial]) -> Floats:
    """Give the first angle of each log, deg."""
    return np.array([float(np.median(trial.angle_deg[:_FIRST_ROWS])) for trial in trials])


def _left_share(trials: Sequence[Trial]) -> Floats | None:
    """Give what was left before all but the first log, of the largest pressure; None for noise.

    Before the first one nothing was, which tells the sensor's zero.
    """
    logged = [trial.pressure_kpa for trial in trials if trial.pressure_kpa is not None]
    if len(logged) < max(len(trials), _FEWEST):
        return None
    first_kpa = np.array([float(np.median(one[:_FIRST_ROWS])) for one in logged])
    left_kpa = first_kpa[1:] - first_kpa[0]
    if not _is_clear(left_kpa):
        return None
    return np.asarray(left_kpa / max(float(np.abs(one).max()) for one in logged))


def _is_clear(values: Floats) -> bool:
    """Say whether values are away from 0 by more than they scatter, as much as 0 itself does."""
    return bool(abs(values.mean()) > _CLEARLY * values.std(ddof=1))


def _later(one: Floats, other: Floats, begins: int, other_begins: int) -> int:
    """Say by how many cells one input runs later than another; 0 where they fit as well as logged.

    Both begin at one level. A glitch, or noise of a measured pressure, is no begin.
    """
    cells = other_begins - begins
    if abs(cells) * FINEST_STEP_S < _AT_ONCE_S:
        return 0
    like = abs(one[0] - other[0]) < _LIKE * max(float(np.abs(one).max()), 1e-9)
    moved = _apart(one[max(-cells, 0) :], other[max(cells, 0) :])
    return cells if like and moved < 0.5 * _apart(one, other) else 0


def _apart(one: Floats, other: Floats) -> float:
    """Mean distance of two inputs over the time that both have."""
    n = min(one.size, other.size)
    return float(np.mean(np.abs(one[:n] - other[:n]))) if n else np.inf


def _begins(drive: Floats, least: float) -> int:
    """Find the cell in which an input first leaves where it was by a share of its range."""
    moved = np.abs(drive - drive[0]) > least * float(np.ptp(drive))
    return int(np.argmax(moved))


def same_course(one: Floats, other: Floats) -> bool:
    """Say whether two inputs, at like times from where each begins, took the same course."""
    n = min(one.size, other.size)
    if n < 0.9 * max(one.size, other.size):
        return False
    size = max(float(np.abs(one).max()), 1e-9)
    return _apart(one, other) < _LIKE * size
