"""Logs whose zero is their own (`rest: zero`): what is predicted of them has that zero, too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from campaigns import step_campaign, write_yaml
from plant_cases import KPA, X, campaign_data, entry, model, step_release, trials, vector
from spa_fo.plant.augmented import predict_augmented
from spa_fo.plant.chain import chain_for
from spa_fo.plant.grid import campaign_grid
from spa_fo.rig import Trial, load_trials, read_campaign, read_trials, write_trials

REST_S = 0.5
REMNANT_DEG = 0.5  # what a play of 3 kPa leaves is more


def zeroed(*commands: np.ndarray) -> tuple[Trial, ...]:
    return tuple(replace(trial, zero_until_s=REST_S) for trial in trials(*commands))


def rests(run: tuple[Trial, ...], angle_deg: list[np.ndarray]) -> list[float]:
    return [float(y[t.t_s < REST_S].mean()) for t, y in zip(run, angle_deg, strict=True)]


@settings(deadline=None)
@given(seed=st.integers(0, 99), first=st.booleans())
def test_each_logs_own_mean_is_taken_off(seed: int, first: bool) -> None:
    """Of a grid whose samples hold several rows: against a loop over rows."""
    run = (trials(step_release()) if first else zeroed(step_release())) + tuple(
        replace(one, order=2, started_s=60.0) for one in zeroed(step_release(20.0))
    )
    grid = campaign_grid(run)
    values = np.random.default_rng(seed).normal(size=grid.counts.size)
    expected = values.copy()
    for k, trial in enumerate(run):
        of_rows = np.repeat(values, grid.counts.astype(int))
        mine = np.repeat(grid.sample_trial, grid.counts.astype(int)) == k
        rows = zip(of_rows[mine], trial.t_s, strict=True)
        before = [value for value, t in rows if t < trial.zero_until_s]
        expected[grid.sample_trial == k] -= float(np.mean(before)) if before else 0.0
    assert grid.zeroed(values) == pytest.approx(expected, abs=1e-12)
    both = grid.zeroed(np.column_stack([values, -2.0 * values]))
    assert both[:, 1] == pytest.approx(-2.0 * expected, abs=1e-12)


def test_what_a_play_leaves_does_not_show_in_logs_with_a_zero_of_their_own() -> None:
    commands = [step_release(), step_release(), step_release()]
    shown = {}
    for name, run in (("own", zeroed(*commands)), ("sensor's", trials(*commands))):
        grid = campaign_grid(run)
        angle, _ = chain_for(grid, X, KPA).run(X, vector("drive_backlash"))
        split = np.split(angle, np.flatnonzero(np.diff(grid.sample_trial)) + 1)
        shown[name] = [float(y[0]) for y in split]
    assert shown["own"] == pytest.approx([0.0, 0.0, 0.0], abs=0.02)
    assert min(shown["sensor's"][1:]) > REMNANT_DEG


def test_a_model_predicts_them_so() -> None:
    play = model(entry("drive_backlash"))
    run = zeroed(step_release(), step_release())
    predicted = predict_augmented(play, campaign_data(run))
    assert rests(run, list(predicted)) == pytest.approx([0.0, 0.0], abs=1e-9)
    bare = trials(step_release(), step_release())
    before = predict_augmented(play, campaign_data(bare))
    assert rests(bare, list(before))[1] > REMNANT_DEG


def test_logs_are_read_with_the_time_until_which_their_zero_is_taken(tmp_path: Path) -> None:
    folder = tmp_path / "steps"
    folder.mkdir()
    document = step_campaign(folder, trials=1)
    kept = read_trials(read_campaign(folder))
    assert [trial.zero_until_s for trial in kept.trials] == [0.0, 0.0]
    document["log"]["columns"]["angle"]["rest"] = "zero"
    write_yaml(folder, document)
    data = read_trials(read_campaign(folder))
    for trial in data.trials:
        assert trial.zero_until_s == pytest.approx(1.0)  # a second of rest
        before = trial.t_s < trial.zero_until_s
        assert trial.angle_deg[before].mean() == pytest.approx(0.0, abs=1e-9)
    write_trials(tmp_path / "trials.csv", data.trials)
    loaded = load_trials(tmp_path / "trials.csv", data.campaign)
    assert [t.zero_until_s for t in loaded] == [t.zero_until_s for t in data.trials]
