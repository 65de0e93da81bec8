"""Every effect in its forms, ready to be given in any size.

A form draws the secondary parameters of an effect (time constants, thresholds, directions) within
physically plausible ranges and leaves its principal amplitude open: that is a dose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from blind.first_rig import further_effects as further
from blind.first_rig import measured_effects as measured
from blind.first_rig.foreign_effects import FOREIGN_EFFECTS, place
from spa_fo.virtual_rig import actuator as act
from spa_fo.virtual_rig import converter as conv
from spa_fo.virtual_rig import first_forms as first
from spa_fo.virtual_rig import flex_sensor as flex
from spa_fo.virtual_rig import second_forms as second
from spa_fo.virtual_rig import second_moments as moments
from spa_fo.virtual_rig import syringe_pump as pump
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.bench import Specimen


@dataclass(frozen=True)
class Dose:
    """An effect with all but its principal amplitude decided.

    Parameters
    ----------
    make : callable
        Makes the effect of an amplitude; the larger it is, the more the effect is felt.
    typical, largest : float
        An amplitude of usual size, and the largest that is still physically sensible.
    place : callable
        Gives a specimen the effect.
    uneven : bool
        Whether what is felt grows by leaps, so that only halving finds a size.
    """

    make: Callable[[float], object]
    typical: float
    largest: float
    place: Callable[[Specimen, object], Specimen]
    uneven: bool = False

    def given_to(self, specimen: Specimen, amplitude: float) -> Specimen:
        """Give a specimen the effect in this size."""
        return self.place(specimen, self.make(amplitude))


# How to make the effect of an amplitude; a typical and the largest sensible amplitude.
_Drawn = tuple[Callable[[float], object], float, float]
_Form = Callable[[np.random.Generator], _Drawn]


def draw_dose(effect: str, form: str, rng: np.random.Generator, trials: int) -> Dose:
    """Draw the secondary parameters of an effect, of the library or foreign (which has one form).

    Parameters
    ----------
    effect : str
        Its name.
    form : {"a", "b"}
        Its functional form.
    rng : numpy.random.Generator
        Of the secondary parameters.
    trials : int
        How many the campaign has: what happens once happens in one of them.

    Raises
    ------
    KeyError
        No effect has this identifier, or the effect no such form.
    """
    if effect in FOREIGN_EFFECTS:
        return Dose(*FOREIGN_EFFECTS[effect].draw(rng), place)
    if effect in measured.MEASURED_EFFECTS:  # which have one form too
        return Dose(*measured.MEASURED_EFFECTS[effect](rng), measured.place)
    if effect in further.FURTHER_FORMS[form]:
        drawn = further.FURTHER_FORMS[form][effect](rng, trials)
        return Dose(*drawn, further.place, effect in further.UNEVEN)
    draw = FORMS[form][effect]
    make, typical, largest = _single_jump(rng, trials) if draw is _single_jump else draw(rng)
    return Dose(make, typical, largest, lambda specimen, it: specimen.with_effect(effect, it))


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


# --- the drive ----------------------------------------------------------------------------------


def _supply_droop(rng: np.random.Generator) -> _Drawn:
    recovery_s = rng.uniform(1.2, 4.0)
    return lambda x: pump.SupplyDroop(x, recovery_s), 0.08, 0.5


def _slew_limit(rng: np.random.Generator) -> _Drawn:
    band_kpa = rng.uniform(1.5, 4.0)  # within which the motor slows down
    return lambda x: pump.SlewLimit(1.0 / x, max(band_kpa * x, 0.005)), 1 / 200.0, 1 / 8.0


# --- the actuator -------------------------------------------------------------------------------


def _stiffening(_: np.random.Generator) -> _Drawn:
    # The amplitude is the relative excess of stiffness that the squared angle makes at 60°.
    return lambda x: first.Stiffening(60.0 / float(np.sqrt(x))), 0.06, 0.8


def _gravity_load(rng: np.random.Generator) -> _Drawn:
    mounting_deg = rng.uniform(0.0, 90.0)
    return lambda x: first.GravityLoad(x, mounting_deg), 0.05, 1.0


def _contact_stop(rng: np.random.Generator) -> _Drawn:
    angle_deg = rng.uniform(32.0, 45.0)
    return lambda x: first.ContactStop(angle_deg, x), 2.0, 100.0


def _mullins_softening(
    rng: np.random.Generator,
) -> _Drawn:
    span_deg = rng.uniform(65.0, 85.0)
    break_s = _log_uniform(rng, 8.0, 20.0)
    heal_s = _log_uniform(rng, 1e4, 4e4)
    return lambda x: first.MullinsSoftening(x, span_deg, break_s, heal_s), 0.08, 0.8


def _creep(rng: np.random.Generator) -> _Drawn:
    factor = _log_uniform(rng, 0.6, 1.6)
    times_s = (3.0 * factor, 15.0 * factor, 75.0 * factor)
    return lambda x: first.Creep(x, times_s), 0.02, 0.2


def _hysteresis(rng: np.random.Generator) -> _Drawn:
    yield_deg = rng.uniform(12.0, 25.0)
    return lambda x: first.Hysteresis(x, yield_deg), 2.0, 15.0


def _thermal_drift(rng: np.random.Generator) -> _Drawn:
    sign = _sign(rng)
    return lambda x: first.ThermalDrift(float(np.expm1(sign * x))), 0.1, 1.0


def _parameter_shift(rng: np.random.Generator) -> _Drawn:
    # Another casting: mostly stiffness and gain, the orders hardly.
    return _along(rng.standard_normal(5) * [0.1, 0.1, 0.6, 0.7, 0.7])


def _along(direction: Array) -> _Drawn:
    """Shift (alpha2, alpha1, a1, a0, b0) along a direction of their logarithms."""
    unit = direction / np.linalg.norm(direction)
    # Keeps 1 < alpha1 < alpha2 < 2 for every core that is drawn: what is left of the way between
    # the orders, down to 1 and up to 2.
    rises = np.array([unit[1] - unit[0], -unit[1], unit[0]])
    room = np.array([0.045, 0.08, 0.25])
    largest = min(0.5, float(np.min(room / np.maximum(rises, 1e-9))))
    return lambda x: act.ParameterShift(*np.exp(x * unit).tolist()), min(0.1, largest), largest


# --- the sensor ---------------------------------------------------------------------------------


def _sensor_nonlinearity(
    rng: np.random.Generator,
) -> _Drawn:
    sign, period_deg = _sign(rng), rng.uniform(60.0, 90.0)
    # Beyond a quarter of the period the reading would no longer rise with the angle.
    return lambda x: flex.SensorNonlinearity(sign * x, period_deg), 3.0, 0.25 * period_deg


def _sensor_saturation(
    rng: np.random.Generator,
) -> _Drawn:
    knee_deg = rng.uniform(1.5, 4.0)
    return lambda x: flex.SensorSaturation(75.0 - x, knee_deg), 20.0, 55.0


def _sensor_creep(rng: np.random.Generator) -> _Drawn:
    times_s = (_log_uniform(rng, 1.5, 3.0), _log_uniform(rng, 15.0, 40.0))
    return lambda x: flex.SensorCreep(x, times_s), 0.02, 0.25


def _sensor_slip(rng: np.random.Generator) -> _Drawn:
    sign, share = _sign(rng), rng.uniform(0.5, 2.0)
    return lambda x: flex.SensorSlip(sign * x, share * x), 0.1, 5.0


# --- the log ------------------------------------------------------------------------------------


def _mains_pickup(rng: np.random.Generator) -> _Drawn:
    off_hz = _sign(rng) * _log_uniform(rng, 0.02, 0.3)
    third = rng.uniform(0.0, 0.3)
    return lambda x: conv.MainsPickup(x, 50.0 + off_hz, third), 0.02, 0.15


# --- second forms -------------------------------------------------------------------------------


def _reservoir_droop(rng: np.random.Generator) -> _Drawn:
    times_s = (_log_uniform(rng, 0.4, 1.0), _log_uniform(rng, 3.0, 8.0))
    fast_share, fill_s = rng.uniform(0.3, 0.7), rng.uniform(0.05, 0.15)
    return lambda x: second.ReservoirDroop(x, times_s, fast_share, fill_s), 0.08, 0.7


def _regulated_leak(rng: np.random.Generator) -> _Drawn:
    make_up_s = _log_uniform(rng, 8.0, 25.0)
    return lambda x: second.RegulatedLeak(x, make_up_s), 0.3, 10.0


def _two_rate_slew(rng: np.random.Generator) -> _Drawn:
    ratio = _log_uniform(rng, 1.25, 2.0) ** _sign(rng)
    return lambda x: second.TwoRateSlew(1.0 / x, ratio / x), 1 / 200.0, 1 / 8.0


def _fung_stiffening(_: np.random.Generator) -> _Drawn:
    return moments.FungStiffening, 0.1, 2.0


def _own_weight(rng: np.random.Generator) -> _Drawn:
    mounting_deg = rng.uniform(0.0, 60.0)
    return lambda x: moments.OwnWeight(x, mounting_deg), 0.1, 3.0


def _foam_pad(rng: np.random.Generator) -> _Drawn:
    angle_deg, toe_deg = rng.uniform(32.0, 45.0), rng.uniform(1.0, 4.0)
    return lambda x: moments.FoamPad(angle_deg, x, toe_deg), 0.2, 50.0


def _cycle_softening(rng: np.random.Generator) -> _Drawn:
    cycles, heal_s = rng.uniform(1.0, 3.0), _log_uniform(rng, 1e4, 4e4)
    return lambda x: moments.CycleSoftening(x, cycles, heal_s), 0.1, 2.0


def _power_creep(rng: np.random.Generator) -> _Drawn:
    exponent = rng.uniform(0.0, 0.35)
    return lambda x: second.PowerCreep(x, exponent), 0.06, 0.5


def _stop_hysteresis(rng: np.random.Generator) -> _Drawn:
    yield_deg = rng.uniform(8.0, 18.0)
    return lambda x: moments.StopHysteresis(x, yield_deg), 2.0, 15.0


def _warming(rng: np.random.Generator) -> _Drawn:
    sign, time_s = _sign(rng), _log_uniform(rng, 4500.0, 12000.0)
    return lambda x: second.Warming(sign * x, time_s), 0.3, 0.9 if sign < 0 else 3.0


def _slower_casting(rng: np.random.Generator) -> _Drawn:
    # Mostly the orders and the damping: another rate rather than another gain.
    return _along(rng.standard_normal(5) * [0.12, 0.12, 1.0, 0.4, 0.4])


def _curve_change(rng: np.random.Generator) -> _Drawn:
    sign = _sign(rng)
    return lambda x: second.CurveChange(sign * x), 3.0, 15.0


def _tanh_saturation(rng: np.random.Generator) -> _Drawn:
    knee_deg = rng.uniform(8.0, 18.0)
    return lambda x: second.TanhSaturation(85.0 - x, knee_deg), 25.0, 60.0


def _duhem_reading(rng: np.random.Generator) -> _Drawn:
    turn_deg = rng.uniform(8.0, 16.0)
    # A wider loop than this would make the reading turn against the angle.
    return lambda x: second.DuhemReading(x, turn_deg), 2.0, turn_deg


def _single_jump(rng: np.random.Generator, trials: int = 14) -> _Drawn:
    # Early in a campaign or late, but rather not at its ends.
    sign, before_trial = _sign(rng), round(1 + (trials - 1) * rng.uniform(0.25, 0.8))
    return lambda x: second.SingleJump(sign * x, before_trial), 1.5, 15.0


def _beating_pickup(rng: np.random.Generator) -> _Drawn:
    mains_hz = float(rng.choice([49.9, 60.0]) + rng.uniform(-0.05, 0.05))
    depth, beat_s = rng.uniform(0.3, 0.6), rng.uniform(6.0, 20.0)
    return lambda x: second.BeatingPickup(x, mains_hz, depth, beat_s), 0.02, 0.15


FORMS: Mapping[str, Mapping[str, _Form]] = {
    "a": {
        "dead_time": lambda _: (pump.DeadTime, 0.08, 1.0),
        "line_lag": lambda _: (pump.LineLag, 0.15, 1.5),
        "supply_droop": _supply_droop,
        "leak": lambda _: (pump.Leak, 0.004, 0.1),
        "slew_limit": _slew_limit,
        "drive_backlash": lambda _: (pump.DriveBacklash, 2.0, 20.0),
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
        "sensor_lag": lambda _: (flex.SensorLag, 0.1, 1.5),
        "sensor_creep": _sensor_creep,
        "sensor_hysteresis": lambda _: (flex.SensorHysteresis, 2.0, 20.0),
        "sensor_slip": _sensor_slip,
        "channel_latency": lambda _: (conv.ChannelLatency, 0.06, 1.0),
        "mains_pickup": _mains_pickup,
    },
    "b": {
        "dead_time": lambda _: (second.PolledCommand, 0.08, 1.0),
        "line_lag": lambda _: (second.DistributedLine, 0.15, 1.5),
        "supply_droop": _reservoir_droop,
        "leak": _regulated_leak,
        "slew_limit": _two_rate_slew,
        "drive_backlash": lambda _: (second.SmoothPlay, 2.0, 20.0),
        "stiffening": _fung_stiffening,
        "gravity_load": _own_weight,
        "contact_stop": _foam_pad,
        "mullins_softening": _cycle_softening,
        "creep": _power_creep,
        "hysteresis": _stop_hysteresis,
        "thermal_drift": _warming,
        "parameter_shift": _slower_casting,
        "sensor_nonlinearity": _curve_change,
        "sensor_saturation": _tanh_saturation,
        "sensor_lag": lambda _: (pump.LowPass, 0.1, 1.5),
        "sensor_creep": lambda _: (second.LogSensorCreep, 0.03, 0.5),
        "sensor_hysteresis": _duhem_reading,
        "sensor_slip": _single_jump,
        "channel_latency": lambda _: (second.MovingAverage, 0.06, 1.0),
        "mains_pickup": _beating_pickup,
    },
}
