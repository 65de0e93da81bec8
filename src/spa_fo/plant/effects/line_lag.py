"""Tube and volume filter the command: a low-pass between command and pressure."""

from __future__ import annotations

from spa_fo.plant.effects.effect import Effect, Parameter
from spa_fo.plant.effects.shared import lag

EFFECT = Effect(
    id="line_lag",
    stage="drive",
    parameters=(
        *lag(),
        Parameter(
            *("venting_excess", "1", 0.0, 0.25, -0.7, 3.0),
            starts=(0.0,),
            means="by how much longer a fall takes than a rise, as a part of that",
            is_addition=True,
        ),
    ),
    name="pneumatic lag of the line",
    means="tube and chamber fill slowly, so the pressure is a smoothed command",
    remedy="shorten or widen the tube, or put the regulator's sensor at the actuator",
    filter="lag",
)
