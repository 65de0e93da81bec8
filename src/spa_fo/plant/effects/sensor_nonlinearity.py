"""The flex channel's curve is not the one that was calibrated."""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import Effect, Parameter, amplitude
from spa_fo.plant.effects.shared import CURVE_KNOTS_DEG, CURVE_SPLINES


def _error_at(angle: float) -> Parameter:
    words = f"error of the curve at {angle:.0f}°".replace("-", "−")
    name = f"at_{angle:.0f}deg".replace("-", "minus_")
    return amplitude(name, "deg", words, spread=2.5, high=90.0, start=0.0, low=-90.0)


EFFECT = Effect(
    id="sensor_nonlinearity",
    stage="sensor",
    place="reading",
    parameters=(
        *(_error_at(angle) for angle in CURVE_KNOTS_DEG if angle != 0.0),
        Parameter(
            *("wider", "1", 0.0, 0.01, -0.99, 9.0),
            starts=(0.0,),
            means="by how much wider apart these angles are than they are called, as a part",
            is_addition=True,
        ),
    ),
    name="wrong curve of the sensor",
    means="the flex sensor's curve is not the one that was calibrated",
    remedy="calibrate again with the sensor in its pocket, at more angles",
    port="curve",
    shown_in=("levels",),
)

_STARTS = CURVE_SPLINES.x[:-1]
_CUBICS = np.ascontiguousarray(CURVE_SPLINES.c)  # (4, pieces, offsets)


@njit
def bend_curve(y: Floats, offsets: Floats, wider: float) -> None:
    """Add the curve's error, a spline through its knots, straight beyond them.

    The knots stand at 1 + `wider` times the angles that they are called by.
    """
    cubics = np.zeros((_STARTS.size, 4))
    for piece in range(_STARTS.size):
        for power in range(4):
            cubics[piece, power] = np.sum(_CUBICS[power, piece] * offsets)
    for i in range(y.size):
        piece = 0
        at = y[i] / (1.0 + wider)
        while piece + 1 < _STARTS.size and at > _STARTS[piece + 1]:
            piece += 1
        a, b, c, d = cubics[piece]
        t = at - _STARTS[piece]
        y[i] += ((a * t + b) * t + c) * t + d
