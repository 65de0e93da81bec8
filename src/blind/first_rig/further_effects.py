"""More effects that logs of real rigs show, each in two forms of this rig's own.

Their names are the library's; the forms are others than the library's on purpose. Those of the
drive and of the actuator are here, those of the reading in `reading_effects`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from blind.first_rig import reading_effects as reading
from spa_fo._jit import njit
from spa_fo.virtual_rig.arrays import Array, Process
from spa_fo.virtual_rig.bench import Specimen
from spa_fo.virtual_rig.syringe_pump import LowPass

_STILL_KPA_S = 0.5  # a command that moves less is held
_LED_S = 0.25  # how long after its last move the regulator still follows it
_EMPTY_KPA = 0.5  # below, the valve is shut and nothing can swing
_FORGETS_S = 0.3  # how soon a regulator that is led forgets its swing


@dataclass(frozen=True)
class SelfExcited:
    """A regulator that swings itself up while its command is held: Van der Pol's oscillator.

    Each move of the command gives it a kick; while the command moves or is zero the swing dies out.

    Parameters
    ----------
    amplitude_kpa : float
        Of the limit cycle at high pressure, about; at 8 kPa it is 0.7 of that.
    frequency_hz : float
        Of the swing.
    growth : float
        Van der Pol's coefficient: how soon it is there, and how far it is from a sine.
    """

    amplitude_kpa: float
    frequency_hz: float
    growth: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        state = np.zeros(4)
        omega = 2.0 * np.pi * self.frequency_hz
        return lambda signal: np.asarray(
            signal + _excited(signal, step_s, omega, self.growth, self.amplitude_kpa, state)
        )


@dataclass(frozen=True)
class BangBang:
    """A regulator of two valves: it fills up to the end of its dead band, vents down to the other.

    The tube rounds the corners.

    Parameters
    ----------
    band_kpa : float
        Half the width of the dead band.
    period_s : float
        Of the cycle while the command is held.
    filling : float
        Share of the period in which it fills.
    tube_s : float
        Time constant of the tube.
    """

    band_kpa: float
    period_s: float
    filling: float
    tube_s: float = 0.08

    def begin(self, step_s: float) -> Process:
        """Start at rest, filling."""
        state = np.array([0.0, 0.0, 0.0, 1.0])
        travel = 2.0 * self.band_kpa * step_s / self.period_s
        moves = np.array([travel / self.filling, travel / (1.0 - self.filling)])
        tube = LowPass(self.tube_s).begin(step_s)

        def advance(signal: Array) -> Array:
            swung = signal + tube(_switched(signal, step_s, moves, self.band_kpa, state))
            return np.maximum(swung, np.minimum(signal, 0.0))  # no vacuum

        return advance


@dataclass(frozen=True)
class SqueezedFolds:
    """Folds press on each other: damping grows (falls) as a power of the pressure.

    `share` is that of a1 at 30 kPa; what falls does so no further than to a tenth of a1.
    """

    share: float
    exponent: float

    def begin(self, step_s: float) -> Process:
        """Do the same at all times."""
        return lambda signal: np.maximum(
            self.share * (np.maximum(signal, 0.0) / 30.0) ** self.exponent, -0.9
        )


@dataclass(frozen=True)
class TouchingWalls:
    """Walls that rub (or part) from about `from_kpa` on: a step of the damping, of cubic shape.

    `share` is that of a1, all of it `width_kpa` further on.
    """

    share: float
    from_kpa: float
    width_kpa: float

    def begin(self, step_s: float) -> Process:
        """Do the same at all times."""

        def damped(signal: Array) -> Array:
            way = np.clip((signal - self.from_kpa) / self.width_kpa, 0.0, 1.0)
            return np.asarray(self.share * way**2 * (3.0 - 2.0 * way))

        return damped


# How to make the effect of an amplitude; a typical and the largest sensible amplitude.
_Drawn = tuple[Callable[[float], object], float, float]
_Draw = Callable[[np.random.Generator, int], _Drawn]


def _self_excited(rng: np.random.Generator, _: int) -> _Drawn:
    frequency_hz, growth = rng.uniform(0.15, 0.35), rng.uniform(0.8, 1.6)
    return lambda x: SelfExcited(x, frequency_hz, growth), 4.0, 20.0


def _bang_bang(rng: np.random.Generator, _: int) -> _Drawn:
    period_s, filling = rng.uniform(2.5, 6.0), rng.uniform(0.35, 0.65)
    return lambda x: BangBang(x, period_s, filling), 4.0, 20.0


def _squeezed_folds(rng: np.random.Generator, _: int) -> _Drawn:
    sign, exponent = _more_or_less(rng), rng.uniform(0.7, 2.0)
    return lambda x: SqueezedFolds(sign * x, exponent), 0.3, _MOST[sign]


def _touching_walls(rng: np.random.Generator, _: int) -> _Drawn:
    sign = _more_or_less(rng)
    from_kpa, width_kpa = rng.uniform(5.0, 18.0), rng.uniform(3.0, 12.0)
    return lambda x: TouchingWalls(sign * x, from_kpa, width_kpa), 0.3, _MOST[sign]


_MOST = {1.0: 8.0, -1.0: 0.85}  # times a1, added or taken away


def _more_or_less(rng: np.random.Generator) -> float:
    # Rather more: what is taken away can hardly be as large.
    return 1.0 if rng.random() < 0.7 else -1.0


FURTHER_FORMS: Mapping[str, Mapping[str, _Draw]] = {
    "a": {
        "drive_hunting": _self_excited,
        "pressure_damping": _squeezed_folds,
        "unsigned_reading": reading.draw_folded,
        "sensor_detachment": reading.draw_torn,
        "sensor_freeze": reading.draw_jammed,
    },
    "b": {
        "drive_hunting": _bang_bang,
        "pressure_damping": _touching_walls,
        "unsigned_reading": reading.draw_blended,
        "sensor_detachment": reading.draw_peeling,
        "sensor_freeze": reading.draw_stuck,
    },
}
"""By form and name: draws the effect of an amplitude in a campaign of so many trials."""

UNEVEN = frozenset({"unsigned_reading", "sensor_freeze"})
"""Those whose size goes by leaps, as the body moves or stands still."""


def place(specimen: Specimen, effect: object) -> Specimen:
    """Give a specimen such an effect, where it belongs."""
    match effect:
        case SelfExcited() | BangBang():
            pump = specimen.pump
            return replace(specimen, pump=replace(pump, further=(*pump.further, effect)))
        case SqueezedFolds() | TouchingWalls():
            actuator = specimen.actuator
            damping = (*actuator.damping, effect)
            return replace(specimen, actuator=replace(actuator, damping=damping))
    return reading.place(specimen, effect)


@njit
def _excited(
    signal: Array, step_s: float, omega: float, growth: float, amplitude: float, state: Array
) -> Array:
    out = np.empty_like(signal)
    before, led, swing, rate = state[0], state[1], state[2], state[3]
    for i in range(signal.size):
        move = signal[i] - before
        before = signal[i]
        led = _LED_S if abs(move) > _STILL_KPA_S * step_s else led - step_s
        if led > 0.0 or before < _EMPTY_KPA:
            swing -= step_s / _FORGETS_S * swing + 0.3 * min(max(move / amplitude, -1.0), 1.0)
            swing = min(max(swing, -0.3), 0.3)
            rate = 0.0
        else:
            # The swing's energy comes from the supply: the more of it the higher the pressure.
            fed = before / (before + 8.0)
            pushed = growth * omega * (fed - 4.0 * swing * swing) * rate
            rate += step_s * (pushed - omega * omega * swing)
            swing += step_s * rate
        out[i] = max(amplitude * swing, -max(before, 0.0))  # no vacuum
    state[0], state[1], state[2], state[3] = before, led, swing, rate
    return out


@njit
def _switched(signal: Array, step_s: float, moves: Array, band: float, state: Array) -> Array:
    out = np.empty_like(signal)
    before, led, off, direction = state[0], state[1], state[2], state[3]
    for i in range(signal.size):
        move = signal[i] - before
        before = signal[i]
        led = _LED_S if abs(move) > _STILL_KPA_S * step_s else led - step_s
        if move != 0.0:
            direction = np.sign(move)  # it goes on the way it came
        if led > 0.0 or before < _EMPTY_KPA:
            off -= step_s / _FORGETS_S * off
        else:
            off += moves[0] if direction > 0.0 else -moves[1]
            if abs(off) >= band:
                direction = -np.sign(off)
        out[i] = off
    state[0], state[1], state[2], state[3] = before, led, off, direction
    return out
