"""The actuator tears: from some moment on a kPa bends it less, or more.

A seam opens, a layer comes off, a fibre breaks. When is a share of the campaign: a model with it
does not go on to a later one.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude
from spa_fo.plant.effects.shared import SINCE, switched


def torn(pressure_kpa: Floats, time_s: Floats, lost: float, since: float) -> Floats:
    """Lose a part of what the pressure does from some moment on."""
    return np.asarray(pressure_kpa * (1.0 - lost * switched(time_s, since)))


EFFECT = Effect(
    id="tear",
    stage="actuator",
    parameters=(
        amplitude(
            "lost",
            "1",
            "share of what a kPa bends that is lost; negative where it bends more",
            spread=0.12,
            low=-1.0,
            high=1.0,
            start=0.06,
        ),
        SINCE,
    ),
    name="an actuator that tore",
    means="from some moment on a kPa bends it less, or more: a seam, a layer or a fibre gave way",
    remedy="look at the actuator for a seam that opened, and identify it anew after the moment",
    shown_in=("order",),
    check=Check(
        "look at the actuator under pressure, and under water for bubbles",
        "a seam that opened shows at once",
    ),
    equivalents={
        "thermal_drift": Check(
            "repeat one step ten times in a row, and once more after an hour",
            "a drift goes on; what has torn stays as it is",
        )
    },
    act=torn,
    sees_angle=False,
    odds=RARER,
)
