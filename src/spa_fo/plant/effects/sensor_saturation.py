"""The reading stops rising at the top of its range."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Check, Effect, shape
from spa_fo.plant.effects.shared import Floats

EFFECT = Effect(
    id="sensor_saturation",
    stage="sensor",
    place="reading",
    parameters=(
        shape(
            "ceiling_deg",
            "deg",
            "largest angle that it reads",
            centre=55.0,
            factor=1.35,
            low=1.0,
            high=360.0,
            starts=(40.0, 58.0),
            beyond_read=True,
        ),
        shape(
            "knee_deg",
            "deg",
            "how far below the reading begins to bend",
            centre=3.0,
            factor=2.2,
            low=0.1,
            high=90.0,
        ),
    ),
    name="saturation of the sensor",
    means="the reading stops rising at the top of its range",
    remedy="change the divider's resistor or the gain, so that the whole range of angles fits",
    in_later=True,
    shown_in=("levels",),
    equivalents={
        "contact_stop": Check(
            "bend the actuator by hand beyond where the reading ends",
            "a body that is stopped does not go on, a sensor at its top goes on being bent",
        )
    },
    neutral={"ceiling_deg": 360.0, "knee_deg": 0.1},
)


@njit
def saturate(y: Floats, ceiling: float, knee: float) -> None:
    """Smooth minimum of the angle and the ceiling."""
    for i in range(y.size):
        over = y[i] - ceiling
        y[i] -= 0.5 * (over + math.sqrt(over * over + knee * knee))
