"""A jump of the command whose row was lost: trials run alike say when it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spa_fo.plant.lost_rows import command_times
from spa_fo.rig import Trial

INTERVAL_S = 0.1
JUMP_S = 2.0


def trial(number: int, lost: tuple[int, ...] = (), jump_s: float = JUMP_S) -> Trial:
    t = INTERVAL_S * np.arange(60) + 0.013 * number
    t -= t[0]
    command = np.where(t >= jump_s - 1e-9, 30.0, 0.0)
    keep = np.setdiff1d(np.arange(t.size), lost)
    none = np.zeros(keep.size, dtype=bool)
    return Trial(
        experiment="step",
        trial=number,
        protocol="step",
        setpoint_deg=None,
        order=number,
        started_s=100.0 * number,
        t_s=t[keep],
        command_kpa=command[keep],
        pressure_kpa=None,
        flex_adc=None,
        angle_deg=np.zeros(keep.size),
        after_reset=none,
        outside_calibration=none,
    )


def holds_from(one: Trial, times: np.ndarray) -> float:
    assert one.command_kpa is not None
    return float(times[np.flatnonzero(one.command_kpa > 0.0)[0]])


@pytest.mark.parametrize("lost", [(20,), (20, 21), (19, 20), tuple(range(17, 26))])
def test_a_lost_first_row_is_put_where_it_was_due(lost: tuple[int, ...]) -> None:
    trials = [trial(1), trial(2, lost), trial(3)]
    times = command_times(trials)
    assert holds_from(trials[1], times[1]) == pytest.approx(JUMP_S, abs=1e-9)


def test_of_several_jumps_in_a_gap_none_is_taken_for_another() -> None:
    whole = trial(1)
    square = np.where((whole.t_s >= 2.0) & (whole.t_s < 3.0) | (whole.t_s >= 4.0), 30.0, 0.0)
    one, other, lossy = (replace(trial(k), command_kpa=square) for k in (1, 2, 3))
    kept = (lossy.t_s < 1.75) | (lossy.t_s > 4.25)
    arrays = {k: v[kept] for k, v in vars(lossy).items() if isinstance(v, np.ndarray)}
    times = command_times([one, other, replace(lossy, **arrays)])
    np.testing.assert_array_equal(times[2], lossy.t_s[kept])


def test_a_row_lost_before_the_jump_moves_nothing() -> None:
    trials = [trial(1), trial(2, (19,)), trial(3)]
    times = command_times(trials)
    for one, own in zip(trials, times, strict=True):
        np.testing.assert_array_equal(own, one.t_s)


def test_without_a_repeat_nothing_is_moved() -> None:
    alone = trial(1, (20,))
    other = replace(trial(2), experiment="another")
    times = command_times([alone, other])
    np.testing.assert_array_equal(times[0], alone.t_s)


def test_a_jump_of_another_height_says_nothing() -> None:
    one, other = trial(1, (20,)), trial(2)
    assert other.command_kpa is not None
    times = command_times([one, replace(other, command_kpa=2.0 * other.command_kpa)])
    np.testing.assert_array_equal(times[0], one.t_s)


def test_repeats_that_lost_it_too_say_nothing() -> None:
    trials = [trial(1, (20,)), trial(2, (20,))]
    for one, own in zip(trials, command_times(trials), strict=True):
        np.testing.assert_array_equal(own, one.t_s)


def test_the_grid_holds_the_command_from_then_on() -> None:
    from spa_fo.plant.grid import campaign_grid

    whole = campaign_grid([trial(1), trial(2)])
    gappy = campaign_grid([trial(1), trial(2, (20,))])
    assert whole.command_kpa is not None
    assert gappy.command_kpa is not None
    np.testing.assert_allclose(gappy.command_kpa, whole.command_kpa, atol=1e-9)
