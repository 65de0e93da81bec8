"""Periodic interference on the flex channel, at or aliased from the mains frequency.

Nothing of it is simulated: its phase is another one in every trial.
"""

from __future__ import annotations

from spa_fo.plant.effects.effect import Check, Effect, amplitude

EFFECT = Effect(
    id="mains_pickup",
    stage="acquisition",
    parameters=(
        amplitude(
            "amplitude_deg",
            "deg",
            "amplitude of the interference",
            spread=2.0,
            high=30.0,
            start=0.5,
        ),
        amplitude("frequency_hz", "Hz", "its frequency", spread=1e3, high=1e6, start=10.0),
    ),
    name="mains pickup",
    means="a periodic interference on the flex channel",
    remedy="shield and ground the sensor's cable, and move it away from the pump's supply",
    port="line",
    check=Check(
        "record the flex channel at rest for a minute, pump off and pump on",
        "interference shows without any motion",
    ),
)
