"""The restoring moment grows faster than the angle."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Effect, amplitude, shape

EFFECT = Effect(
    id="stiffening",
    stage="actuator",
    place="moment",
    parameters=(
        amplitude(
            "fraction_at_60deg",
            "1",
            "extra restoring moment at 60°, as a share of the elastic one",
            spread=0.08,
            high=2.0,
            start=0.05,
        ),
        shape(
            "exponent",
            "1",
            "how steeply it grows with the angle",
            centre=2.2,
            factor=1.5,
            low=0.8,
            high=8.0,
        ),
    ),
    name="stiffening of the actuator",
    means="the restoring moment grows faster than the angle",
    remedy="keep it in the model: it belongs to the material and the shape",
    shown_in=("levels",),
)

_REFERENCE = math.radians(60.0)


@njit
def stiffening_moment(angle: float, fraction: float, exponent: float) -> tuple[float, float]:
    """Moment (rad) of the part that grows as a power of the angle, and its slope."""
    part = fraction * (abs(angle) / _REFERENCE) ** exponent
    return part * angle, part * (1.0 + exponent)
