"""Tube and volume filter the command: a low-pass between command and pressure."""

from __future__ import annotations

from spa_fo.plant.effects.effect import Effect
from spa_fo.plant.effects.shared import lag

EFFECT = Effect(
    id="line_lag",
    stage="drive",
    parameters=lag("venting_excess"),
    name="pneumatic lag of the line",
    means="tube and chamber fill slowly, so the pressure is a smoothed command",
    remedy="shorten or widen the tube, or put the regulator's sensor at the actuator",
    filter="lag",
)
