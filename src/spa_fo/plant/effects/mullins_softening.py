"""Stress softening: the first loadings to a given maximum are stiffer.

Beyond the largest strain so far a softened actuator is as stiff as it ever was there: each level
pulls by itself, or all of it is back on the path of virgin material. The strain is the angle, whose
restoring moment softens, or the load, of which less arrives: then it is the gain that grows, and
the pace stays. Which it is a fit says.
"""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import Check, Effect, amplitude, shape, share

EFFECT = Effect(
    id="mullins_softening",
    stage="actuator",
    parameters=(
        amplitude(
            "fraction", "1", "extra stiffness of virgin material", spread=0.2, high=1.0, start=0.1
        ),
        shape(
            "loadings",
            "1",
            "loadings in which it goes",
            centre=1.5,
            factor=2.2,
            low=0.2,
            high=30.0,
        ),
        shape(
            "dwell_s",
            "s",
            "time under load that does the same",
            centre=50.0,
            factor=3.5,
            low=1.0,
            high=500.0,
            starts=(12.0, 120.0),
        ),
        amplitude(
            "level_share",
            "1",
            "part of it that is lost level by level",
            spread=0.6,
            high=1.0,
            start=0.9,
            further=(0.3,),
        ),
        amplitude(
            "rejoins",
            "1",
            "share of that which is back wherever an angle is new, as if nothing were softened",
            spread=0.6,
            high=1.0,
            start=0.2,
            further=(0.9,),
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
        share(
            "by_load",
            "share by which it goes with the load, as a gain does, and not with the angle",
            centre=0.0,
            spread=0.6,
            starts=(0.0, 1.0),
            is_addition=True,
        ),
        shape(
            "blend_deg",
            "deg",
            "angles about a loading's largest one over which its softening ends",
            centre=9.0,
            factor=2.0,
            low=1.0,
            high=200.0,
        ),
        share(
            "by_peak",
            "part of what is back that goes, all through a log, by the largest strain so far",
            centre=0.0,
            spread=0.6,
            starts=(0.0,),
            is_addition=True,
            by_repeats=True,  # else each log is as soft as a static curve is at its angle
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

MULLINS_LEVELS = 24
_REACH = 0.5  # of what a loading reaches over lies beyond its largest strain. Assumed.


@njit
def virgin_moment(
    strain: float,
    virgin: Floats,
    below: Floats,
    width: float,
    by_level: float,
    rejoins: float,
    fresh: Floats,
    peak: float,
    by_peak: float,
) -> tuple[float, float]:
    """Moment of what has not been softened yet at a strain (rad), and its slope.

    The levels that are passed pull (`by_level` of it), and the whole bundle stiffens the actuator
    as a whole (the rest). Either each level pulls by itself, or (`rejoins`) all is as stiff as the
    level of the strain: beyond the largest so far the actuator is back on the path of virgin
    material (Ogden and Roxburgh 1999, doi:10.1098/rspa.1999.0431). A part `by_peak` of that is as
    virgin as the level of the largest strain in this log, `peak`, was when the log began, `fresh`.
    The levels are `width` (rad) apart, `below` are the sums of those below each and of all.
    """
    last, at = virgin.size - 1, strain / width
    level = min(int(max(at, 0.0)), last)
    part = min(max(strain - level * width, 0.0), width)
    local = width * below[level] + virgin[level] * part
    tangent = virgin[level] if 0.0 < part < width else 0.0
    whole = below[virgin.size] / virgin.size
    back, steeper = 0.0, 0.0
    if rejoins > 0.0 and strain > 0.0:
        here, rising = virgin_at(at, virgin)
        there, climbing = virgin_at(max(strain, peak) / width, fresh)
        here += by_peak * (there - here)
        rising += by_peak * ((climbing if strain > peak else 0.0) - rising)
        back = here * strain
        steeper = here + at * rising
    own = (1.0 - rejoins) * local + rejoins * back
    own_slope = (1.0 - rejoins) * tangent + rejoins * steeper
    moment = by_level * own + (1.0 - by_level) * whole * strain
    return moment, by_level * own_slope + (1.0 - by_level) * whole


@njit
def virgin_at(at: float, virgin: Floats) -> tuple[float, float]:
    """Say how virgin the material is at so many levels, and how that rises from level to level."""
    last = virgin.size - 1
    lower = min(int(max(at, 0.0)), last - 1)
    rising = virgin[lower + 1] - virgin[lower]
    here = virgin[lower] + (min(at, float(last)) - lower) * rising
    return here, rising if at < last else 0.0


@njit
def _reached(strain: float, blend: float) -> float:
    """Say how far a strain passes a level of 0, in blends: at rest it does not."""
    return strain / blend + min(max(strain / blend, 0.0), _REACH)


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
    blend: float,
) -> None:
    """Soften each level as far as it is passed downwards, and while the strain stays beyond it.

    On its way up to a new largest strain the material is virgin. How far a level is passed goes
    over `blend` (rad), half of which lies beyond it, but no more than the strain itself.
    """
    stays = math.exp(-step / dwell)  # of levels that it stays beyond: one exponential for all
    was, now, apart = _reached(before, blend), _reached(after, blend), width / blend
    for j in range(virgin.size):
        passed, beyond = min(max(was, 0.0), 1.0), min(max(now, 0.0), 1.0)
        if beyond == 1.0:
            virgin[j] *= stays
        elif passed > 0.0 or beyond > 0.0:
            virgin[j] *= math.exp(-beyond * step / dwell - max(passed - beyond, 0.0) / loadings)
        below[j + 1] = below[j] + virgin[j]
        was -= apart
        now -= apart
