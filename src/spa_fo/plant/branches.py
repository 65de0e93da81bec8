"""The branch of a sensor's loop that each log begins on, which no log tells by itself.

Between two logs an actuator may swing back, or a hand may bend it. So a log begins some way from
where its past would have left the loop, and logs that were come to alike begin alike.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.grid import CampaignGrid

CAME_BEFORE = ("nothing", "log_to_rest", "log_under_load")
"""What came before a log: nothing, a log that ended at rest, or one that did not."""

Branches = Mapping[str, Floats]
"""By loop, for each of `CAME_BEFORE`: how far such logs begin from where the past would have left
it, of half of what two branches differ by."""

_AT_REST = 0.05  # of the largest input: a log that ends there shows how it was vented. Assumed.


def came_before(input_kpa: Floats, starts: Integers, continues: bool = False) -> Integers:
    """Say what came before each log, (trials,), as a place in `CAME_BEFORE`.

    `starts`, (trials + 1,), are where the trials' cells of the input begin. An earlier campaign
    that this one `continues` counts as one that ended at rest.
    """
    ends = np.abs(input_kpa[starts[1:-1] - 1])
    at_rest = ends <= _AT_REST * np.abs(input_kpa).max(initial=0.0)
    return np.append(int(continues), np.where(at_rest, 1, 2))


def half_loop(grid: CampaignGrid, name: str, angle_deg: Floats, effects: Floats) -> Floats:
    """Simulate half of what the two branches of a loop differ by that each log may begin on.

    Parameters
    ----------
    grid : CampaignGrid
        The campaign.
    name : str
        The effect that has a loop of the reading.
    angle_deg : (steps,) array
        True angles at the ends of the grid's steps.
    effects : array
        Parameters of all effects, NaN where absent.

    Returns
    -------
    (steps,) array
        Of the reading, deg; 0 in the rests between logs. It is of the loop alone: what filters it
        behind the loop leaves a little less, and a ceiling nothing.
    """
    effect, reading = LIBRARY[name], np.zeros(angle_deg.size)
    assert effect.half_loop is not None
    for first, size in zip(grid.step_starts[:-1], grid.trial_steps, strict=True):
        own = angle_deg[first : first + size].copy()
        reading[first : first + size] = effect.half_loop(own, *effects[effect.slots])
    return reading


def begun(
    grid: CampaignGrid, branches: Branches, before: Integers, angle_deg: Floats, effects: Floats
) -> Floats:
    """Say what known branches make of the reading at the end of each step, (steps,), deg.

    `before`, (trials,), is what came before each log; the rest as for `half_loop`.
    """
    reading = np.zeros(angle_deg.size)
    for name, of_kind in branches.items():
        own = half_loop(grid, name, angle_deg, effects)
        for trial, first in enumerate(grid.step_starts[:-1]):
            steps = slice(first, first + grid.trial_steps[trial])
            reading[steps] += of_kind[before[trial]] * own[steps]
            if first > 0:  # where the log's first step comes from
                reading[first - 1] += of_kind[before[trial]] * own[first]
    return reading
