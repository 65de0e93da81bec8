"""What a log's rows read of a signal on the grid's cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spa_fo._jit import njit

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@njit
def read_rows(
    cells: Floats,
    before: Integers,
    over: Integers,
    following: Integers,
    cells_on: Floats,
    starts: Integers,
) -> Floats:
    """Sum up what rows read, from each of `starts` to the next, (n,); see `CampaignGrid.read`.

    A row reads the cell that is `over`, and how far it goes `cells_on` by the smaller slope to its
    neighbours. In one go it takes a fifth of the time that whole arrays do.
    """
    out = np.zeros(starts.size)
    for i in range(starts.size):
        end = starts[i + 1] if i + 1 < starts.size else over.size
        for row in range(starts[i], end):
            here = cells[over[row]]
            rise, goes_on = here - cells[before[row]], cells[following[row]] - here
            if rise * goes_on > 0.0:
                here += math.copysign(min(abs(rise), abs(goes_on)), rise) * cells_on[row]
            out[i] += here
    return out
