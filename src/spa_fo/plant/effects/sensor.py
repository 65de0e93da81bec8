"""True angle -> what the flex channel holds, step by step.

The curve of the mounting first, then hysteresis, creep and lag of the film; what then reaches the
top of its range stops there. The zero of a slipping sensor is added last.
"""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.sensor_creep import drift_on
from spa_fo.plant.effects.sensor_hysteresis import lag_behind
from spa_fo.plant.effects.sensor_lag import follow
from spa_fo.plant.effects.sensor_nonlinearity import bend_curve
from spa_fo.plant.effects.sensor_saturation import saturate
from spa_fo.plant.effects.shared import CREEP_TIMES_S, CURVE_KNOTS_DEG, creep_sizes, poles

SENSOR_NONLINEARITY = LIBRARY["sensor_nonlinearity"].first
SENSOR_SATURATION = LIBRARY["sensor_saturation"].first
SENSOR_LAG = LIBRARY["sensor_lag"].first
SENSOR_CREEP = LIBRARY["sensor_creep"].first
SENSOR_HYSTERESIS = LIBRARY["sensor_hysteresis"].first

_ERRORS = len(CURVE_KNOTS_DEG) - 1


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
        State, carried on in place: hysteresis, last angle, two poles of the lag, creep elements,
        the lag's tail.
    """
    y = angle.copy()
    if not math.isnan(e[SENSOR_NONLINEARITY]):
        ends = SENSOR_NONLINEARITY + _ERRORS
        bend_curve(y, e[SENSOR_NONLINEARITY:ends], e[ends])
    if not math.isnan(e[SENSOR_HYSTERESIS]):
        lag_behind(y, e[SENSOR_HYSTERESIS : SENSOR_HYSTERESIS + 6], film)
    if not math.isnan(e[SENSOR_CREEP]):
        size = creep_sizes(e[SENSOR_CREEP], e[SENSOR_CREEP + 1], e[SENSOR_CREEP + 2])
        drift_on(y, level, size, e[SENSOR_CREEP + 3], film[4 : 4 + size.size])
    if not math.isnan(e[SENSOR_LAG]):
        share, excess = e[SENSOR_LAG + 2], e[SENSOR_LAG + 3]
        slow, fast, latest = poles(e[SENSOR_LAG], e[SENSOR_LAG + 1], share)
        tail = y.copy()
        follow(tail, level, latest, excess, film[4 + CREEP_TIMES_S.size :])
        follow(y, level, slow, excess, film[2:3])
        follow(y, level, fast, excess, film[3:4])
        for i in range(y.size):
            y[i] += share * (tail[i] - y[i])
    if not math.isnan(e[SENSOR_SATURATION]):
        saturate(y, e[SENSOR_SATURATION], e[SENSOR_SATURATION + 1])
    return y
