"""Below a pressure nothing bends: a fold or a flat wall has to open first.

Seen in logs of bellows (E-IJpelaar/MScControlCode), and of chambers whose walls lie flat when they
are empty.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude, shape


def opened(pressure_kpa: Floats, time_s: Floats, opening_kpa: float, sharpness: float) -> Floats:
    """Take away the smooth minimum of pressure and threshold."""
    if opening_kpa <= 0.0:
        return pressure_kpa
    share = np.maximum(pressure_kpa, 0.0) / opening_kpa
    low = np.minimum(share, 1.0) / (
        1.0 + np.minimum(share, 1.0 / np.maximum(share, 1e-300)) ** sharpness
    ) ** (1.0 / sharpness)
    return np.asarray(pressure_kpa - opening_kpa * low)


EFFECT = Effect(
    id="opening_fold",
    stage="actuator",
    place="input_map",
    parameters=(
        amplitude(
            "opening_kpa",
            "kPa",
            "pressure that is needed before it bends",
            spread=3.0,
            high=600.0,
            start=1.5,
        ),
        shape(
            "sharpness",
            "1",
            "how suddenly it opens",
            centre=3.0,
            factor=1.8,
            low=1.0,
            high=20.0,
        ),
    ),
    name="fold that opens",
    means="a fold or a flat wall opens at some pressure; it hardly bends below",
    remedy="keep the pressure above the opening, or keep it in the model",
    shown_in=("levels",),
    equivalents={
        "drive_backlash": Check(
            "go to one level from below and from above, each time by a slow ramp",
            "play leaves two angles at one command; a fold gives the same angle both ways",
        )
    },
    act=opened,
    sees_angle=False,
    odds=RARER,
)
