"""The sensor shifts in its pocket: the zero jumps or walks from trial to trial."""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Check, Effect, amplitude

EFFECT = Effect(
    id="sensor_slip",
    stage="sensor",
    parameters=(
        amplitude(
            "walk_deg",
            "deg per trial",
            "steady walk of the zero",
            spread=0.3,
            high=20.0,
            start=0.05,
            low=-20.0,
        ),
        amplitude(
            "zero_deg",
            "deg",
            "error of the zero at the first trial",
            spread=1.0,
            high=90.0,
            start=0.0,
            low=-90.0,
        ),
    ),
    name="slip of the sensor",
    means="the sensor shifts in its pocket, and its zero walks or jumps from trial to trial",
    remedy="glue or clamp the sensor, and zero it before every trial",
    port="zeros",
    shown_in=("order",),
    check=Check(
        "note the reading at rest before each trial, and calibrate again after the last",
        "a slip stays in the zero",
    ),
)


def slipped(orders: Integers, walk: float, zero: float) -> Floats:
    """Zero of a slipping sensor in the trials of these orders, deg."""
    return np.asarray(zero + walk * (orders - 1.0))
