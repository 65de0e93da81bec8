"""Every effect in its forms, ready to be given in any size.

A form draws the secondary parameters of an effect (time constants, thresholds, directions) within
physically plausible ranges and leaves its principal amplitude open: that is a dose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from spa_fo.virtual_rig import actuator as act
from spa_fo.virtual_rig import converter as conv
from spa_fo.virtual_rig import flex_sensor as flex
from spa_fo.virtual_rig import syringe_pump as pump
from spa_fo.virtual_rig.bench import Specimen


@dataclass(frozen=True)
class Dose:
    """An effect with all but its principal amplitude decided.

    Parameters
    ----------
    make : callable
        Makes the effect of an amplitude; the larger it is, the more the effect is felt.
    typical, largest : float
        An amplitude of usual size, and the largest that is still sensible.
    place : callable
        Gives a specimen the effect.
    """

    make: Callable[[float], object]
    typical: float
    largest: float
    place: Callable[[Specimen, object], Specimen]

    def given_to(self, specimen: Specimen, amplitude: float) -> Specimen:
        """Give a specimen the effect in this size."""
        return self.place(specimen, self.make(amplitude))


_Form = Callable[[np.random.Generator], tuple[Callable[[float], object], float, float]]


def draw_dose(effect: str, form: str, rng: np.random.Generator) -> Dose:
    """Draw the secondary parameters of an effect of the library.

    Raises
    ------
    KeyError
        No effect has this identifier, or the effect no such form.
    """
    make, typical, largest = FORMS[form][effect](rng)
    return Dose(make, typical, largest, lambda specimen, it: specimen.with_effect(effect, it))


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


# --- the drive ----------------------------------------------------------------------------------


def _dead_time(_: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    return pump.DeadTime, 0.08, 1.0


def _line_lag(_: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    return pump.LineLag, 0.15, 2.0


def _supply_droop(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    recovery_s = rng.uniform(1.2, 4.0)
    return lambda x: pump.SupplyDroop(x, recovery_s), 0.08, 0.7


def _leak(_: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    return pump.Leak, 0.004, 0.1


def _slew_limit(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    band_kpa = rng.uniform(1.5, 4.0)  # within which the motor slows down
    return lambda x: pump.SlewLimit(1.0 / x, max(band_kpa * x, 0.005)), 1 / 200.0, 1 / 8.0


def _drive_backlash(_: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    return pump.DriveBacklash, 2.0, 20.0


# --- the actuator -------------------------------------------------------------------------------


def _stiffening(_: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    # The amplitude is the relative excess of stiffness that the squared angle makes at 60°.
    return lambda x: act.Stiffening(60.0 / float(np.sqrt(x))), 0.06, 0.8


def _gravity_load(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    mounting_deg = rng.uniform(0.0, 90.0)
    return lambda x: act.GravityLoad(x, mounting_deg), 0.05, 1.0


def _contact_stop(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    angle_deg = rng.uniform(32.0, 45.0)
    return lambda x: act.ContactStop(angle_deg, x), 2.0, 100.0


def _mullins_softening(
    rng: np.random.Generator,
) -> tuple[Callable[[float], object], float, float]:
    span_deg = rng.uniform(65.0, 85.0)
    break_s = _log_uniform(rng, 8.0, 20.0)
    heal_s = _log_uniform(rng, 1e4, 4e4)
    return lambda x: act.MullinsSoftening(x, span_deg, break_s, heal_s), 0.08, 0.8


def _creep(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    pace = _log_uniform(rng, 0.6, 1.6)
    times_s = (3.0 * pace, 15.0 * pace, 75.0 * pace)
    return lambda x: act.Creep(x, times_s), 0.02, 0.3


def _hysteresis(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    yield_deg = rng.uniform(12.0, 25.0)
    return lambda x: act.Hysteresis(x, yield_deg), 2.0, 20.0


def _thermal_drift(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    sign = _sign(rng)
    return lambda x: act.ThermalDrift(float(np.expm1(sign * x))), 0.1, 1.5


def _parameter_shift(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    # Another casting: mostly stiffness and gain, the orders hardly.
    return _along(rng.standard_normal(5) * [0.1, 0.1, 0.6, 0.7, 0.7]), 0.1, 0.5


def _along(direction: np.ndarray) -> Callable[[float], object]:
    """Factors of (alpha2, alpha1, a1, a0, b0) that move along a direction of their logarithms."""
    unit = direction / np.linalg.norm(direction)
    return lambda x: act.ParameterShift(*np.exp(x * unit).tolist())


# --- the sensor ---------------------------------------------------------------------------------


def _sensor_nonlinearity(
    rng: np.random.Generator,
) -> tuple[Callable[[float], object], float, float]:
    sign, period_deg = _sign(rng), rng.uniform(60.0, 90.0)
    # Beyond a quarter of the period the reading would no longer rise with the angle.
    return lambda x: flex.SensorNonlinearity(sign * x, period_deg), 3.0, 0.25 * period_deg


def _sensor_saturation(
    rng: np.random.Generator,
) -> tuple[Callable[[float], object], float, float]:
    knee_deg = rng.uniform(1.5, 4.0)
    return lambda x: flex.SensorSaturation(75.0 - x, knee_deg), 20.0, 55.0


def _sensor_lag(_: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    return flex.SensorLag, 0.1, 2.0


def _sensor_creep(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    times_s = (_log_uniform(rng, 1.5, 3.0), _log_uniform(rng, 15.0, 40.0))
    return lambda x: flex.SensorCreep(x, times_s), 0.02, 0.4


def _sensor_hysteresis(
    _: np.random.Generator,
) -> tuple[Callable[[float], object], float, float]:
    return flex.SensorHysteresis, 2.0, 25.0


def _sensor_slip(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    sign, share = _sign(rng), rng.uniform(0.5, 2.0)
    return lambda x: flex.SensorSlip(sign * x, share * x), 0.1, 5.0


# --- the log ------------------------------------------------------------------------------------


def _channel_latency(_: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    return conv.ChannelLatency, 0.06, 1.0


def _mains_pickup(rng: np.random.Generator) -> tuple[Callable[[float], object], float, float]:
    off_hz = _sign(rng) * _log_uniform(rng, 0.01, 0.15)
    third = rng.uniform(0.0, 0.3)
    return lambda x: conv.MainsPickup(x, 50.0 + off_hz, third), 4.0, 60.0


FORMS: Mapping[str, Mapping[str, _Form]] = {
    "a": {
        "dead_time": _dead_time,
        "line_lag": _line_lag,
        "supply_droop": _supply_droop,
        "leak": _leak,
        "slew_limit": _slew_limit,
        "drive_backlash": _drive_backlash,
        "stiffening": _stiffening,
        "gravity_load": _gravity_load,
        "contact_stop": _contact_stop,
        "mullins_softening": _mullins_softening,
        "creep": _creep,
        "hysteresis": _hysteresis,
        "thermal_drift": _thermal_drift,
        "parameter_shift": _parameter_shift,
        "sensor_nonlinearity": _sensor_nonlinearity,
        "sensor_saturation": _sensor_saturation,
        "sensor_lag": _sensor_lag,
        "sensor_creep": _sensor_creep,
        "sensor_hysteresis": _sensor_hysteresis,
        "sensor_slip": _sensor_slip,
        "channel_latency": _channel_latency,
        "mains_pickup": _mains_pickup,
    },
}
