"""The flex channel's curve is not the one that was calibrated."""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Effect, Parameter, amplitude
from spa_fo.plant.effects.shared import CURVE_KNOTS_DEG, CURVE_SLOPES, CURVE_SPLINES, Floats


def _error_at(angle: float) -> Parameter:
    words = f"error of the curve at {angle:.0f}°".replace("-", "−")
    name = f"at_{angle:.0f}deg".replace("-", "minus_")
    return amplitude(name, "deg", words, spread=2.5, high=90.0, start=0.0, low=-90.0)


EFFECT = Effect(
    id="sensor_nonlinearity",
    stage="sensor",
    place="reading",
    parameters=tuple(_error_at(angle) for angle in CURVE_KNOTS_DEG if angle != 0.0),
    name="wrong curve of the sensor",
    means="the flex sensor's curve is not the one that was calibrated",
    remedy="calibrate again with the sensor in its pocket, at more angles",
    port="curve",
    shown_in=("levels",),
)

_KNOTS = np.array(CURVE_KNOTS_DEG)
_CUBICS = np.ascontiguousarray(CURVE_SPLINES.c)  # (4, intervals, offsets)


@njit
def bend_curve(y: Floats, offsets: Floats) -> None:
    """Add the curve's error, a spline through its knots, straight beyond them."""
    last = _KNOTS.size - 1
    cubics = np.zeros((last, 4))
    for j in range(last):
        for power in range(4):
            cubics[j, power] = np.sum(_CUBICS[power, j] * offsets)
    low, high = np.sum(CURVE_SLOPES[0] * offsets), np.sum(CURVE_SLOPES[1] * offsets)
    for i in range(y.size):
        inside = min(max(y[i], _KNOTS[0]), _KNOTS[last])
        j = 1
        while j < last and inside > _KNOTS[j]:
            j += 1
        a, b, c, d = cubics[j - 1]
        t, beyond = inside - _KNOTS[j - 1], y[i] - inside
        y[i] += ((a * t + b) * t + c) * t + d + (low if beyond < 0.0 else high) * beyond
