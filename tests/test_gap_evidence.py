"""How sure each averaged sample of a campaign is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import campaigns
from plant_cases import campaign_data, trials
from spa_fo.errors import BadInput
from spa_fo.gap.data.evidence import (
    collect,
    noise_floor,
    repeats,
)
from spa_fo.gap.noise.bench_noise import bench_noise
from spa_fo.plant.effects.shared import CURVE_KNOTS_DEG
from spa_fo.plant.sensor_curve import curve_columns, curve_stretch_of
from spa_fo.rig import CampaignData, Trial, read_campaign, read_trials

BEGIN_S, END_S = 0.7, 1.3  # of a gap in which the command rises


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> CampaignData:
    folder = tmp_path_factory.mktemp("evidence") / "steps"
    campaigns.step_campaign(folder, trials=2)
    return read_trials(read_campaign(folder))


def without(trial: Trial, begin_s: float, end_s: float) -> Trial:
    kept = (trial.t_s <= begin_s) | (trial.t_s >= end_s)
    arrays = {
        name: values[kept] for name, values in vars(trial).items() if isinstance(values, np.ndarray)
    }
    return replace(trial, **arrays)


def gapped(data: CampaignData, begin_s: float, end_s: float) -> CampaignData:
    first, *others = data.trials
    return replace(data, trials=(without(first, begin_s, end_s), *others))


def after_reset(trial: Trial, known: int) -> Trial:
    return replace(trial, after_reset=np.arange(trial.t_s.size) >= known)


def test_logs_that_were_cut_short_do_not_say_how_long_a_step_is(clean: CampaignData) -> None:
    whole, *others = clean.trials
    cut = replace(clean, trials=(whole, *(after_reset(trial, 1) for trial in others)))
    assert collect(cut).horizon_s == pytest.approx(0.5 * whole.t_s[-1], rel=0.1)
    nothing = replace(clean, trials=tuple(after_reset(trial, 1) for trial in clean.trials))
    with pytest.raises(BadInput, match="no trial has samples at times that are known"):
        collect(nothing)


def test_what_changed_in_a_gap_of_the_log_did_so_at_any_time_in_it(clean: CampaignData) -> None:
    evidence, before = collect(gapped(clean, BEGIN_S, END_S)), collect(clean)
    rows, whole = evidence.rows[0], before.rows[0]
    time, rising = evidence.grid.time_s[rows], before.grid.time_s[whole]
    variance = np.interp(time, rising, before.variance[whole])
    angle = np.interp(time, rising, before.grid.angle_deg[whole])
    command = clean.trials[0].command_kpa
    assert command is not None
    release_s = clean.trials[0].t_s[np.flatnonzero(np.diff(command) < 0.0)[-1]]
    released = time > release_s + 0.1  # that was logged
    np.testing.assert_allclose(evidence.variance[rows][released], variance[released], rtol=0.2)
    # As it rises, by as much as the angle moves in a twelfth of the gap's square.
    risen = (time > END_S + 0.2) & (time < 2.5)
    moved = np.gradient(angle, time)[risen] ** 2 * (END_S - BEGIN_S) ** 2 / 12.0
    more = evidence.variance[rows][risen] - variance[risen]
    assert np.sqrt(more.mean()) == pytest.approx(np.sqrt(moved.mean()), rel=0.2)
    assert more.min() > 1.0
    # Other trials are as sure as before, but for what the first says of the noise.
    sure = evidence.variance[evidence.rows[1]]
    np.testing.assert_allclose(sure, before.variance[before.rows[1]], rtol=0.05)


def test_a_gap_while_the_input_holds_makes_nothing_unsure(clean: CampaignData) -> None:
    evidence, before = collect(gapped(clean, 3.0, 3.6)), collect(clean)
    rows, whole = evidence.rows[0], before.rows[0]
    time = evidence.grid.time_s[rows]
    variance = np.interp(time, before.grid.time_s[whole], before.variance[whole])
    np.testing.assert_allclose(evidence.variance[rows][time > 4.0], variance[time > 4.0], rtol=0.2)


@pytest.mark.parametrize("period_s", [3.0, 10.0])
def test_a_wave_is_where_it_was_and_where_it_is_after_a_gap(
    clean: CampaignData, period_s: float
) -> None:
    waving = tuple(
        replace(trial, command_kpa=25.0 + 25.0 * np.sin(2.0 * np.pi * trial.t_s / period_s))
        for trial in clean.trials
    )
    data = replace(clean, trials=waving)
    evidence, before = collect(gapped(data, 5.0, 5.4)), collect(data)
    rows, whole = evidence.rows[0], before.rows[0]
    time = evidence.grid.time_s[rows]
    variance = np.interp(time, before.grid.time_s[whole], before.variance[whole])
    later = time > 6.0
    assert np.median(evidence.variance[rows][later] / variance[later]) < 1.2


# --- trials that begin sooner or later ------------------------------------------------------------

GIVEN = np.array([campaigns.TRUTH[name] for name in ("alpha2", "alpha1", "a1", "a0", "b0")])


def resting(trial: Trial, seconds: float) -> Trial:
    """Let a trial's log begin sooner: the actuator rests for so much longer before it is driven."""
    every_s = float(np.median(np.diff(trial.t_s)))
    rows = round(seconds / every_s)
    rng = np.random.default_rng(trial.order)
    noise = rng.normal(0.0, campaigns.NOISE_DEG, rows)
    arrays = {
        "t_s": np.concatenate([every_s * np.arange(rows), trial.t_s + rows * every_s]),
        "angle_deg": np.concatenate([noise, trial.angle_deg]),
    }
    for name in ("command_kpa", "after_reset", "outside_calibration"):
        values = getattr(trial, name)
        arrays[name] = np.concatenate([np.full(rows, values[0]), values])
    return replace(trial, **arrays)


@pytest.mark.parametrize("seconds", [0.2, 0.52, 1.4])
def test_repeats_are_held_together_from_where_each_is_driven(
    clean: CampaignData, seconds: float
) -> None:
    late = {2: seconds, 4: 0.5 * seconds}  # by order: of either experiment one
    own = [resting(t, late[t.order]) if t.order in late else t for t in clean.trials]
    evidence, before = collect(replace(clean, trials=tuple(own))), collect(clean)
    np.testing.assert_array_equal(evidence.alike, before.alike)
    # An experiment's first trial is no later than itself.
    expected = [0.0, 0.0, 0.0, 0.0]
    for i, trial in enumerate(evidence.grid.trials):
        begun = {t.order: late.get(t.order, 0.0) for t in evidence.grid.trials}
        expected[i] = begun[trial.order] - begun[evidence.grid.trials[evidence.alike[i]].order]
    np.testing.assert_allclose(evidence.late_s, expected, atol=0.021)
    assert noise_floor(evidence) == pytest.approx(noise_floor(before), rel=0.1)
    noise, usual = bench_noise(evidence, GIVEN), bench_noise(before, GIVEN)
    assert noise.spectrum.repeats == usual.spectrum.repeats == 2
    assert noise.scatter.time_scale < 0.02
    assert noise.spectrum.deviation_deg == pytest.approx(usual.spectrum.deviation_deg, rel=0.15)
    (one, _) = repeats(evidence, evidence.grid.time_s, np.ones(4, dtype=bool))
    moved = np.nanmedian(one.values[1] - one.values[0])
    assert moved == pytest.approx(evidence.late_s[one.trials[1]], abs=0.05)


def test_a_row_more_or_less_is_no_later_begin(clean: CampaignData) -> None:
    first, *others = clean.trials
    evidence = collect(replace(clean, trials=(resting(first, 0.04), *others)))
    np.testing.assert_array_equal(evidence.late_s, 0.0)
    np.testing.assert_array_equal(evidence.alike, collect(clean).alike)


def pressed(seed: int, noise_kpa: float) -> CampaignData:
    """Four triangles that a pressure was measured of, and no command."""
    rng = np.random.default_rng(seed)
    t = 0.02 * np.arange(1000)
    kpa = np.maximum(30.0 - 3.0 * np.abs(t - 10.0), 0.0)
    own = trials(kpa, kpa, kpa, kpa)
    noisy = [kpa + noise_kpa * rng.normal(size=kpa.size) for _ in own]
    return campaign_data(
        [replace(one, command_kpa=None, pressure_kpa=p) for one, p in zip(own, noisy, strict=True)]
    )


@pytest.mark.parametrize("noise_kpa", [0.15, 0.6])
def test_noise_of_a_measured_pressure_is_no_begin(noise_kpa: float) -> None:
    evidence = collect(pressed(2, noise_kpa))
    np.testing.assert_array_equal(evidence.alike, 0)
    np.testing.assert_array_equal(evidence.late_s, 0.0)


def test_a_glitch_of_the_command_is_no_begin(clean: CampaignData) -> None:
    first, *others = clean.trials
    assert first.command_kpa is not None
    for rows, kpa in ((slice(0, 1), 20.0), (slice(20, 21), 3.0)):  # a stale row, one too soon
        command = first.command_kpa.copy()
        command[rows] = kpa
        evidence = collect(replace(clean, trials=(replace(first, command_kpa=command), *others)))
        np.testing.assert_array_equal(evidence.alike, collect(clean).alike)
        np.testing.assert_array_equal(evidence.late_s, 0.0)


def test_what_begins_elsewhere_is_no_repeat_that_is_late(clean: CampaignData) -> None:
    first, *others = clean.trials
    late = resting(first, 0.6)
    assert late.command_kpa is not None
    before = late.command_kpa + np.where(late.t_s < 1.6, 0.4 * late.command_kpa.max(), 0.0)
    evidence = collect(replace(clean, trials=(replace(late, command_kpa=before), *others)))
    alike = next(i for i, t in enumerate(evidence.grid.trials) if t.order == first.order)
    assert np.count_nonzero(evidence.alike == evidence.alike[alike]) == 1


def test_an_error_of_the_curve_may_bend_as_often_over_a_small_range() -> None:
    for reach, stretch in ((20.0, 1.0 / 3.0), (60.0, 1.0), (80.0, 1.0), (180.0, 2.0)):
        assert curve_stretch_of(reach) == pytest.approx(stretch)
    knots = np.array(CURVE_KNOTS_DEG[2:])
    at_knots = curve_columns(knots / 3.0, 1.0 / 3.0)[:, 1:]
    np.testing.assert_allclose(at_knots, np.eye(knots.size), atol=1e-12)
