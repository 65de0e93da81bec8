"""Second forms of the effects of drive, sensor and board, and of creep and drift.

Each stands where the first form of its effect does, is as physical and shares no function with
it: a diagnosis that knows an effect by one form only will fail on the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spa_fo._jit import njit
from spa_fo.virtual_rig.arrays import Array, Process, chain
from spa_fo.virtual_rig.syringe_pump import LowPass, delay

# --- the drive ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class PolledCommand:
    """Dead time of a controller that looks for a command now and then.

    It looks every 0.6 `delay_s` and acts 0.7 `delay_s` after it has looked: `delay_s` on average.
    """

    delay_s: float

    def begin(self, step_s: float) -> Process:
        """Start with a look."""
        period = max(0.6 * self.delay_s / step_s, 1.0)
        done, seen = 0, 0.0

        def look(signal: Array) -> Array:
            nonlocal done, seen
            now = done + np.arange(signal.size)
            last = np.ceil(np.floor(now / period) * period).astype(np.int64)
            last = np.minimum(last, now) - done
            out = np.where(last >= 0, signal[np.maximum(last, 0)], seen)
            done, seen = done + signal.size, float(out[-1])
            return np.asarray(out)

        return chain([look, delay(0.7 * self.delay_s / step_s)])


@dataclass(frozen=True)
class DistributedLine:
    """A tube along which pressure diffuses: its first three poles, 1, 1/9 and 1/25.

    `time_constant_s` is their sum.
    """

    time_constant_s: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        shares = np.array([1.0, 1 / 9, 1 / 25])
        times = self.time_constant_s * shares / shares.sum()
        return chain([LowPass(float(time)).begin(step_s) for time in times])


@dataclass(frozen=True)
class ReservoirDroop:
    """Flow empties a reservoir that two stages of the supply fill up again.

    Parameters
    ----------
    fraction : float
        Share of a fast rise that would be missing if nothing recovered.
    times_s : (float, float)
        Time constants of the recovery, the faster stage first.
    fast_share : float
        What of the loss the faster one makes good.
    fill_s : float
        Time constant with which the actuator fills: the flow follows the rise so late.
    """

    fraction: float
    times_s: tuple[float, float] = (0.6, 5.0)
    fast_share: float = 0.5
    fill_s: float = 0.08

    def begin(self, step_s: float) -> Process:
        """Start with a full reservoir."""
        state = np.zeros(3)
        keep = np.exp(-step_s / np.array(self.times_s))
        shares = self.fraction * np.array([self.fast_share, 1.0 - self.fast_share])
        taken = float(-np.expm1(-step_s / self.fill_s))
        return lambda signal: _reservoir(signal, keep, shares, taken, state)


@dataclass(frozen=True)
class TwoRateSlew:
    """A motor with one top speed for filling and another for emptying, and no approach."""

    up_kpa_s: float
    down_kpa_s: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        state = np.zeros(1)
        up, down = self.up_kpa_s * step_s, self.down_kpa_s * step_s
        return lambda signal: _two_rates(signal, up, down, state)


@dataclass(frozen=True)
class SmoothPlay:
    """Lost motion of `play_kpa` that is taken up gradually, as by worn teeth (Duhem's form)."""

    play_kpa: float

    def begin(self, step_s: float) -> Process:
        """Start at rest, the play open towards rising pressure."""
        state = np.array([0.0, -1.0])
        half = 0.5 * self.play_kpa
        return lambda signal: signal - half - _turned(signal, self.play_kpa, state) * half


@dataclass(frozen=True)
class RegulatedLeak:
    """An orifice that loses √(p/30 kPa) · `rate_kpa_s`, made good with `make_up_s`.

    Held pressure falls to a floor rather than to nothing.
    """

    rate_kpa_s: float
    make_up_s: float = 15.0

    def begin(self, step_s: float) -> Process:
        """Start with nothing lost."""
        state = np.zeros(1)
        return lambda signal: _orifice(signal, self.rate_kpa_s, self.make_up_s, step_s, state)


# --- the actuator's gain and creep --------------------------------------------------------------


@dataclass(frozen=True)
class PowerCreep:
    """Creep by a power law of time: relaxing elements over four decades, shares as τ^exponent.

    Parameters
    ----------
    fraction : float
        Extra angle after a minute under load, as a share of the static one.
    exponent : float
        0 is creep by the logarithm of time.
    """

    fraction: float
    exponent: float = 0.2

    @property
    def times_s(self) -> tuple[float, ...]:
        """Retardation times of the elements, s."""
        return tuple(np.logspace(-0.5, 3.5, 9).tolist())

    @property
    def shares(self) -> tuple[float, ...]:
        """Share of the static angle that each element adds in the end."""
        times = np.array(self.times_s)
        weights = times**self.exponent
        after_a_minute = np.sum(weights * -np.expm1(-60.0 / times))
        return tuple((self.fraction * weights / after_a_minute).tolist())


@dataclass(frozen=True)
class Warming:
    """The specimen warms up to a steady temperature: its gain settles at 1 + `share`."""

    share: float
    time_s: float = 6000.0

    def gain(self, time_s: Array) -> Array:
        """Gain at campaign times."""
        return np.asarray(1.0 - self.share * np.expm1(-time_s / self.time_s))


# --- the sensor ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class CurveChange:
    """The film's own curve changed when it was built in: `excess_deg` (θ/60°)² too much.

    A later calibration shows it as well.
    """

    excess_deg: float
    in_fixture: bool = True

    def felt(self, angle_deg: Array) -> Array:
        """Angle the sensor feels."""
        return np.asarray(angle_deg + self.excess_deg * angle_deg * np.abs(angle_deg) / 3600.0)


@dataclass(frozen=True)
class TanhSaturation:
    """True up to `knee_deg` below `ceiling_deg`, from there a hyperbolic tangent up to it."""

    ceiling_deg: float
    knee_deg: float = 15.0
    in_fixture: bool = False

    def felt(self, angle_deg: Array) -> Array:
        """Angle the sensor feels."""
        start = self.ceiling_deg - self.knee_deg
        bent = start + self.knee_deg * np.tanh((angle_deg - start) / self.knee_deg)
        return np.where(angle_deg > start, bent, angle_deg)


@dataclass(frozen=True)
class LogSensorCreep:
    """The reading creeps with the logarithm of time: `fraction` of the angle for every decade."""

    fraction: float

    def begin(self, step_s: float) -> Process:
        """Start relaxed."""
        slow = [LowPass(time).begin(step_s) for time in np.logspace(-0.5, 3.5, 9).tolist()]
        share = 0.5 * self.fraction  # two elements a decade
        return lambda signal: np.asarray(signal + share * sum(run(signal) for run in slow))


@dataclass(frozen=True)
class DuhemReading:
    """The reading lags `width_deg`/2 behind a long movement, and turns round smoothly."""

    width_deg: float
    turn_deg: float = 10.0

    def begin(self, step_s: float) -> Process:
        """Start at 0°, midway."""
        state = np.zeros(2)
        half = 0.5 * self.width_deg
        return lambda signal: signal - half * _turned(signal, self.turn_deg, state)


@dataclass(frozen=True)
class SingleJump:
    """The sensor slips once: its zero moves by `jump_deg` before one trial."""

    jump_deg: float
    before_trial: int

    def shift_deg(self, trial: int, _: float) -> float:
        """Shift of the zero before this trial, deg."""
        return self.jump_deg if trial == self.before_trial else 0.0


# --- the log ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MovingAverage:
    """The flex channel is averaged over 2 `delay_s`: late by half the window."""

    delay_s: float

    def begin(self, step_s: float) -> Process:
        """Start with a window of zeros."""
        window = max(2.0 * self.delay_s / step_s, 1.0)
        whole = int(window)
        before = np.zeros(whole + 1)

        def advance(signal: Array) -> Array:
            nonlocal before
            line = np.concatenate([before, signal])
            before = line[-(whole + 1) :]
            total = np.cumsum(line)
            oldest = line[1:-whole]
            full = total[whole + 1 :] - total[1:-whole]
            return np.asarray((full + (window - whole) * oldest) / window)

        return advance


@dataclass(frozen=True)
class BeatingPickup:
    """Interference whose strength rises and falls, as machines nearby come and go.

    Parameters
    ----------
    amplitude_volt : float
        Mean amplitude.
    frequency_hz : float
        Mains frequency.
    depth, beat_s : float
        Relative change of the amplitude, and its period.
    """

    amplitude_volt: float
    frequency_hz: float = 60.0
    depth: float = 0.5
    beat_s: float = 11.0

    def volts(self, time_s: Array) -> Array:
        """Interference at campaign times."""
        strength = 1.0 + self.depth * np.sin(2.0 * np.pi * time_s / self.beat_s)
        wave = np.sin(2.0 * np.pi * self.frequency_hz * time_s)
        return np.asarray(self.amplitude_volt * strength * wave)


# --- kernels ------------------------------------------------------------------------------------


@njit
def _reservoir(signal: Array, keep: Array, shares: Array, taken: float, state: Array) -> Array:
    out = np.empty_like(signal)
    filled = state[2]
    for i in range(signal.size):
        flow = taken * (signal[i] - filled)
        filled += flow
        for k in range(2):
            state[k] = keep[k] * state[k] + shares[k] * max(flow, 0.0)
        missing = min(state[0] + state[1], max(signal[i], 0.0))
        out[i] = signal[i] - missing
    state[2] = filled
    return out


@njit
def _two_rates(signal: Array, up: float, down: float, state: Array) -> Array:
    out = np.empty_like(signal)
    pressure = state[0]
    for i in range(signal.size):
        pressure += min(max(signal[i] - pressure, -down), up)
        out[i] = pressure
    state[0] = pressure
    return out


@njit
def _turned(signal: Array, scale: float, state: Array) -> Array:
    """Direction of the movement, -1 to 1, turning round over `scale` of it; state: last, it."""
    out = np.empty_like(signal)
    last, direction = state[0], state[1]
    for i in range(signal.size):
        moved = signal[i] - last
        last = signal[i]
        keep = np.exp(-abs(moved) / scale)
        direction = np.sign(moved) * (1.0 - keep) + keep * direction
        out[i] = direction
    state[0], state[1] = last, direction
    return out


@njit
def _orifice(signal: Array, rate: float, make_up: float, step: float, state: Array) -> Array:
    out = np.empty_like(signal)
    lost = state[0]
    for i in range(signal.size):
        pressure = max(signal[i] - lost, 0.0)
        lost += step * (rate * np.sqrt(pressure / 30.0) - lost / make_up)
        lost = min(lost, max(signal[i], 0.0))
        out[i] = signal[i] - lost
    state[0] = lost
    return out
