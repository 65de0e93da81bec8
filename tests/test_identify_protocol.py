from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identify_cases import TRUTH, step_command, trial
from spa_fo.errors import BadInput
from spa_fo.fractional import step_response
from spa_fo.identify import paper_selection, step_data
from spa_fo.rig import Trial


def campaign(trials: int = 4) -> list[Trial]:
    """Two interleaved experiments, as measured: 30, 60, 30, 60, ..."""
    return [
        trial(
            step_command(50 + i, 400, after=100, kpa=kpa),
            experiment=name,
            number=i + 1,
            protocol="step_release",
            order=2 * i + k + 1,
            setpoint_deg=setpoint,
        )
        for k, (name, kpa, setpoint) in enumerate(
            [("step_30", 27.5, 30.0), ("step_60", 55.0, 60.0)]
        )
        for i in range(trials)
    ]


def without(one: Trial, keep: np.ndarray) -> Trial:
    names = ("t_s", "command_kpa", "angle_deg", "after_reset", "outside_calibration")
    return replace(one, **{name: getattr(one, name)[keep] for name in names})


def test_the_step_is_cut_out_and_scaled() -> None:
    data = step_data(campaign(), 30.0)
    assert data.points == 50
    assert data.datasets == 8
    # The window's last sample is one interval before the release.
    assert data.t[-1] == pytest.approx(399 / 50)
    assert np.allclose(np.diff(data.t, prepend=0.0), data.t[-1] / 50)
    assert sorted(set(data.u)) == pytest.approx([27.5 / 30, 55 / 30])
    # The samples are 20 ms apart: linear interpolation errs by some 1e-5 of the curve.
    expected = data.u[:, np.newaxis] * step_response(data.t, *TRUTH)
    np.testing.assert_allclose(data.angle_rad, expected, atol=2e-4)
    assert data.left_out == ()


@given(st.permutations(range(8)))
@settings(max_examples=20, deadline=None)
def test_the_order_of_trials_changes_only_the_order_of_rows(order: list[int]) -> None:
    trials = campaign()
    data, other = step_data(trials, 30.0), step_data([trials[i] for i in order], 30.0)
    np.testing.assert_array_equal(other.angle_rad, data.angle_rad[order])
    assert other.t.tolist() == data.t.tolist()


def test_the_papers_selection_takes_the_earliest_of_each_setpoint() -> None:
    data = step_data(campaign()[::-1], 30.0)
    chosen = paper_selection(data, 4)
    assert sorted(zip(chosen.experiments, chosen.trials, strict=True)) == [
        ("step_30", 1),
        ("step_30", 2),
        ("step_60", 1),
        ("step_60", 2),
    ]
    assert chosen.angle_rad.size == 200
    with pytest.raises(ValueError, match="1 to 8"):
        paper_selection(data, 9)


def test_a_step_from_a_pressure_above_zero_counts_its_rise() -> None:
    data = step_data([trial(10.0 + step_command(kpa=20.0))], 30.0)
    assert data.u.tolist() == pytest.approx([20.0 / 30.0])


def test_the_angle_of_the_pressure_before_is_no_part_of_the_rise() -> None:
    command = 10.0 + step_command(before=3000, kpa=20.0)  # at rest by then, 10 kPa up
    data = step_data([trial(command)], 30.0)
    expected = data.u[:, np.newaxis] * step_response(data.t, *TRUTH)
    np.testing.assert_allclose(data.angle_rad, expected, atol=2e-3)


def test_samples_after_a_reset_are_not_used() -> None:
    trials = campaign(2)
    reset = trials[0].t_s > 5.0
    spoilt = replace(
        trials[0], after_reset=reset, angle_deg=np.where(reset, 999.0, trials[0].angle_deg)
    )
    data = step_data([spoilt, *trials[1:]], 30.0)
    assert data.t[-1] == pytest.approx(4.0, abs=0.05)
    assert np.degrees(data.angle_rad).max() < 100.0


def test_a_trial_that_is_mostly_a_gap_is_left_out_and_named() -> None:
    trials = campaign(3)
    t = trials[1].t_s
    data = step_data([trials[0], without(trials[1], (t < 2.0) | (t > 8.0)), *trials[2:]], 30.0)
    assert data.datasets == 5
    assert data.left_out[0].startswith("step_30 trial 2: a gap of 6.")


def test_a_short_trial_is_left_out_and_does_not_cut_the_others() -> None:
    trials = campaign(3)
    data = step_data([without(trials[0], trials[0].t_s < 3.0), *trials[1:]], 30.0)
    assert data.left_out[0].startswith("step_30 trial 1: its step lasts")
    assert data.t[-1] == pytest.approx(399 / 50)


def gapped(one: Trial) -> Trial:
    return without(one, (one.t_s < 2.0) | (one.t_s > 8.0))


def test_an_experiment_without_a_usable_trial_is_left_out_and_its_trials_are_named() -> None:
    trials = campaign(2)
    spoilt = [gapped(one) if one.experiment == "step_30" else one for one in trials]
    data = step_data(spoilt, 30.0)
    assert set(data.experiments) == {one.experiment for one in trials} - {"step_30"}
    assert [text.partition(":")[0] for text in data.left_out] == [
        "step_30 trial 1",
        "step_30 trial 2",
    ]


def test_an_experiment_of_short_steps_does_not_cut_the_others() -> None:
    trials = campaign(3)
    spoilt = [without(one, one.t_s < 3.0) if one.experiment == "step_30" else one for one in trials]
    data = step_data(spoilt[:1] + spoilt[3:], 30.0)
    assert "step_30" not in data.experiments
    assert data.t[-1] == pytest.approx(399 / 50)


def test_a_campaign_without_a_usable_step_is_refused_with_the_reasons() -> None:
    with pytest.raises(BadInput, match=r"no step is usable: step_30 trial 1: a gap of 6\."):
        step_data([gapped(one) for one in campaign(2)], 30.0)


@pytest.mark.parametrize("release", [0, 200])
def test_a_command_in_force_at_the_first_sample_is_a_step_at_rest(release: int) -> None:
    one = trial(step_command(0, 400, after=release, kpa=28.0), protocol="step_release")
    data = step_data([one], 30.0)
    assert data.u == pytest.approx([28.0 / 30.0])
    assert data.t[-1] == pytest.approx(399 / 50)
    expected = data.u[:, np.newaxis] * step_response(data.t, *TRUTH)
    np.testing.assert_allclose(data.angle_rad, expected, atol=2e-4)


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (lambda one: without(one, one.t_s < 1.1), "at least 10 samples"),
        (lambda one: replace(one, command_kpa=np.zeros_like(one.t_s)), "never rises"),
        (lambda one: replace(one, command_kpa=-one.command_kpa), "never rises"),
    ],
)
def test_a_trial_that_is_no_step_is_refused_by_its_file(spoil: object, word: str) -> None:
    trials = campaign(2)
    files = {("step_30", 1): Path("raw/step_30/trial_01.log")}
    with pytest.raises(BadInput, match=word) as refused:
        step_data([spoil(trials[0]), *trials[1:]], 30.0, files=files)  # type: ignore[operator]
    assert refused.value.path == files["step_30", 1]


def test_no_step_trials_at_all() -> None:
    free = trial(step_command(), protocol="staircase")
    with pytest.raises(BadInput, match="expected a step"):
        step_data([free], 30.0, source="raw/x/campaign.yaml")
