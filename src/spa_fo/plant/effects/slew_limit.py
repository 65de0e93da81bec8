"""The pump can change the pressure only at a limited rate."""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Effect, Parameter, shape
from spa_fo.plant.effects.shared import REACHED_KPA
from spa_fo.plant.memory import FINEST_STEP_S

EFFECT = Effect(
    id="slew_limit",
    stage="drive",
    parameters=(
        shape(
            "rise_kpa_s",
            "kPa/s",
            "fastest rise of the pressure",
            centre=120.0,
            factor=3.0,
            low=0.02,
            high=30000.0,
            starts=(30.0, 70.0, 200.0),
        ),
        shape(
            "fall_ratio",
            "1",
            "fastest fall near empty, as a multiple of the fastest rise",
            centre=1.0,
            factor=1.6,
            low=0.02,
            high=10.0,
        ),
        shape(
            "approach_kpa",
            "kPa",
            "how far from the command it slows down",
            centre=1.2,
            factor=2.5,
            low=0.02,
            high=1000.0,
            searched=(0.0, 9.0),  # what slows down farther off is a line's lag
        ),
        Parameter(
            *("backpressure_per_kpa", "1/kPa", 0.0, 0.012, 0.0, 0.2),
            starts=(0.0, 0.012),
            means="part of the rate that each kPa takes of a rise",
            is_addition=True,
        ),
        Parameter(
            *("vent_per_kpa", "1/kPa", 0.0, 0.012, 0.0, 0.2),
            starts=(0.0, 0.012),
            means="what each kPa adds to the fall's multiple: a vent slows down near empty",
            is_addition=True,
        ),
    ),
    name="slew limit of the drive",
    means="the pump changes the pressure at a limited rate only",
    remedy="command ramps the pump can follow, or fit a faster pump",
    neutral={
        "rise_kpa_s": 30000.0,
        "fall_ratio": 1.0,
        "approach_kpa": 0.02,
        "backpressure_per_kpa": 0.0,
        "vent_per_kpa": 0.0,
    },
)


_LEAST = 0.05  # of the rate that a back pressure leaves. Assumed.
_FAR = 20.0  # approaches, from which on tanh is 1
_NEAR = 0.03  # approaches, within which a series errs by less than 3e-10 of them


@njit
def _left(rest: float, passed: float, kept: float, approach: float) -> float:
    """Solve e' = -rate tanh(e/approach) over a cell: sinh(e/approach) falls exponentially.

    `passed` is rate·cell/approach, and `kept` exp(-passed). Near the command by a series, as most
    cells are: two thirds of the time.
    """
    far = abs(rest) / approach
    if far < _NEAR:
        return rest * kept * (1.0 + far * far * (1.0 - kept * kept) / 6.0)
    if far - passed > _FAR:
        return math.copysign((far - passed) * approach, rest)
    if far > _FAR:
        grown = 0.5 * math.exp(far - passed)
    else:
        e = math.exp(far)
        grown = 0.5 * (e - 1.0 / e) * kept
    return math.copysign(math.log(grown + math.sqrt(1.0 + grown * grown)) * approach, rest)


@njit
def slew(
    p: Floats,
    starts: Integers,
    rise: float,
    ratio: float,
    approach: float,
    backpressure: float,
    vent: float,
) -> None:
    """Follow the command at a limited rate, which bends off near it; exact where it is constant."""
    cell = rise * FINEST_STEP_S / approach
    for trial in range(starts.size - 1):
        now = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            rest = p[i] - now
            if abs(rest) < REACHED_KPA:  # as in most cells: there it is not solved
                now = p[i]
                continue
            left, at = rest, now
            if rest > 0.0:
                least, most, more = _LEAST, 1.0, -backpressure
            else:
                least, most, more = _LEAST * ratio, ratio, vent
            for _ in range(1 if more == 0.0 else 2):  # the rate of the middle
                passed = cell * max(most + more * at, least)
                left = _left(rest, passed, math.exp(-passed), approach)
                at = now + 0.5 * (rest - left)
            before, now = now, p[i] - left
            p[i] = 0.5 * (before + now)
