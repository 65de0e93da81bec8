"""Effects that no library holds: a diagnosis that meets one should say that it does not know.

Which identifiers of the library would still be a fair answer was written down for each before any
diagnosis was run (`FOREIGN_EFFECTS`): a physical equivalent, or one that points at the same part.
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
class CrackingPressure:
    """A check valve that opens at `opens_kpa`: so much of every command is missing."""

    opens_kpa: float

    def begin(self, step_s: float) -> Process:
        """Start closed."""
        return lambda signal: np.maximum(signal - self.opens_kpa, 0.0)


@dataclass(frozen=True)
class SlowExhaust:
    """A throttled vent: falling pressure follows with `time_constant_s`, rising at once."""

    time_constant_s: float

    def begin(self, step_s: float) -> Process:
        """Start empty."""
        taken = float(-np.expm1(-step_s / self.time_constant_s))
        state = np.zeros(1)
        return lambda signal: _vented(signal, taken, state)


@dataclass(frozen=True)
class PumpRipple:
    """The strokes of a running pump: a sine on the pressure, as long as there is any."""

    amplitude_kpa: float
    frequency_hz: float = 0.6

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        done = 0

        def advance(signal: Array) -> Array:
            nonlocal done
            time = step_s * (done + np.arange(signal.size))
            done += signal.size
            wave = self.amplitude_kpa * np.sin(2.0 * np.pi * self.frequency_hz * time)
            return np.asarray(signal + wave * np.tanh(signal / 5.0))

        return advance


@dataclass(frozen=True)
class QuadraticDrag:
    """Damping that grows with the square of the rate: moment a0 `coefficient` v|v|, in s²/rad."""

    coefficient: float


@dataclass(frozen=True)
class SnapThrough:
    """A wall buckles: above `snaps_kpa` pressure bends more by `jump`, until below `returns_kpa`.

    The pressure sensor sees nothing of it.
    """

    jump: float
    snaps_kpa: float
    returns_kpa: float

    def begin(self, step_s: float) -> Process:
        """Start unbuckled."""
        settle = LowPass(0.05).begin(step_s)
        state = np.zeros(1)
        return lambda signal: np.asarray(
            signal
            * (1.0 + self.jump * settle(_relay(signal, self.returns_kpa, self.snaps_kpa, state)))
        )


@dataclass(frozen=True)
class ReferenceSag:
    """The pump's current pulls the divider's supply down: volts lost per kPa/s of flow."""

    volt_per_kpa_s: float
    smoothing_s: float = 0.15

    def begin(self, step_s: float) -> Callable[[Array, Array], Array]:
        """Start at rest."""
        smooth = LowPass(self.smoothing_s).begin(step_s)
        before = 0.0

        def advance(_: Array, pressure_kpa: Array) -> Array:
            nonlocal before
            rate = np.diff(pressure_kpa, prepend=before) / step_s
            before = float(pressure_kpa[-1])
            return np.asarray(-self.volt_per_kpa_s * smooth(np.abs(rate)))

        return advance


@dataclass(frozen=True)
class CommandCrosstalk:
    """The wire of the pump's setpoint couples into the flex channel, V per kPa."""

    volt_per_kpa: float

    def begin(self, step_s: float) -> Callable[[Array, Array], Array]:
        """Start at rest."""
        return lambda command_kpa, _: self.volt_per_kpa * command_kpa


@dataclass(frozen=True)
class GainWander:
    """The film's grip in the pocket wanders: gain 1 + `share` times a slow random wave.

    The wave has unit variance and six periods about `period_s`, its phases by `seed`.
    """

    share: float
    period_s: float = 10.0
    seed: int = 0

    def begin(self, step_s: float) -> Process:
        """Start wherever it is."""
        rng = np.random.default_rng(self.seed)
        rates = 2.0 * np.pi / (self.period_s * rng.uniform(0.6, 1.8, 6))
        phases = rng.uniform(0.0, 2.0 * np.pi, 6)
        done = 0

        def advance(signal: Array) -> Array:
            nonlocal done
            time = step_s * (done + np.arange(signal.size))
            done += signal.size
            wave = np.zeros_like(signal)
            for rate, phase in zip(rates, phases, strict=True):
                wave += np.sin(rate * time + phase)
            return np.asarray(signal * (1.0 + self.share * wave / np.sqrt(3.0)))

        return advance


@dataclass(frozen=True)
class ForeignEffect:
    """What is known of a foreign effect beforehand.

    Parameters
    ----------
    draw : callable
        Draws the secondary parameters: the effect of an amplitude, a typical and a largest one.
    equivalents : tuple of str
        Identifiers of the library that are a fair answer.
    why : str
        The reason in a line.
    """

    draw: Callable[[np.random.Generator], tuple[Callable[[float], object], float, float]]
    equivalents: tuple[str, ...]
    why: str


def place(specimen: Specimen, effect: object) -> Specimen:
    """Give a specimen a foreign effect, where it belongs."""
    pump, actuator, sensor = specimen.pump, specimen.actuator, specimen.sensor
    match effect:
        case CrackingPressure() | SlowExhaust() | PumpRipple():
            return replace(specimen, pump=replace(pump, further=(*pump.further, effect)))
        case QuadraticDrag():
            return replace(specimen, actuator=replace(actuator, drag=effect.coefficient))
        case SnapThrough():
            inside = (*actuator.inside, effect)
            return replace(specimen, actuator=replace(actuator, inside=inside))
        case GainWander():
            return replace(specimen, sensor=replace(sensor, pocket=(*sensor.pocket, effect)))
        case ReferenceSag() | CommandCrosstalk():
            acquisition = specimen.acquisition
            couplings = (*acquisition.couplings, effect)
            return replace(specimen, acquisition=replace(acquisition, couplings=couplings))
    raise TypeError(f"{type(effect).__name__} is no foreign effect")


def _snap_through(
    rng: np.random.Generator,
) -> tuple[Callable[[float], object], float, float]:
    snaps = rng.uniform(18.0, 30.0)
    returns = snaps * rng.uniform(0.5, 0.85)
    return lambda x: SnapThrough(x, snaps, returns), 0.08, 0.5


def _wander(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    period, seed = rng.uniform(7.0, 14.0), int(rng.integers(2**32))
    return lambda x: GainWander(x, period, seed), 0.04, 0.4


def _ripple(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    frequency = rng.uniform(0.3, 0.7)  # the actuator hardly follows anything faster
    return lambda x: PumpRipple(x, frequency), 5.0, 25.0


def _sag(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    smoothing = rng.uniform(0.15, 0.5)
    return lambda x: ReferenceSag(x, smoothing), 1e-3, 0.02


FOREIGN_EFFECTS: Mapping[str, ForeignEffect] = {
    "valve_cracking": ForeignEffect(
        lambda _: (CrackingPressure, 2.0, 20.0),
        ("drive_backlash",),
        "on every rise from rest play withholds the same pressure",
    ),
    "slow_exhaust": ForeignEffect(
        lambda _: (SlowExhaust, 0.3, 5.0),
        ("line_lag", "slew_limit"),
        "the line follows late, if in one direction only",
    ),
    "pump_ripple": ForeignEffect(
        _ripple, ("drive_hunting",), "a regulator that hunts swings the pressure as regularly"
    ),
    "quadratic_drag": ForeignEffect(
        lambda _: (QuadraticDrag, 0.05, 5.0), (), "no effect of the library depends on the rate so"
    ),
    "snap_through": ForeignEffect(
        _snap_through, (), "no effect of the library raises the gain beyond a threshold"
    ),
    "reference_sag": ForeignEffect(
        _sag, (), "no effect of the library moves the reading with the flow"
    ),
    "command_crosstalk": ForeignEffect(
        lambda rng: (_either_sign(rng, CommandCrosstalk), 4e-4, 0.005),
        (),
        "no effect of the library moves the reading with the command",
    ),
    "gain_wander": ForeignEffect(_wander, (), "no effect of the library is random within a trial"),
}


def _either_sign(
    rng: np.random.Generator, make: Callable[[float], object]
) -> Callable[[float], object]:
    sign = float(rng.choice([-1.0, 1.0]))
    return lambda x: make(sign * x)


@njit
def _vented(signal: Array, taken: float, state: Array) -> Array:
    out = np.empty_like(signal)
    pressure = state[0]
    for i in range(signal.size):
        if signal[i] >= pressure:
            pressure = signal[i]
        else:
            pressure += taken * (signal[i] - pressure)
        out[i] = pressure
    state[0] = pressure
    return out


@njit
def _relay(signal: Array, off: float, on: float, state: Array) -> Array:
    out = np.empty_like(signal)
    up = state[0]
    for i in range(signal.size):
        if signal[i] > on:
            up = 1.0
        elif signal[i] < off:
            up = 0.0
        out[i] = up
    state[0] = up
    return out
