"""Interference on the flex channel: found where it is, and in no coloured noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import campaigns
from spa_fo.gap.data.evidence import collect
from spa_fo.gap.noise.coloured import CORRELATION_S, Spectrum
from spa_fo.gap.noise.interference import (
    WORTH_A_FIT,
    Line,
    fast_line,
    slow_line,
    without_lines,
)
from spa_fo.gap.noise.whitening import Whitening, lay_rows
from spa_fo.rig import CampaignData, read_campaign, read_trials

STEP_S, SAMPLES, TRIALS = 0.16, 120, 6
QUIET = Spectrum(0.01, np.full(CORRELATION_S.size, 0.002))


def searched(hz: float, amplitude_deg: float, seed: int = 1) -> Line:
    """Look for a line in coloured noise, a wave of a phase of its own added to every trial."""
    rng = np.random.default_rng(seed)
    time = np.tile(STEP_S * (np.arange(SAMPLES) + 0.5), TRIALS)
    trial = np.repeat(np.arange(TRIALS), SAMPLES)
    groups = [[np.flatnonzero(trial == t)] for t in range(TRIALS)]
    ones = np.ones(trial.size)
    rows = lay_rows(groups, time, STEP_S * ones, 8.0 * ones, 1e-4 * ones, trial, 10**6)
    whitening = Whitening(rows, QUIET, 0.0 * ones)
    factor = whitening.factor(1.0, 0.0)
    draws = [(own, rng.standard_normal(own.shape[0])) for own in factor.whiteners]
    noise = np.concatenate([np.linalg.solve(own, draw) for own, draw in draws])
    phase = np.repeat(rng.uniform(0.0, 2.0 * np.pi, TRIALS), SAMPLES)
    left = noise + amplitude_deg * np.sin(2.0 * np.pi * hz * time + phase)
    taken = np.linalg.qr(whitening.white(factor, ones[:, None]))[0].T
    return slow_line(rows, whitening, factor, whitening.white(factor, left), taken)


@pytest.mark.parametrize("hz", [0.4, 1.1, 2.6])
def test_a_slow_line_is_found_with_its_frequency(hz: float) -> None:
    found = searched(hz, 0.6)
    assert found.frequency_hz == pytest.approx(hz, abs=0.03)
    assert found.amplitude_deg == pytest.approx(0.6, rel=0.5)  # it is searched on a coarse grid
    assert found.gain > 20.0


@pytest.mark.parametrize("seed", range(6))
def test_coloured_noise_alone_shows_none(seed: int) -> None:
    assert searched(1.0, 0.0, seed).gain < 3.0


@pytest.mark.parametrize(
    ("cycles", "amplitude_deg"),
    [
        (0.5, 0.6),
        (1.0, 0.6),
        (1.0, 2.0),
        (1.8, 0.6),
        (2.5, 0.6),
    ],
)
def test_a_wave_slower_than_three_cycles_a_trial_is_none(
    cycles: float, amplitude_deg: float
) -> None:
    """It may be any drift."""
    found = searched(cycles / (STEP_S * (SAMPLES - 1)), amplitude_deg)
    assert found.gain < WORTH_A_FIT


def test_a_wave_a_little_faster_is_one() -> None:
    hz = 3.3 / (STEP_S * (SAMPLES - 1))
    found = searched(hz, 0.6)
    assert found.frequency_hz == pytest.approx(hz, abs=0.03)
    assert found.gain > 20.0


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> CampaignData:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    campaigns.step_campaign(folder, trials=3)
    return read_trials(read_campaign(folder))


def hummed(data: CampaignData, hz: float, amplitude_deg: float) -> CampaignData:
    """Add a wave whose phase is each trial's own."""
    phases = np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, len(data.trials))
    trials = tuple(
        replace(
            trial,
            angle_deg=trial.angle_deg
            + amplitude_deg * np.sin(2.0 * np.pi * hz * trial.t_s + phase),
        )
        for trial, phase in zip(data.trials, phases, strict=True)
    )
    return replace(data, trials=trials)


@pytest.mark.parametrize("hz", [4.3, 8.0, 11.9])
def test_a_fast_line_is_found_with_its_frequency_and_amplitude(
    hz: float, clean: CampaignData
) -> None:
    found = fast_line(collect(hummed(clean, hz, 0.8)))
    assert found.frequency_hz == pytest.approx(hz, abs=0.05)
    assert found.amplitude_deg == pytest.approx(0.8, rel=0.15)
    assert found.gain > 100.0


@pytest.mark.parametrize("hz", [8.0, 12.2])
def test_a_line_does_not_hide_itself_where_it_leaks_far(hz: float, clean: CampaignData) -> None:
    """In short trials; near half the sampling rate it has neighbours on one side alone."""
    logged = [
        *("t_s", "command_kpa", "pressure_kpa", "flex_adc", "angle_deg"),
        *("after_reset", "outside_calibration"),
    ]
    columns = [{n: getattr(t, n) for n in logged} for t in clean.trials]
    cut = [{n: None if c is None else c[:150] for n, c in own.items()} for own in columns]
    short = tuple(replace(trial, **own) for trial, own in zip(clean.trials, cut, strict=True))
    found = [fast_line(collect(hummed(replace(clean, trials=short), hz, d))) for d in (0.2, 2.0)]
    assert [line.frequency_hz for line in found] == pytest.approx([hz, hz], abs=0.1)
    # Ten times the amplitude has a hundred times the power.
    assert found[1].gain > 50.0 * found[0].gain > 0.0


def late_by_jitter(data: CampaignData, share: float) -> CampaignData:
    """Let each interval between samples be longer by up to a share: the loop's work takes time."""
    rng = np.random.default_rng(5)

    def later(t_s: np.ndarray) -> np.ndarray:
        steps = np.diff(t_s) * (1.0 + share * rng.uniform(size=t_s.size - 1))
        return t_s[0] + np.append(0.0, np.cumsum(steps))

    return replace(data, trials=tuple(replace(t, t_s=later(t.t_s)) for t in data.trials))


@pytest.mark.parametrize(("hz", "error"), [(8.0, 0.15), (17.3, 0.15), (50.0, 0.15), (120.0, 0.25)])
def test_a_line_is_found_in_a_log_whose_intervals_differ(
    hz: float, error: float, clean: CampaignData
) -> None:
    """Samples count when they were taken, which tells a line from its alias, a rectified hum too.

    A part of it is in the means over averaging steps.
    """
    data = late_by_jitter(clean, 0.3)
    assert np.diff(data.trials[0].t_s).min() > 1.0 / 50.0
    found = fast_line(collect(hummed(data, hz, 0.8)))
    assert found.frequency_hz == pytest.approx(hz, abs=0.02)
    assert found.amplitude_deg == pytest.approx(0.8, rel=error)
    assert fast_line(collect(data)).gain == 0.0


def test_a_line_above_half_the_rate_of_a_regular_log_is_its_alias(clean: CampaignData) -> None:
    rate = 1.0 / float(np.median(np.diff(clean.trials[0].t_s)))
    found = fast_line(collect(hummed(clean, rate - 8.0, 0.8)))
    assert found.frequency_hz == pytest.approx(8.0, abs=0.05)


def test_lines_of_readings_that_are_held_are_no_interference(clean: CampaignData) -> None:
    read = [np.floor(trial.t_s / 0.25 + 1e-9) * 0.25 for trial in clean.trials]
    trials = tuple(
        replace(trial, angle_deg=np.interp(at, trial.t_s, trial.angle_deg))
        for trial, at in zip(clean.trials, read, strict=True)
    )
    held = collect(replace(clean, trials=trials))
    assert held.grid.held_s is not None
    assert fast_line(held).gain == 0.0


def test_no_fast_line_is_found_where_there_is_none(clean: CampaignData) -> None:
    assert fast_line(collect(clean)).gain == 0.0


def test_white_noise_of_another_level_is_no_line(clean: CampaignData) -> None:
    rng = np.random.default_rng(3)
    louder = tuple(
        replace(trial, angle_deg=trial.angle_deg + rng.normal(0.0, 1.0, trial.t_s.size))
        for trial in clean.trials
    )
    assert fast_line(collect(replace(clean, trials=louder))).gain < WORTH_A_FIT


@pytest.mark.parametrize("hz", [8.0, 20.3])
def test_lines_are_taken_off_and_leave_what_was_there(hz: float, clean: CampaignData) -> None:
    """With a harmonic, and a phase of its own in every trial."""
    before = collect(clean)
    loud = hummed(hummed(clean, hz, 2.0), 0.51 * hz, 0.6)
    found = without_lines(collect(loud))
    assert found.line_deg == pytest.approx(np.hypot(2.0, 0.6) / np.sqrt(2.0), rel=0.05)
    assert found.noise_deg == pytest.approx(before.noise_deg, rel=0.2)
    assert collect(loud).noise_deg > 3.0 * before.noise_deg
    left = found.grid.angle_deg - before.grid.angle_deg
    assert np.sqrt(np.mean(left**2)) < 0.3 * before.noise_deg + 0.03


def test_what_was_taken_off_is_as_large_as_is_said_where_the_phase_wanders(
    clean: CampaignData,
) -> None:
    wandering = tuple(
        replace(
            trial,
            angle_deg=trial.angle_deg
            + 2.0 * np.sin(2.0 * np.pi * (9.0 * trial.t_s + 0.2 * np.sin(trial.t_s))),
        )
        for trial in clean.trials
    )
    logged = collect(replace(clean, trials=wandering))
    found = without_lines(logged)
    pairs = zip(logged.grid.trials, found.grid.trials, strict=True)
    taken = np.concatenate([before.angle_deg - after.angle_deg for before, after in pairs])
    assert found.line_deg == pytest.approx(np.sqrt(np.mean(taken**2)))
    assert found.line_deg > 1.0


def test_a_converters_step_is_that_of_the_log(clean: CampaignData) -> None:
    """What is left of an interference is no whole number of steps."""
    coarse = tuple(
        replace(trial, angle_deg=np.round(trial.angle_deg / 0.7) * 0.7)
        for trial in hummed(clean, 8.0, 0.5).trials
    )
    logged = collect(replace(clean, trials=coarse))
    found = without_lines(logged)
    assert found.line_deg > 0.2
    assert found.step_deg == logged.step_deg == pytest.approx(0.7)


def test_nothing_is_taken_off_where_there_is_no_line(clean: CampaignData) -> None:
    evidence = collect(clean)
    assert without_lines(evidence) is evidence
