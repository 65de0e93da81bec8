"""The library of effects, in the order a command passes through them.

Identifiers and physics of the first are the contract's; the parametric forms are ours. Behind them
stand those that measured logs show. Each form has enough
freedom to bend with a neighbouring form of the same physics (one pole or several, cubic or
exponential), because a form too stiff loses to a wrong effect that bends better.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects import (
    body_mode,
    channel_latency,
    contact_stop,
    creep,
    dead_time,
    drive_backlash,
    drive_hunting,
    drive_overshoot,
    gain_growth,
    gravity_load,
    hysteresis,
    leak,
    line_lag,
    mains_pickup,
    mullins_softening,
    opening_fold,
    parameter_shift,
    pressure_damping,
    pressure_set,
    sensor_creep,
    sensor_detachment,
    sensor_freeze,
    sensor_hysteresis,
    sensor_lag,
    sensor_nonlinearity,
    sensor_saturation,
    sensor_slip,
    slew_limit,
    stiffening,
    supply_droop,
    supply_limit,
    tear,
    thermal_drift,
    unsigned_reading,
)
from spa_fo.plant.effects.effect import Effect, Port, Stage

Ids = tuple[str, ...]
"""Identifiers of effects, in the order of the library."""

_CONTRACT: tuple[Effect, ...] = (
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
_FURTHER: tuple[Effect, ...] = (
    drive_overshoot.EFFECT,
    drive_hunting.EFFECT,
    supply_limit.EFFECT,
    gain_growth.EFFECT,
    opening_fold.EFFECT,
    pressure_set.EFFECT,
    body_mode.EFFECT,
    pressure_damping.EFFECT,
    tear.EFFECT,
    unsigned_reading.EFFECT,
    sensor_detachment.EFFECT,
    sensor_freeze.EFFECT,
)
"""What measured logs show beside the contract's, or may show, as effects of one's own."""

COMMONEST = hysteresis.EFFECT.id
"""What one hears most often about soft actuators: a baseline that always answers so."""


class Library(Mapping[str, Effect]):
    """Effects by identifier, each with its place in the vector of all parameters.

    The project's own never change; behind them stand those that a campaign or an installed package
    brings along (`spa_fo.plant.effects.own`).
    """

    def __init__(self, effects: Sequence[Effect]) -> None:
        self._lasting = tuple(effects)
        self.hold(())

    def hold(self, further: Sequence[Effect]) -> None:
        """Take in these effects, in place of any that were taken in before."""
        self.size = 0
        self._effects: dict[str, Effect] = {}
        self.further = tuple(further)
        for effect in (*self._lasting, *self.further):
            self._effects[effect.id] = replace(effect, first=self.size)
            self.size += len(effect.parameters)
        self.acting = tuple(e for e in self._effects.values() if e.act is not None)
        self._of_stage: dict[Stage, Integers] = {}

    def __getitem__(self, name: str) -> Effect:
        return self._effects[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def slots(self, holds: Callable[[Effect], bool]) -> Integers:
        """Places of the parameters of all effects of a kind."""
        held = [range(e.slots.start, e.slots.stop) for e in self._effects.values() if holds(e)]
        return np.array([place for each in held for place in each], dtype=np.int64)

    def of_stage(self, stage: Stage) -> Integers:
        """Places of the parameters of all effects of a stage, which are looked up once."""
        if stage not in self._of_stage:
            self._of_stage[stage] = self.slots(lambda e: e.stage == stage)
        return self._of_stage[stage]


LIBRARY = Library((*_CONTRACT, *_FURTHER))
IDS = tuple(LIBRARY)
"""The project's own effects; what else the library holds changes from campaign to campaign."""
CONTRACT = tuple(effect.id for effect in _CONTRACT)
"""Those that the contract names."""


def ordered(ids: Sequence[str]) -> tuple[str, ...]:
    """Put effects in the library's order, each once."""
    return tuple(name for name in LIBRARY if name in ids)


def at_port(port: Port, ids: Sequence[str] = IDS) -> str | None:
    """Return the effect among `ids` that is met at a port; None where there is none."""
    return next((name for name in ids if LIBRARY[name].port == port), None)


def log_odds(ids: Sequence[str]) -> float:
    """Logarithm of how probable effects are beforehand, against as many that most rigs show."""
    return float(sum(np.log(LIBRARY[name].odds) for name in ids))


def rare(name: str) -> bool:
    """Say whether only single rigs show an effect."""
    return LIBRARY[name].odds < 1.0


def alike(one: str, other: str) -> bool:
    """Say whether two effects act alike: they are equivalents by what either says."""
    return other in LIBRARY[one].equivalents or one in LIBRARY[other].equivalents


def same_filter(one: str, other: str, pressed: bool) -> bool:
    """Say whether two effects are the same linear filter at two places in the chain.

    Filters in series change places without a trace. A measured pressure (`pressed`) tells the drive
    from the rest.
    """
    first, second = LIBRARY[one], LIBRARY[other]
    told = pressed and "drive" in (first.stage, second.stage)
    return bool(first.filter) and first.filter == second.filter and not told


def acts_like(name: str, stage: Stage) -> bool:
    """Say whether an effect acts like one of a stage."""
    return any(effect.stage == stage and alike(name, other) for other, effect in LIBRARY.items())


def beside(ids: Sequence[str], names: Sequence[str]) -> list[str]:
    """Leave out of `names` what does not come beside effects: no rig shows two that are rare."""
    return [name for name in names if not (rare(name) and any(map(rare, ids)))]


def absent() -> Floats:
    """Return the vector of all parameters with no effect in it: NaN in every slot."""
    return np.full(LIBRARY.size, np.nan)
