"""What a kPa bends depends on the pressure: more as a wall balloons, less against a bias chamber.

Seen in the logs of a three-chamber arm (zhiqiao0256/Soft-Arm-SMART-Controller-), whose angle goes
about as the pressure to the power of 1.22; held against an opposing chamber it goes the other way.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude, shape

REFERENCE_KPA = 30.0
_EXPONENT = 1.0  # typical


def stretched(pressure_kpa: Floats, time_s: Floats, growth: float, exponent: float) -> Floats:
    """Multiply by a gain of 1 + x for small x = growth (p/30 kPa)^n; it stays positive for any."""
    x = growth * (np.abs(pressure_kpa) / REFERENCE_KPA) ** exponent
    return np.asarray(pressure_kpa * np.exp(np.arcsinh(x)))


EFFECT = Effect(
    id="gain_growth",
    stage="actuator",
    place="input_map",
    parameters=(
        amplitude(
            "growth",
            "1",
            "growth of the gain up to 30 kPa; negative where it falls",
            spread=0.12,
            low=-20.0,
            high=20.0,
            start=0.06,
            goes_with=(0.0, -_EXPONENT),  # as much at the largest pressure
        ),
        shape(
            "exponent",
            "1",
            "how steeply it grows with the pressure",
            centre=_EXPONENT,
            factor=1.6,
            low=0.3,
            high=4.0,
        ),
    ),
    name="gain that goes with the pressure",
    means="each further kPa bends more than the one before, or less: the wall balloons, or works "
    "against another chamber",
    remedy="keep it in the model, or work about one pressure",
    shown_in=("levels",),
    equivalents={
        "stiffening": Check(
            "hang a known weight at the tip at two pressures, and read by how much the angle gives",
            "a stiffer spring gives less at the larger angle; another gain does not",
        ),
        "sensor_nonlinearity": Check(
            "check a few angles against an outside reference, such as a camera",
            "a wrong curve shows there, a gain of the actuator does not",
        ),
    },
    act=stretched,
    sees_angle=False,
    odds=RARER,
)
