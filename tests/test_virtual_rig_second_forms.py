"""The second forms of the effects, and the aliens: each against its own definition."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from blind.first_rig import foreign_effects as alien
from blind.first_rig.doses import FORMS, draw_dose
from spa_fo.virtual_rig import actuator as act
from spa_fo.virtual_rig import flex_sensor as flex
from spa_fo.virtual_rig import second_forms as second
from spa_fo.virtual_rig import second_moments as moments
from spa_fo.virtual_rig.actuators import DRAGON_SKIN_20_CORE as CORE
from spa_fo.virtual_rig.actuators import REFERENCE_KPA
from spa_fo.virtual_rig.bench import Bench, Specimen
from spa_fo.virtual_rig.syringe_pump import SyringePump

STEP_S = 1e-3
HELD = np.full(30_000, 50.0)
UP_DOWN = np.repeat([0.0, 50.0, 0.0], [200, 10_000, 20_000])


def angle_of(pressure_kpa=HELD, **effect):
    return act.SoftActuator(CORE, REFERENCE_KPA, **effect).begin(STEP_S)(pressure_kpa)


def specimen() -> Specimen:
    return Specimen(SyringePump(), act.SoftActuator(CORE, REFERENCE_KPA))


# --- all of them --------------------------------------------------------------------------------

PROCESSES = [
    second.PolledCommand(0.0837),
    second.DistributedLine(0.2),
    second.ReservoirDroop(0.1),
    second.TwoRateSlew(60.0, 40.0),
    second.SmoothPlay(2.0),
    second.RegulatedLeak(0.5),
    second.LogSensorCreep(0.03),
    second.DuhemReading(3.0),
    second.MovingAverage(0.0533),
    alien.CrackingPressure(2.0),
    alien.SlowExhaust(0.4),
    alien.PumpRipple(3.0),
    alien.SnapThrough(0.1, 25.0, 15.0),
    alien.GainWander(0.05),
]


@pytest.mark.parametrize("effect", PROCESSES, ids=lambda effect: type(effect).__name__)
def test_a_signal_in_pieces_gives_the_same(effect):
    signal = np.repeat([0.0, 40.0, 20.0, 55.0, 0.0], [150, 300, 250, 200, 400])
    whole = effect.begin(STEP_S)(signal)
    run = effect.begin(STEP_S)
    pieces = [run(piece) for piece in np.split(signal, [1, 2, 60, 151, 700, 1290])]
    np.testing.assert_allclose(np.concatenate(pieces), whole, atol=1e-9)
    assert np.abs(whole - signal).max() > 0.1


def test_there_are_two_forms_of_every_effect():
    names = set(specimen().effects())
    rng = np.random.default_rng(0)
    for form in ("a", "b"):
        assert set(FORMS[form]) == names
    for name in names:
        made = [draw_dose(name, form, rng, 14).make(0.04) for form in ("a", "b")]
        # Another specimen is another specimen; all others differ in kind.
        assert (type(made[0]) is type(made[1])) is (name == "parameter_shift")


# --- the drive ----------------------------------------------------------------------------------


def test_a_polled_command_is_late_by_its_delay_on_average():
    delays = []
    for start in range(1, 300, 7):
        signal = np.zeros(1000)
        signal[start:] = 1.0
        out = second.PolledCommand(0.1).begin(STEP_S)(signal)
        delays.append((np.argmax(out > 0.5) - start) * STEP_S)
    assert np.mean(delays) == pytest.approx(0.1, abs=0.004)
    assert min(delays) >= 0.069
    assert max(delays) <= 0.131
    assert np.ptp(delays) > 0.04


def test_the_distributed_line_has_its_time_constant_and_begins_flat():
    out = second.DistributedLine(0.2).begin(STEP_S)(HELD)
    assert np.sum(50.0 - out) * STEP_S / 50.0 == pytest.approx(0.2, abs=0.002)
    assert out[1] < 0.01 * 50.0 * STEP_S / 0.2 * 10


def test_the_reservoir_sags_after_the_rise_and_recovers_at_two_rates():
    out = second.ReservoirDroop(0.1, (0.5, 5.0), 0.5).begin(STEP_S)(HELD)
    missing = 50.0 - out
    assert missing[0] < 0.1  # nothing has flowed yet
    assert 3.0 < missing.max() < 5.0
    assert missing[5000] == pytest.approx(2.5 * np.exp(-1.0), rel=0.05)
    assert missing[-1] < 0.01


def test_the_slew_has_a_rate_for_either_direction():
    rates = np.diff(second.TwoRateSlew(60.0, 40.0).begin(STEP_S)(UP_DOWN)) / STEP_S
    assert rates.max() == pytest.approx(60.0)
    assert rates.min() == pytest.approx(-40.0)


def test_smooth_play_waits_after_each_reversal_and_loses_its_width():
    rise, fall = np.linspace(0.0, 50.0, 5001), np.linspace(50.0, 0.0, 5001)
    run = second.SmoothPlay(2.0).begin(STEP_S)
    up, down = run(rise), run(fall)
    assert up[-1] == pytest.approx(48.0, abs=0.01)
    assert up[-1] - down[20] < 0.05 * (fall[0] - fall[20]) + 0.05
    assert down[4000] == pytest.approx(fall[4000], abs=0.02)


def test_the_regulated_leak_falls_to_its_floor():
    out = second.RegulatedLeak(0.5, 5.0).begin(STEP_S)(np.full(60_000, 50.0))
    assert np.all(np.diff(out) <= 1e-12)
    assert 50.0 - out[-1] == pytest.approx(0.5 * 5.0 * np.sqrt(out[-1] / 30.0), rel=1e-3)


# --- the actuator -------------------------------------------------------------------------------

MOMENTS = {
    "fung": moments.FungStiffening(0.4),
    "weight": moments.OwnWeight(0.3, 40.0),
    "pad": moments.FoamPad(35.0, 0.5, 2.0),
    "wear": moments.CycleSoftening(0.2),
    "stops": moments.StopHysteresis(2.0, 12.0),
}


@pytest.mark.parametrize("name", MOMENTS)
@pytest.mark.parametrize("angle_deg", [-4.0, 3.0, 33.0, 47.0, 61.0])
def test_the_slope_of_a_moment_is_its_derivative(name, angle_deg):
    sizes, state = moments.second_moment([MOMENTS[name]]), moments.second_state()
    angle, moved, by = np.deg2rad(angle_deg), 0.02, 1e-6
    _, slope = moments.restoring_besides(angle, moved, sizes, state)
    above, _ = moments.restoring_besides(angle + by, moved + by, sizes, state)
    below, _ = moments.restoring_besides(angle - by, moved - by, sizes, state)
    assert slope == pytest.approx((above - below) / (2 * by), abs=1e-5)


def test_the_own_weight_is_its_integral():
    psi, theta = np.deg2rad(40.0), np.deg2rad(55.0)
    expected, _ = quad(
        lambda s: 6 * s * (1 - s) * (np.sin(psi + theta * s) - np.sin(psi)), 0.0, 1.0
    )
    sizes = moments.second_moment([moments.OwnWeight(0.3, 40.0)])
    moment, _ = moments.restoring_besides(theta, 0.0, sizes, moments.second_state())
    assert moment == pytest.approx(0.3 * expected, rel=1e-6)


def test_the_exponential_tissue_settles_where_its_moment_balances():
    angle = np.deg2rad(angle_of(stiffening=moments.FungStiffening(0.3))[-1])
    plain = np.deg2rad(angle_of()[-1])
    assert np.expm1(0.3 * angle) / 0.3 == pytest.approx(plain, rel=3e-3)


def test_the_pad_acts_beyond_its_angle_only():
    pad = moments.FoamPad(35.0, 1.0, 1.0)
    low, high = np.full(20_000, 15.0), np.full(20_000, 55.0)
    assert angle_of(low, contact_stop=pad)[-1] == pytest.approx(angle_of(low)[-1], abs=0.01)
    assert angle_of(high, contact_stop=pad)[-1] < angle_of(high)[-1] - 5.0


def test_softening_counts_loadings_level_by_level():
    effect = moments.CycleSoftening(0.2, cycles=2.0)
    run = act.SoftActuator(CORE, REFERENCE_KPA, mullins_softening=effect).begin(STEP_S)
    small = np.repeat([20.0, 0.0], [10_000, 60_000])
    large = np.repeat([50.0, 0.0], [10_000, 60_000])
    lows = [run(small)[9_999] for _ in range(5)]
    assert np.all(np.diff(lows) > 0)
    assert lows[4] - lows[3] < 0.3 * (lows[1] - lows[0])
    # Levels beyond the small loadings are still virgin.
    highs = [run(large)[9_999] for _ in range(2)]
    assert highs[1] - highs[0] > 2.0 * (lows[4] - lows[3])


def test_power_creep_is_its_share_after_a_minute_and_goes_on():
    held = np.full(300_000, 50.0)
    extra = angle_of(held, creep=second.PowerCreep(0.05, 0.2)) - angle_of(held)
    settled = np.rad2deg(CORE.gain * 50.0 / REFERENCE_KPA)
    assert extra[60_000] / settled == pytest.approx(0.05, rel=0.01)
    assert extra[-1] > 1.2 * extra[60_000]


def test_the_stops_leave_a_remnant_and_a_loop():
    effect = moments.StopHysteresis(2.0, 10.0)
    remnant = angle_of(UP_DOWN, hysteresis=effect) - angle_of(UP_DOWN)
    assert remnant[-1] > 0.5
    ramp = np.linspace(0.0, 55.0, 20_000)
    withheld = angle_of(ramp) - angle_of(ramp, hysteresis=effect)
    assert withheld[-1] == pytest.approx(2.0, abs=0.05)  # every stop yields


def test_warming_settles():
    gain = second.Warming(-0.2, 5000.0).gain(np.array([0.0, 5000.0, 1e6]))
    np.testing.assert_allclose(gain, [1.0, 1.0 - 0.2 * (1 - np.exp(-1.0)), 0.8])


# --- sensor and board ---------------------------------------------------------------------------


def test_a_changed_curve_shows_in_the_later_calibration_only():
    sensor = flex.FlexSensor(sensor_nonlinearity=second.CurveChange(3.0)).begin(STEP_S)
    at_60 = np.array([60.0])
    volts = flex.DividerCurve().volts
    np.testing.assert_allclose(sensor.in_fixture(at_60), volts(at_60))
    sensor.mount(0.0, 0.0)
    np.testing.assert_allclose(sensor(at_60), volts(np.array([63.0])))
    np.testing.assert_allclose(sensor.in_fixture(at_60), volts(np.array([63.0])))


def test_the_tanh_ceiling_is_smooth_and_never_passed():
    felt = second.TanhSaturation(60.0, 15.0).felt(np.linspace(0.0, 90.0, 901))
    assert np.all(np.diff(felt) > 0)
    assert felt[400] == 40.0
    assert felt.max() < 60.0
    assert np.abs(np.diff(felt, 2)).max() < 1e-3


def test_the_reading_creeps_by_the_logarithm_of_time():
    out = second.LogSensorCreep(0.03).begin(STEP_S)(np.full(300_000, 50.0))
    decade = (out[100_000] - out[10_000]) / 50.0
    assert decade == pytest.approx(0.03, rel=0.1)


def test_the_duhem_reading_lags_half_its_width_either_way():
    rise, fall = np.linspace(0.0, 80.0, 8001), np.linspace(80.0, 0.0, 8001)
    run = second.DuhemReading(3.0, 8.0).begin(STEP_S)
    up, down = run(rise), run(fall)
    assert rise[-1] - up[-1] == pytest.approx(1.5, abs=0.01)
    assert down[7000] - fall[7000] == pytest.approx(1.5, abs=0.01)
    assert np.all(np.diff(down) <= 1e-12)


def test_the_sensor_jumps_once():
    slip = second.SingleJump(2.0, before_trial=3)
    assert [slip.shift_deg(trial, 0.7) for trial in range(1, 6)] == [0, 0, 2.0, 0, 0]


def test_a_moving_average_delays_a_ramp_by_half_its_window():
    ramp = np.arange(1000.0)
    out = second.MovingAverage(0.0533).begin(STEP_S)(ramp)
    # The window holds the present step, which half a step makes up for.
    np.testing.assert_allclose((ramp - out)[200:], 53.3 - 0.5, atol=0.05)


def test_the_pickup_beats():
    volts = second.BeatingPickup(0.02, 60.0, 0.5, 10.0).volts(np.arange(10_000) / 1000.0)
    thirds = volts[2400:2600], volts[7400:7600]
    assert [part.max() for part in thirds] == pytest.approx([0.03, 0.01], rel=0.01)


# --- aliens -------------------------------------------------------------------------------------


def test_every_alien_has_its_place_and_is_felt():
    command = np.repeat([0.0, 55.0, 0.0], [20, 400, 200])

    def read(it):
        bench = Bench(it, 50, 0.0)
        bench.begin_trial(np.random.default_rng(0))
        return bench.drive_exactly(command)

    _, pressure, volts = read(specimen())
    for name, known in alien.FOREIGN_EFFECTS.items():
        make, typical, largest = known.draw(np.random.default_rng(1))
        assert 0 < typical < largest
        given = alien.place(specimen(), make(typical))
        assert given.effects() == specimen().effects()  # none of them is the library's
        _, changed_pressure, changed = read(given)
        assert np.abs(changed - volts).max() > 0.005, name
        drives = name in ("valve_cracking", "slow_exhaust", "pump_ripple")
        assert np.array_equal(changed_pressure, pressure) is not drives
    with pytest.raises(TypeError):
        alien.place(specimen(), object())


def test_aliens_do_what_their_names_say():
    assert alien.CrackingPressure(2.0).begin(STEP_S)(HELD)[0] == 48.0
    vented = alien.SlowExhaust(0.5).begin(STEP_S)(UP_DOWN)
    np.testing.assert_array_equal(vented[:10_200], UP_DOWN[:10_200])
    assert vented[10_700] == pytest.approx(50.0 / np.e, rel=0.01)
    snapped = alien.SnapThrough(0.1, 25.0, 15.0).begin(STEP_S)
    levels = [snapped(np.full(1000, kpa))[-1] / kpa for kpa in (20.0, 30.0, 20.0, 10.0, 20.0)]
    np.testing.assert_allclose(levels, [1.0, 1.1, 1.1, 1.0, 1.0], atol=1e-6)
    dragged = angle_of(drag=0.5)
    assert dragged[400] < angle_of()[400] - 1.0
    assert dragged[-1] == pytest.approx(angle_of()[-1], abs=0.2)
    sag = alien.ReferenceSag(0.2).begin(STEP_S)(HELD, np.linspace(0.0, 50.0, 30_000))
    assert sag[-1] == pytest.approx(-0.2 * 50.0 / 30.0, rel=0.01)
    assert alien.CommandCrosstalk(0.1).begin(STEP_S)(HELD, HELD)[0] == pytest.approx(5.0)
    wander = alien.GainWander(0.05).begin(STEP_S)(np.ones(600_000)) - 1.0
    assert wander.std() == pytest.approx(0.05, rel=0.15)
