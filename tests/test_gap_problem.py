"""What calibrations say of an explanation: later ones, and how a fixture came to stand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import campaigns
import naive_rig
from spa_fo.gap.data.evidence import (
    Evidence,
    Foreseen,
    _drifts,
    angle_chain,
    collect,
    with_usual,
)
from spa_fo.gap.data.searched import to_x
from spa_fo.gap.fit.bench import _DELAY, DELAY, DWELL, Bench, _times_foreseen, bench_for, rows_of
from spa_fo.gap.fit.problem import MOSTLY, AngleProblem, Calibrated
from spa_fo.gap.noise.dwell_error import DwellError
from spa_fo.gap.search.fitted import fit, variants
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.branches import came_before
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.plant.fixture import fixture_of
from spa_fo.plant.sensor_curve import curve_columns, curve_sigma
from spa_fo.rig import Calibration, read_campaign, read_trials
from spa_fo.rig.calibration import calibrate, drift
from spa_fo.rig.spa_rig_log import parse_spa_rig_log

GIVEN = np.array([campaigns.TRUTH[name] for name in ("alpha2", "alpha1", "a1", "a0", "b0")])
CEILING_DEG = 25.0
IN_STEP_S = SETTINGS.angle_late_s / _DELAY  # clocks are not in step by a part of it, as delays are
EVEN = {"lens": 0.0, "span_deg": 80.0}  # of a loop that is as wide everywhere


@pytest.fixture(scope="module")
def evidence(tmp_path_factory: pytest.TempPathFactory) -> Evidence:
    """Trials between two calibrations, the later of which reads no more than a ceiling."""
    folder = tmp_path_factory.mktemp("calibrated") / "steps"
    campaigns.step_campaign(folder, trials=2)
    log = parse_spa_rig_log(naive_rig.calibration_log(), "pre.log")
    first = calibrate(log.t_s, log.columns["angle_deg"], log.columns["flex_adc"], "pre.log")
    fixture = fixture_of((first, replace(first, started_s=5000.0)), 1000.0)
    assert fixture is not None
    known_deg = np.unique(fixture.known_deg)
    bare = collect(read_trials(read_campaign(folder)))
    return replace(
        bare,
        fixture=fixture,
        drift_angle_deg=known_deg,
        drift_deg=np.minimum(known_deg, CEILING_DEG) - known_deg,
        drift_sigma_deg=np.full(known_deg.size, 0.1),
        drift_after=np.full(known_deg.size, len(bare.grid.trials)),
    )


def bench_of(evidence: Evidence) -> Bench:
    return bench_for(evidence, GIVEN, own=False, pressure_kpa=None)


def point(problem: AngleProblem, **values: float) -> np.ndarray:
    """The most plausible coefficients, and these parameters."""
    own = [slot.searched(values[slot.parameter.name]) for slot in problem.slots]
    return np.append(problem.bench.centre, own)


def test_a_ceiling_that_came_since_shows_in_a_later_calibration(evidence: Evidence) -> None:
    bench = bench_of(evidence)
    ids = ("sensor_saturation",)
    assert variants(bench, ids) == [MOSTLY, Calibrated(later=True)]
    shown, hidden = (AngleProblem(bench, ids, Calibrated(later)) for later in (True, False))
    z = point(shown, ceiling_deg=CEILING_DEG, knee_deg=0.1)
    np.testing.assert_allclose(shown.drifted(z), bench.evidence.drift_deg, atol=0.01)
    np.testing.assert_array_equal(hidden.drifted(z), 0.0)
    first = shown.rows.size + shown.further[0]
    left = shown.left(z)[first : first + shown.further[1]]
    np.testing.assert_allclose(left, 0.0, atol=0.01)


def test_nothing_else_of_the_mechanics_shows_there(evidence: Evidence) -> None:
    bench = bench_of(evidence)
    problem = AngleProblem(bench, ("contact_stop",), Calibrated(later=True))
    z = point(problem, angle_deg=10.0, stiffness=1.0, softness_deg=1.0)
    np.testing.assert_array_equal(problem.drifted(z), 0.0)
    no_later = replace(bench.evidence, drift_deg=np.zeros(0))
    assert variants(replace(bench, evidence=no_later), ("sensor_saturation",)) == [MOSTLY]


def test_a_late_channel_hides_no_curve_that_came_since(evidence: Evidence) -> None:
    bench, ids = bench_of(evidence), ("sensor_nonlinearity", "channel_latency")
    assert len(set(variants(bench, ids))) == 4
    assert variants(bench, ("channel_latency",), Calibrated(later=True)) == [
        Calibrated(later=True),
        Calibrated(later=True, apart=True),
    ]
    for apart in (False, True):
        problem = AngleProblem(bench, ids, Calibrated(later=True, apart=apart))
        z = point(problem, delay_s=0.3, window_share=0.5)
        first = problem.rows.size + problem.further[0]
        drift = problem.columns(z)[first : first + problem.further[1], problem.curve]
        np.testing.assert_array_equal(
            drift, curve_columns(bench.evidence.drift_angle_deg, bench.evidence.curve_stretch)
        )
        assert np.any(problem.predict(z)[1] != 0.0) != apart


def test_dwells_err_as_the_ways_of_a_calibration_say(evidence: Evidence) -> None:
    """A wave in what is read is not made up for by dwells whose ways say that they err little."""
    bench = bench_of(evidence)
    found = {}
    for told in (0.0, 12.0):
        noise = replace(bench.noise, fixture=DwellError(0.05, told, 0.0))
        scales = bench.scales.copy()
        scales[DWELL] = 0.05
        problem = AngleProblem(replace(bench, noise=noise, scales=scales), ())
        z = point(problem)
        wave = np.sin(problem.predict(z)[0] / 4.0)
        angle = np.concatenate([problem.rows.merged(wave), np.zeros(sum(problem.further))])
        linear = replace(problem.linear(z), left=angle)
        factor = problem.whitening.factor(1.0, 0.0)
        _, solution, _ = problem.weigh(linear, factor, problem.scales**2, rounds=20)
        found[told] = float(np.sqrt(solution.variances[DWELL]))
    assert found[0.0] > 0.5
    assert found[12.0] < 0.25


def test_a_wrong_mark_is_in_both_ways_alike(evidence: Evidence) -> None:
    bench = bench_of(evidence)
    assert not AngleProblem(bench, ()).marks.size  # nothing says what a dwell errs by
    noise = replace(bench.noise, fixture=DwellError(0.1, 5.0, 0.15))
    problem = AngleProblem(replace(bench, noise=noise), ())
    columns = problem.columns(point(problem))
    fixture = problem.evidence.fixture
    assert fixture is not None
    known = [fixture.known_deg[fixture.dwell == d][0] for d in range(problem.dwells.size)]
    of_first = [fixture.log[fixture.dwell == d][0] == 0 for d in range(problem.dwells.size)]
    n = problem.rows.size
    assert np.abs(columns[:n, problem.marks]).max() > 0.1
    for mark, angle in zip(problem.marks, np.unique(fixture.known_deg), strict=True):
        own = problem.dwells[(np.array(known) == angle) & np.array(of_first)]
        both = columns[:n, own].sum(axis=1)
        np.testing.assert_allclose(columns[:n, mark], both, atol=1e-12)
        assert not columns[n:, mark].any()


def test_a_weight_hangs_in_a_fit_as_in_a_prediction(evidence: Evidence) -> None:
    problem = AngleProblem(bench_of(evidence), ("gravity_load", "sensor_creep"))
    weight = {"along_rest": -0.1, "across_rest": -0.1, "at_rest": -0.1}
    z = point(problem, **weight, per_decade=0.1, typical_s=6.0, decades=0.8, growth=0.0)
    e = problem.effects(z)
    chain = problem.chain.mounted(problem.in_fixture(e)[1])
    predicted, _ = chain.run(to_x(z[:5]), e)
    np.testing.assert_allclose(problem.predict(z)[0], predicted, atol=1e-9)
    assert predicted[0] < -4.0


@pytest.mark.parametrize("others", [(), ("sensor_hysteresis",)])
def test_what_a_lag_leaves_to_a_dwell_is_known_by_half(
    evidence: Evidence, others: tuple[str, ...]
) -> None:
    problem = AngleProblem(bench_of(evidence), ("sensor_lag", *others))
    none = {"return_excess": 0.0, "width_deg": 0.0, "turn_deg": 3.0, "exponent": 0.8, "begins": 0.0}
    z = point(problem, time_constant_s=0.4, second_pole=0.2, tail_share=0.0, **none, **EVEN)
    n, rows = problem.rows.size, problem.further[0]
    column = problem.columns(z)[:, problem.arrived]
    _, fixture = problem.predict(z)
    assert np.abs(fixture).max() > 0.05
    np.testing.assert_allclose(column[n : n + rows, 0], fixture, atol=1e-12)
    assert not column[:n].any()
    assert not problem.columns(z)[n:, problem.branch].any()
    factor = problem.whitening.factor(1.0, 0.0)
    white = problem.white(factor, problem.columns(z)[:, problem.moving])
    np.testing.assert_allclose(problem.moved(factor, z), white, atol=1e-9 * np.abs(white).max())
    b = np.zeros(problem.size)
    b[problem.arrived] = -0.5
    halved, whole = problem.slopes_beside(z, b), problem.slopes(z)
    lag = slice(5, 7)
    np.testing.assert_allclose(halved[n : n + rows, lag], 0.5 * whole[n : n + rows, lag], atol=1e-9)
    assert AngleProblem(bench_of(evidence), ("creep",)).arrived.size == 0
    assert LIBRARY["sensor_lag"].in_fixture


def test_a_trial_may_begin_on_either_branch_of_a_loop(evidence: Evidence) -> None:
    problem = AngleProblem(bench_of(evidence), ("sensor_hysteresis",))
    z = point(problem, width_deg=4.0, turn_deg=3.0, exponent=1.0, begins=0.0, **EVEN)
    n = problem.rows.size
    columns = problem.columns(z)[:, problem.branch]
    assert not columns[n:].any()
    # One of the first trial, one of those that were come to alike.
    assert problem.after.tolist() == [0, 1, 1, 1]
    for after, column in enumerate(columns[:n].T):
        for trial, kind in zip(problem.trials, problem.after, strict=True):
            own = column[problem.trial == trial]
            if kind != after:
                assert not own.any()
                continue
            # Half of the loop's width, until the actuator bends.
            assert own[0] == pytest.approx(-2.0, abs=0.02)
            assert abs(own[-1]) < 0.01
    factor = problem.whitening.factor(1.0, 0.0)
    white = problem.white(factor, problem.columns(z)[:, problem.moving])
    np.testing.assert_allclose(problem.moved(factor, z), white, atol=1e-9 * np.abs(white).max())
    assert AngleProblem(bench_of(evidence), ("hysteresis",)).branch.size == 0


@pytest.mark.parametrize("name", ["dead_time", "channel_latency"])
def test_a_trial_may_wait_longer_than_others_where_an_effect_delays(
    evidence: Evidence, name: str
) -> None:
    problem = AngleProblem(bench_of(evidence), (name,))
    z = point(problem, delay_s=0.2, uneven=0.0, window_share=0.0)
    n, e = problem.rows.size, problem.effects(z)
    columns = problem.columns(z)[:, problem.delays]
    # Of a delay what is beyond a row differs, and clocks are not in step anyway.
    varies = problem.delay_s(z) / 0.2
    assert varies == pytest.approx((0.2 - evidence.interval_s + IN_STEP_S) / 0.2)
    assert 0.5 < varies < 1.0
    assert not columns[n:].any()
    later = z.copy()
    later[problem.free] *= 1.01
    change = varies * (problem.at_rows(later) - problem.at_rows(z))[:n] / 0.01
    # All but where a motion begins: a row's slope is a mean of its neighbours'.
    close = np.isclose(columns[:n].sum(axis=1), change, atol=0.15 * np.abs(change).max())
    assert np.mean(close) > 0.98
    for trial, column in zip(problem.trials, columns[:n].T, strict=True):
        assert column.any()
        assert not column[problem.trial != trial].any()
    assert not np.isnan(e[LIBRARY[name].first])
    for others in ((), ("sensor_lag",), ("drive_backlash",)):
        other = AngleProblem(bench_of(evidence), others)
        assert other.delay_s(np.full(other.parameters, 0.3)) == IN_STEP_S
    # Nothing tells clocks from what is at work where nothing was repeated.
    noise = problem.bench.noise
    alone = replace(noise, spectrum=replace(noise.spectrum, repeats=0))
    never = AngleProblem(replace(problem.bench, noise=alone), (name,))
    assert never.delay_s(z) == pytest.approx(0.2 - evidence.interval_s)


def test_delays_that_differ_from_trial_to_trial_speak_for_what_delays(evidence: Evidence) -> None:
    problem = AngleProblem(bench_of(evidence), ("channel_latency",))
    waits = point(problem, delay_s=0.2, window_share=0.0)
    angle = evidence.grid.angle_deg.copy()
    for trial, wait in enumerate((0.1, 0.25, 0.12, 0.3)):
        own = evidence.grid.sample_trial == trial
        angle[own] = problem.predict(np.append(waits[:5], [wait, 0.0]))[0][own]
    angle += 0.05 * np.random.default_rng(5).standard_normal(angle.size)
    grid = replace(evidence.grid, angle_deg=angle)
    bench = bench_of(replace(evidence, grid=grid, noise_deg=0.05))
    found = {
        name: fit(bench, (name,), [point(AngleProblem(bench, (name,)), **values)])
        for name, values in {
            "channel_latency": {"delay_s": 0.1, "window_share": 0.2},
            "sensor_lag": {
                **{"time_constant_s": 0.1, "second_pole": 0.2},
                **{"tail_share": 0.0, "return_excess": 0.0},
            },
        }.items()
    }
    late = found["channel_latency"]
    assert late.delay_s == pytest.approx(0.19 - evidence.interval_s + IN_STEP_S, abs=0.05)
    assert 0.2 < np.sqrt(late.variances[DELAY]) < 3.0**-0.5 + 1e-9
    assert late.delays_deg > 0.1
    assert found["sensor_lag"].delay_s == IN_STEP_S
    assert late.quick > found["sensor_lag"].quick + 20.0


def test_clocks_that_are_not_in_step_are_no_effect(evidence: Evidence) -> None:
    plain = AngleProblem(bench_of(evidence), ())
    angle, waits_s = plain.predict(point(plain))[0], np.array([0.012, -0.009, 0.007, -0.012])
    angle = angle - waits_s[evidence.grid.sample_trial] * evidence.grid.slopes(angle)
    angle += 0.05 * np.random.default_rng(6).standard_normal(angle.size)
    grid = replace(evidence.grid, angle_deg=angle)
    bench = bench_of(replace(evidence, grid=grid, noise_deg=0.05))
    found = fit(bench, (), [point(plain)])
    assert found.delay_s * np.sqrt(found.variances[DELAY]) == pytest.approx(0.01, rel=0.5)
    late = AngleProblem(bench, ("channel_latency",))
    delayed = fit(bench, late.ids, [point(late, delay_s=0.05, window_share=0.0)])
    assert delayed.quick < found.quick + 2.0


def test_a_delay_of_less_than_a_row_takes_no_scatter_of_times(evidence: Evidence) -> None:
    problem = AngleProblem(bench_of(evidence), ("channel_latency",))
    prompt = point(problem, delay_s=0.9 * evidence.interval_s, window_share=0.0)
    assert problem.delay_s(prompt) == IN_STEP_S
    # Nor does one differ by more than a wait that may be as short as none.
    assert problem.most[DELAY] == pytest.approx(np.std(np.linspace(0.0, 2.0, 10001)), rel=1e-3)


def test_a_log_that_ends_under_pressure_does_not_show_how_it_was_vented() -> None:
    trials = [[0.0, 30.0, 0.0], [0.0, 30.0, 30.0], [0.0, 30.0, 1.0], [0.0, 20.0, 0.0]]
    starts = np.array([0, 3, 6, 9, 12])
    assert came_before(np.concatenate(trials), starts).tolist() == [0, 1, 2, 1]


def test_a_loop_is_weighed_with_the_branches_that_trials_began_on(evidence: Evidence) -> None:
    problem = AngleProblem(bench_of(evidence), ("sensor_hysteresis",))
    z, b = (
        point(problem, width_deg=4.0, turn_deg=3.0, exponent=0.8, begins=0.0, **EVEN),
        np.zeros(problem.size),
    )
    b[problem.branch] = [0.7, -1.5]
    step = 1e-4 * np.eye(z.size)[problem.free :]

    def predicted(at: np.ndarray) -> np.ndarray:
        return problem.at_rows(at) + problem.columns(at)[:, problem.branch] @ b[problem.branch]

    numeric = np.array([(predicted(z + d) - predicted(z - d)) / 2e-4 for d in step]).T
    found = problem.slopes_beside(z, b)[:, problem.free :]
    np.testing.assert_allclose(found[: problem.rows.size], numeric[: problem.rows.size], atol=0.02)
    assert np.abs(numeric).max() > 0.5


def test_what_goes_with_the_trials_order_has_columns_of_gain_and_rest(evidence: Evidence) -> None:
    bench = bench_of(evidence)
    trials = len(evidence.grid.trials)
    gains, zeros = 0.1 * np.arange(trials), np.arange(trials)[::-1] - 1.5
    bench = replace(bench, noise=replace(bench.noise, gains=gains, zeros_deg=zeros))
    problem = AngleProblem(bench, (), trend=True)
    z, n = problem.bench.centre, problem.rows.size
    columns = problem.columns(z)
    of_gain = columns[np.arange(n), problem.own[np.searchsorted(problem.trials, problem.trial), 0]]
    late, early, fallen, at_rest, soon, moved = columns[:n, problem.trends].T
    np.testing.assert_allclose(fallen, gains[problem.trial] * of_gain)
    np.testing.assert_allclose(moved, zeros[problem.trial])
    np.testing.assert_allclose(late, at_rest * of_gain)
    np.testing.assert_allclose(early, soon * of_gain)
    by_order = np.argsort(problem.trial, kind="stable")
    assert (np.diff(at_rest[by_order]) >= 0.0).all()
    assert (np.diff(soon[by_order]) <= 0.0).all()
    assert np.ptp(at_rest) > 0.5
    # Their sizes: three times the bench's scatter, and as large as repeats say.
    scale = bench.scales
    expected = np.square([*[3.0 * scale[0]] * 2, 1.0, *[3.0 * scale[1]] * 2, 1.0])
    np.testing.assert_allclose(problem.variance[problem.trends], expected)


def test_a_rest_angle_that_goes_with_the_order_is_a_slipping_sensors_own(
    evidence: Evidence,
) -> None:
    bench = bench_of(evidence)
    every = AngleProblem(bench, (), trend=True)
    slipping = AngleProblem(bench, ("sensor_slip",), trend=True)
    assert (every.trends.size, slipping.trends.size) == (6, 3)
    own = [each.columns(bench.centre)[:, each.trends[:3]] for each in (every, slipping)]
    np.testing.assert_array_equal(*own)
    gain = np.square(3.0 * bench.scales[[0, 0]])
    np.testing.assert_array_equal(slipping.variance[slipping.trends], [*gain, 1.0])


def looped(loop_deg: float, ways: int = 2) -> Calibration:
    """A calibration over 19 angles whose sensor has a loop."""
    angles = np.arange(0.0, 91.0, 5.0)
    known = np.concatenate([angles, angles[::-1]][:ways])
    t_s = np.arange(0.0, 5.0 * known.size, 0.1)
    at = np.minimum((t_s / 5.0).astype(int), known.size - 1)
    way = np.where(np.arange(known.size) < angles.size, 0.5, -0.5)
    counts = 10.0 * (known + way * loop_deg * np.sin(np.pi * known / 90.0))
    return calibrate(t_s, known[at], 100.0 + counts[at], "c.log")


def test_beside_a_hysteresis_the_calibrations_loop_is_no_error_of_its_curve() -> None:
    inside = slice(1, 5)  # knots from 12 to 48 deg
    assert (curve_sigma(looped(4.0), 1.0, loop=True)[inside] > 0.5).all()
    apart, none = (
        curve_sigma(looped(4.0), 1.0, loop=False),
        curve_sigma(looped(0.0), 1.0, loop=True),
    )
    np.testing.assert_allclose(apart, none, atol=0.03)


def test_a_drift_between_calibrations_alike_does_not_err_by_their_loop() -> None:
    first = looped(4.0)

    def sigma(later: Calibration) -> np.ndarray:
        data = SimpleNamespace(
            calibration=first, calibrations=[first, later], drifts=[drift(first, later)]
        )
        return _drifts(data, SimpleNamespace(trials=[]))[1]  # type: ignore[arg-type]

    assert (sigma(looped(4.0)) < 0.15).all()
    assert (sigma(looped(4.0, ways=1))[4:-4] > 1.0).all()


def test_what_a_reference_says_is_foreseen_from_the_first_sample_on(evidence: Evidence) -> None:
    resting = [
        Foreseen(
            np.full(trial.t_s.size, 6.0 + trial.order),
            np.full(trial.t_s.size, 0.1),
            np.zeros(trial.t_s.size, dtype=bool),
            np.full(trial.t_s.size, 0.3),
        )
        for trial in evidence.data.trials
    ]
    expected = with_usual(evidence, resting, GIVEN, read_deg=0.0)
    plain, _ = angle_chain(evidence, GIVEN, None).run(GIVEN, absent())
    found, _ = angle_chain(expected, GIVEN, None).run(GIVEN, absent())
    orders = evidence.grid.orders[evidence.grid.sample_trial]
    assert np.unique(orders).size > 1
    np.testing.assert_allclose(found - plain, 6.0 + orders, atol=1e-9)
    # Times that are off make single rows less sure, and the gap no smaller.
    assert expected.foreseen_deg is not None
    assert expected.late_deg is not None
    np.testing.assert_allclose(expected.foreseen_deg, 0.1)
    np.testing.assert_allclose(expected.late_deg, 0.3)
    noise = cast(Any, SimpleNamespace(foreseen_deg=0.1))
    times = _times_foreseen(expected, rows_of(expected), noise)
    np.testing.assert_allclose(times, np.sqrt(10.0))
