"""A loading and unloading loop that does not depend on the rate: friction in the wall.

Its moment acts within the dynamics, and the actuator comes to it as to a load; or what yields is
what the angle is measured at, and the angle has the loop at once (Kuhnen 2003,
doi:10.3166/ejc.9.407-418, puts such a stack in series with the dynamics).
"""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import Effect, Parameter, amplitude, shape

EFFECT = Effect(
    id="hysteresis",
    stage="actuator",
    parameters=(
        amplitude(
            "moment_deg", "deg", "width of the loop, as an angle", spread=3.0, high=90.0, start=1.5
        ),
        shape(
            "turn_deg",
            "deg",
            "travel after a reversal until the other branch is reached",
            centre=25.0,
            factor=1.8,
            low=0.1,
            high=600.0,
        ),
        shape(
            "tail",
            "1",
            "how the travels of its elements are spread",
            centre=1.4,
            factor=1.5,
            low=0.4,
            high=4.0,
        ),
        Parameter(
            *("outside", "1", 0.5, 0.5, 0.0, 1.0),
            starts=(0.0, 1.0),
            means="part of the loop that the angle has at once, behind the dynamics",
            is_addition=True,
        ),
        Parameter(
            *("begins", "1", 0.0, 0.6, -1.0, 1.0),
            starts=(0.0,),
            means="where in the loop its angle is 0, and a specimen without a past: -1 to 1",
            is_addition=True,
        ),
        Parameter(
            *("forgets", "1", 0.0, 0.5, 0.0, 1.0),
            starts=(0.2,),
            means="part of what its friction holds that is gone after a rest",
            is_addition=True,
        ),
    ),
    name="hysteresis of the actuator",
    means="loading and unloading take different paths, and an angle remains after release",
    remedy="keep it in the model, and approach every level from the same side where it matters",
    shown_in=("release", "levels"),
)

STOPS = 4


@njit
def stop_radii(turn: float, tail: float) -> Floats:
    """Travel over which each stop yields: `turn` for the last, the others by a power law."""
    radii = np.empty(STOPS)
    for j in range(STOPS):
        radii[j] = turn * ((j + 1.0) / STOPS) ** tail
    return radii


@njit
def friction(moved: float, stops: Floats, radii: Floats, begins: float) -> tuple[float, float]:
    """Mean stop of a Prandtl-Ishlinskii stack after moving further; and its slope.

    All stops are counted from where they begin, -1 to 1.
    """
    total, slope = 0.0, 0.0
    for j in range(STOPS):
        state = stops[j] + begins + moved / radii[j]
        if state > 1.0:
            state = 1.0
        elif state < -1.0:
            state = -1.0
        else:
            slope += 1.0 / radii[j]
        total += state
    return total / STOPS - begins, slope / STOPS


@njit
def rub(moved: float, stops: Floats, radii: Floats, begins: float) -> None:
    """Move the stops on, in place."""
    for j in range(STOPS):
        stops[j] = min(max(stops[j] + begins + moved / radii[j], -1.0), 1.0) - begins
