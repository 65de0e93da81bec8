"""The library of effects, in the order a command passes through them.

Identifiers and physics are the contract's; the parametric forms are ours. Each form has enough
freedom to bend with a neighbouring form of the same physics (one pole or several, cubic or
exponential), because a form too stiff loses to a wrong effect that bends better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.plant.effects import (
    channel_latency,
    contact_stop,
    creep,
    dead_time,
    drive_backlash,
    gravity_load,
    hysteresis,
    leak,
    line_lag,
    mains_pickup,
    mullins_softening,
    parameter_shift,
    sensor_creep,
    sensor_hysteresis,
    sensor_lag,
    sensor_nonlinearity,
    sensor_saturation,
    sensor_slip,
    slew_limit,
    stiffening,
    supply_droop,
    thermal_drift,
)
from spa_fo.plant.effects.effect import Effect, Floats, Port, Stage

_BUILT_IN: tuple[Effect, ...] = (
    dead_time.EFFECT,
    line_lag.EFFECT,
    supply_droop.EFFECT,
    leak.EFFECT,
    slew_limit.EFFECT,
    drive_backlash.EFFECT,
    stiffening.EFFECT,
    gravity_load.EFFECT,
    contact_stop.EFFECT,
    mullins_softening.EFFECT,
    creep.EFFECT,
    hysteresis.EFFECT,
    thermal_drift.EFFECT,
    parameter_shift.EFFECT,
    sensor_nonlinearity.EFFECT,
    sensor_saturation.EFFECT,
    sensor_lag.EFFECT,
    sensor_creep.EFFECT,
    sensor_hysteresis.EFFECT,
    sensor_slip.EFFECT,
    channel_latency.EFFECT,
    mains_pickup.EFFECT,
)

COMMONEST = hysteresis.EFFECT.id
"""What one hears most often about soft actuators: a baseline that always answers so."""


def _numbered() -> dict[str, Effect]:
    effects, first = {}, 0
    for effect in _BUILT_IN:
        effects[effect.id] = replace(effect, first=first)
        first += len(effect.parameters)
    return effects


LIBRARY: Mapping[str, Effect] = _numbered()
IDS = tuple(LIBRARY)
SIZE = sum(len(effect.parameters) for effect in LIBRARY.values())
"""Length of the vector that holds the parameters of all effects."""


def ordered(ids: Sequence[str]) -> tuple[str, ...]:
    """Put effects in the library's order, each once."""
    return tuple(sorted(set(ids), key=IDS.index))


def at_port(port: Port, ids: Sequence[str] = IDS) -> str | None:
    """Return the effect among `ids` that is met at a port; None where there is none."""
    return next((name for name in ids if LIBRARY[name].port == port), None)


def absent() -> Floats:
    """Return the vector of all parameters with no effect in it: NaN in every slot."""
    return np.full(SIZE, np.nan)


def switches(parameters: Floats) -> NDArray[np.bool_]:
    """Say which effects of `IDS` a vector of all parameters holds."""
    return np.array(
        [
            bool(effect.parameters) and not np.isnan(parameters[effect.first])
            for effect in LIBRARY.values()
        ]
    )


def stage_of(ids: Sequence[str]) -> set[Stage]:
    """Return the stages of the effects `ids`."""
    return {LIBRARY[name].stage for name in ids}
