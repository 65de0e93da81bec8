"""Some trials of a campaign on the simulator's grid."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plant_cases import SIXTY, X, campaign_data, trials, vector
from spa_fo.gap.data.evidence import collect, modelled_pressure
from spa_fo.gap.fit.pressure import lagged
from spa_fo.plant.chain import chain_for
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.plant.grid import CampaignGrid, campaign_grid
from spa_fo.plant.grid_parts import only
from spa_fo.rig import Trial

LEVELS_KPA = 0.0, 0.6 * SIXTY, 0.0, 0.8 * SIXTY
SHARES = st.lists(st.booleans(), min_size=4, max_size=4).filter(any)


def logged(seed: int = 0) -> list[Trial]:
    """Trials of uneven length; some rows are lost where nothing jumps."""
    rng = np.random.default_rng(seed)
    made = []
    for k, trial in enumerate(trials(*map(up_and_down, LEVELS_KPA))):
        assert trial.command_kpa is not None
        jumps = np.flatnonzero(np.diff(trial.command_kpa, prepend=0.0))
        near = np.abs(np.subtract.outer(np.arange(trial.t_s.size), jumps)).min(axis=1) < 5
        kept = (rng.random(trial.t_s.size) > 0.1) | near
        kept[trial.t_s.size - 10 * k :] = False
        arrays = {
            name: values[kept]
            for name, values in vars(trial).items()
            if isinstance(values, np.ndarray)
        }
        made.append(replace(trial, **arrays, pressure_kpa=arrays["command_kpa"] + 0.1))
    return made


def up_and_down(level_kpa: float) -> np.ndarray:
    """Command to the largest pressure and another one, (rows,)."""
    return np.repeat([0.0, SIXTY, level_kpa], [20, 60, 60])


def alone(grid: CampaignGrid, some: np.ndarray) -> CampaignGrid:
    return campaign_grid([trial for trial, stays in zip(grid.trials, some, strict=True) if stays])


@settings(deadline=None, max_examples=40)
@given(some=SHARES, seed=st.integers(0, 9))
def test_some_trials_are_as_if_only_they_had_been_run(some: list[bool], seed: int) -> None:
    whole, stays = campaign_grid(logged(seed)), np.array(some)
    part, expected = only(whole, stays), alone(whole, stays)
    rests = {"level", "first_cell", "cells", "middle_s", "step_starts", "sample_step"}
    for field in fields(CampaignGrid):
        if field.name not in rests and field.name != "trials":
            ours, theirs = getattr(part, field.name), getattr(expected, field.name)
            np.testing.assert_allclose(ours, theirs, atol=1e-9, err_msg=field.name)
    assert [t.order for t in part.trials] == [t.order for t in expected.trials]
    for i, n in enumerate(part.trial_steps):
        ours, theirs = part.step_starts[i], expected.step_starts[i]
        for name in ("level", "cells", "first_cell"):
            steps = (
                getattr(part, name)[ours : ours + n],
                getattr(expected, name)[theirs : theirs + n],
            )
            assert np.array_equal(*steps), name
        own = part.sample_trial == i
        assert np.array_equal(part.sample_step[own] - ours, expected.sample_step[own] - theirs)


@settings(deadline=None, max_examples=20)
@given(some=SHARES)
def test_what_has_faded_between_trials_is_the_same_without_some_of_them(some: list[bool]) -> None:
    stays, whole = np.array(some), collect(campaign_data(logged()))
    part = whole.only(stays)
    samples = stays[whole.grid.sample_trial]
    e = absent()
    e[LIBRARY["slew_limit"].slots] = 60.0, 0.8, 1.2, 0.0, 0.0
    e[LIBRARY["stiffening"].slots] = 0.3, 1.2, 0.0
    shown = [
        own.grid.read(lagged(modelled_pressure(own, e), own.grid.cell_starts, 0.02))
        for own in (part, whole)
    ]
    np.testing.assert_allclose(shown[0], shown[1][samples], atol=1e-9)
    angles = [chain_for(own.grid, X, SIXTY).run(X, e)[0] for own in (part, whole)]
    np.testing.assert_allclose(angles[0], angles[1][samples], atol=0.02)
    assert part.reach == whole.reach
    for i, own in enumerate(part.rows):
        assert own.tolist() == np.flatnonzero(part.grid.sample_trial == i).tolist()


def test_trials_alike_stay_alike_without_the_first_of_them() -> None:
    evidence = collect(campaign_data(trials(*map(up_and_down, (*LEVELS_KPA, 0.0)))))
    assert evidence.alike.tolist() == [0, 1, 0, 3, 0]
    assert evidence.only(np.arange(5) > 0).alike.tolist() == [0, 1, 2, 1]
    every = np.ones(5, dtype=bool)
    assert evidence.only(every) is evidence
    assert only(evidence.grid, every) is evidence.grid


def test_no_part_changes_what_the_whole_says() -> None:
    whole = campaign_grid(logged())
    before = {f.name: np.array(getattr(whole, f.name)) for f in fields(whole) if f.name != "trials"}
    only(whole, np.array([False, True, False, True]))
    for name, values in before.items():
        assert np.array_equal(getattr(whole, name), values), name


@pytest.mark.parametrize("name", [n for n, e in LIBRARY.items() if e.stage == "drive"])
def test_a_drive_effect_goes_on_from_trial_to_trial_where_it_says_so(name: str) -> None:
    whole, e = collect(campaign_data(logged())), vector(name)
    if LIBRARY[name].carries_on:
        e[LIBRARY[name].slots][2] = 1.0  # nothing is vented
    command = whole.grid.command_kpa
    assert command is not None
    command[whole.grid.cell_starts[1] - 20 : whole.grid.cell_starts[1]] = SIXTY
    later = np.arange(4) > 0
    alone = modelled_pressure(whole.only(later), e)
    among_all = modelled_pressure(whole, e)[whole.grid.cell_starts[1] :]
    assert np.allclose(alone, among_all, atol=1e-9) != LIBRARY[name].carries_on
