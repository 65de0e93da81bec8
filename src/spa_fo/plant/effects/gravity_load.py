"""Weight of the actuator or of a mass at its tip: a moment that depends on the orientation."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Check, Effect, Parameter, amplitude

EFFECT = Effect(
    id="gravity_load",
    stage="actuator",
    place="moment",
    is_sum=True,
    parameters=(
        amplitude(
            "along_rest",
            "rad",
            "moment of the weight that grows with the sine of the angle",
            spread=0.08,
            high=0.8,
            start=0.05,
            low=-0.3,
        ),
        amplitude(
            "across_rest",
            "rad",
            "moment of the weight that grows with 1 − cosine of the angle",
            spread=0.12,
            high=1.5,
            start=0.05,
            low=-0.8,
        ),
        Parameter(
            *("at_rest", "rad", 0.0, 0.06, -0.8, 0.8),
            starts=(0.0,),
            means="angle that the weight bends the vented actuator by",
        ),
    ),
    name="gravity",
    means="the weight of the actuator or of a mass at its tip adds a moment",
    remedy="note the orientation, and repeat one step with the actuator turned over",
    shown_in=("levels",),
    check=Check(
        "mount the actuator in another orientation and repeat a step",
        "only the weight's moment turns with it",
    ),
)


@njit
def weight_moment(angle: float, along: float, across: float, at_rest: float) -> tuple[float, float]:
    """Moment (rad) of a weight at an angle, and its slope."""
    sine, cosine = math.sin(angle), math.cos(angle)
    moment = along * sine + across * (1.0 - cosine) - at_rest
    return moment, along * cosine + across * sine
