"""Fits of the measured pressure, and the true pressure that follows."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from plant_cases import KPA, SIXTY, X, campaign_data, step_release, trials
from spa_fo import simulate
from spa_fo.gap.data.evidence import collect, modelled_pressure
from spa_fo.gap.fit.believed import WINDOWS, surely_shown
from spa_fo.gap.fit.bench import rows_of
from spa_fo.gap.fit.least_squares import starts
from spa_fo.gap.fit.pressure import PressureProblem, resolution, timing_error
from spa_fo.gap.noise.coloured import CORRELATION_S, Spectrum
from spa_fo.gap.noise.pressure_noise import pressure_noise
from spa_fo.gap.noise.whitening import Whitening
from spa_fo.gap.search.drive import (
    _looked_at,
    _noise,
    _one_of_each,
    _together,
    examine_drive,
)
from spa_fo.plant.effects.library import LIBRARY, absent, rare
from spa_fo.plant.memory import FINEST_STEP_S

NOISE_KPA = 0.1
RARE = tuple(filter(rare, LIBRARY))
_BUT_DROOP = [n for n, e in LIBRARY.items() if e.stage == "drive" and n != "supply_droop"]


def driven(delays_s, levels_kpa=(SIXTY,), leak_per_s=0.0, step_kpa=0.0):
    """Trials of jumps that the drive follows late, each after a delay of its own.

    `step_kpa` is that of the converter that reads the pressure.
    """
    rng = np.random.default_rng(3)
    own = []
    commands = [step_release(level) for level in levels_kpa for _ in delays_s]
    for trial, delay_s in zip(trials(*commands), list(delays_s) * len(levels_kpa), strict=True):
        # The command of a row holds until the next one's time.
        at = np.searchsorted(trial.t_s, trial.t_s - delay_s - 1e-9, side="left") - 1
        pressure = np.where(at >= 0, trial.command_kpa[np.maximum(at, 0)], 0.0)
        pressure = pressure * np.exp(-leak_per_s * trial.t_s)
        angle = np.degrees(simulate(trial.t_s, pressure / KPA, *X, hold="zero"))
        noisy = pressure + (0.0 if step_kpa else NOISE_KPA) * rng.normal(size=pressure.size)
        if step_kpa:
            noisy = step_kpa * np.round(noisy / step_kpa)
        own.append(
            replace(
                trial,
                pressure_kpa=noisy,
                angle_deg=angle + 0.1 * rng.normal(size=angle.size),
            )
        )
    return collect(campaign_data(own))


def best(found, count):
    fits = [fit for ids, fit in found.fits.items() if len(ids) == count]
    return max(fits, key=lambda fit: fit.evidence.max())


@pytest.mark.parametrize("delay_s", [0.08, 0.34, 0.9])
def test_a_delay_of_any_length_is_found(delay_s):
    found = examine_drive(driven([delay_s] * 3), RARE, X)
    assert best(found, 1).ids == ("dead_time",)
    assert best(found, 1).z[0] == pytest.approx(delay_s, abs=0.03)
    assert found.gap_deg > 0.3


@pytest.mark.parametrize("fraction", [0.06, 0.3, 0.5])
def test_a_supply_that_comes_back_at_a_steady_pace_is_found_however_far_it_sags(fraction):
    """From a small sag that comes back exponentially no fit finds a large one that does not."""
    rng, own = np.random.default_rng(5), []
    commands = [step_release(level) for level in (SIXTY, 0.5 * SIXTY, 0.75 * SIXTY)]
    for trial in trials(*commands):
        command_kpa = np.append(0.0, trial.command_kpa[:-1])  # a row's holds until the next
        rises = np.maximum(np.diff(command_kpa, prepend=0.0), 0.0)
        missing, level = np.zeros_like(command_kpa), 0.0
        for i, step_s in enumerate(np.diff(trial.t_s, prepend=trial.t_s[0])):
            level = max(level - 0.4 * fraction * SIXTY * step_s, 0.0) + fraction * rises[i]
            missing[i] = level = min(level, command_kpa[i])
        pressure = command_kpa - missing
        angle = np.degrees(simulate(trial.t_s, pressure / KPA, *X, hold="zero"))
        noisy = pressure + NOISE_KPA * rng.normal(size=pressure.size)
        own.append(replace(trial, pressure_kpa=noisy, angle_deg=angle))
    found = examine_drive(collect(campaign_data(own)), (*RARE, *_BUT_DROOP), X)
    assert found.fits[("supply_droop",)].left_kpa < 0.05 * fraction * SIXTY


def test_what_is_weak_alone_is_tried_beside_the_best():
    # A pump that waits where it turns would have both, on a step and its release.
    found = examine_drive(driven([0.3] * 4, leak_per_s=0.01), (*RARE, "drive_backlash"), X)
    assert best(found, 1).ids == ("dead_time",)
    assert "dead_time" in best(found, 2).ids
    # Where nothing may be missed the second effect counts for a great deal.
    assert best(found, 2).evidence[0] > best(found, 1).evidence[0] + 100.0


def test_the_angle_is_driven_by_what_each_trial_was():
    delays = [0.20, 0.26, 0.32, 0.38]
    evidence = driven(delays)
    pressure = examine_drive(evidence, RARE, X).pressure_kpa
    grid = evidence.grid
    for trial, delay_s in enumerate(delays):
        first = grid.cell_starts[trial]
        begins = pressure[first : first + round(1.2 / FINEST_STEP_S)]
        rise = (np.flatnonzero(begins < 0.5 * SIXTY)[-1] + 1) * FINEST_STEP_S
        assert rise == pytest.approx(0.5 + delay_s, abs=0.035)


def test_a_drive_that_follows_its_command_has_no_gap():
    found = examine_drive(driven([0.0] * 4), RARE, X)
    assert found.gap_deg < 0.3  # a sample's time, at a jump
    none = found.fits[()].evidence.max()
    assert all(fit.evidence.max() < none + 0.5 for fit in found.fits.values())


def test_a_drive_effect_may_be_left_out():
    found = examine_drive(driven([0.3] * 3), ("dead_time", *RARE), X)
    assert all("dead_time" not in ids for ids in found.fits)


def test_a_step_of_the_converter_is_no_drive_effect():
    levels = (0.31 * SIXTY, 0.52 * SIXTY, 0.77 * SIXTY, SIXTY)
    found = examine_drive(driven([0.0] * 2, levels, step_kpa=0.04 * SIXTY), RARE, X)
    none = found.fits[()].evidence
    assert all(fit.evidence.max() < none.max() + 1.0 for fit in found.fits.values())
    # Nor is it something that no effect of the library explains.
    assert none[0] > none.max() - 3.0


def swept(step_kpa, seconds=24.0, lost_kpa=1.5):
    """Two slow sweeps whose supply gives way by a little, read in steps of a coarse converter."""
    t_s = 0.02 * np.arange(round(seconds / 0.02))
    command = 0.5 * SIXTY * (1.0 - np.cos(2.0 * np.pi * (0.1 + 0.01 * t_s) * t_s))
    true = command - lost_kpa * t_s / seconds * (command > 0.0)
    read = [
        replace(t, pressure_kpa=step_kpa * np.round(true / step_kpa))
        for t in trials(*[command] * 2)
    ]
    runs = [
        replace(t, angle_deg=np.degrees(simulate(t.t_s, true / KPA, *X, hold="zero"))) for t in read
    ]
    return collect(campaign_data(runs)), true


def test_what_a_sensor_shows_slowly_is_believed_though_single_rows_do_not_tell_it():
    evidence, true = swept(0.6)
    names = [n for n, effect in LIBRARY.items() if effect.stage == "drive"]
    found = examine_drive(evidence, names, X)  # nothing explains it
    command_kpa = evidence.grid.command_kpa
    assert command_kpa is not None
    # What drifts is seen by means over a second; a lasting part may be the sensor's offset.
    missed, drift = (
        (kpa[: true.size] - true)[:1180].reshape(-1, 59).mean(axis=1).std()
        for kpa in (found.pressure_kpa, command_kpa)
    )
    assert drift > 0.35
    assert missed < 0.6 * drift


@pytest.mark.parametrize("every", [1, 5, 10])
@pytest.mark.parametrize("late", [0, 1])
def test_when_a_row_is_read_is_no_error_of_the_drive(every, late):
    """A perfect drive on a slow sine, its pressure read at either end of its rows."""
    t_s = 0.02 * np.arange(1500)
    command = 0.5 * SIXTY * (1.0 - np.cos(0.2 * np.pi * t_s))
    runs = []
    for trial in trials(*[command] * 2):
        rows = slice(None, None, every)
        own = trial.command_kpa[rows]
        read = own if late else np.concatenate([own[:1], own[:-1]])
        arrays = {n: v[rows] for n, v in vars(trial).items() if isinstance(v, np.ndarray)}
        runs.append(replace(trial, **arrays | {"pressure_kpa": read}))
    names = [n for n, effect in LIBRARY.items() if effect.stage == "drive"]
    assert examine_drive(collect(campaign_data(runs)), names, X).gap_deg < 0.01


def test_a_slow_part_within_the_room_of_single_rows_is_believed_and_noise_is_not():
    starts, rng = np.array([0, 300, 300 + 40, 600]), np.random.default_rng(4)
    noise = 0.3 * rng.standard_normal(600)
    rooms = [np.full(600, 0.6 / np.sqrt(window)) for window in WINDOWS]
    slow = 0.5 * np.sin(np.arange(600) / 60.0)
    believed = surely_shown(slow + noise, starts, rooms)
    assert np.corrcoef(believed, slow)[0, 1] > 0.95
    assert np.sqrt(np.mean((believed - slow) ** 2)) < 0.15
    assert np.sqrt(np.mean(surely_shown(noise, starts, rooms) ** 2)) < 0.05
    # By single rows alone none of it is.
    alone = [np.full(600, np.inf)] * (len(WINDOWS) - 1) + rooms[-1:]
    assert (surely_shown(slow, starts, alone) == 0.0).all()


def test_a_jump_is_uncertain_by_its_size_and_a_ramp_by_its_rate():
    evidence = driven([0.1] * 2)
    error = timing_error(evidence)
    rows = evidence.rows[0]
    time, jumps = evidence.grid.time_s[rows], np.array([0.5, 0.6])
    near = np.min(np.abs(time[:, None] - jumps[None, :]), axis=1)
    assert error[rows][near < 0.015].min() > 0.2 * SIXTY
    quiet = (near > 0.2) & (time < 4.0)
    assert error[rows][quiet].max() < 5.0 * NOISE_KPA
    rate, ramp = 50.0, trials(np.minimum(50.0 * 0.02 * np.arange(400), 200.0))
    data = campaign_data([replace(t, pressure_kpa=t.command_kpa) for t in ramp])
    moving = timing_error(collect(data))[5:30]
    # Both signals, each anywhere within a cell.
    expected = np.sqrt(2.0) * rate * FINEST_STEP_S / np.sqrt(12.0)
    np.testing.assert_allclose(moving, expected, rtol=0.05)


def test_what_repeats_differ_by_is_no_effect_of_the_drive():
    found = examine_drive(driven([0.1, 0.3, 0.1, 0.3]), RARE, X)
    alike = examine_drive(driven([0.1, 0.1, 0.3, 0.3]), RARE, X)
    for one in (found, alike):
        assert one.best.ids[:1] == ("dead_time",)
        assert one.best.evidence[0] > one.best.evidence.max() - 50.0


def logged_under(commands_kpa, e, seed=8):
    """Trials whose measured pressure is that of the drive with effects `e`."""
    logged, rng, own = trials(*commands_kpa), np.random.default_rng(seed), []
    before = collect(campaign_data(logged))
    shown = before.grid.read(modelled_pressure(before, e))
    for trial, rows in zip(logged, before.rows, strict=True):
        kpa = np.interp(trial.t_s, before.grid.time_s[rows], shown[rows])
        noisy = kpa + NOISE_KPA * rng.normal(size=kpa.size)
        own.append(replace(trial, pressure_kpa=noisy))
    return collect(campaign_data(own))


def test_a_delay_that_is_nothing_alone_may_be_any_beside_another_effect():
    """Whatever each was alone: a pair is begun at the delay that is there, too."""
    evidence = driven([0.3] * 3)
    found = examine_drive(evidence, RARE, X)
    rows = rows_of(evidence, timing_error(evidence) ** 2)
    white = Spectrum(NOISE_KPA**2, np.zeros(CORRELATION_S.size))
    whitening = Whitening(rows, white, np.zeros(rows.size))
    nothing = replace(found.fits[("dead_time",)], ends=(np.array([0.01, 0.0, 0.0]),))
    both = PressureProblem(evidence, whitening, ("dead_time", "slew_limit"))
    points = _together(both, [nothing, found.fits[("slew_limit",)]])
    assert any(abs(z[0] - 0.3) < FINEST_STEP_S for z in points)
    assert len({tuple(z[1:]) for z in points}) < len(points)
    without = PressureProblem(evidence, whitening, ("line_lag", "slew_limit"))
    alone = [found.fits[(name,)] for name in without.ids]
    assert len(_together(without, alone)) <= 2 * len(alone[0].ends) * len(alone[1].ends)


def test_only_trials_that_are_looked_at_are_simulated_but_where_one_goes_on_from_another():
    evidence = driven([0.1, 0.1, 0.1], (SIXTY, 0.5 * SIXTY))
    evidence = replace(evidence, takes_part=np.array([True, False, True, False, True, True]))
    noise = _noise(evidence, resolution(evidence), None)
    looked_at = _looked_at(evidence, noise, evidence.takes_part)
    for ids in (("line_lag",), ("drive_backlash",)):
        part, whitening = looked_at.by(ids)
        goes_on = any(LIBRARY[name].carries_on for name in ids)
        assert len(part.grid.trials) == (6 if goes_on else 4)
        problems = [
            PressureProblem(*those, ids, False, noise.of_trials)
            for those in (looked_at.alone, looked_at.among_all)
        ]
        z = starts(problems[0], np.zeros(0))[0]
        factor = whitening.factor(1.0, 0.05)
        assert np.array_equal(*(one.measured for one in problems))
        if not goes_on:
            alone, among_all = (one.misfit(z, factor) for one in problems)
            assert alone == pytest.approx(among_all, rel=1e-12)


def test_one_trial_of_each_experiment_says_which_pairs_are_worth_more():
    evidence = driven([0.1, 0.1, 0.1], (SIXTY, 0.5 * SIXTY))
    assert _one_of_each(evidence).tolist() == [True, False, False, True, False, False]
    evidence = replace(evidence, takes_part=np.array([False, True, True, False, False, False]))
    assert _one_of_each(evidence).tolist() == [False, True, False, False, False, False]


@pytest.mark.parametrize("orifice_share", [0.0, 1.0])
def test_a_line_of_either_form_is_found_behind_a_pump_that_is_late(orifice_share):
    levels_kpa = SIXTY, SIXTY, 0.8 * SIXTY, 0.8 * SIXTY
    e = absent()
    e[LIBRARY["dead_time"].slots] = 0.12, 0.0
    e[LIBRARY["line_lag"].slots] = 0.25, 0.0, 0.0, 0.0, orifice_share
    commands = [np.repeat([0.0, level], [25, 130]) for level in levels_kpa]
    found = examine_drive(logged_under(commands, e), (), X)
    both = found.fits[("dead_time", "line_lag")]
    # A pump that waits where it turns does the same, from rest.
    assert both.evidence.max() > found.best.evidence.max() - 3.0
    assert both.evidence.max() > best(found, 1).evidence.max() + 50.0
    assert both.z[-2] == pytest.approx(orifice_share, abs=0.2)


def test_no_explanation_of_the_pressure_holds_two_effects_that_are_rare():
    found = examine_drive(driven([0.3] * 3), (), X)
    assert any(any(map(rare, ids)) for ids in found.fits)
    assert all(sum(map(rare, ids)) < 2 for ids in found.fits)


def test_the_sensor_of_a_spa_rig_log_has_no_lag_so_the_drive_has():
    # 60 ms between command and pressure: a csv's sensor may have them, a board's may not.
    lag_s = 0.06
    evidence = driven([0.0] * 3, (SIXTY, 0.5 * SIXTY))
    keep = np.exp(-np.diff(evidence.grid.trials[0].t_s, prepend=0.0)[1] / lag_s)
    slow = []
    for trial in evidence.grid.trials:
        shown = lfilter([1.0 - keep], [1.0, -keep], trial.pressure_kpa)
        slow.append(replace(trial, pressure_kpa=shown))
    data = campaign_data(slow)
    found = {}
    for kind in ("csv", "spa-rig"):
        log = replace(data.campaign.log, format=kind)
        own = replace(data, campaign=replace(data.campaign, log=log))
        found[kind] = examine_drive(collect(own), RARE, X).fits[()].z[-1]
    assert found["csv"] == pytest.approx(lag_s, abs=0.02)
    assert found["spa-rig"] <= 1.0 / (2.0 * np.pi * 100.0)


def test_a_regulator_that_wanders_slowly_is_no_drive_effect():
    """In no two trials alike, and by far more than the sensor's noise."""
    evidence = driven([0.0] * 6)
    rng, wandering = np.random.default_rng(7), []
    for trial in evidence.grid.trials:
        wander = np.zeros(trial.t_s.size)
        for i in range(1, wander.size):  # over 5 s
            wander[i] = 0.996 * wander[i - 1] + 0.5 * np.sqrt(1.0 - 0.996**2) * rng.normal()
        wandering.append(replace(trial, pressure_kpa=trial.pressure_kpa + wander))
    evidence = collect(campaign_data(wandering))
    noise = pressure_noise(evidence, np.full(evidence.grid.angle_deg.size, 0.02**2))
    assert np.sqrt(noise.spectrum.coloured.sum()) == pytest.approx(0.5, rel=0.4)
    found = examine_drive(evidence, RARE, X)
    none = found.fits[()].evidence.max()
    assert all(fit.evidence.max() < none + 3.0 for fit in found.fits.values())
    assert found.fits[()].evidence[0] > none - 3.0  # and nothing is missed


def test_without_repeats_the_pressure_has_the_noise_of_its_samples():
    evidence = driven([0.0])
    known = np.full(evidence.grid.angle_deg.size, 0.02**2)
    noise = pressure_noise(evidence, known)
    assert noise.spectrum.white == evidence.pressure_noise_kpa**2
    assert not noise.spectrum.coloured.any()
    assert noise.gain == 0.0


def test_a_regulator_that_comes_to_a_pressure_with_a_gain_of_each_trial_is_no_drive_effect():
    evidence = driven([0.0] * 8)
    gains = 1.0 + 0.02 * np.random.default_rng(4).standard_normal(8)
    own = [
        replace(trial, pressure_kpa=gain * trial.pressure_kpa)
        for gain, trial in zip(gains, evidence.grid.trials, strict=True)
    ]
    evidence = collect(campaign_data(own))
    noise = pressure_noise(evidence, np.full(evidence.grid.angle_deg.size, 0.02**2))
    assert noise.gain == pytest.approx(gains.std(ddof=1), rel=0.3)
    found = examine_drive(evidence, RARE, X)
    none = found.fits[()]
    assert all(fit.evidence.max() < none.evidence.max() + 3.0 for fit in found.fits.values())
    assert none.evidence[0] > none.evidence.max() - 3.0  # and nothing is missed
    true_kpa = np.repeat(gains, np.diff(evidence.grid.cell_starts)) * evidence.grid.command_kpa
    missed = np.mean((found.pressure_kpa - true_kpa) ** 2)
    assert missed < 0.3 * np.mean((evidence.grid.command_kpa - true_kpa) ** 2)


@pytest.mark.parametrize(("runs", "gains"), [(1, 0), (3, 3)])
def test_trials_have_gains_of_their_own_where_repeats_tell_their_scatter(runs, gains):
    evidence = driven([0.0] * runs)
    noise = pressure_noise(evidence, np.full(evidence.grid.angle_deg.size, 0.02**2))
    rows = rows_of(evidence)
    whitening = Whitening(rows, noise.spectrum, np.zeros(rows.size))
    problem = PressureProblem(evidence, whitening, (), noise=noise)
    assert problem.columns(np.zeros(1)).shape == (rows.size, gains + 3)
    assert problem.group.tolist() == [0] * gains + [-1] * 3


def test_starts_differ_by_more_than_a_delay():
    evidence = driven([0.0])
    rows = rows_of(evidence)
    whitening = Whitening(rows, Spectrum(0.1, np.zeros(CORRELATION_S.size)), np.zeros(rows.size))
    problem = PressureProblem(evidence, whitening, ("drive_backlash",))
    points = starts(problem, np.zeros(0), (0.01, 0.02, 0.5))
    factor = whitening.factor(1.0, 0.05)
    first = problem.first_of(points, factor, 8)
    named = [slot.parameter.name for slot in problem.slots]
    # Each way to keep the play and to vent it, with the delay that does best.
    kept, vented = (np.array([z[named.index(n)] for z in first]) for n in ("kept", "vented"))
    assert len({*zip(kept.tolist(), vented.tolist(), strict=True)}) == 4
    for z in first:
        same = [o for o in points if np.array_equal(np.delete(o, 3), np.delete(z, 3))]
        assert problem.misfit(z, factor) == min(problem.misfit(o, factor) for o in same)
    assert len(problem.first_of(points, factor, 6)) == 6
    assert len(problem.first_of(points[:2], factor, 4)) == 2


def test_a_supply_that_cycles_varies_by_more_than_a_regulator():
    evidence, wandering = driven([0.0] * 6), {}
    for share in (0.01, 0.2):
        own = []
        for k, trial in enumerate(evidence.grid.trials):  # in no two trials at the same time
            saw = (trial.t_s / 3.0 + 0.37 * k) % 1.0 - 0.5
            own.append(replace(trial, pressure_kpa=trial.pressure_kpa * (1.0 + share * saw)))
        wandering[share] = examine_drive(collect(campaign_data(own)), RARE, X)
    assert wandering[0.01].is_ordinary
    assert not wandering[0.2].is_ordinary
    assert wandering[0.2].wander == pytest.approx(0.2 / np.sqrt(12.0), rel=0.5)
