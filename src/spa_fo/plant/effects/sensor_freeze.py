"""The reading freezes: from some moment on it stays near what it was then.

A channel that hangs repeats its last value; a sensor that sticks in its pocket follows a part of
the angle. Seen in the dead channels of measured logs. When is a share of the campaign: a model
with it does not go on to a later one.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude
from spa_fo.plant.effects.shared import SINCE, switched


def freeze(angle_deg: Floats, time_s: Floats, held: float, since: float) -> Floats:
    """Read a part of what was read at some moment in place of what is read from then on."""
    then = np.interp(since * time_s[-1], time_s, angle_deg)
    return np.asarray(angle_deg + held * switched(time_s, since) * (then - angle_deg))


EFFECT = Effect(
    id="sensor_freeze",
    stage="sensor",
    parameters=(
        amplitude(
            "held",
            "1",
            "share of the reading that does not move any more",
            spread=0.5,
            high=1.0,
            start=0.5,
            searched=(0.3, 1.0),  # what is held less moves: a gain that dropped
        ),
        SINCE,
    ),
    name="a reading that froze",
    means="from some moment on the reading stays near what it was then",
    remedy="look at the channel's cable, converter and program, and leave out what it read then",
    shown_in=("order",),
    check=Check(
        "look whether the reading still has its noise",
        "a channel that hangs repeats one value exactly",
    ),
    equivalents={
        "sensor_detachment": Check(
            "bend the actuator by hand while watching the reading",
            "a channel that hangs does not move at all, a loose sensor does",
        )
    },
    act=freeze,
    odds=RARER,
)
