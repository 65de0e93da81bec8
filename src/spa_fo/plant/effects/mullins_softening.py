"""Stress softening: the first loadings to a given maximum are stiffer."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Check, Effect, amplitude, shape
from spa_fo.plant.effects.shared import Floats

EFFECT = Effect(
    id="mullins_softening",
    stage="actuator",
    parameters=(
        amplitude(
            "fraction", "1", "extra stiffness of virgin material", spread=0.12, high=1.0, start=0.06
        ),
        shape(
            "loadings",
            "1",
            "loadings in which it goes",
            centre=2.0,
            factor=2.2,
            low=0.2,
            high=30.0,
        ),
        shape(
            "dwell_s",
            "s",
            "time under load that does the same",
            centre=25.0,
            factor=2.5,
            low=1.0,
            high=500.0,
        ),
        amplitude(
            "level_share",
            "1",
            "part of it that is lost level by level",
            spread=0.6,
            high=1.0,
            start=0.5,
        ),
        shape(
            "span_deg",
            "deg",
            "angles over which there is any to lose",
            centre=85.0,
            factor=1.2,
            low=2.0,
            high=600.0,
        ),
    ),
    name="Mullins softening",
    means="the first loadings to a new maximum are stiffer; it fades over a few trials",
    remedy="load the specimen some ten times to the largest pressure before measuring",
    shown_in=("hold", "order"),
    check=Check(
        "take a fresh specimen through the same first loads", "only virgin material softens"
    ),
)

MULLINS_LEVELS = 9


@njit
def virgin_moment(
    angle: float, virgin: Floats, below: Floats, width: float, share: float
) -> tuple[float, float]:
    """Moment of what has not been softened yet, and its slope.

    Chains of the levels that the angle has passed pull (`share` of it), and the whole bundle
    stiffens the actuator as a whole (the rest). Levels are `width` (rad) apart, `below` are the
    sums of those below each and of all.
    """
    level = 0
    while level < virgin.size - 1 and angle > (level + 1) * width:
        level += 1
    part = min(max(angle - level * width, 0.0), width)
    local = width * below[level] + virgin[level] * part
    tangent = virgin[level] if 0.0 < part < width else 0.0
    whole = below[virgin.size] / virgin.size
    return share * local + (1.0 - share) * whole * angle, share * tangent + (1.0 - share) * whole


@njit
def soften(
    before: float,
    after: float,
    step: float,
    virgin: Floats,
    below: Floats,
    width: float,
    loadings: float,
    dwell: float,
) -> None:
    """Soften each level as far as it is passed upwards, and while the angle stays beyond it."""
    here, there = after / width, before / width
    passed = math.exp(-step / dwell)  # of levels that it stays beyond: one exponential for all
    for j in range(virgin.size):
        beyond = min(max(here - j, 0.0), 1.0)
        if beyond == 1.0 and there - j >= 1.0:
            virgin[j] *= passed
        elif beyond > 0.0:
            newly = max(beyond - min(max(there - j, 0.0), 1.0), 0.0)
            virgin[j] *= math.exp(-beyond * step / dwell - newly / loadings)
        below[j + 1] = below[j] + virgin[j]
