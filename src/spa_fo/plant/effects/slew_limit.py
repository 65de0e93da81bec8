"""The pump can change the pressure only at a limited rate."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Effect, shape
from spa_fo.plant.effects.shared import Floats, Integers
from spa_fo.plant.memory import FINEST_STEP_S

EFFECT = Effect(
    id="slew_limit",
    stage="drive",
    parameters=(
        shape(
            "rise_kpa_s",
            "kPa/s",
            "fastest rise of the pressure",
            centre=120.0,
            factor=3.0,
            low=0.02,
            high=30000.0,
            starts=(30.0, 70.0, 200.0),
        ),
        shape(
            "fall_ratio",
            "1",
            "fastest fall, as a multiple of the fastest rise",
            centre=1.0,
            factor=1.6,
            low=0.1,
            high=10.0,
        ),
        shape(
            "approach_s",
            "s",
            "time constant of the last bit towards the command",
            centre=0.03,
            factor=2.0,
            low=0.005,
            high=0.2,  # one that takes longer is a line's lag
        ),
    ),
    name="slew limit of the drive",
    means="the pump changes the pressure at a limited rate only",
    remedy="command ramps the pump can follow, or fit a faster pump",
    neutral={"rise_kpa_s": 30000.0, "fall_ratio": 1.0, "approach_s": 0.005},
)


@njit
def slew(p: Floats, starts: Integers, rise: float, ratio: float, approach: float) -> None:
    """Follow the command at a limited rate, exponentially at the end; exact over a cell."""
    decay = math.exp(-FINEST_STEP_S / approach)
    for trial in range(starts.size - 1):
        now = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            before = now
            rest = p[i] - now
            rate = rise if rest > 0.0 else rise * ratio
            ramp = abs(rest) - rate * approach  # so much of the way at full rate
            sign = 1.0 if rest > 0.0 else -1.0
            if ramp <= 0.0:
                now = p[i] - rest * decay
            elif ramp >= rate * FINEST_STEP_S:
                now += sign * rate * FINEST_STEP_S
            else:
                left = FINEST_STEP_S - ramp / rate
                now = p[i] - sign * rate * approach * math.exp(-left / approach)
            p[i] = 0.5 * (before + now)
