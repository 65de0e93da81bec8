"""Some trials of a campaign on the simulator's grid, each as it is among all."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from spa_fo.arrays import Bools, Floats, Integers
from spa_fo.plant.grid import CampaignGrid


def only(grid: CampaignGrid, trials: Bools) -> CampaignGrid:
    """Leave trials out of a grid, their rests with them.

    Parameters
    ----------
    grid : CampaignGrid
        The campaign.
    trials : (trials,) bool array
        Those that stay, one at least.
    """
    if trials.all():
        return grid
    kept = np.flatnonzero(trials)
    cells, cell_starts, cell_back = _kept(grid.cell_starts, kept)
    steps, step_starts, step_back = _kept(grid.step_starts, kept)
    lead = np.arange(grid.step_starts[0])
    steps, step_starts = np.concatenate([lead, steps]), step_starts + lead.size
    back = np.concatenate([0 * lead, np.repeat(cell_back, np.diff(step_starts))])
    samples, counts = trials[grid.sample_trial], grid.counts.astype(np.int64)
    rows = np.repeat(samples, counts)
    trial = (np.cumsum(trials) - 1)[grid.sample_trial[samples]]
    return replace(
        grid,
        trials=tuple(grid.trials[i] for i in kept.tolist()),
        command_kpa=_taken(grid.command_kpa, cells),
        pressure_kpa=_taken(grid.pressure_kpa, cells),
        cell_starts=cell_starts,
        level=grid.level[steps],
        first_cell=grid.first_cell[steps] - np.where(grid.cells[steps] > 0, back, 0),
        cells=grid.cells[steps],
        middle_s=grid.middle_s[steps],
        step_starts=step_starts,
        trial_steps=grid.trial_steps[kept],
        sample_step=grid.sample_step[samples] - step_back[trial] + lead.size,
        sample_share=grid.sample_share[samples],
        sample_trial=trial,
        row_cell=grid.row_cell[rows] - np.repeat(cell_back[trial], counts[samples]),
        row_starts=np.cumsum(np.append(0, counts[samples]))[:-1],
        time_s=grid.time_s[samples],
        angle_deg=grid.angle_deg[samples],
        counts=grid.counts[samples],
        measured_kpa=_taken(grid.measured_kpa, samples),
    )


def _kept(starts: Integers, kept: Integers) -> tuple[Integers, Integers, Integers]:
    """Give the places of some parts, where they begin by themselves, and how far back that is.

    `starts`, (parts + 1,), is where each begins among all.
    """
    parts = [np.arange(*ends) for ends in pairwise(starts.tolist())]
    own = [parts[i] for i in kept.tolist()]
    begins = np.cumsum([0, *(part.size for part in own)])
    return np.concatenate(own), begins, starts[kept] - begins[:-1]


def _taken(values: Floats | None, some: Integers | Bools) -> Floats | None:
    return None if values is None else values[some]
