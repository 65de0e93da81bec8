"""The gain drifts with campaign time and does not saturate within a few trials."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Check, Effect, Parameter, amplitude, share

EFFECT = Effect(
    id="thermal_drift",
    stage="actuator",
    parameters=(
        amplitude(
            "per_hour",
            "1/h",
            "change of the gain in the first hour",
            spread=1.0,
            high=6.0,  # a doubling in ten minutes
            start=0.06,
            low=-4.0,
        ),
        Parameter(
            *("fading_per_hour", "1/h", 0.0, 1.2, -40.0, 40.0),
            starts=(0.3,),
            means="how fast the change slows down; below 0 how fast it gathers speed",
            searched=(-4.0, 6.0),
            by_campaign=True,
        ),
        share(
            "of_stiffness",
            "part of the drift that is of the stiffness: a softer actuator is slower, too",
            centre=0.0,
            spread=0.6,
            is_addition=True,
        ),
    ),
    name="thermal drift",
    means="the gain drifts steadily with the time of day",
    remedy="let rig and specimen warm up, log the temperature, and mix the order of the "
    "experiments",
    shown_in=("order",),
    check=Check(
        "repeat one step every quarter of an hour for some hours",
        "a drift goes on with the clock, whatever the loads",
    ),
)


@njit
def drifted_gain(hours: float, rate: float, fading: float) -> float:
    """Gain after so many hours: 1 + rate·t at first.

    It slows as e^{-fading·t}, or with a fading below 0 gathers speed evenly.
    """
    if fading * hours < 1e-6:
        return 1.0 + rate * hours * (1.0 - 0.5 * fading * hours)
    return 1.0 - rate * math.expm1(-fading * hours) / fading
