"""Effects that logs of real rigs show, in forms of this rig's own, ready to be asked for by name.

Their names are the library's; the forms are others than the library's on purpose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from spa_fo._jit import njit
from spa_fo.virtual_rig.arrays import Array, Process
from spa_fo.virtual_rig.bench import Specimen
from spa_fo.virtual_rig.syringe_pump import LowPass


@dataclass(frozen=True)
class LaggingRegulator:
    """A regulator that goes too far: a quick lag less a slower one, scaled, on top of the command.

    `fraction` is the peak's share of a step; `slow_s` and a fifth of it are the two lags.
    """

    fraction: float
    slow_s: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        quick, slow = (LowPass(s).begin(step_s) for s in (self.slow_s / 5.0, self.slow_s))
        peak = 5.0**-0.25 - 5.0**-1.25  # of their difference, at ln 5 / 4 slow times
        return lambda signal: np.asarray(
            signal + self.fraction / peak * (quick(signal) - slow(signal))
        )


@dataclass(frozen=True)
class Ballooning:
    """The load goes as the pressure to the power of 1 + `power`, equal at 30 kPa."""

    power: float

    def begin(self, step_s: float) -> Process:
        """Do the same at all times."""
        return lambda signal: np.asarray(
            np.sign(signal) * 30.0 * (np.abs(signal) / 30.0) ** (1.0 + self.power)
        )


@dataclass(frozen=True)
class FlatWall:
    """A wall that opens about `opens_kpa`, over `width_kpa`, by the integral of a logistic."""

    opens_kpa: float
    width_kpa: float

    def begin(self, step_s: float) -> Process:
        """Do the same at all times."""

        def lost(p: Array) -> Array:
            # p less a softplus of p - opens, zero at rest
            soft = np.logaddexp(0.0, (p - self.opens_kpa) / self.width_kpa)
            rest = np.logaddexp(0.0, -self.opens_kpa / self.width_kpa)
            return np.asarray(p - self.width_kpa * (soft - rest))

        return lambda signal: np.asarray(signal - lost(signal))


@dataclass(frozen=True)
class RestSet:
    """Slipping links set the rest angle, one at each of four pressures.

    Each link that is loaded beyond its pressure slips within `builds_s` and comes back within
    `recovers_s`; all together they are worth `set_kpa`.
    """

    set_kpa: float
    builds_s: float
    recovers_s: float
    at_kpa: tuple[float, ...] = (10.0, 16.0, 22.0, 28.0)

    def begin(self, step_s: float) -> Process:
        """Start fresh."""
        state = np.zeros(len(self.at_kpa))
        at = np.array(self.at_kpa)
        rates = step_s / np.array([self.builds_s, self.recovers_s])
        return lambda signal: np.asarray(signal + self.set_kpa * _slipped(signal, at, rates, state))


@dataclass(frozen=True)
class Sway:
    """The body sways in two modes, the second at 2.7 times the rate with a fifth of the share."""

    share: float
    frequency_hz: float
    damping: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        states = np.zeros((2, 2))
        rates = 2.0 * np.pi * self.frequency_hz * np.array([1.0, 2.7])
        shares = self.share * np.array([0.8, 0.2])
        return lambda signal: _swayed(signal, step_s, rates, shares, self.damping, states)


_Drawn = tuple[Callable[[float], object], float, float]
_Draw = Callable[[np.random.Generator], _Drawn]


def _overshoot(rng: np.random.Generator) -> _Drawn:
    slow_s = rng.uniform(0.6, 2.5)
    return lambda x: LaggingRegulator(x, slow_s), 0.1, 1.5


def _ballooning(rng: np.random.Generator) -> _Drawn:
    sign = float(rng.choice([-1.0, 1.0]))
    return lambda x: Ballooning(sign * x), 0.1, 0.8


def _wall(rng: np.random.Generator) -> _Drawn:
    width = rng.uniform(0.15, 0.4)
    return lambda x: FlatWall(x, width * x), 3.0, 20.0


def _set(rng: np.random.Generator) -> _Drawn:
    builds_s, recovers_s = rng.uniform(2.0, 8.0), rng.uniform(100.0, 400.0)
    return lambda x: RestSet(x, builds_s, recovers_s), 2.0, 20.0


def _sway(rng: np.random.Generator) -> _Drawn:
    frequency_hz, damping = rng.uniform(0.3, 1.0), rng.uniform(0.03, 0.15)
    return lambda x: Sway(x, frequency_hz, damping), 0.2, 2.0


MEASURED_EFFECTS: Mapping[str, _Draw] = {
    "drive_overshoot": _overshoot,
    "gain_growth": _ballooning,
    "opening_fold": _wall,
    "pressure_set": _set,
    "body_mode": _sway,
}
"""By name: draws the effect of an amplitude, a usual amplitude and the largest one."""


def place(specimen: Specimen, effect: object) -> Specimen:
    """Give a specimen such an effect, where it belongs."""
    if isinstance(effect, LaggingRegulator):
        pump = specimen.pump
        return replace(specimen, pump=replace(pump, further=(*pump.further, effect)))
    if isinstance(effect, Ballooning | FlatWall | RestSet | Sway):
        actuator = specimen.actuator
        inside = (*actuator.inside, effect)
        return replace(specimen, actuator=replace(actuator, inside=inside))
    raise TypeError(f"{type(effect).__name__} is none of these effects")


@njit
def _slipped(signal: Array, at_kpa: Array, rates: Array, state: Array) -> Array:
    out = np.empty_like(signal)
    for i in range(signal.size):
        total = 0.0
        for k in range(at_kpa.size):
            if signal[i] > at_kpa[k]:
                state[k] += rates[0] * (1.0 - state[k])
            state[k] -= rates[1] * state[k]
            total += state[k]
        out[i] = total / at_kpa.size
    return out


@njit
def _swayed(
    signal: Array, step_s: float, rates: Array, shares: Array, damping: float, states: Array
) -> Array:
    out = np.empty_like(signal)
    for i in range(signal.size):
        out[i] = signal[i]
        for k in range(rates.size):
            pull = rates[k] * rates[k] * (signal[i] - states[k, 0])
            states[k, 1] += step_s * (pull - 2.0 * damping * rates[k] * states[k, 1])
            states[k, 0] += step_s * states[k, 1]
            out[i] += shares[k] * (states[k, 0] - signal[i])
    return out
