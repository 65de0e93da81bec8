"""The pressure stops rising at the supply's own, or at the regulator's largest.

A pressure sensor at the top of its range looks the same in the pressure alone; then the angle goes
on. Not seen in the logs at hand: the ramps of a three-chamber arm
(zhiqiao0256/Soft-Arm-SMART-Controller-), which reach 29.7 psi of 33, lack a tenth all along.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, shape

_HIGHEST_KPA = 5000.0
_BLUNT = 0.02
_PRESSURE = Check(
    "log the pressure with a tap at the actuator",
    "where the supply is at its end it stands still at the largest commands",
)


def limited(pressure_kpa: Floats, time_s: Floats, highest_kpa: float, knee: float) -> Floats:
    """Take the smooth minimum of what is asked and the highest pressure there is."""
    over = pressure_kpa - highest_kpa
    bend = knee * highest_kpa
    rounded = 0.5 * (over + np.sqrt(over**2 + bend**2))
    # Nothing is missed of no pressure.
    at_rest = 0.5 * (np.sqrt(highest_kpa**2 + bend**2) - highest_kpa)
    return np.asarray(pressure_kpa - np.maximum(rounded - at_rest, 0.0))


EFFECT = Effect(
    id="supply_limit",
    stage="drive",
    parameters=(
        shape(
            "highest_kpa",
            "kPa",
            "highest pressure that is reached",
            centre=55.0,
            factor=1.35,
            low=0.5,
            high=_HIGHEST_KPA,
            starts=(40.0, 55.0),
        ),
        shape(
            "knee",
            "1",
            "how far below it begins to lag behind, as a share of it",
            centre=_BLUNT,
            factor=2.5,
            low=0.002,
            high=0.5,
        ),
    ),
    name="limit of the supply",
    means="the pressure stops rising at the largest that the supply or the regulator can give",
    remedy="raise the supply pressure, or command no more than it gives",
    shown_in=("levels",),
    check=Check(
        "read a second gauge at the actuator while the command goes on rising",
        "it stands still where the supply is at its end, and goes on where a sensor is",
    ),
    equivalents=dict.fromkeys(("sensor_saturation", "contact_stop"), _PRESSURE),
    neutral={"highest_kpa": _HIGHEST_KPA, "knee": 0.002},
    act=limited,
    odds=RARER,
)
