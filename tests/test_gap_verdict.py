from types import SimpleNamespace

import numpy as np
import pytest

from spa_fo.gap.hold_out import fraction_closed, hold_out
from spa_fo.gap.unknown import Stress, _slope
from spa_fo.gap.verdict import Scored, beating, judge, log_prior, stage_shares


def scored(ids, probability, moved=None):
    explanation = SimpleNamespace(ids=ids)
    return Scored(explanation, ids, moved or dict.fromkeys(ids, 1.0), 0.0, 0.0, 0.0, probability)


def test_one_set_that_holds_nearly_all_is_the_cause():
    verdict = judge([scored(("creep",), 0.97), scored((), 0.03)], 0.01, 0.001, True)
    assert verdict.kind == "cause"
    assert verdict.sets == (("creep",),)


def test_sets_that_share_the_probability_are_ambiguous():
    every = [scored(("creep",), 0.6), scored(("sensor_creep",), 0.35), scored(("leak",), 0.05)]
    verdict = judge(every, 0.0, 0.001, True)
    assert verdict.kind == "ambiguous"
    assert verdict.sets == (("creep",), ("sensor_creep",))


def test_no_gap_names_nothing():
    verdict = judge([scored((), 0.9), scored(("creep",), 0.1)], 0.0, 0.6, False)
    assert verdict.kind == "no_gap"
    assert verdict.sets == ()
    assert set(stage_shares(verdict).values()) == {0.0}


def test_unknown_keeps_only_the_part_that_is_explained():
    every = [scored(("creep",), 0.6), scored(("leak",), 0.4)]
    verdict = judge(every, 0.9, 0.001, True)
    assert verdict.kind == "unknown"
    assert verdict.sets == (("creep",),)


def test_given_a_gap_unknown_may_be_more_probable_than_all_that_is_named():
    every = [scored((), 0.55), scored(("creep",), 0.3), scored(("leak",), 0.15)]
    assert judge(every, 0.4, 0.1, True).kind == "unknown"
    assert judge(every, 0.2, 0.1, True).kind == "ambiguous"


def test_only_the_plain_model_may_be_left():
    every = [scored(("creep",), 1.0), scored((), 0.0)]
    (left,) = beating(every, {("creep",): (2.0, 2.0)}, (1.0, 1.0))
    assert (left.named, left.probability) == ((), 1.0)


def test_stage_shares_weigh_by_square_and_probability():
    every = [
        scored(("leak", "creep"), 0.5, {"leak": 1.0, "creep": 3.0}),
        scored(("sensor_lag",), 0.5),
    ]
    shares = stage_shares(judge(every, 0.0, 0.001, True))
    assert shares["drive"] == pytest.approx(0.05)
    assert shares["actuator"] == pytest.approx(0.45)
    assert shares["sensor"] == pytest.approx(0.5)
    assert sum(shares.values()) == pytest.approx(1.0)


def test_what_does_not_beat_the_plain_model_is_left_out():
    every = [scored(("creep",), 0.8), scored(("leak",), 0.15), scored((), 0.05)]
    kept = beating(every, {("creep",): (1.2, 0.5), ("leak",): (0.5, 0.5)}, (1.0, 1.0))
    assert [s.named for s in kept] == [("leak",), ()]
    assert sum(s.probability for s in kept) == pytest.approx(1.0)


def test_neither_on_held_out_trials_nor_on_all():
    every = [scored(("creep",), 0.8), scored(("leak",), 0.15), scored((), 0.05)]
    kept = beating(every, {("creep",): (0.5, 1.1), ("leak",): (0.5, 0.9)}, (1.0, 1.0))
    assert [s.named for s in kept] == [("leak",), ()]


def test_what_was_not_tried_stands():
    every = [scored(("mains_pickup",), 0.8), scored((), 0.2)]
    assert beating(every, {}, (1.0, 1.0)) == every


def test_small_sets_come_first_and_lookalikes_last():
    assert log_prior(("creep",)) > log_prior(("creep", "leak"))
    assert log_prior(("creep", "leak")) > log_prior(("creep", "sensor_creep"))
    assert log_prior(("creep", "leak")) > log_prior(("creep", "parameter_shift"))
    assert log_prior(("creep", "leak")) > log_prior(("creep", "leak", "sensor_slip"))


def test_the_loudest_evidence_counts():
    assert Stress(0.2, 1.4, 0.0, 0.3, 0.0).largest == ("fixture", 1.4)


def test_slope_of_a_line_and_its_error():
    rng = np.random.default_rng(1)
    x = np.arange(200.0)
    slope, error = _slope(x, 0.3 * x + rng.standard_normal(200))
    assert slope == pytest.approx(0.3, abs=4 * error)
    assert error == pytest.approx(1.0 / np.sqrt(np.sum((x - x.mean()) ** 2)), rel=0.2)


def test_fraction_closed_is_the_contracts():
    before, after, floor = 2.1**2, 0.6**2, 0.5
    expected = 1.0 - (after - floor**2) / (before - floor**2)
    assert fraction_closed(before, after, floor) == pytest.approx(expected)
    # What is left below the floor closes no more than all of the gap.
    assert fraction_closed(before, 0.4**2, floor) == 1.0


def trials(names):
    listed = tuple(SimpleNamespace(experiment=name, label=f"{name} {i}") for i, name in names)
    return SimpleNamespace(grid=SimpleNamespace(trials=listed))


def test_one_trial_of_each_repeated_experiment_is_held_out_and_never_the_first():
    names = list(enumerate(["a"] * 5 + ["b"] * 4 + ["c"]))
    for seed in range(20):
        held = hold_out(trials(names), np.random.default_rng(seed))
        assert held.trials[:5].sum() == 1
        assert held.trials[5:9].sum() == 1
        assert not held.trials[[0, 5, 9]].any()


def test_without_repeats_one_experiment_is_held_out():
    held = hold_out(trials(list(enumerate("abcd"))), np.random.default_rng(0))
    assert held.trials.sum() == 1
