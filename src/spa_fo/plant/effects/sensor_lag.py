"""The reading follows the angle with a low-pass."""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Check, Effect
from spa_fo.plant.effects.shared import lag
from spa_fo.plant.memory import STEPS_S

EFFECT = Effect(
    id="sensor_lag",
    stage="sensor",
    parameters=lag("return_excess"),
    name="lag of the sensor",
    means="the reading follows the angle as through a low-pass",
    remedy="take filtering out of the sensor's circuit; check against a video of one step",
    filter="lag",
    in_fixture=True,
    equivalents={
        "channel_latency": Check(
            "log several times as fast and let the sensor snap back from a known angle",
            "a delay keeps the edge, a lag rounds it",
        )
    },
)


@njit
def follow(y: Floats, level: Integers, time_constant: float, excess: float, state: Floats) -> None:
    """First-order lag of an input that runs straight within a step; the first value is at rest.

    A fall takes longer than a rise by `excess`, as a part of that.
    """
    if time_constant <= 0.0:
        return
    now = state[0]
    before = now if y.size == 0 else y[0]
    x = STEPS_S / (time_constant * np.array([[1.0], [1.0 + excess]]))
    keeps, means = np.exp(-x), -np.expm1(-x) / x
    for i in range(y.size):
        falls = 1 if 0.5 * (before + y[i]) < now else 0
        keep, mean = keeps[falls, level[i]], means[falls, level[i]]
        now = keep * now + (1.0 - mean) * y[i] + (mean - keep) * before
        before = y[i]
        y[i] = now
    state[0] = now
