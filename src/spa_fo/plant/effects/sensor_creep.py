"""The reading keeps drifting while the angle is held."""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Check, Effect
from spa_fo.plant.effects.shared import CREEP_AT_DEG, CREEP_TIMES_S, GROWTH, driving, spectrum
from spa_fo.plant.memory import LEVELS, STEPS_S

EFFECT = Effect(
    id="sensor_creep",
    stage="sensor",
    place="relaxation",
    parameters=(*spectrum(low=-0.3), GROWTH),
    name="creep of the sensor",
    means="the reading keeps drifting while the angle is held",
    remedy="calibrate with long dwells, and check one hold against a video or a protractor",
    filter="creep",
    in_fixture=True,
    shown_in=("release", "hold"),
    equivalents={
        "creep": Check(
            "calibrate again with dwells of ten minutes at large angles",
            "against a fixture only the sensor's own creep drifts",
        )
    },
)


@njit
def drift_on(y: Floats, level: Integers, size: Floats, growth: float, state: Floats) -> None:
    """Add what the film's elements have crept; `state` is carried on in place."""
    keep = np.empty((LEVELS, state.size))
    for j in range(state.size):
        for k in range(LEVELS):
            keep[k, j] = math.exp(-STEPS_S[k] / CREEP_TIMES_S[j])
    for i in range(y.size):
        total, towards = y[i], driving(y[i], growth, CREEP_AT_DEG)
        for j in range(state.size):
            state[j] += (1.0 - keep[level[i], j]) * (size[j] * towards - state[j])
            total += state[j]
        y[i] = total
