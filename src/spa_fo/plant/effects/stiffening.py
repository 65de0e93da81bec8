"""The restoring moment grows faster than the angle, or more slowly.

A wall that straightens, or an opposing chamber, stiffens the actuator as it bends; one that
balloons gives way.
"""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Effect, amplitude, shape, share

_EXPONENT = 2.2  # typical

EFFECT = Effect(
    id="stiffening",
    stage="actuator",
    place="moment",
    parameters=(
        amplitude(
            "fraction_at_60deg",
            "1",
            "extra restoring moment at 60°, of the elastic one; negative where it softens",
            spread=0.08,
            low=-100.0,
            high=100.0,
            start=0.05,
            goes_with=(-_EXPONENT, 0.0),  # as much at the largest angle
        ),
        shape(
            "exponent",
            "1",
            "how steeply it grows with the angle",
            centre=_EXPONENT,
            factor=1.5,
            low=0.8,
            high=8.0,
        ),
        share(
            "by_load",
            "part of what it grows with that is the load, as in a wall under tension",
            centre=0.0,
            spread=0.4,
            is_addition=True,
        ),
    ),
    name="stiffening or softening of the actuator",
    means="the restoring moment grows faster than the angle, or more slowly where it softens",
    remedy="keep it in the model: it belongs to the material and the shape",
    shown_in=("levels",),
)

_REFERENCE = math.radians(60.0)


@njit
def stiffening_moment(
    angle: float, load: float, fraction: float, exponent: float, by_load: float
) -> tuple[float, float]:
    """Moment (rad) of the part that grows as a power of the angle, and its slope.

    A part `by_load` of what it grows with is the load (rad of the static angle) instead. One that
    softens does so to first order alike; with the elastic part it rises to any angle, so that there
    is one angle to each load.
    """
    strain = (1.0 - by_load) * angle + by_load * load
    part = fraction * (abs(strain) / _REFERENCE) ** exponent
    growing = 0.0 if strain == 0.0 else exponent * part * (1.0 - by_load) * angle / strain
    if part >= 0.0:
        return part * angle, part + growing
    left = (1.0 - exponent * part) ** (-1.0 / exponent)
    return (left - 1.0) * angle, left - 1.0 + left / (1.0 - exponent * part) * growing
