"""How slowly it moves depends on the pressure.

An inflated wall is stiffer, and a slack one dissipates more: the load is felt late by a time that
goes with the pressure, one way or the other. Seen in a three-chamber arm
(zhiqiao0256/Soft-Arm-SMART-Controller-), whose angle takes 1 to 3 s by the level while its pressure
takes 0.35 to 0.8 s.
"""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude
from spa_fo.plant.effects.pressure_set import lengths_of

REFERENCE_KPA = 15.0


def delayed(pressure_kpa: Floats, time_s: Floats, lag_s: float) -> Floats:
    """Let the load follow with a time constant of its own at each pressure."""
    empty = np.exp(-np.maximum(pressure_kpa, 0.0) / REFERENCE_KPA)
    times = lag_s * (1.0 - empty) if lag_s >= 0.0 else -lag_s * empty
    return np.asarray(trailed(pressure_kpa, lengths_of(time_s), times))


@njit
def trailed(load: Floats, length_s: Floats, times_s: Floats) -> Floats:
    """Mean over each step of what follows a held load with a time constant of that step."""
    out = np.empty_like(load)
    lack, before = 0.0, 0.0
    for i in range(load.size):
        lack += load[i] - before
        before = load[i]
        if times_s[i] <= 1e-9 * length_s[i]:
            out[i], lack = load[i], 0.0
            continue
        spent = length_s[i] / times_s[i]
        keep = math.exp(-spent)
        out[i] = load[i] - lack * (1.0 - keep) / spent
        lack *= keep
    return out


EFFECT = Effect(
    id="pressure_damping",
    stage="actuator",
    place="damping",
    parameters=(
        amplitude(
            "lag_s",
            "s",
            "time by which the inflated actuator follows late; negative for the empty one",
            spread=0.2,
            low=-3.0,
            high=3.0,
            start=0.1,
        ),
    ),
    name="damping that goes with the pressure",
    means="the actuator moves more slowly when it is inflated than when it is empty, or the other "
    "way round",
    remedy="keep it in the model, or work about one pressure",
    shown_in=("release", "levels"),
    equivalents={
        "line_lag": Check(
            "step up by the same small height from several pressures",
            "a line lags alike at all of them, damping that goes with the pressure does not",
        )
    },
    act=delayed,
    sees_angle=False,
    odds=RARER,
)
