"""A pure delay between command and pressure."""

from __future__ import annotations

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Effect, Parameter, lateness
from spa_fo.plant.memory import FINEST_STEP_S

EFFECT = Effect(
    id="dead_time",
    stage="drive",
    parameters=(
        lateness("delay_s", "how long the pressure waits after the command", is_delay=True),
        Parameter(
            *("uneven", "1", 0.0, 0.3, -1.0, 1.0),
            starts=(0.0, -1.0, -0.5, 0.5, 1.0),
            means="part by which a rise waits longer than that, and a fall shorter",
            is_addition=True,
        ),
    ),
    name="dead time of the drive",
    means="the pressure follows the command after a pure delay",
    remedy="look for the delay in the valve, the tube and the control loop; a shorter tube or a "
    "faster loop removes it",
    filter="delay",
)


@njit
def delay_cells(p: Floats, starts: Integers, delay: float, uneven: float) -> None:
    """Delay by a fraction of cells; the means are held cell by cell.

    Where a rise waits longer than a fall, it is the lesser of the signals that wait as either does,
    and else the larger.
    """
    if uneven == 0.0:
        shift(p, starts, delay)
        return
    fallen = p.copy()
    shift(p, starts, delay * (1.0 + uneven))
    shift(fallen, starts, delay * (1.0 - uneven))
    for i in range(p.size):
        if (abs(fallen[i]) < abs(p[i])) == (uneven > 0.0):
            p[i] = fallen[i]


@njit
def shift(p: Floats, starts: Integers, delay: float) -> None:
    """Delay a rise and a fall alike, from rest."""
    cells = delay / FINEST_STEP_S
    whole = int(cells)
    part = cells - whole
    for trial in range(starts.size - 1):
        first, end = starts[trial], starts[trial + 1]
        for i in range(end - 1, first - 1, -1):
            near = p[i - whole] if i - whole >= first else 0.0
            far = p[i - whole - 1] if i - whole - 1 >= first else 0.0
            p[i] = (1.0 - part) * near + part * far
