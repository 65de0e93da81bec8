"""True angle -> divider voltage: a resistive flex sensor in a pocket of the actuator.

Mechanics and material first (what angle the sensor feels, in degrees: slip, hysteresis, creep,
lag), then its curve (angle -> resistance -> voltage). The field names of `FlexSensor` are the
effects' identifiers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from spa_fo._jit import njit
from spa_fo.virtual_rig.arrays import Array, Effect, Process, chain
from spa_fo.virtual_rig.second_forms import SingleJump
from spa_fo.virtual_rig.syringe_pump import LowPass


class Bend(Protocol):
    """A static effect: what the film feels at a true angle."""

    @property
    def in_fixture(self) -> bool:
        """Whether calibrations show it once the sensor has been in the actuator."""

    def felt(self, angle_deg: Array) -> Array:
        """Angle the sensor feels."""


@dataclass(frozen=True)
class DividerCurve:
    """Flex resistor R = R_flat + (R_right - R_flat)(θ/90 + bow sin(2πθ/180)), below a fixed one.

    Parameters
    ----------
    flat_ohm, right_ohm : float
        Resistance at 0° and at 90°.
    fixed_ohm : float
        The divider's other resistor.
    bow : float
        Departure from a straight line at 45°, as a share of the range.
    supply_volt : float
        The divider's supply.
    """

    flat_ohm: float = 10_000.0
    right_ohm: float = 30_000.0
    fixed_ohm: float = 30_000.0
    bow: float = -0.06
    supply_volt: float = 5.0

    def volts(self, angle_deg: Array) -> Array:
        """Divider voltage at the angles the sensor feels."""
        bend = angle_deg / 90.0 + self.bow * np.sin(np.pi * angle_deg / 90.0)
        ohm = self.flat_ohm + (self.right_ohm - self.flat_ohm) * bend
        return np.asarray(self.supply_volt * ohm / (ohm + self.fixed_ohm))


@dataclass(frozen=True)
class SensorHysteresis:
    """A stack of five elements with play, widths evenly up to `width_deg` (Prandtl-Ishlinskii)."""

    width_deg: float

    def begin(self, step_s: float) -> Process:
        """Start at 0°, every play centred."""
        widths = np.linspace(0.2, 1.0, 5) * self.width_deg
        state = np.zeros(5)
        return lambda signal: _play_stack(signal, widths, state)


@dataclass(frozen=True)
class SensorCreep:
    """The resistive layer keeps flowing: two relaxing elements, `fraction` of the angle each."""

    fraction: float
    times_s: tuple[float, ...] = (2.0, 25.0)

    def begin(self, step_s: float) -> Process:
        """Start relaxed."""
        slow = [LowPass(time).begin(step_s) for time in self.times_s]
        return lambda signal: np.asarray(signal + self.fraction * sum(run(signal) for run in slow))


@dataclass(frozen=True)
class SensorLag:
    """Pocket and film follow late: two equal first-order lags, `time_constant_s` together."""

    time_constant_s: float

    def begin(self, step_s: float) -> Process:
        """Start at rest."""
        single = LowPass(self.time_constant_s / 2)
        return chain([single.begin(step_s), single.begin(step_s)])


@dataclass(frozen=True)
class SensorNonlinearity:
    """In the actuator the sensor bends otherwise than in the calibration fixture.

    The angle felt is θ + `excess_deg` (1 - cos(2πθ/period)) / 2; nothing in the fixture.
    """

    excess_deg: float
    period_deg: float = 70.0
    in_fixture: bool = False

    def felt(self, angle_deg: Array) -> Array:
        """Angle the sensor feels."""
        bump = 0.5 * (1.0 - np.cos(2.0 * np.pi * angle_deg / self.period_deg))
        return np.asarray(angle_deg + self.excess_deg * bump)


@dataclass(frozen=True)
class SensorSaturation:
    """The pocket's end stops the film: soft minimum of the angle and `ceiling_deg`.

    Nothing in the fixture, where the film lies free.
    """

    ceiling_deg: float
    knee_deg: float = 3.0
    in_fixture: bool = False

    def felt(self, angle_deg: Array) -> Array:
        """Angle the sensor feels."""
        below = (self.ceiling_deg - angle_deg) / self.knee_deg
        return np.asarray(self.ceiling_deg - self.knee_deg * np.logaddexp(0.0, below))


@dataclass(frozen=True)
class SensorSlip:
    """The sensor works its way along the pocket: the zero moves before each trial.

    Parameters
    ----------
    walk_deg : float
        Systematic shift a trial.
    jump_deg : float
        Standard deviation of a random shift on top.
    """

    walk_deg: float
    jump_deg: float = 0.0

    def shift_deg(self, _: int, normal: float) -> float:
        """Shift of the zero before a trial, deg; `normal` ~ N(0, 1) is that trial's own."""
        return self.walk_deg + self.jump_deg * normal


@dataclass(frozen=True)
class FlexSensor:
    """The sensor: its curve and its imperfections; None is an effect that is absent.

    `pocket` changes what arrives at the film while it sits in the actuator.
    """

    curve: DividerCurve = DividerCurve()
    sensor_slip: SensorSlip | SingleJump | None = None
    sensor_nonlinearity: Bend | None = None
    sensor_saturation: Bend | None = None
    sensor_hysteresis: Effect | None = None
    sensor_creep: Effect | None = None
    sensor_lag: Effect | None = None
    pocket: tuple[Effect, ...] = ()

    def begin(self, step_s: float) -> RunningSensor:
        """Start the sensor flat and relaxed."""
        return RunningSensor(self, step_s)


class RunningSensor:
    """A sensor and its memory: true deg in, volts out, both every `step_s`."""

    def __init__(self, sensor: FlexSensor, step_s: float) -> None:
        effects = (sensor.sensor_hysteresis, sensor.sensor_creep, sensor.sensor_lag)
        self._sensor = sensor
        self._film = chain([effect.begin(step_s) for effect in effects if effect is not None])
        self._pocket = chain([effect.begin(step_s) for effect in sensor.pocket])
        bends = (sensor.sensor_nonlinearity, sensor.sensor_saturation)
        self._bends = [bend for bend in bends if bend is not None]
        self._zero_deg = 0.0
        self._mounting_deg = 0.0
        self._trials = 0

    def mount(self, offset_deg: float, shift: float) -> None:
        """Begin a trial: the actuator rests `offset_deg` off; `shift` ~ N(0, 1) moves the zero."""
        self._trials += 1
        slip = self._sensor.sensor_slip
        if slip is not None:
            self._zero_deg += slip.shift_deg(self._trials, shift)
        self._mounting_deg = offset_deg

    def __call__(self, angle_deg: Array) -> Array:
        """Divider voltage while the sensor sits in the actuator."""
        felt = self._pocket(angle_deg)
        for bend in self._bends:
            felt = bend.felt(felt)
        return self._volts(felt + self._mounting_deg)

    def in_fixture(self, angle_deg: Array) -> Array:
        """Divider voltage in the calibration fixture: no pocket, no offset."""
        felt = angle_deg
        for bend in self._bends:
            if bend.in_fixture and self._trials:
                felt = bend.felt(felt)
        return self._volts(felt)

    def _volts(self, angle_deg: Array) -> Array:
        return self._sensor.curve.volts(self._film(angle_deg + self._zero_deg))


@njit
def _play_stack(signal: Array, widths: Array, state: Array) -> Array:
    out = np.empty_like(signal)
    for i in range(signal.size):
        total = 0.0
        for k in range(widths.size):
            half = 0.5 * widths[k]
            state[k] = min(max(state[k], signal[i] - half), signal[i] + half)
            total += state[k]
        out[i] = total / widths.size
    return out
