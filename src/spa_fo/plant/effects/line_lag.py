"""Tube and volume filter the command: a low-pass between command and pressure.

A long tube is a linear filter. Through a valve, a fitting or a short tube the flow goes about as
the root of the pressure across it (Richer and Hurmuzlu 2000, doi:10.1115/1.1286336, has the choked
regime too): a step of four times the height takes twice as long, and ends after a finite time. So
it is seen in the pressures of a three-chamber arm (zhiqiao0256/Soft-Arm-SMART-Controller-), which
fill in 0.8 to 1 s and take 1.4 s to vent nearly all.
"""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Effect, Parameter
from spa_fo.plant.effects.shared import lag
from spa_fo.plant.memory import FINEST_STEP_S

REFERENCE_KPA = 30.0
"""A step of so much comes as late through an orifice as any does through a linear line."""

EFFECT = Effect(
    id="line_lag",
    stage="drive",
    parameters=(
        *lag("venting_excess"),
        Parameter(
            *("orifice_share", "1", 0.0, 0.6, 0.0, 1.0),
            starts=(0.0, 1.0),
            means="part of it that is an orifice's, whose rate goes as the root of the difference",
            is_addition=True,
            two_forms=True,
        ),
    ),
    name="pneumatic lag of the line",
    means="tube and chamber fill slowly, so the pressure is a smoothed command",
    remedy="shorten or widen the tube, the valve or the fitting, or put the regulator's sensor at "
    "the actuator",
    filter="lag",
)


@njit
def through_orifice(p: Floats, starts: Integers, late_s: float, venting_excess: float) -> None:
    """Let the pressure follow by the root of what it lacks, which falls evenly; in place.

    Means over cells of an input that is constant in each. A rise of `REFERENCE_KPA` comes late by
    `late_s` on the mean: it takes three times that.
    """
    if late_s <= 0.0:
        return
    fill = math.sqrt(REFERENCE_KPA) / (3.0 * late_s) * FINEST_STEP_S  # of the root, by cell
    vent = fill / (1.0 + venting_excess)
    for trial in range(starts.size - 1):
        now = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            lack = p[i] - now
            if lack == 0.0:
                continue
            fall = fill if lack > 0.0 else vent
            sign = 1.0 if lack > 0.0 else -1.0
            root = math.sqrt(abs(lack))
            left = max(root - fall, 0.0)
            now = p[i] - sign * left * left
            p[i] -= sign * (root**3 - left**3) / (3.0 * fall)
