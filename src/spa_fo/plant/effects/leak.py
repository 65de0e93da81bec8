"""Pressure is lost in proportion to itself while the command is held."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Effect, Parameter, amplitude, share
from spa_fo.plant.memory import FINEST_STEP_S

EFFECT = Effect(
    id="leak",
    stage="drive",
    parameters=(
        amplitude(
            "rate_per_s",
            "1/s",
            "share of the pressure that is lost in a second",
            spread=0.01,
            high=0.3,
            start=0.004,
        ),
        amplitude(
            "makeup_per_s",
            "1/s",
            "share of the loss that the supply makes good in a second",
            spread=0.05,
            high=2.0,
            start=0.01,
        ),
        share(
            "vented_share",
            "part of the loss that a falling command takes along: all of it where the air is shut "
            "in, none where the supply falls by as much as it is told to",
        ),
        Parameter(
            *("renewal_per_kpa", "1/kPa", 0.0, 0.2, 0.0, 20.0),
            starts=(0.0, 0.3),
            goes_with=(0.0, -1.0),
            means="how soon a command that changes makes the loss good: a valve that opens only "
            "where it is told something new",
            is_addition=True,
        ),
        Parameter(
            *("below_share", "1", 0.0, 0.6, 0.0, 1.0),
            starts=(0.0, 1.0),
            means="part of what is missing below the atmosphere that still is a second later: none "
            "behind a valve that opens to it, all but what leaks in where the air is shut in",
            is_addition=True,
            two_forms=True,
        ),
        Parameter(
            *("kept_share", "1", 0.0, 0.2, 0.0, 1.0),
            starts=(0.0,),
            means="part of the loss that a change leaves, however large: the valve shuts again "
            "before all is made good",
            is_addition=True,
        ),
        Parameter(
            *("opens_per_kpa", "1/kPa", 0.0, 0.1, 0.0, 20.0),
            starts=(0.0,),
            goes_with=(0.0, -1.0),
            means="how much more of the pressure is lost for each kPa of it: a crack that it opens",
            is_addition=True,
        ),
    ),
    name="leak",
    means="pressure is lost while the command is held",
    remedy="hold the pressure with the valves closed, find the fitting or seam that leaks and "
    "seal it",
    shown_in=("hold",),
)


@njit
def lose(
    p: Floats,
    starts: Integers,
    rate: float,
    makeup: float,
    vented: float,
    renewal: float,
    below: float,
    kept: float,
    opens: float,
) -> None:
    """Lose pressure in proportion to itself; the supply makes good in proportion to the loss.

    Through a crack that it opens it is lost 1 + opens·p times as fast. Of the loss a change of what
    the supply gives by Δ kPa leaves the part `kept`, and of the rest exp(-renewal·Δ). Below the
    atmosphere air leaks in as it leaks out above, and a part `below` of what is missing there is
    left by what else lets it in for a second.
    """
    still_below = below**FINEST_STEP_S
    for trial in range(starts.size - 1):
        lost = before = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            if 0.0 <= p[i] < before:
                lost *= 1.0 - vented * (1.0 - p[i] / before)
            lost *= kept + (1.0 - kept) * math.exp(-renewal * abs(p[i] - before))
            before = p[i]
            given = max(p[i], 0.0)
            left = given - lost
            opened = 1.0 + opens * max(left, 0.0)
            lost += FINEST_STEP_S * (rate * opened * left - makeup * lost)
            if lost > given:
                lost = given + still_below * (lost - given)
            p[i] -= lost
