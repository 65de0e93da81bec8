"""The reading depends on the direction of bending."""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import Check, Effect, Parameter, shape


@njit
def opening(angle_deg: float, lens: float, span_deg: float) -> float:
    """Give how wide a loop is at an angle, of where it is widest: a lens is shut at both ends."""
    if lens == 0.0 or span_deg <= 0.0:
        return 1.0 - lens
    way = min(max(angle_deg / span_deg, 0.0), 1.0)
    return 1.0 - lens + lens * 4.0 * way * (1.0 - way)


@njit
def lag_behind(y: Floats, loop: Floats, film: Floats) -> None:
    """Duhem loop: the film lags by up to width/2, turning round over `turn` degrees.

    What is left of the way r falls as dr/dθ = -r^exponent/turn: with 1 exponentially, with 1/2 as
    a stack of plays of all widths does (Visintin 1994, doi:10.1007/978-3-662-11557-2), and near 0
    as one does. Its state is counted from where it begins, and what it reads there is 0. A part
    `lens` of its width is that of a lens, from 0 to `span` degrees.
    """
    width, turn, exponent, begins, lens, span = loop
    state, before = film[0] + begins, film[1]
    zero = begins * (1.0 - lens)
    for i in range(y.size):
        moved = y[i] - before
        before = y[i]
        if moved == 0.0:  # most of a fixture's steps: two powers would leave it where it is
            y[i] -= 0.5 * width * (state * opening(before, lens, span) - zero)
            continue
        target = 1.0 if moved > 0.0 else -1.0
        left = 0.5 * abs(target - state)
        if abs(1.0 - exponent) < 1e-3:
            left *= math.exp(-abs(moved) / turn)
        else:
            power = left ** (1.0 - exponent) - (1.0 - exponent) * abs(moved) / turn
            left = power ** (1.0 / (1.0 - exponent)) if power > 0.0 else 0.0
        state = target * (1.0 - 2.0 * left)
        y[i] -= 0.5 * width * (state * opening(before, lens, span) - zero)
    film[0], film[1] = state - begins, before


@njit
def half_loop(
    angle_deg: Floats,
    width: float,
    turn: float,
    exponent: float,
    begins: float,
    lens: float,
    span: float,
) -> Floats:
    """Give half of what the two branches differ by that a film may begin on."""
    upper, lower = angle_deg.copy(), angle_deg.copy()
    loop = np.array([width, turn, exponent, begins, lens, span])
    lag_behind(upper, loop, np.array([1.0 - begins, angle_deg[0]]))
    lag_behind(lower, loop, np.array([-1.0 - begins, angle_deg[0]]))
    return 0.5 * (upper - lower)


EFFECT = Effect(
    id="sensor_hysteresis",
    stage="sensor",
    parameters=(
        Parameter(
            *("width_deg", "deg", 0.0, 2.0, -60.0, 60.0),
            starts=(1.0,),
            means="width of the loop: the reading lags; below 0 it is ahead",
        ),
        shape(
            "turn_deg",
            "deg",
            "travel after a reversal until the other branch is reached",
            centre=3.0,
            factor=2.5,
            low=0.02,
            high=200.0,
            starts=(2.0, 7.0),
        ),
        shape(
            "exponent",
            "1",
            "shape of the way there: 1 is exponential",
            centre=0.5,
            factor=2.2,
            low=0.05,
            high=2.0,
        ),
        Parameter(
            *("begins", "1", 0.0, 0.6, -1.0, 1.0),
            starts=(0.0,),
            means="where in the loop its reading is 0, and a film without a past: -1 to 1",
            is_addition=True,
        ),
        Parameter(
            *("lens", "1", 0.0, 0.5, 0.0, 1.0),
            starts=(0.0, 1.0),
            means="part of its width that goes with the angle and is shut at both ends",
            is_addition=True,
        ),
        Parameter(
            *("span_deg", "deg", 80.0, 30.0, 0.0, 720.0),
            starts=(80.0,),
            means="angle at which that is shut again",
            is_addition=True,
        ),
    ),
    name="hysteresis of the sensor",
    means="the reading depends on the direction of bending",
    remedy="calibrate up and down, and read angles after approaching them from below",
    in_fixture=True,
    half_loop=half_loop,
    shown_in=("release", "levels"),
    equivalents={
        "hysteresis": Check(
            "calibrate again up and down in small steps", "a loop against a fixture is the sensor's"
        )
    },
)
