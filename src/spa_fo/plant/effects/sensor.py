"""True angle -> what the flex channel holds, step by step.

The mechanics first (curve of the seat, saturation), then hysteresis, creep and lag of the film;
the zero of a slipping sensor is added last.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spa_fo._jit import njit
from spa_fo.plant.effects.actuator import CREEP_TIMES_S, creep_sizes
from spa_fo.plant.effects.drive import poles
from spa_fo.plant.effects.library import CURVE_KNOTS_DEG, LIBRARY
from spa_fo.plant.memory import LEVELS, STEPS_S

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SENSOR_NONLINEARITY = LIBRARY["sensor_nonlinearity"].first
SENSOR_SATURATION = LIBRARY["sensor_saturation"].first
SENSOR_LAG = LIBRARY["sensor_lag"].first
SENSOR_CREEP = LIBRARY["sensor_creep"].first
SENSOR_HYSTERESIS = LIBRARY["sensor_hysteresis"].first

_KNOTS = np.array(CURVE_KNOTS_DEG)
_ZERO_KNOT = CURVE_KNOTS_DEG.index(0.0)


@njit
def read_angle(angle: Floats, level: Integers, e: Floats, film: Floats) -> Floats:
    """Angle that the sensor feels (deg) at the end of each step.

    Parameters
    ----------
    angle : (n,) array
        True angle at the end of each step, deg.
    level : (n,) array
        Step lengths, as indices into `STEPS_S`.
    e : array
        Parameters of all effects, NaN where absent.
    film : array
        State, carried on in place: hysteresis, last angle, two poles of the lag, creep elements.
    """
    y = angle.copy()
    if not math.isnan(e[SENSOR_NONLINEARITY]):
        _bend_curve(y, e[SENSOR_NONLINEARITY : SENSOR_NONLINEARITY + _KNOTS.size - 1])
    if not math.isnan(e[SENSOR_SATURATION]):
        _saturate(y, e[SENSOR_SATURATION], e[SENSOR_SATURATION + 1])
    if not math.isnan(e[SENSOR_HYSTERESIS]):
        k = SENSOR_HYSTERESIS
        _loop(y, e[k], e[k + 1], e[k + 2], film)
    if not math.isnan(e[SENSOR_CREEP]):
        size = creep_sizes(e[SENSOR_CREEP], e[SENSOR_CREEP + 1], e[SENSOR_CREEP + 2])
        _creep(y, level, size, film[4:])
    if not math.isnan(e[SENSOR_LAG]):
        slow, fast = poles(e[SENSOR_LAG], e[SENSOR_LAG + 1])
        _lag(y, level, slow, film[2:3])
        _lag(y, level, fast, film[3:4])
    return y


@njit
def _bend_curve(y: Floats, offsets: Floats) -> None:
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


@njit
def _saturate(y: Floats, ceiling: float, knee: float) -> None:
    """Smooth minimum of the angle and the ceiling."""
    for i in range(y.size):
        over = y[i] - ceiling
        y[i] -= 0.5 * (over + math.sqrt(over * over + knee * knee))


@njit
def _loop(y: Floats, width: float, turn: float, exponent: float, film: Floats) -> None:
    """Duhem loop: the film lags by up to width/2, turning round over `turn` degrees.

    What is left of the way r falls as dr/dθ = -r^exponent/turn: with 1 exponentially, with 1/2 as
    a stack of plays of all widths does (Visintin 1994, doi:10.1007/978-3-662-11557-2).
    """
    state, before = film[0], film[1]
    for i in range(y.size):
        moved = y[i] - before
        before = y[i]
        target = 1.0 if moved > 0.0 else -1.0
        left = 0.5 * abs(target - state)
        if abs(1.0 - exponent) < 1e-3:
            left *= math.exp(-abs(moved) / turn)
        else:
            power = left ** (1.0 - exponent) - (1.0 - exponent) * abs(moved) / turn
            left = power ** (1.0 / (1.0 - exponent)) if power > 0.0 else 0.0
        state = target * (1.0 - 2.0 * left)
        y[i] -= 0.5 * width * state
    film[0], film[1] = state, before


@njit
def _creep(y: Floats, level: Integers, size: Floats, state: Floats) -> None:
    keep = np.empty((LEVELS, state.size))
    for j in range(state.size):
        for k in range(LEVELS):
            keep[k, j] = math.exp(-STEPS_S[k] / CREEP_TIMES_S[j])
    for i in range(y.size):
        total = y[i]
        for j in range(state.size):
            state[j] += (1.0 - keep[level[i], j]) * (size[j] * y[i] - state[j])
            total += state[j]
        y[i] = total


@njit
def _lag(y: Floats, level: Integers, time_constant: float, state: Floats) -> None:
    """First-order lag of an input that runs straight within a step; the first value is at rest."""
    if time_constant < 1e-4:
        return
    now = state[0]
    before = now if y.size == 0 else y[0]
    for i in range(y.size):
        x = STEPS_S[level[i]] / time_constant
        keep = math.exp(-x)
        mean = -math.expm1(-x) / x
        now = keep * now + (1.0 - mean) * y[i] + (mean - keep) * before
        before = y[i]
        y[i] = now
    state[0] = now
