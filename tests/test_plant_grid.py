"""The simulator's grid: what rows of a log read of a signal that is given on cells."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naive_plant import row_reading
from spa_fo.errors import BadInput
from spa_fo.plant.grid import acting_command, campaign_grid
from spa_fo.plant.memory import FINEST_STEP_S
from spa_fo.rig import Trial

INTERVAL_S = st.sampled_from([0.005, 0.01, 0.02, 0.033, 0.05])


def trial(order: int, t_s: np.ndarray, command_kpa: np.ndarray | None) -> Trial:
    none = np.zeros(t_s.size, dtype=bool)
    pressure = np.zeros(t_s.size)
    about = ("free", order, "free", None, order, 100.0 * order, t_s)
    return Trial(*about, command_kpa, pressure, None, np.zeros(t_s.size), none, none)


def logged(rows: int, interval_s: float, seed: int) -> tuple[Trial, Trial]:
    rng = np.random.default_rng(seed)
    t = interval_s * np.arange(rows)
    return trial(1, t, rng.normal(size=rows)), trial(2, t, rng.normal(size=rows))


@given(rows=st.integers(12, 90), interval_s=INTERVAL_S, seed=st.integers(0, 99))
def test_a_sample_is_the_mean_over_its_own_rows(rows: int, interval_s: float, seed: int) -> None:
    grid = campaign_grid(logged(rows, interval_s, seed))
    cells = np.random.default_rng(seed).normal(size=grid.cell_starts[-1])
    expected = []
    for k, one in enumerate(grid.trials):
        first = grid.step_starts[k]
        ends = np.cumsum(grid.cells[first : first + grid.trial_steps[k]])
        read: dict[int, list[float]] = {}
        for t in one.t_s:
            size = int(grid.cell_starts[k + 1] - grid.cell_starts[k])
            cell = next((c for c in range(size) if t <= (c + 1) * FINEST_STEP_S), size - 1)
            step = int(np.searchsorted(ends, cell, side="right"))
            read.setdefault(step, []).append(float(cells[grid.cell_starts[k] + cell]))
        expected += [float(np.mean(values)) for _, values in sorted(read.items())]
    assert grid.sampled(cells) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@given(rows=st.integers(12, 90), seed=st.integers(0, 99))
def test_what_acts_on_a_row_is_the_command_of_the_row_before(rows: int, seed: int) -> None:
    one, _ = logged(rows, FINEST_STEP_S, seed)
    assert one.command_kpa is not None
    assert acting_command(one)[1:] == pytest.approx(one.command_kpa[:-1], abs=1e-9)


def test_a_trial_without_a_command_has_none_that_acts() -> None:
    with pytest.raises(BadInput, match="free trial 1 holds no command"):
        acting_command(trial(1, 0.1 * np.arange(9), None))


def jittered(rows: int, interval_s: float, seed: int) -> Trial:
    rng = np.random.default_rng(seed)
    t = interval_s * (np.arange(rows) + 0.2 * rng.uniform(-1.0, 1.0, rows))
    return trial(1, t - t[0], np.cumsum(rng.normal(size=rows)))


@settings(deadline=None)
@given(rows=st.integers(12, 60), interval_s=st.floats(0.1, 0.3), seed=st.integers(0, 99))
def test_a_row_reads_the_pressure_before_its_own_command_acts(
    rows: int, interval_s: float, seed: int
) -> None:
    """Of a drive that follows at once: the command of the row before, whenever the row came."""
    one = jittered(rows, interval_s, seed)
    grid = campaign_grid([one])
    assert one.command_kpa is not None
    assert grid.command_kpa is not None
    expected = grid.averaged(np.append(one.command_kpa[0], one.command_kpa[:-1]))
    assert grid.read(grid.command_kpa)[1:] == pytest.approx(expected[1:], abs=1e-9)


@settings(deadline=None)
@given(rows=st.integers(12, 60), interval_s=st.floats(0.02, 0.1), seed=st.integers(0, 99))
def test_a_smooth_signal_is_read_at_the_time_of_the_row(
    rows: int, interval_s: float, seed: int
) -> None:
    one = jittered(rows, interval_s, seed)
    grid = campaign_grid([one])
    assert grid.command_kpa is not None
    cells = FINEST_STEP_S * (np.arange(grid.command_kpa.size) + 0.5)
    signal = 20.0 * cells + np.sin(cells)
    expected = grid.averaged(20.0 * one.t_s + np.sin(one.t_s))
    inside = grid.time_s > 2.0 * FINEST_STEP_S
    inside[0] = False  # which holds the trial's first row: nothing was before it
    assert grid.read(signal)[inside] == pytest.approx(expected[inside], abs=2e-3)


@settings(deadline=None)
@given(seed=st.integers(0, 99))
def test_a_reading_is_never_beyond_its_neighbours_by_more_than_their_difference(seed: int) -> None:
    one = jittered(40, 0.1, seed)
    grid = campaign_grid([one])
    assert grid.command_kpa is not None
    cells = np.random.default_rng(seed).normal(size=grid.command_kpa.size)
    read = grid.read(cells)
    assert np.all(read <= 2.0 * cells.max() - cells.min())
    assert np.all(read >= 2.0 * cells.min() - cells.max())


def test_a_reading_is_that_of_whole_arrays() -> None:
    grid = campaign_grid([jittered(60, 0.013, 1)])
    assert grid.command_kpa is not None
    cells = np.random.default_rng(2).normal(size=grid.command_kpa.size)
    expected = grid.averaged(row_reading(cells, grid.trials[0].t_s))
    np.testing.assert_allclose(grid.read(cells), expected, rtol=1e-12)
