"""The pump can change the pressure only at a limited rate."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Effect, shape
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
            "approach_kpa",
            "kPa",
            "how far from the command it slows down",
            centre=1.2,
            factor=2.5,
            low=0.02,
            high=1000.0,
            searched_to=9.0,  # what slows down farther off is a line's lag
        ),
    ),
    name="slew limit of the drive",
    means="the pump changes the pressure at a limited rate only",
    remedy="command ramps the pump can follow, or fit a faster pump",
    neutral={"rise_kpa_s": 30000.0, "fall_ratio": 1.0, "approach_kpa": 0.02},
)


@njit
def slew(p: Floats, starts: Integers, rise: float, ratio: float, approach: float) -> None:
    """Follow the command at a limited rate, exponentially near it; exact over a cell."""
    for trial in range(starts.size - 1):
        now = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            before = now
            rest = p[i] - now
            rate = rise if rest > 0.0 else rise * ratio
            ramp = abs(rest) - approach  # so much of the way at full rate
            sign = 1.0 if rest > 0.0 else -1.0
            if ramp <= 0.0:
                now = p[i] - rest * math.exp(-FINEST_STEP_S * rate / approach)
            elif ramp >= rate * FINEST_STEP_S:
                now += sign * rate * FINEST_STEP_S
            else:
                left = FINEST_STEP_S - ramp / rate
                now = p[i] - sign * approach * math.exp(-left * rate / approach)
            p[i] = 0.5 * (before + now)
