"""The flex channel's curve is not the one that was calibrated."""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Effect, Parameter, amplitude
from spa_fo.plant.effects.shared import CURVE_KNOTS_DEG, Floats


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
_ZERO_KNOT = CURVE_KNOTS_DEG.index(0.0)


@njit
def bend_curve(y: Floats, offsets: Floats) -> None:
    """Add the curve's error, straight between its knots and as steep beyond them."""
    last = _KNOTS.size - 1
    for i in range(y.size):
        j = 1
        while j < last and y[i] > _KNOTS[j]:
            j += 1
        left, right = _offset(offsets, j - 1), _offset(offsets, j)
        y[i] += left + (right - left) * (y[i] - _KNOTS[j - 1]) / (_KNOTS[j] - _KNOTS[j - 1])


@njit
def _offset(offsets: Floats, knot: int) -> float:
    if knot == _ZERO_KNOT:
        return 0.0
    return float(offsets[knot] if knot < _ZERO_KNOT else offsets[knot - 1])
