"""Commanded pressure -> true pressure: a syringe pump, its tube and what is wrong with them.

Every effect is a frozen dataclass of its sizes; `begin(step_s)` starts it at rest (0 kPa). The
names of the fields of `SyringePump` are the effects' identifiers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from spa_fo._jit import njit
from spa_fo.virtual_rig.arrays import Array, Effect, Process, chain


@dataclass(frozen=True)
class DeadTime:
    """A pure transport delay of `delay_s` seconds."""

    delay_s: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        return delay(self.delay_s / step_s)


@dataclass(frozen=True)
class DriveBacklash:
    """Lost motion of the piston: pressure follows only when the play of `play_kpa` is taken up."""

    play_kpa: float

    def begin(self, step_s: float) -> Process:
        """Start at rest, the play open towards rising pressure."""
        state = np.zeros(1)
        return lambda signal: _play(signal, self.play_kpa, state)


@dataclass(frozen=True)
class SlewLimit:
    """The motor's top speed: dp/dt = r tanh((command - p) / (r τ)).

    Parameters
    ----------
    rate_kpa_s : float
        Fastest change of pressure r, kPa/s.
    approach_s : float
        Time constant τ of the final approach, s.
    """

    rate_kpa_s: float
    approach_s: float = 0.03

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        state = np.zeros(1)
        return lambda signal: _slew(signal, self.rate_kpa_s, self.approach_s, step_s, state)


@dataclass(frozen=True)
class SupplyDroop:
    """Each rise empties the reserve; it recovers exponentially while the command is held.

    Parameters
    ----------
    fraction : float
        Share of a fast rise that is missing right after it.
    recovery_s : float
        Time constant of the recovery, s.
    """

    fraction: float
    recovery_s: float = 2.5

    def begin(self, step_s: float) -> Process:
        """Start with a full reserve."""
        state = np.zeros(2)
        return lambda signal: _droop(signal, self.fraction, self.recovery_s, step_s, state)


@dataclass(frozen=True)
class LineLag:
    """Tube and chamber volume: two equal first-order lags, `time_constant_s` together."""

    time_constant_s: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        single = LowPass(self.time_constant_s / 2)
        return chain([single.begin(step_s), single.begin(step_s)])


@dataclass(frozen=True)
class Leak:
    """Gas escapes in proportion to the pressure; an empty chamber breathes in again."""

    rate_per_s: float

    def begin(self, step_s: float) -> Process:
        """Start with nothing lost."""
        state = np.zeros(1)
        return lambda signal: _leak(signal, self.rate_per_s, step_s, state)


@dataclass(frozen=True)
class LowPass:
    """A first-order lag of `time_constant_s`, exact for an input held over each step."""

    time_constant_s: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        keep = float(np.exp(-step_s / self.time_constant_s))
        memory = np.zeros(1)

        def advance(signal: Array) -> Array:
            nonlocal memory
            out, memory = lfilter([1.0 - keep], [1.0, -keep], signal, zi=memory)
            return np.asarray(out)

        return advance


@dataclass(frozen=True)
class SyringePump:
    """The drive, in the order the command passes through it; None is an effect that is absent.

    `further` comes last: what no library of effects knows.
    """

    dead_time: Effect | None = None
    drive_backlash: Effect | None = None
    slew_limit: Effect | None = None
    supply_droop: Effect | None = None
    line_lag: Effect | None = None
    leak: Effect | None = None
    further: tuple[Effect, ...] = ()

    def begin(self, step_s: float) -> Process:
        """Start the drive at 0 kPa: commanded kPa in, true gauge kPa out, both every `step_s`."""
        effects = (
            self.dead_time,
            self.drive_backlash,
            self.slew_limit,
            self.supply_droop,
            self.line_lag,
            self.leak,
            *self.further,
        )
        return chain([effect.begin(step_s) for effect in effects if effect is not None])


def delay(steps: float) -> Process:
    """Delay a signal by `steps`, straight between them; zero before it began."""
    whole, part = divmod(round(steps, 6), 1.0)
    waiting = np.zeros(int(whole) + 1)

    def advance(signal: Array) -> Array:
        nonlocal waiting
        line = np.concatenate([waiting, signal])
        waiting = line[len(signal) :]
        late, later = line[1 : len(signal) + 1], line[: len(signal)]
        return np.asarray(late + part * (later - late)) if part else late

    return advance


@njit
def _play(signal: Array, width: float, state: Array) -> Array:
    out = np.empty_like(signal)
    position = state[0]
    for i in range(signal.size):
        position = min(max(position, signal[i] - width), signal[i])
        out[i] = position
    state[0] = position
    return out


@njit
def _slew(signal: Array, rate: float, approach: float, step: float, state: Array) -> Array:
    out = np.empty_like(signal)
    pressure = state[0]
    for i in range(signal.size):
        pressure += step * rate * np.tanh((signal[i] - pressure) / (rate * approach))
        out[i] = pressure
    state[0] = pressure
    return out


@njit
def _droop(signal: Array, fraction: float, recovery: float, step: float, state: Array) -> Array:
    out = np.empty_like(signal)
    before, missing = state[0], state[1]
    keep = np.exp(-step / recovery)
    for i in range(signal.size):
        missing = keep * missing + fraction * max(signal[i] - before, 0.0)
        before = signal[i]
        missing = min(missing, max(before, 0.0))
        out[i] = before - missing
    state[0], state[1] = before, missing
    return out


@njit
def _leak(signal: Array, rate: float, step: float, state: Array) -> Array:
    out = np.empty_like(signal)
    lost = state[0]
    for i in range(signal.size):
        lost = min(lost + step * rate * max(signal[i] - lost, 0.0), max(signal[i], 0.0))
        out[i] = signal[i] - lost
    state[0] = lost
    return out
