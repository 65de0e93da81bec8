"""What a model misses in both campaigns, as a law of where the input has been."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spa_fo.compare.fading_memory import (
    NEAREST,
    FadingMemoryLaw,
    Kernel,
    Signal,
    inputs,
    nearest,
    neighbours,
    telling,
)
from spa_fo.compare.learning import beyond_scatter, calibrated, courses, learn, ways

LEAST = 0.1


def signals(trials: int = 3, gain: float = 1.0, step: float = 4.0) -> list[Signal]:
    """Trials of an actuator whose misses depend on a slow lag of the input, squared."""
    made = []
    for trial in range(trials):
        t = np.arange(0.0, 12.0, 0.05)
        drive = np.where((t > 1.0) & (t < 7.0), 10.0 + step * trial, 0.0)
        (x,) = inputs([Signal(0.0, t, drive, t)], np.array([2.0]))
        made.append(Signal(1000.0 * trial, t, drive, gain * 0.01 * x[:, 1] ** 2))
    return made


def noisy(trials: int, sigma: float, step: float = 0.0) -> list[Signal]:
    """The same with a level of each trial's own."""
    rng = np.random.default_rng(5)
    levels = sigma * rng.standard_normal(trials)
    made = signals(trials, step=step)
    return [replace(s, missed=s.missed + level) for s, level in zip(made, levels, strict=True)]


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_the_law_predicts_a_trial_between_those_that_it_learned_from() -> None:
    first, between, last = signals()
    law = learn([first, last], LEAST)
    ((mean, deviation),) = law.predict([between])
    assert rms(mean - between.missed) < 0.2 * rms(between.missed)
    assert deviation.shape == mean.shape


def test_the_law_goes_back_to_nothing_where_nothing_like_it_was_seen() -> None:
    law = learn(signals(), LEAST)
    far = replace(signals(1)[0], input=40.0 * signals(1)[0].input)
    ((mean, _),) = law.predict([far])
    (nowhere,) = law.unvisited([far])
    on = far.input > 0.0
    assert np.abs(mean[on]).max() < 0.2 * law.chosen.kernel.amplitude
    assert nowhere[on].all()


def test_where_nothing_is_missed_the_law_is_nothing() -> None:
    quiet = signals(gain=0.0)
    law = learn(quiet, LEAST)
    assert law.left_rms == 0.0
    assert all(np.all(mean == 0.0) for mean, _ in law.predict(quiet))


def test_what_was_done_before_is_known_as_well_as_repeats_repeat() -> None:
    """And what was not is known the less the farther it is from that."""
    law = learn(noisy(6, 0.3), LEAST)
    ((_, same), (_, other)) = law.predict([noisy(1, 0.0)[0], signals(2, step=6.0)[1]])
    assert law.chosen.repeats
    assert float(np.median(same)) == pytest.approx(0.3, rel=0.5)
    on = (signals(1)[0].t_s > 1.5) & (signals(1)[0].t_s < 6.0)
    assert np.all(other[on] > same[on])


def test_what_repeats_differ_by_is_taken_for_granted_where_none_shows_it() -> None:
    t = np.arange(0.0, 12.0, 0.05)
    drives = (np.maximum(t - 1.0, 0.0), 12.0 - t, 6.0 + 5.0 * np.sin(t))
    trials = [Signal(0.0, t, drive, 0.1 * drive) for drive in drives]
    law = learn(trials, LEAST)
    assert not law.chosen.repeats
    assert law.chosen.scatter == pytest.approx(LEAST**2)


@pytest.mark.parametrize("steps_deg", [0.5, 1.0, 5.0])
def test_of_a_rough_law_it_is_known_how_much_is_missed_nearby_and_far_away(
    steps_deg: float,
) -> None:
    """Trials of seven levels, done once each, of a law with steps in it."""
    levels = [signals(1)[0], *(signals(2, step=float(k))[1] for k in range(1, 7))]
    trials = [
        replace(s, started_s=1000.0 * k, missed=s.missed + steps_deg * (np.floor(s.missed) % 2.0))
        for k, s in enumerate(levels)
    ]
    law = learn(trials, LEAST)
    assert law.chosen.power > 1.0  # at rest nothing is missed, and between the levels all the more
    left, foreseen = np.concatenate(law.left), np.concatenate(law.expected)
    far = foreseen > np.median(foreseen)
    for rows in (far, ~far):
        assert rms(left[rows]) == pytest.approx(rms(foreseen[rows]), rel=0.3)


def test_a_power_of_its_variance_is_a_share_of_that_of_its_values() -> None:
    kernel, variance = Kernel(1.0, 0.01, 3.0), np.array([0.0, 0.09, 9.0])
    np.testing.assert_allclose(kernel.doubt(variance, 1.0), variance)
    np.testing.assert_allclose(kernel.doubt(variance, 0.5), [0.0, 0.9, 9.0])
    assert np.all(Kernel(1.0, 0.01, 0.0).doubt(np.zeros(3), 0.5) == 0.0)


def test_what_was_left_out_took_no_part() -> None:
    """The misses on a left-out trial are those of a law that never saw it."""
    trials = signals()
    trials[1] = replace(trials[1], missed=trials[1].missed + 5.0)
    law = learn(trials, LEAST)
    rows, others = plainly_left_out(trials, 1, law)
    np.testing.assert_allclose(law.left[1][rows], others, atol=1e-6)
    assert np.mean(law.left[1]) == pytest.approx(5.0, abs=1.5)


def plainly_left_out(
    trials: list[Signal], out: int, law: FadingMemoryLaw
) -> tuple[np.ndarray, np.ndarray]:
    """Learn from the nearest samples of the other trials, row after row, by the textbook."""
    every = (np.concatenate(inputs(trials, law.lags_s)) - law.centre) / law.scale
    ends = np.cumsum([0, *(t.t_s.size for t in trials)])
    chosen = telling(every, 4000)
    learned = chosen[(chosen < ends[out]) | (chosen >= ends[out + 1])]
    y = np.concatenate([t.missed for t in trials])
    mine = chosen[(chosen >= ends[out]) & (chosen < ends[out + 1])]
    left = []
    for row in mine:
        apart = np.linalg.norm(every[learned] - every[row], axis=1)
        near = learned[np.argsort(apart)[:NEAREST]]
        k = matern(every[near], every[near], law.chosen.kernel) + law.chosen.kernel.noise * np.eye(
            near.size
        )
        own = matern(every[[row]], every[near], law.chosen.kernel)[0]
        left.append(y[row] - own @ np.linalg.solve(k, y[near]))
    return mine - ends[out], np.array(left)


def matern(x: np.ndarray, y: np.ndarray, kernel: Kernel) -> np.ndarray:
    apart = np.array([[float(np.linalg.norm(one - other)) for other in y] for one in x])
    scaled = np.sqrt(3.0) * apart / kernel.length
    return np.asarray((1.0 + scaled) * np.exp(-scaled))


def test_a_prediction_from_all_rows_is_the_whole_gaussian_process() -> None:
    rng = np.random.default_rng(2)
    x, values, asked = rng.normal(size=(20, 3)), rng.normal(size=20), rng.normal(size=(5, 3))
    kernel = Kernel(1.5, 0.01, 2.0)
    mean, variance = neighbours(asked, x, nearest(asked, x, 20)).predict(kernel, values)
    k = matern(x, x, kernel) + 0.01 * np.eye(20)
    own = matern(asked, x, kernel)
    np.testing.assert_allclose(mean, own @ np.linalg.solve(k, values))
    known = np.einsum("ij,ji->i", own, np.linalg.solve(k, own.T))
    np.testing.assert_allclose(variance, 4.0 * (1.0 - known))


def test_trials_are_left_out_one_by_one_and_all_of_one_course() -> None:
    alike, other = signals(1)[0], signals(2)[1]
    trials = [alike, replace(alike, started_s=100.0), replace(other, started_s=200.0)]
    assert courses(trials) == [0, 0, 2]
    one_by_one, together = ways(trials)
    n = alike.t_s.size
    assert [one_by_one[i * n] for i in range(3)] == [0, 1, 2]
    assert [together[i * n] for i in range(3)] == [0, 0, 2]
    (lone,) = ways([alike])
    assert np.unique(lone).size == 4
    _, pieces = ways(trials[:2])
    np.testing.assert_array_equal(pieces[:n], pieces[n:])


@settings(max_examples=25, deadline=None)
@given(st.floats(0.05, 5.0), st.floats(0.0, 20.0))
def test_what_squares_are_made_of_is_found_again(scatter: float, trust: float) -> None:
    rng = np.random.default_rng(3)
    variance, weights = rng.uniform(0.0, 1.0, 4000), rng.uniform(0.5, 1.0, 4000)
    squares = (scatter + trust * variance) * rng.standard_normal(4000) ** 2
    found = calibrated(squares, variance, weights)
    mean = scatter + 0.5 * trust
    assert found[0] == pytest.approx(scatter, abs=0.15 * mean)
    assert found[1] == pytest.approx(trust, abs=0.25 * mean)
    known = beyond_scatter(squares, variance, weights, scatter)
    assert known == pytest.approx(trust, abs=0.2 * mean)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(0.0, 50.0), min_size=2, max_size=6), st.floats(0.1, 20.0))
def test_the_lags_are_those_of_a_plain_loop(levels: list[float], lag_s: float) -> None:
    t = np.arange(0.0, 2.0 * len(levels), 0.02)
    drive = np.repeat(levels, 100)[: t.size]
    (x,) = inputs([Signal(0.0, t, drive, t)], np.array([lag_s]))
    state, plain = 0.0, []
    for value in drive:
        state += (1.0 - np.exp(-0.02 / lag_s)) * (value - state)
        plain.append(state)
    np.testing.assert_allclose(x[:, 1], plain, atol=1e-6 * max(1.0, max(levels)))
    np.testing.assert_array_equal(x[:, 2], np.maximum.accumulate(drive))


def test_a_trial_begins_with_what_the_one_before_left() -> None:
    t = np.arange(0.0, 4.0, 0.02)
    first = Signal(0.0, t, np.full(t.size, 8.0), t)
    second = Signal(first.t_s[-1] + 5.0, t, np.zeros(t.size), t)
    at_once, later = inputs([first, second], np.array([3.0]))
    left = at_once[-1, 1] * np.exp(-5.0 / 3.0)
    assert later[0, 1] == pytest.approx(left, rel=0.02)
