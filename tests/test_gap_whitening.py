"""Rows of a campaign and their covariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from spa_fo.gap.noise.coloured import CORRELATION_S, Spectrum
from spa_fo.gap.noise.whitening import MISSED_OVER_S, Factor, Rows, Whitening, lay_rows

Floats = NDArray[np.float64]

WIDTH = 0.08
SPECTRUM = Spectrum(0.02, np.linspace(0.01, 0.03, CORRELATION_S.size))


def laid(most: int = 1000) -> Rows:
    """Three trials of two experiments, five to seven samples each."""
    sizes = [5, 7, 6]
    trial = np.repeat(np.arange(3), sizes)
    time = np.concatenate([WIDTH * (np.arange(n) + 0.5) for n in sizes])
    own = np.split(np.arange(18), np.cumsum(sizes)[:-1])
    count = np.full(18, 4.0)
    groups = [[own[0], own[2]], [own[1]]]
    return lay_rows(groups, time, np.full(18, WIDTH), count, np.full(18, 0.003), trial, most)


def test_rows_are_means_of_neighbours_in_one_trial() -> None:
    rows = laid(most=9)
    values = np.arange(18.0)
    assert rows.number.tolist() == [2, 2, 1, 2, 2, 2, 2, 2, 2, 1]
    assert rows.merged(values).tolist() == [0.5, 2.5, 4, 12.5, 14.5, 16.5, 5.5, 7.5, 9.5, 11]
    both = rows.merged(np.column_stack([values, -values]))
    np.testing.assert_allclose(both[:, 1], -both[:, 0])
    assert [g.trial.tolist() for g in rows.groups] == [[0, 0, 0, 2, 2, 2], [1, 1, 1, 1]]


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.lists(st.integers(1, 12), min_size=1, max_size=4), min_size=1, max_size=3),
    st.integers(1, 40),
    st.integers(0, 99),
)
def test_rows_are_means_whatever_the_campaign(sizes: list[list[int]], most: int, seed: int) -> None:
    """Rows hold every sample once and no two trials; what they sum and average is theirs."""
    rng = np.random.default_rng(seed)
    flat = [size for group in sizes for size in group]
    trial = np.repeat(np.arange(len(flat)), flat)
    own = iter(np.split(np.arange(trial.size), np.cumsum(flat)[:-1]))
    groups = [[next(own) for _ in group] for group in sizes]
    time, width, count, fixed, values = rng.uniform(0.1, 2.0, (5, trial.size))
    rows = lay_rows(groups, time, width, count, fixed, trial, most)
    assert rows.size <= most + len(flat)  # a trial's last row may be short
    assert sorted(rows.order.tolist()) == list(range(trial.size))
    ends = [*rows.first[1:].tolist(), rows.order.size]
    held = [rows.order[a:b] for a, b in zip(rows.first.tolist(), ends, strict=True)]
    np.testing.assert_allclose(rows.merged(values), [values[h].mean() for h in held])
    laid_out = [held[k] for group in rows.groups for k in range(group.rows.start, group.rows.stop)]
    assert len(laid_out) == rows.size
    for group in rows.groups:
        mine = held[group.rows]
        assert [set(trial[h]) for h in mine] == [{t} for t in group.trial]
        np.testing.assert_allclose(group.time_s, [time[h].mean() for h in mine])
        np.testing.assert_allclose(group.width_s, [width[h].sum() for h in mine])
        np.testing.assert_allclose(group.count, [count[h].sum() for h in mine])
        # The variance of a mean of samples whose errors have nothing to do with each other.
        np.testing.assert_allclose(group.fixed, [fixed[h].sum() / h.size**2 for h in mine])


def lowers(factor: Factor) -> list[Floats]:
    return [np.asarray(np.linalg.inv(own), dtype=np.float64) for own in factor.whiteners]


@pytest.mark.parametrize(
    ("level", "hidden", "foreseen"), [(1.5, 0.0, False), (1.0, 0.3, False), (1.5, 0.0, True)]
)
def test_the_factor_is_of_the_covariance_entry_by_entry(
    level: float, hidden: float, foreseen: bool
) -> None:
    rows = laid()
    gap = np.linspace(0.5, 2.0, rows.size)
    times = np.linspace(1.0, 3.0, rows.size)
    whitening = Whitening(rows, SPECTRUM, gap, hidden, times if foreseen else None)
    share = 0.2
    factor = whitening.factor(level, share)
    half_log = 0.0
    for group, lower in zip(rows.groups, lowers(factor), strict=True):
        n = group.time_s.size
        slow = np.zeros((n, n))
        coloured = SPECTRUM.coloured_covariance(group)
        for i in range(n):
            for j in range(n):
                if group.trial[i] == group.trial[j]:
                    own = times[group.rows][[i, j]].prod() if foreseen else 1.0
                    slow[i, j] += level**2 * own * coloured[i, j]
                apart = abs(group.time_s[i] - group.time_s[j])
                size = gap[group.rows][i] * gap[group.rows][j]
                slow[i, j] += share**2 * size * np.mean(np.exp(-apart / MISSED_OVER_S))
                slow[i, j] += hidden**2 * np.mean(np.exp(-apart / CORRELATION_S))
            slow[i, i] += SPECTRUM.white / group.count[i] + group.fixed[i]
        np.testing.assert_allclose(lower @ lower.T, slow, rtol=1e-9)
        half_log += 0.5 * np.linalg.slogdet(slow)[1]
    assert factor.half_log == pytest.approx(half_log)


def test_white_values_have_the_identity_for_covariance() -> None:
    rows = laid()
    whitening = Whitening(rows, SPECTRUM, np.ones(rows.size))
    factor = whitening.factor(1.0, 0.1)
    roots = np.zeros((rows.size, rows.size))
    for group, lower in zip(rows.groups, lowers(factor), strict=True):
        roots[group.rows, group.rows] = lower
    np.testing.assert_allclose(whitening.white(factor, roots), np.eye(rows.size), atol=1e-9)


def test_what_is_missed_is_shared_by_trials_that_were_run_alike_alone() -> None:
    rows = laid()
    whitening = Whitening(rows, SPECTRUM, np.ones(rows.size))
    with_it, without = (lowers(whitening.factor(1.0, share))[0] for share in (0.5, 0.0))
    first, third = rows.groups[0].trial == 0, rows.groups[0].trial == 2
    assert np.all((with_it @ with_it.T)[np.ix_(first, third)] > 0.0)
    np.testing.assert_allclose((without @ without.T)[np.ix_(first, third)], 0.0, atol=1e-12)


def test_what_is_left_is_judged_without_its_noise() -> None:
    rows = laid()
    whitening = Whitening(rows, SPECTRUM, np.ones(rows.size))
    rng = np.random.default_rng(1)
    covariances = [low @ low.T for low in lowers(whitening.factor(1.5, 0.0))]
    noise, left = [], []
    for _ in range(400):
        drawn = [rng.multivariate_normal(np.zeros(len(own)), own) for own in covariances]
        noise.append(whitening.beyond_noise(np.concatenate(drawn), 1.5))
        left.append(whitening.beyond_noise(np.concatenate(drawn) + 0.8, 1.5))
    assert np.mean(np.square(noise)) < 0.15
    assert np.mean(np.square(left)) == pytest.approx(0.64, rel=0.1)


@pytest.mark.parametrize("level", [0.5, 1.0, 4.0])
def test_a_sum_over_rows_varies_as_noise_of_a_level_makes_it(level: float) -> None:
    rows = laid()
    whitening = Whitening(rows, SPECTRUM, np.ones(rows.size))
    weights = np.random.default_rng(1).normal(size=rows.size)
    slow = 0.0
    for group, own in zip(rows.groups, lowers(whitening.factor(level, 0.0)), strict=True):
        slow += float(weights[group.rows] @ own @ own.T @ weights[group.rows])
    assert whitening.variance_of(weights, level) == pytest.approx(slow)


def test_a_few_noisy_rows_do_not_hide_what_is_left() -> None:
    rows = laid()
    few = replace(
        rows.groups[0], fixed=np.where(np.arange(rows.groups[0].count.size) == 3, 400.0, 0.003)
    )
    loud = replace(rows, groups=(few, *rows.groups[1:]))
    left = Whitening(loud, SPECTRUM, np.ones(rows.size)).beyond_noise(np.full(rows.size, 1.0))
    quiet = Whitening(rows, SPECTRUM, np.ones(rows.size)).beyond_noise(np.full(rows.size, 1.0))
    assert left == pytest.approx(quiet, rel=0.05)
