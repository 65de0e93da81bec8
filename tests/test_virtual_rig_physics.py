"""The virtual actuator: its solver against independent references, each effect against its word."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import naive_virtual_rig as naive
from spa_fo.virtual_rig import actuator as act
from spa_fo.virtual_rig import converter as conv
from spa_fo.virtual_rig import first_forms as first
from spa_fo.virtual_rig import flex_sensor as flex
from spa_fo.virtual_rig import syringe_pump as pump
from spa_fo.virtual_rig.actuators import DRAGON_SKIN_20_CORE, FX_PRO_CORE, PLANS, REFERENCE_KPA
from spa_fo.virtual_rig.bench import Bench, Scatter, Specimen

STEP_S = 1e-3
CORES = {"DS20": DRAGON_SKIN_20_CORE, "FX-Pro": FX_PRO_CORE}
UP = np.repeat([0.0, 50.0, 0.0], [200, 6000, 6000])

# The effects a diagnosis may name, by the stage that they belong to.
EFFECTS = {
    "pump": "dead_time line_lag supply_droop leak slew_limit drive_backlash",
    "actuator": "stiffening gravity_load contact_stop mullins_softening creep hysteresis "
    "thermal_drift parameter_shift",
    "sensor": "sensor_nonlinearity sensor_saturation sensor_lag sensor_creep sensor_hysteresis "
    "sensor_slip",
    "acquisition": "channel_latency mains_pickup",
}
# One typical size of each, as objects.
TYPICAL = {
    "dead_time": pump.DeadTime(0.08),
    "line_lag": pump.LineLag(0.15),
    "supply_droop": pump.SupplyDroop(0.08),
    "leak": pump.Leak(0.004),
    "slew_limit": pump.SlewLimit(60.0),
    "drive_backlash": pump.DriveBacklash(2.0),
    "stiffening": first.Stiffening(250.0),
    "gravity_load": first.GravityLoad(0.05),
    "contact_stop": first.ContactStop(50.0, 5.0),
    "mullins_softening": first.MullinsSoftening(0.08),
    "creep": first.Creep(0.02),
    "hysteresis": first.Hysteresis(2.0),
    "thermal_drift": first.ThermalDrift(0.1),
    "parameter_shift": act.ParameterShift(a0=1.1, b0=1.05),
    "sensor_nonlinearity": flex.SensorNonlinearity(3.0),
    "sensor_saturation": flex.SensorSaturation(50.0),
    "sensor_lag": flex.SensorLag(0.1),
    "sensor_creep": flex.SensorCreep(0.02),
    "sensor_hysteresis": flex.SensorHysteresis(2.0),
    "sensor_slip": flex.SensorSlip(1.5, 0.5),
    "channel_latency": conv.ChannelLatency(0.06),
    "mains_pickup": conv.MainsPickup(0.02),
}


def bare(core=DRAGON_SKIN_20_CORE) -> Specimen:
    """Nothing but the core, read by noiseless 20-bit converters."""
    fine = conv.Acquisition(converter=conv.Converter(bits=20, noise_counts=0.0))
    return Specimen(pump.SyringePump(), act.SoftActuator(core, REFERENCE_KPA), acquisition=fine)


def angle_of(actuator: act.SoftActuator, pressure_kpa=UP):
    return actuator.begin(STEP_S)(pressure_kpa)


def with_effect(**effect):
    return act.SoftActuator(DRAGON_SKIN_20_CORE, REFERENCE_KPA, **effect)


# --- the core -----------------------------------------------------------------------------------


@pytest.mark.parametrize("row", ["DS20", "FX-Pro"])
def test_the_bare_core_is_the_golden_step_response(golden_step, row):
    core = CORES[row]
    run = act.SoftActuator(core, 1.0).begin(STEP_S)
    response = np.deg2rad(run(np.ones(100_000)))
    for time, golden in golden_step[row].items():
        at = response[round(float(time) / STEP_S) - 1]
        assert at == pytest.approx(float(golden), abs=5e-4 * core.gain)


def test_a_finer_step_comes_closer_to_the_golden_step_response(golden_step):
    golden = golden_step["DS20"]
    times = [time for time in golden if float(time) <= 10]

    def error(step_s):
        run = act.SoftActuator(DRAGON_SKIN_20_CORE, 1.0).begin(step_s)
        response = np.deg2rad(run(np.ones(round(10 / step_s))))
        return max(abs(response[round(float(t) / step_s) - 1] - float(golden[t])) for t in times)

    coarse, fine = error(1e-3), error(2.5e-4)
    assert fine < 0.35 * coarse


@pytest.mark.parametrize(
    ("effect", "moment"),
    [
        ({}, lambda x, _: x),
        (
            {"stiffening": first.Stiffening(120.0)},
            lambda x, _: x / (1 - (x / np.deg2rad(120)) ** 2),
        ),
        (
            {"gravity_load": first.GravityLoad(0.2, 30.0)},
            lambda x, _: x + 0.2 * (np.cos(np.pi / 6) - np.cos(np.pi / 6 + x)),
        ),
        (
            {"contact_stop": first.ContactStop(40.0, 6.0)},
            lambda x, _: x + 6.0 * max(x - np.deg2rad(40), 0.0) ** 1.5,
        ),
    ],
    ids=["linear", "stiffening", "gravity", "contact"],
)
def test_the_actuator_agrees_with_a_grunwald_letnikov_twin(effect, moment):
    core, step_s = DRAGON_SKIN_20_CORE, 0.005
    pressure = np.repeat([55.0, 0.0], [600, 200])
    twin = naive.fractional_actuator(
        core.b0 * pressure / REFERENCE_KPA,
        step_s,
        (core.alpha2, core.alpha1),
        (1.0, core.a1),
        lambda x, before: core.a0 * moment(x, before),
    )
    fast = angle_of(with_effect(**effect), np.repeat(pressure, 5))[4::5]
    np.testing.assert_allclose(fast, np.rad2deg(twin), atol=0.5)


def test_friction_agrees_with_a_grunwald_letnikov_twin():
    core, step_s = DRAGON_SKIN_20_CORE, 0.005
    half_height, yields = np.deg2rad(3.0), np.deg2rad(6.0)
    pressure = np.repeat([55.0, 0.0], [600, 200])
    friction = {"z": 0.0, "at": 0.0}

    def moment(x, before):
        if before != friction["at"]:  # the last step is settled: keep what it left behind
            moved = (before - friction["at"]) / yields
            friction.update(z=(friction["z"] + moved) / (1 + abs(moved)), at=before)
        moved = (x - before) / yields
        return core.a0 * (x + half_height * (friction["z"] + moved) / (1 + abs(moved)))

    load = core.b0 * pressure / REFERENCE_KPA
    twin = naive.fractional_actuator(
        load, step_s, (core.alpha2, core.alpha1), (1.0, core.a1), moment
    )
    fast = angle_of(with_effect(hysteresis=first.Hysteresis(3.0, 6.0)), np.repeat(pressure, 5))
    np.testing.assert_allclose(fast[4::5], np.rad2deg(twin), atol=0.5)


def test_a_core_outside_its_range_is_refused():
    with pytest.raises(ValueError, match="alpha1"):
        act.FractionalCore(1.2, 1.4, 1.0, 1.0, 1.0)


@settings(max_examples=25, deadline=None)
@given(
    low=st.floats(0.0, 60.0),
    more=st.floats(0.5, 30.0),
    name=st.sampled_from([n for n in EFFECTS["actuator"].split() if n != "parameter_shift"]),
)
def test_more_pressure_bends_more(low, more, name):
    actuator = with_effect(**{name: TYPICAL[name]})
    pressed = np.ones(1500)
    angle, larger = angle_of(actuator, low * pressed), angle_of(actuator, (low + more) * pressed)
    assert np.all(larger > angle)


@settings(max_examples=20, deadline=None)
@given(cut=st.integers(1, 799))
def test_stretches_join_without_a_seam(cut):
    specimen = Specimen(
        pump.SyringePump(**{n: TYPICAL[n] for n in EFFECTS["pump"].split()}),
        with_effect(**{n: TYPICAL[n] for n in EFFECTS["actuator"].split()}),
        flex.FlexSensor(**{n: TYPICAL[n] for n in EFFECTS["sensor"].split()}),
        replace(bare().acquisition, **{n: TYPICAL[n] for n in EFFECTS["acquisition"].split()}),
    )
    command = np.repeat([0.0, 40.0, 0.0], [20, 400, 380])
    rng = np.random.default_rng(0)
    whole = Bench(specimen, 50, 0.0).drive(command, rng)
    bench = Bench(specimen, 50, 0.0)
    parts = [bench.drive(command[:cut], rng), bench.drive(command[cut:], rng)]
    for joined, expected in zip(zip(*parts, strict=True), whole, strict=True):
        np.testing.assert_allclose(np.concatenate(joined), expected, atol=1)


def test_a_resting_actuator_reads_zero_angle():
    bench = Bench(bare(), 50, 0.0)
    _, pressure, angle = bench.drive(np.zeros(50), np.random.default_rng(0))
    flat = flex.DividerCurve().volts(np.zeros(1))[0] / 5.0 * (2**20 - 1)
    assert np.all(angle == round(flat))
    assert np.all(pressure == round(0.1 * (2**20 - 1)))


# --- effects of the drive -----------------------------------------------------------------------

SIGNAL = st.lists(st.floats(0.0, 100.0), min_size=1, max_size=60).map(np.array)


@settings(max_examples=50, deadline=None)
@given(signal=SIGNAL)
def test_pump_kernels_agree_with_their_twins(signal):
    twins = [
        (pump.DriveBacklash(3.0), naive.play(signal, 3.0)),
        (pump.SlewLimit(40.0, 0.05), naive.slew(signal, 40.0, 0.05, STEP_S)),
        (pump.SupplyDroop(0.1, 2.0), naive.droop(signal, 0.1, 2.0, STEP_S)),
        (pump.Leak(0.02), naive.leak(signal, 0.02, STEP_S)),
    ]
    for effect, expected in twins:
        np.testing.assert_allclose(effect.begin(STEP_S)(signal), expected, atol=1e-10)


@settings(max_examples=50, deadline=None)
@given(signal=SIGNAL, name=st.sampled_from(EFFECTS["pump"].split()))
def test_the_pump_gives_no_more_than_commanded_and_no_vacuum(signal, name):
    pressure = TYPICAL[name].begin(STEP_S)(signal)
    assert np.all(pressure >= -1e-12)
    assert pressure.max() <= signal.max() + 1e-12


def test_pump_effects_do_what_their_names_say():
    rise = np.full(8000, 50.0)
    assert np.argmax(pump.DeadTime(0.08).begin(STEP_S)(rise) > 0) == 80
    assert np.diff(pump.SlewLimit(60.0).begin(STEP_S)(rise)).max() <= 60.0 * STEP_S + 1e-12
    droop = pump.SupplyDroop(0.08, 2.0).begin(STEP_S)(rise)
    assert droop[0] == pytest.approx(46.0, abs=0.01)
    assert droop[2000] == pytest.approx(50.0 - 4.0 / np.e, abs=0.01)
    leaking = pump.Leak(0.01).begin(STEP_S)(rise)
    assert leaking[-1] == pytest.approx(50.0 * np.exp(-0.08), abs=0.01)
    lagging = pump.LineLag(0.2).begin(STEP_S)(rise)
    assert np.sum(50.0 - lagging) * STEP_S / 50.0 == pytest.approx(0.2, abs=0.001)
    waiting = pump.DriveBacklash(2.0).begin(STEP_S)(np.array([50.0, 49.0, 48.0, 47.0]))
    np.testing.assert_allclose(waiting, [48.0, 48.0, 48.0, 47.0])


# --- effects of the actuator --------------------------------------------------------------------


def test_the_stiffened_actuator_bends_less_and_proportionally_less_at_large_angles():
    stiff = with_effect(stiffening=first.Stiffening(200.0))
    share = [
        angle_of(stiff, np.full(20_000, kpa))[-1]
        / angle_of(with_effect(), np.full(20_000, kpa))[-1]
        for kpa in (20.0, 55.0)
    ]
    assert 0.8 < share[1] < share[0] < 1.0


def test_softening_makes_later_loadings_larger_and_saturates():
    run = with_effect(mullins_softening=first.MullinsSoftening(0.08)).begin(STEP_S)
    load = np.repeat([50.0, 0.0], [10_000, 60_000])
    reached = [run(load)[9_999] for _ in range(6)]
    gains = np.diff(reached)
    assert np.all(gains > 0)
    assert gains[-1] < 0.25 * gains[0]


def test_creep_goes_on_under_load_and_recovers_at_rest():
    run = with_effect(creep=first.Creep(0.02)).begin(STEP_S)
    held = run(np.full(120_000, 50.0))
    assert held[-1] > held[30_000] + 0.3
    rested = run(np.zeros(600_000))
    assert rested[30_000] > 0.3
    assert abs(rested[-1]) < 0.05


def test_friction_leaves_a_remnant_angle():
    vented = np.repeat([50.0, 0.0], [10_000, 60_000])
    remnant = angle_of(with_effect(hysteresis=first.Hysteresis(2.0)), vented)[-1]
    plain = angle_of(with_effect(), vented)[-1]
    assert remnant - plain > 0.5


def test_drift_grows_with_campaign_time_only():
    actuator = with_effect(thermal_drift=first.ThermalDrift(0.1))
    early = actuator.begin(STEP_S, 0.0)(np.full(20_000, 50.0))[-1]
    late = actuator.begin(STEP_S, 3600.0)(np.full(20_000, 50.0))[-1]
    assert late / early == pytest.approx(1.1, abs=1e-6)


def test_a_shifted_specimen_is_another_linear_core():
    shifted = with_effect(parameter_shift=act.ParameterShift(b0=1.2))
    np.testing.assert_allclose(angle_of(shifted), 1.2 * angle_of(with_effect()), atol=1e-9)


def test_a_faster_trial_is_the_same_response_in_less_time():
    run = with_effect().begin(STEP_S)
    run.retune(1.0, 1.25)
    fast = run(np.full(4000, 50.0))
    usual = angle_of(with_effect(), np.full(5000, 50.0))
    np.testing.assert_allclose(fast[399::400], usual[499::500], atol=0.05)


# --- effects of the sensor and the board --------------------------------------------------------


@settings(max_examples=50, deadline=None)
@given(signal=SIGNAL)
def test_the_play_stack_agrees_with_its_twin(signal):
    fast = flex.SensorHysteresis(4.0).begin(STEP_S)(signal)
    expected = naive.play_stack(signal, [0.8, 1.6, 2.4, 3.2, 4.0])
    np.testing.assert_allclose(fast, expected, atol=1e-10)


def test_the_divider_voltage_rises_with_the_angle():
    volts = flex.DividerCurve().volts(np.linspace(-20.0, 110.0, 500))
    assert np.all(np.diff(volts) > 0)
    assert volts.min() > 0
    assert volts.max() < 5.0


def test_sensor_effects_do_what_their_names_say():
    held = np.full(60_000, 50.0)
    creeping = flex.SensorCreep(0.02).begin(STEP_S)(held)
    assert creeping[-1] > creeping[5000] > creeping[0]
    lagging = flex.SensorLag(0.1).begin(STEP_S)(held)
    assert np.sum(50.0 - lagging) * STEP_S / 50.0 == pytest.approx(0.1, abs=0.001)
    angles = np.linspace(0.0, 90.0, 91)
    capped = flex.SensorSaturation(60.0, 2.0).felt(angles)
    assert np.all(np.diff(capped) > 0)
    assert capped[-1] <= 60.0
    assert capped[30] == pytest.approx(30.0, abs=1e-3)
    assert flex.SensorNonlinearity(3.0, 70.0).felt(np.array([0.0, 35.0])).tolist() == [0.0, 38.0]
    sensor = flex.FlexSensor(sensor_slip=flex.SensorSlip(1.5)).begin(STEP_S)
    flat = sensor(np.zeros(1))
    sensor.mount(0.0, 0.3)
    sensor.mount(0.0, -2.0)
    np.testing.assert_allclose(sensor(np.zeros(1)), flex.DividerCurve().volts(np.array([3.0])))
    assert sensor(np.zeros(1)) > flat


def test_latency_delays_the_flex_channel_alone():
    command = np.repeat([0.0, 50.0], [10, 100])
    rng = np.random.default_rng(0)
    _, pressure, angle = Bench(bare(), 50, 0.0).drive(command, rng)
    late = bare().with_effect("channel_latency", conv.ChannelLatency(0.06))
    _, same, later = Bench(late, 50, 0.0).drive(command, rng)
    assert np.array_equal(pressure, same)
    assert np.array_equal(later[3:], angle[:-3])


def test_pickup_is_periodic():
    volts = conv.MainsPickup(0.02, 50.0, 0.0).volts(np.arange(100) / 1000.0)
    np.testing.assert_allclose(volts[20:], volts[:-20], atol=1e-9)
    assert volts.max() == pytest.approx(0.02)


@pytest.mark.parametrize("noise", [0.0, 0.6, 2.0])
def test_converter_counts_have_the_ordered_noise(noise):
    converter = conv.Converter(noise_counts=noise)
    volts = np.full(20_000, 2.0) + np.linspace(0, 5.0 / 1023, 20_000)  # over one whole count
    counts = converter.counts(volts, np.random.default_rng(1))
    error = counts - volts / 5.0 * 1023
    assert error.std() == pytest.approx(np.sqrt(noise**2 + 1 / 12), rel=0.03)
    assert abs(error.mean()) < 0.03


def test_converter_clips_at_its_rails():
    rails = conv.Converter().counts(np.array([-1.0, 9.0]), np.random.default_rng(0))
    assert rails.tolist() == [0, 1023]


def test_one_count_of_pressure_is_two_thirds_of_a_kilopascal():
    sensor = conv.PressureSensor()
    assert sensor.volts(np.array([0.0, 551.6])).tolist() == [0.5, 4.5]
    per_count = (5.0 / 1023) / (sensor.volts(np.ones(1)) - sensor.volts(np.zeros(1)))
    assert per_count[0] == pytest.approx(0.674, abs=0.001)


# --- the tree of effects ------------------------------------------------------------------------


def test_every_effect_has_its_place():
    specimen = bare()
    for stage, names in EFFECTS.items():
        for name in names.split():
            changed = specimen.with_effect(name, TYPICAL[name])
            assert getattr(getattr(changed, stage), name) is TYPICAL[name]
            assert changed.with_effect(name, None) == specimen
    assert set(specimen.effects()) == set(" ".join(EFFECTS.values()).split())
    with pytest.raises(KeyError):
        specimen.with_effect("ghost", None)


@pytest.mark.parametrize("name", TYPICAL)
def test_every_effect_changes_what_is_read(name):
    command = np.repeat([0.0, 50.0, 0.0], [20, 300, 200])

    def read(specimen):
        bench = Bench(specimen, 50, 1800.0)
        bench.begin_trial(np.random.default_rng(3))
        return bench.drive(command, np.random.default_rng(0))

    _, pressure, angle = read(bare().with_effect(name, TYPICAL[name]))
    _, plain_pressure, plain_angle = read(bare())
    assert np.ptp(angle - plain_angle) > 0 or np.any(angle != plain_angle)
    drives = name in EFFECTS["pump"].split()
    assert np.array_equal(pressure, plain_pressure) is not drives


def test_trials_scatter_as_ordered():
    specimen = replace(bare(), scatter=Scatter(gain=0.02))
    bench, ends = Bench(specimen, 50, 0.0), []
    rng = np.random.default_rng(5)
    for _ in range(40):
        bench.begin_trial(rng)
        ends.append(bench.drive(np.repeat([50.0, 0.0], [500, 500]), rng)[2][499])
    counts_per_deg = np.diff(flex.DividerCurve().volts(np.array([54.0, 55.0])))[0] / 5.0 * 2**20
    assert np.std(ends) / counts_per_deg == pytest.approx(0.02 * 54.5, rel=0.35)


@pytest.mark.parametrize("name", PLANS)
def test_the_committed_actuators_are_the_papers(name):
    core = PLANS[name].specimen.actuator.core
    gain = {"dragon_skin_20": 0.934 / 1.638, "fx_pro": 0.728 / 2.103}[name]
    assert core.gain == pytest.approx(gain)
    assert any(effect is not None for effect in PLANS[name].specimen.effects().values())
