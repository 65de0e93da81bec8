"""Stress softening: the first loadings to a given maximum are stiffer.

Beyond the largest angle so far a softened actuator is as stiff as it ever was there: each level of
angle pulls by itself, or all of it is back on the path of virgin material. Both are in the
literature, and which it is a fit says.
"""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import Check, Effect, amplitude, shape

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
        amplitude(
            "rejoins",
            "1",
            "share of that which is back wherever an angle is new, as if nothing were softened",
            spread=0.6,
            high=1.0,
            start=0.3,
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

MULLINS_LEVELS = 12


@njit
def _newly(level: int, before: float, after: float) -> float:
    """Share of a level that is passed upwards from one angle to another, in levels."""
    return max(min(max(after - level, 0.0), 1.0) - min(max(before - level, 0.0), 1.0), 0.0)


@njit
def _kept(passed: float, loadings: float) -> float:
    """Share of a level that is left once so much of it is passed: mostly nothing is, and 1."""
    return math.exp(-passed / loadings) if passed > 0.0 else 1.0


@njit
def virgin_moment(
    before: float,
    angle: float,
    virgin: Floats,
    below: Floats,
    width: float,
    loadings: float,
    share: float,
    rejoins: float,
) -> tuple[float, float]:
    """Moment of what has not been softened yet, and its slope.

    The levels that the angle has passed pull (`share` of it), and the whole bundle stiffens the
    actuator as a whole (the rest). Either each level pulls by itself, or (`rejoins`) all is as
    stiff as the level that the angle is at: beyond the largest angle so far the actuator is back
    on the path of virgin material (Ogden and Roxburgh 1999, doi:10.1098/rspa.1999.0431). All
    softens on the way from `before`, where the levels are known. They are `width`
    (rad) apart, `below` are the sums of those below each and of all.
    """
    last, start, at = virgin.size - 1, before / width, angle / width
    level = min(int(max(at, 0.0)), last)
    part = min(max(angle - level * width, 0.0), width)
    local = width * below[level] + virgin[level] * part
    tangent = virgin[level] if 0.0 < part < width else 0.0
    for j in range(min(int(max(start, 0.0)), last), level + 1):
        softened = _kept(_newly(j, start, at), loadings) - 1.0
        local += virgin[j] * (part if j == level else width) * softened
    whole = below[virgin.size] / virgin.size
    back, steeper = 0.0, 0.0
    if rejoins > 0.0 and angle > 0.0:
        lower = min(level, last - 1)
        under = virgin[lower] * _kept(_newly(lower, start, at), loadings)
        over = virgin[lower + 1] * _kept(_newly(lower + 1, start, at), loadings)
        here = under + (min(at, float(last)) - lower) * (over - under)
        back = here * angle
        # What softens on the way hardly bends it: Newton's steps need no more of the slope.
        steeper = here + (at * (over - under) if at < last else 0.0)
    own = (1.0 - rejoins) * local + rejoins * back
    own_slope = (1.0 - rejoins) * tangent + rejoins * steeper
    return share * own + (1.0 - share) * whole * angle, share * own_slope + (1.0 - share) * whole


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
            virgin[j] *= math.exp(-beyond * step / dwell - _newly(j, there, here) / loadings)
        below[j + 1] = below[j] + virgin[j]
