"""The reading stops rising at the top of its range."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import Check, Effect, shape

_AT_CEILING = 2.0 * math.log(2.0)
# That a ceiling is high at least: the widest misses 0.04 % of it at rest. Assumed.
_WIDTHS = 6.0

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
            "twice what it misses at the ceiling, up to 0.23 of it: how far below it bends",
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
    """Soft minimum of the angle and the ceiling: at the ceiling it misses half the knee.

    What is missed falls off exponentially below, and is none at rest: a rail says nothing there.
    """
    width = min(knee / _AT_CEILING, ceiling / _WIDTHS)
    for i in range(y.size):
        over = y[i] - ceiling
        y[i] -= max(over, 0.0) + width * math.log1p(math.exp(-abs(over) / width))
