"""The sensor comes off: from some moment on it reads less of the angle, or none of it.

With nothing lost and another level it is a jump of the zero within a trial; with all lost it is a
dead or a frozen reading. Seen in the dead and jumping channels of measured logs. When is a share of
the campaign: a model with it does not go on to a later one.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude
from spa_fo.plant.effects.shared import SINCE, switched


def come_off(
    angle_deg: Floats, time_s: Floats, lost: float, level_deg: float, since: float
) -> Floats:
    """Read a part of the angle and a level from some moment on."""
    return np.asarray(angle_deg + switched(time_s, since) * (level_deg - lost * angle_deg))


EFFECT = Effect(
    id="sensor_detachment",
    stage="sensor",
    parameters=(
        amplitude(
            "lost",
            "1",
            "share of the angle that it does not read any more",
            spread=0.5,
            high=1.0,
            start=0.3,
        ),
        amplitude(
            "level_deg",
            "deg",
            "what it reads in place of it",
            spread=15.0,
            low=-180.0,
            high=180.0,
            start=0.0,
        ),
        SINCE,
    ),
    name="a sensor that came off",
    means="from some moment on it follows the angle less, or not at all, or from another zero",
    remedy="look at how the sensor is fixed, glue or clamp it anew, and calibrate it again",
    shown_in=("order",),
    check=Check(
        "look at the sensor and bend the actuator by hand while watching the reading",
        "a sensor that is loose or dead shows at once",
    ),
    equivalents={
        "sensor_slip": Check(
            "look whether the zero jumps within a trial or from one to the next",
            "a slip between trials leaves each trial as it is",
        )
    },
    neutral={"lost": 0.0, "level_deg": 0.0},
    act=come_off,
    odds=RARER,
)
