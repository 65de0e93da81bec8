"""Tube and volume filter the command: a low-pass between command and pressure."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Effect
from spa_fo.plant.effects.shared import Floats, Integers, two_poles
from spa_fo.plant.memory import FINEST_STEP_S

EFFECT = Effect(
    id="line_lag",
    stage="drive",
    parameters=two_poles(),
    name="pneumatic lag of the line",
    means="tube and chamber fill slowly, so the pressure is a smoothed command",
    remedy="shorten or widen the tube, or put the regulator's sensor at the actuator",
    filter="lag",
)


@njit
def low_pass(p: Floats, starts: Integers, time_constant: float) -> None:
    """First-order lag; means over cells of an input that is constant in each."""
    if time_constant <= 0.0:
        return
    x = FINEST_STEP_S / time_constant
    keep = math.exp(-x)
    mean = -math.expm1(-x) / x
    for trial in range(starts.size - 1):
        now = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            distance = now - p[i]
            p[i] += distance * mean
            now = p[i] - distance * mean + distance * keep
