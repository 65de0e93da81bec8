"""The reading is the size of a rotation: never below its zero, and a tilt across adds to it.

Motion capture and inertial sensors often log the angle of one rotation, or a norm of several. Seen
in the logs of a three-chamber arm (zhiqiao0256/Soft-Arm-SMART-Controller-), which read 2 to 9 deg
at rest.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, Parameter, amplitude, shape


def unsigned(
    angle_deg: Floats, time_s: Floats, share: float, across_deg: float, zero_deg: float
) -> Floats:
    """Read the size of a rotation by the angle and by a constant one across it, or a part of it.

    The rotation is counted from `zero_deg`, where the sensor was tared; a share beyond 1 is of a
    rectifier whose other half is larger.
    """
    rotation = angle_deg - zero_deg
    return np.asarray(angle_deg + share * (np.hypot(rotation, across_deg) - rotation))


EFFECT = Effect(
    id="unsigned_reading",
    stage="sensor",
    place="reading",
    parameters=(
        amplitude(
            "share",
            "1",
            "how much of the reading is a size: 1 is all of it",
            spread=0.5,
            high=1.2,
            start=0.8,
        ),
        shape(
            "across_deg",
            "deg",
            "rotation across, which is in the reading too",
            centre=2.0,
            factor=2.5,
            low=0.005,
            high=120.0,
        ),
        Parameter(
            "zero_deg",
            "deg",
            centre=0.0,
            spread=12.0,
            low=-90.0,
            high=90.0,
            starts=(0.0, 6.0, 18.0),
            means="angle at which the sensor reads zero rotation, where it was tared",
        ),
    ),
    name="reading without a sign",
    means="the sensor logs the size of a rotation: never below its zero, and never at it "
    "where another rotation is in it",
    remedy="compute the angle about the axis of bending, with its sign, from the logged rotation",
    shown_in=("levels",),
    equivalents={
        "sensor_nonlinearity": Check(
            "turn the tip by hand through zero to the other side, without pressure",
            "the size of a rotation rises on both sides of zero",
        )
    },
    act=unsigned,
    odds=RARER,
)
