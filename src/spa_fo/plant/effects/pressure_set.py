"""The rest angle shifts under load, up to a limit, and comes back slowly.

Each load beyond a threshold leaves a set that is soon complete and that fades over minutes. Seen in
the logs of a three-chamber arm (zhiqiao0256/Soft-Arm-SMART-Controller-), whose start angle climbs
from pulse to pulse by 2 to 3 deg from 10 psi on and by 0.15 deg at 5 psi. A later campaign begins
without any.
"""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude, shape

_STEEP = 3.0


def shifted(
    pressure_kpa: Floats,
    time_s: Floats,
    set_kpa: float,
    onset_kpa: float,
    building_s: float,
    recovery_s: float,
) -> Floats:
    """Add what load has set, as the pressure that would bend as much."""
    share = (np.maximum(pressure_kpa, 0.0) / onset_kpa) ** _STEEP
    lengths = lengths_of(time_s)
    return pressure_kpa + set_kpa * np.asarray(
        ratchet(share / (1.0 + share), lengths, building_s, recovery_s)
    )


@njit
def lengths_of(time_s: Floats) -> Floats:
    """Lengths of steps that lie end to end, of their middles from 0 on."""
    out = np.empty_like(time_s)
    end = 0.0
    for i in range(time_s.size):
        out[i] = 2.0 * (time_s[i] - end)
        end += out[i]
    return out


@njit
def ratchet(target: Floats, length_s: Floats, building_s: float, recovery_s: float) -> Floats:
    """Mean over each step of a state that rises to a held target sooner than it falls."""
    out = np.empty_like(target)
    state = 0.0
    for i in range(target.size):
        rate, towards = 1.0 / recovery_s, 0.0
        if target[i] > state:
            rate += 1.0 / building_s
            towards = target[i] / (building_s * rate)
        keep = math.exp(-rate * length_s[i])
        spent = rate * length_s[i]
        mean = (1.0 - keep) / spent if spent > 1e-9 else 1.0
        out[i] = towards + (state - towards) * mean
        state = towards + (state - towards) * keep
    return out


EFFECT = Effect(
    id="pressure_set",
    stage="actuator",
    place="relaxation",
    parameters=(
        amplitude(
            "set_kpa",
            "kPa",
            "largest set, as the pressure that bends as much",
            spread=1.0,
            high=200.0,
            start=0.5,
        ),
        shape(
            "onset_kpa",
            "kPa",
            "pressure that sets half of it",
            centre=30.0,
            factor=2.0,
            low=0.1,
            high=3000.0,
        ),
        shape(
            "building_s",
            "s",
            "time in which it builds up",
            centre=5.0,
            factor=3.0,
            low=0.2,
            high=300.0,
        ),
        shape(
            "recovery_s",
            "s",
            "time in which it is lost again",
            centre=200.0,
            factor=3.0,
            low=5.0,
            high=20000.0,
        ),
    ),
    name="set of the rest angle",
    means="load shifts the rest angle up to a limit, sooner than it comes back",
    remedy="load the actuator once before it is used, and rest it between uses",
    shown_in=("release", "order"),
    equivalents={
        "creep": Check(
            "hold two pressures, one twice the other, for a minute each after a long rest",
            "creep goes with the pressure; a set has a limit and soon reaches it",
        ),
        "sensor_slip": Check(
            "rest the actuator for half an hour after the last trial, and read its angle again",
            "a set comes back by itself; a sensor that has slipped stays",
        ),
    },
    act=shifted,
    sees_angle=False,
    odds=RARER,
)
