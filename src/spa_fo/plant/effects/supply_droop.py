"""The supply sags at each rise and recovers while the command is held."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Effect, Parameter, amplitude, shape, share
from spa_fo.plant.memory import FINEST_STEP_S

EFFECT = Effect(
    id="supply_droop",
    stage="drive",
    parameters=(
        amplitude(
            "fraction",
            "1",
            "part of a rise from 0 to 30 kPa that is missing at first",
            spread=0.1,
            high=0.6,
            start=0.05,
            further=(0.2,),
        ),
        shape(
            "recovery_s",
            "s",
            "time in which most of it comes back",
            centre=2.0,
            factor=2.5,
            low=0.4,  # what comes back sooner is a line's lag
            high=60.0,
        ),
        share("slow_share", "part of it that comes back more slowly"),
        shape(
            "exponent",
            "1",
            "how steeply what is missing grows with the pressure",
            centre=1.0,
            factor=1.5,
            low=0.3,
            high=4.0,
        ),
        share("throttled_share", "part of it that is missing in proportion to the pressure"),
        shape(
            "slower",
            "1",
            "how much longer the slow part of the recovery takes",
            centre=5.0,
            factor=1.6,
            low=1.5,
            high=40.0,
        ),
        share(
            "steady_share",
            "part of the quick recovery that goes at a steady pace, as behind a pump",
            centre=0.2,
            starts=(0.2, 0.95),  # from either end a fit does not find the other
            is_addition=True,
        ),
        Parameter(
            *("building_s", "s", 0.0, 0.4, 0.0, 5.0),
            starts=(0.1,),
            means="time in which the sag builds up, as a reservoir is drawn down",
            is_addition=True,
        ),
    ),
    name="droop of the supply",
    means="the supply sags at each rise and recovers while the command is held",
    remedy="add a reservoir or a supply of more flow, and log the supply pressure",
    shown_in=("hold",),
)

REFERENCE_KPA = 30.0


@njit
def demand(pressure: float, exponent: float) -> float:
    """Give what a pressure asks of the supply, kPa: more than in proportion where it runs low."""
    if pressure <= 0.0 or exponent == 1.0:
        return pressure
    return float(REFERENCE_KPA * (pressure / REFERENCE_KPA) ** exponent)


@njit
def droop(
    p: Floats,
    starts: Integers,
    fraction: float,
    recovery: float,
    slow: float,
    exponent: float,
    throttled: float,
    slower: float,
    steady: float,
    building: float,
) -> None:
    """Miss `fraction` of each rise in demand, recovering by two exponentials.

    A pump fills a reservoir at a steady pace, a regulator from a larger one by what is missing: of
    the quick part `steady` comes back so, at the pace at which all that a rise to 30 kPa misses
    would come back at first. What a rise misses builds up over the time `building`,
    also where the chamber is vented meanwhile: the reservoir has been drawn from.
    A supply that has sagged gives less by so much, or, behind a throttle, by its share of what is
    drawn: then hardly anything of a small pressure is missing, and the supply goes on recovering.
    """
    quick = math.exp(-FINEST_STEP_S / recovery)
    lazy = math.exp(-FINEST_STEP_S / (slower * recovery))
    # Of what is to come, the part that comes in a cell, and how much of that its mean has not yet.
    sags, ahead = 1.0, 0.0
    if building > 0.0:
        sags = -math.expm1(-FINEST_STEP_S / building)
        ahead = 1.0 - (1.0 - sags * building / FINEST_STEP_S) / sags
    for trial in range(starts.size - 1):
        before = asked = coming = fast_missing = slow_missing = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            if p[i] != before:  # a power is dear
                before, earlier = p[i], asked
                asked = demand(before, exponent)
                coming += fraction * max(asked - earlier, 0.0)
            rise = sags * coming
            coming -= rise
            paced = steady * fraction * REFERENCE_KPA + (1.0 - steady) * fast_missing
            fast_missing = max(fast_missing - (1.0 - quick) * paced, 0.0) + (1.0 - slow) * rise
            slow_missing = lazy * slow_missing + slow * rise
            given = 1.0 + throttled * (before / REFERENCE_KPA - 1.0)
            missing = given * (fast_missing + slow_missing - ahead * rise)
            if missing > 0.0 and missing > before:  # an empty chamber misses nothing
                left = max(before, 0.0) / missing
                fast_missing *= left
                slow_missing *= left
                missing *= left
            p[i] = before - missing
