"""Noise within trials and scatter between them, each against its own definition."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from plant_cases import KPA, SIXTY, X, campaign_data, step_release, trials, vector
from spa_fo import simulate
from spa_fo.gap.data.evidence import Evidence, angle_chain, collect
from spa_fo.gap.data.searched import at_rate
from spa_fo.gap.noise import bench_noise as module
from spa_fo.gap.noise.bench_noise import BenchNoise, bench_noise, noise_beside, shown_of_gain
from spa_fo.gap.noise.coloured import (
    CORRELATION_S,
    TYPICAL_DEG,
    Averages,
    Differences,
    Scatter,
    Spectrum,
    _deviation,
    contrasts,
    estimate,
    scatter,
)
from spa_fo.gap.noise.dwell_error import UNKNOWN, DwellError, dwell_error
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import absent
from spa_fo.rig.calibration import Calibration, calibrate

Floats = NDArray[np.float64]

STEP_S = 0.02
TYPICAL = Scatter(gain=0.01, rest_deg=0.2, time_scale=0.01)


def steps(lengths: list[int], fixed: float = 0.0) -> Averages:
    """Averages over so many samples each."""
    count = np.array(lengths, dtype=float)
    ends = np.cumsum(count) * STEP_S
    return Averages(ends - 0.5 * count * STEP_S, count * STEP_S, count, np.full(count.size, fixed))


@settings(deadline=None, max_examples=20)
@given(st.lists(st.integers(1, 16), min_size=2, max_size=6))
def test_correlations_of_averages_are_those_of_their_samples(lengths: list[int]) -> None:
    """Each window cut into many pieces, the process's own correlation between all of them."""
    averages = steps(lengths)
    pieces = 200
    fine = (np.arange(pieces) + 0.5) / pieces - 0.5
    inside = [m + w * fine for m, w in zip(averages.time_s, averages.width_s, strict=True)]
    for k, tau in enumerate(CORRELATION_S):
        naive = np.array(
            [
                [np.mean(np.exp(-np.abs(a[:, None] - b[None, :]) / tau)) for b in inside]
                for a in inside
            ]
        )
        np.testing.assert_allclose(averages.correlations()[k], naive, atol=2e-4)


def test_a_whitener_makes_noise_white_and_knows_its_determinant() -> None:
    averages = steps([1, 1, 2, 4, 8, 8, 8])
    noise = Spectrum(0.04, np.full(CORRELATION_S.size, 0.1))
    covariance = np.tensordot(noise.coloured, averages.correlations(), axes=1)
    covariance += np.diag(0.04 / averages.count)
    w = noise.whitener(averages)
    np.testing.assert_allclose(w @ covariance @ w.T, np.eye(7), atol=1e-10)
    assert np.allclose(w, np.tril(w))
    assert -2.0 * np.sum(np.log(np.diag(w))) == pytest.approx(np.linalg.slogdet(covariance)[1])


def bench(
    coloured_deg: float, correlation_s: float, white_deg: float, own: Scatter, seed: int
) -> list[Differences]:
    """Make four experiments of four trials each on a bench of this noise and scatter."""
    rng = np.random.default_rng(seed)
    lengths = ([1] * 20 + [2] * 20 + [4] * 10 + [8] * 10) * 3
    averages = steps(lengths, fixed=1e-6)
    count = averages.count
    time = STEP_S * (np.arange(int(count.sum())) + 0.5)
    starts = np.append(0, np.cumsum(lengths)[:-1])
    answer = 50.0 * (1.0 - np.exp(-time / 2.0))
    quicker = 25.0 * time * np.exp(-time / 2.0)
    found = []
    for _ in range(4):
        trials = []
        for _ in range(4):
            gain, rest, scale = rng.standard_normal(3)
            noise = np.empty(time.size)
            noise[0] = coloured_deg * rng.standard_normal()
            keep = np.exp(-STEP_S / correlation_s)
            kicks = coloured_deg * np.sqrt(1.0 - keep**2) * rng.standard_normal(time.size)
            for i in range(1, time.size):
                noise[i] = keep * noise[i - 1] + kicks[i]
            noise += white_deg * rng.standard_normal(time.size)
            whole = (1.0 + own.gain * gain) * answer + own.time_scale * scale * quicker
            trials.append(np.add.reduceat(whole + own.rest_deg * rest + noise, starts) / count)
        mean_quicker = np.add.reduceat(quicker, starts) / count
        found.append(contrasts(np.array(trials), averages, mean_quicker))
    return found


@pytest.mark.parametrize(
    ("coloured_deg", "correlation_s"), [(0.25, 0.8), (0.3, 0.06), (0.02, 0.5), (0.4, 2.0)]
)
def test_noise_is_found_as_it_was_made(coloured_deg: float, correlation_s: float) -> None:
    found = estimate(bench(coloured_deg, correlation_s, 0.05, TYPICAL, 3), 0.055)
    assert found.repeats == 12
    expected = np.hypot(coloured_deg, 0.05)
    assert found.deviation_deg == pytest.approx(expected, rel=0.25)
    mean_log = float(found.coloured @ np.log(CORRELATION_S) / found.coloured.sum())
    if coloured_deg > 0.1:
        assert np.exp(mean_log) == pytest.approx(correlation_s, rel=0.6)


def test_scatter_is_found_and_is_no_noise() -> None:
    """16 trials: a standard deviation is known within a fifth."""
    own = Scatter(gain=0.03, rest_deg=0.6, time_scale=0.03)
    differences = bench(0.1, 0.5, 0.05, own, 4)
    noise = estimate(differences, 0.05)
    assert noise.deviation_deg == pytest.approx(np.hypot(0.1, 0.05), rel=0.3)
    found = scatter(differences, noise, TYPICAL)
    assert found.gain == pytest.approx(own.gain, rel=0.4)
    assert found.time_scale == pytest.approx(own.time_scale, rel=0.4)
    assert found.rest_deg == pytest.approx(own.rest_deg, rel=0.4)


@given(values=st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=8), typical=st.floats(0.05, 2.0))
def test_values_without_errors_scatter_by_their_mean_square(values: list[float], typical: float):
    exactly = _deviation(np.array(values), np.zeros(len(values)), typical)
    squares = 2.0 * typical**2 + np.sum(np.square(values))
    assert exactly == pytest.approx(np.sqrt(squares / (2.0 + len(values))), rel=1e-3)


def test_what_hardly_tells_a_scatter_hardly_counts() -> None:
    """Of transients that two of many experiments lack a time scale may seem to be anything."""
    rng = np.random.default_rng(11)
    known, unsure = 0.02 * rng.standard_normal(40), 0.6 * rng.standard_normal(4)
    errors = np.concatenate([np.full(40, 0.005), np.full(4, 0.5)])
    values = np.concatenate([known + 0.005 * rng.standard_normal(40), unsure])
    found = _deviation(values, errors**2, 0.01)
    assert found == pytest.approx(0.02, rel=0.25)
    assert found == pytest.approx(_deviation(values[:40], errors[:40] ** 2, 0.01), rel=0.02)
    # As much as errors make of nothing is no scatter.
    nothing = _deviation(errors * rng.standard_normal(44), errors**2, 0.01)
    assert nothing < 0.012
    assert _deviation(np.ones(3), np.zeros(3), 0.0) == 0.0


def test_a_periodic_interference_is_no_noise() -> None:
    quiet = bench(0.05, 0.5, 0.05, TYPICAL, 5)
    rng = np.random.default_rng(6)
    humming = []
    for d in quiet:
        phase = rng.uniform(0.0, 2.0 * np.pi, (d.values.shape[0], 1))
        wave = 1.0 * np.sinc(1.3 * d.width_s) * np.cos(2.0 * np.pi * 1.3 * d.time_s + phase)
        humming.append(replace(d, values=d.values + wave))
    assert estimate(humming, 0.05).deviation_deg < 1.6 * estimate(quiet, 0.05).deviation_deg


def test_without_repeats_noise_is_what_benches_have() -> None:
    found = estimate([], 0.03)
    assert found.repeats == 0
    np.testing.assert_allclose(np.sqrt(found.coloured), TYPICAL_DEG, rtol=1e-4)
    assert np.sqrt(found.white) == pytest.approx(0.03, rel=1e-4)
    assert scatter([], found, TYPICAL) == TYPICAL


def test_contrasts_have_the_noise_of_one_trial_and_no_mean() -> None:
    rng = np.random.default_rng(7)
    averages = steps([4] * 30)
    angles = np.linspace(0.0, 40.0, 30) + rng.standard_normal((5, 30))
    found = contrasts(angles, averages, np.zeros(30))
    assert found.values.shape == (4, 30)
    shifted = contrasts(angles + 7.0, averages, np.zeros(30))
    np.testing.assert_allclose(found.values, shifted.values, atol=1e-9)
    squares = np.sum((angles - angles.mean(axis=0)) ** 2)
    assert np.sum(found.values**2) == pytest.approx(squares)


def test_a_gain_of_a_trials_own_shows_where_readings_go_on() -> None:
    plain = np.concatenate([np.linspace(0.0, 60.0, 200), np.linspace(60.0, 0.0, 200)])
    noise = 0.2 * np.random.default_rng(8).standard_normal(plain.size)
    np.testing.assert_allclose(shown_of_gain(plain, 0.9 * plain + noise), 1.0, atol=0.05)
    stopped = shown_of_gain(plain, np.minimum(plain, 35.0) + noise)
    assert stopped[plain < 20.0].min() > 0.9
    assert stopped[plain > 50.0].max() < 0.1
    assert (shown_of_gain(np.zeros(5), np.zeros(5)) == 1.0).all()


def saturating(scatter_of_gain: float) -> Evidence:
    """Five steps each to 30 and to 60 degrees, of a sensor that stops at 36."""
    rng = np.random.default_rng(9)
    runs = []
    steps = [step_release(level) for level in (0.5 * SIXTY, SIXTY) for _ in range(5)]
    for number, trial in enumerate(trials(*steps)):
        assert trial.command_kpa is not None
        angle = np.degrees(simulate(trial.t_s, trial.command_kpa / KPA, *X, hold="zero"))
        angle = np.minimum((1.0 + scatter_of_gain * rng.standard_normal()) * angle, 36.0)
        read = angle + 0.05 * rng.standard_normal(angle.size)
        runs.append(replace(trial, experiment=f"level_{number // 5}", angle_deg=read))
    return collect(campaign_data(runs))


def test_the_scatter_of_gain_is_found_though_the_sensor_stops(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    evidence, x = saturating(0.04), np.array(X)
    found = bench_noise(evidence, x)
    assert found.scatter.gain == pytest.approx(0.04, rel=0.3)
    monkeypatch.setattr(module, "shown_of_gain", lambda plain, angle: np.ones(plain.size))
    assert bench_noise(evidence, x).scatter.gain < 0.75 * found.scatter.gain


def test_what_a_softening_lets_repeats_differ_by_is_no_scatter_beside_it() -> None:
    steps = [step_release(level) for level in (SIXTY, 0.6 * SIXTY) for _ in range(4)]
    evidence, x = collect(campaign_data(trials(*steps))), np.array(X)
    chain, e = angle_chain(evidence, x, None), vector("mullins_softening", fraction=0.8)
    softened = chain.run(x, e)[0]
    own = 1.0 + 0.01 * np.random.default_rng(5).standard_normal(len(steps))
    noisy = own[evidence.grid.sample_trial] * softened
    noisy += 0.05 * np.random.default_rng(6).standard_normal(softened.size)
    evidence = replace(evidence, grid=replace(evidence.grid, angle_deg=noisy))
    by_itself, beside = bench_noise(evidence, x), noise_beside(evidence, x, softened)
    assert not by_itself.is_ordinary
    assert beside.is_ordinary
    assert beside.scatter.gain == pytest.approx(0.01, rel=0.5)
    # What lets all repeats be alike changes nothing.
    plain = chain.run(x, absent())[0]
    alike = noise_beside(evidence, x, plain)
    assert alike.scatter.gain == pytest.approx(by_itself.scatter.gain, rel=1e-2)
    assert not alike.is_ordinary
    assert np.array_equal(evidence.grid.angle_deg, noisy)


# --- the fixture ----------------------------------------------------------------------------------


def calibrated(
    error_deg: float,
    loop_deg: float,
    seed: int,
    both: bool = True,
    changed_deg: float = 0.0,
    falling: bool = False,
    mark_deg: float = 0.0,
) -> Calibration:
    """A calibration over 19 angles, up and down or up alone; its film has a smooth loop.

    `changed_deg` is a wave that the sensor's curve has; counts may fall with the angle. By
    `mark_deg` each known angle errs in both ways alike.
    """
    rng = np.random.default_rng(seed)
    angles = np.arange(0.0, 91.0, 5.0)
    known = np.concatenate([angles, angles[::-1]]) if both else angles
    up = np.arange(known.size) < angles.size
    loop = loop_deg * np.where(up, 0.5, -0.5) * np.sin(np.pi * known / 90.0)
    wave = changed_deg * np.sin(np.pi * known / 20.0)
    marks = mark_deg * np.random.default_rng(seed + 1000).standard_normal(angles.size)
    errors = error_deg * rng.standard_normal(known.size)
    errors += np.concatenate([marks, marks[::-1]]) if both else marks
    counts = 10.0 * (known + loop + wave + errors)
    t_s = np.arange(0.0, 5.0 * known.size, 0.1)
    at = np.minimum((t_s / 5.0).astype(int), known.size - 1)
    read = 1000.0 - counts if falling else 100.0 + counts
    return calibrate(t_s, known[at], read[at], f"{seed}.log")


@pytest.mark.parametrize("error_deg", [0.03, 0.2, 0.8])
@pytest.mark.parametrize("loop_deg", [0.0, 3.0])
def test_the_error_of_a_dwells_angle_is_found_beside_a_loop(
    error_deg: float, loop_deg: float
) -> None:
    found = [dwell_error([calibrated(error_deg, loop_deg, seed)]) for seed in range(12)]
    squares = np.array([each.deg**2 for each in found if each.deg is not None])
    assert np.sqrt(squares.mean()) == pytest.approx(error_deg, rel=0.2, abs=0.02)


def test_how_a_film_came_to_the_first_dwell_is_no_error_of_its_angle() -> None:
    known = np.concatenate([np.arange(0.0, 31.0, 5.0), np.arange(25.0, -1.0, -5.0)])
    loop = np.where(np.arange(known.size) < 7, 2.0, -2.0)
    t_s = np.arange(0.0, 5.0 * known.size, 0.1)
    at = np.minimum((t_s / 5.0).astype(int), known.size - 1)

    def found(first: float) -> float | None:
        counts = 100.0 + 10.0 * (known + np.append(first, loop[1:]))
        return dwell_error([calibrate(t_s, known[at], counts[at], "pre.log")]).deg

    # No way led to the first dwell: its film may be anywhere in the loop.
    assert found(0.0) == pytest.approx(found(2.0), rel=0.2)


@pytest.mark.parametrize("mark_deg", [0.0, 0.3, 1.0])
def test_a_wrong_mark_is_told_by_the_scatter_about_the_smooth_curve(mark_deg: float) -> None:
    found = [dwell_error([calibrated(0.05, 1.0, seed, mark_deg=mark_deg)]) for seed in range(12)]
    squares = np.array([each.mark_deg**2 for each in found])
    assert np.sqrt(squares.mean()) == pytest.approx(mark_deg, rel=0.35, abs=0.08)
    # The ways' difference does not hold it.
    errors = [each.deg for each in found if each.deg is not None]
    assert np.mean(errors) == pytest.approx(0.05, rel=0.3)


def test_an_estimate_scatters_by_the_degrees_of_freedom_that_say_it() -> None:
    for both in (True, False):
        found = [dwell_error([calibrated(0.8, 1.0, seed, both)]) for seed in range(150)]
        squares = np.array([each.deg**2 for each in found if each.deg is not None])
        told = np.mean([each.told for each in found])
        # Nineteen angles bend at seventeen of them, each with its neighbours.
        assert told < (10.0 if both else 17.0)
        assert 2.0 * squares.mean() ** 2 / squares.var() == pytest.approx(told, rel=0.4)


def test_no_fixture_is_exact_though_a_coarse_converter_reads_the_same_both_ways() -> None:
    exact = dwell_error([calibrated(0.0, 0.0, 1)]).deg
    assert exact is not None
    assert 0.0 < exact < 0.01


def test_what_has_become_of_the_curve_since_is_no_error_of_the_fixture() -> None:
    found = [
        dwell_error([calibrated(0.2, 1.0, seed), calibrated(0.2, 1.0, seed + 50, changed_deg=4.0)])
        for seed in range(12)
    ]
    mean = np.sqrt(np.mean([each.deg**2 for each in found if each.deg is not None]))
    assert mean == pytest.approx(0.2, rel=0.25)


@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("error_deg", [0.2, 0.8])
def test_one_way_scatters_about_its_smooth_curve_by_the_error(
    error_deg: float, falling: bool
) -> None:
    one_way = [calibrated(error_deg, 3.0, seed, False, falling=falling) for seed in range(12)]
    found = [dwell_error([each]) for each in one_way]
    assert all(each.told > 4.0 and not each.mark_deg for each in found)
    mean = np.sqrt(np.mean([each.deg**2 for each in found if each.deg is not None]))
    assert mean == pytest.approx(error_deg, rel=0.25)


def test_few_angles_move_the_error_from_what_is_usual_by_as_much_as_they_say() -> None:
    def few(error_deg: float, seed: int) -> SimpleNamespace:
        found = calibrated(error_deg, 0.0, seed)
        kept = [d for d in found.dwells if d.angle_deg in (0.0, 20.0, 45.0, 85.0)]
        return SimpleNamespace(
            dwells=kept, angle_deg=lambda counts: (counts - 100.0) / 10.0, of_known=np.eye(4)
        )

    usual = SETTINGS.dwell_error_deg
    exact, rough = (dwell_error([few(error, 1)]) for error in (0.0, 5.0))  # type: ignore[list-item]
    assert exact.told == 1.0
    assert exact.deg == pytest.approx(np.sqrt(0.75) * usual)
    assert exact.mark_deg == usual  # a curve through every angle says nothing of the marks
    assert rough.deg is not None
    assert rough.deg > 3.0 * usual


def test_a_curve_through_every_angle_says_nothing_of_their_error() -> None:
    assert dwell_error([]) == UNKNOWN
    t_s = np.arange(0.0, 15.0, 0.1)
    at = np.minimum((t_s / 5.0).astype(int), 2)
    three = calibrate(t_s, np.array([0.0, 40.0, 90.0])[at], np.array([1.0, 400.0, 980.0])[at], "c")
    assert dwell_error([three]) == UNKNOWN


def test_what_the_bench_adds_is_said_where_trials_were_repeated() -> None:
    own = Scatter(gain=0.015, rest_deg=0.2, time_scale=0.02)
    noise = Spectrum(0.0, np.array([0.0, 0.0, 0.0625, 0.0, 0.0, 0.0]), 12)
    both, one = (DwellError(0.2, 9.0, mark_deg) for mark_deg in (0.15, 0.0))
    said = BenchNoise(noise, own, both).sentence()
    assert "noise of 0.25°, correlated over about 1 s" in said
    assert "1.5 % in gain, 0.2° at rest, 2 % in time scale" in said
    assert said.endswith("known angles err by about 0.2° from dwell to dwell.")
    assert BenchNoise(noise, own, one).sentence().endswith("known angles err by about 0.2°.")
    assert "known angles" not in BenchNoise(noise, own, UNKNOWN).sentence()
    alone = Spectrum(noise.white, noise.coloured, 0)
    assert BenchNoise(alone, own, both).sentence() == ""


@pytest.mark.parametrize(
    ("gain", "rest_deg", "time_scale"), [(0.14, 0.2, 0.01), (0.01, 1.3, 0.01), (0.01, 0.2, 0.09)]
)
def test_trials_that_differ_by_more_than_those_of_benches_show_something(
    gain: float, rest_deg: float, time_scale: float
) -> None:
    spectrum = Spectrum(0.01, np.full(6, 0.01), repeats=4)
    ordinary = BenchNoise(spectrum, Scatter(0.03, 0.2, 0.03), UNKNOWN)
    wild = replace(ordinary, scatter=Scatter(gain, rest_deg, time_scale))
    assert ordinary.is_ordinary
    assert not wild.is_ordinary
    assert "something varies between them" in wild.sentence()
    assert "something varies between them" not in ordinary.sentence()
    # So does what goes with their order, whatever it is called.
    assert not replace(ordinary, zeros_deg=np.repeat([0.0, 2.6], 4)).is_ordinary
    assert not replace(ordinary, gains=np.repeat([0.0, 0.12], 4)).is_ordinary
    assert replace(ordinary, zeros_deg=np.repeat([0.0, 1.0], 4)).is_ordinary


def test_a_time_scale_that_few_repeats_tell_is_ordinary_for_longer() -> None:
    usual = Scatter(0.01, 0.2, 0.01)
    most = SETTINGS.most_scatter * SETTINGS.scatter

    def ordinary(repeats: int, **scatter: float) -> bool:
        spectrum = Spectrum(0.04, np.zeros(CORRELATION_S.size), repeats)
        return BenchNoise(
            spectrum, replace(usual, **scatter), DwellError(0.1, 9.0, 0.1)
        ).is_ordinary

    assert ordinary(4)
    assert not ordinary(4, gain=1.05 * most)
    assert ordinary(4, time_scale=1.3 * most)
    assert ordinary(400, time_scale=1.1 * most)
    assert not ordinary(400, time_scale=1.3 * most)
    assert not ordinary(4, time_scale=2.0 * most)


@pytest.mark.parametrize(("rate", "ordinary"), [(0.5, False), (200.0, True)])
def test_a_time_scale_that_hardly_moves_an_angle_is_no_sign_of_anything(
    rate: float, ordinary: bool
) -> None:
    """Of an actuator that is quick against the rows a late row looks like one."""
    x = at_rate(np.array(X), rate)
    evidence = collect(campaign_data(trials(*[step_release(SIXTY, up=9.0) for _ in range(8)])))
    chain, rng = angle_chain(evidence, x, None), np.random.default_rng(2)
    scales = np.exp(0.15 * rng.standard_normal(8))
    runs = [chain.run(at_rate(x, scale), absent())[0] for scale in scales]
    angle = np.array(runs)[evidence.grid.sample_trial, np.arange(evidence.grid.angle_deg.size)]
    angle = angle * (1.0 + 0.02 * rng.standard_normal(8))[evidence.grid.sample_trial]
    noisy = angle + 0.3 * rng.standard_normal(angle.size)
    found = bench_noise(replace(evidence, grid=replace(evidence.grid, angle_deg=noisy)), x)
    assert found.scatter.time_scale == pytest.approx(0.15, rel=0.6)
    assert (found.paced < SETTINGS.no_gap) == ordinary
    assert found.is_ordinary == ordinary
