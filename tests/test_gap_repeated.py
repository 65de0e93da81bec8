"""What repeats say of an explanation: the likelihood of what they differ by, nothing else."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from spa_fo.gap.fit.bench import GAIN, REST, TIME_SCALE
from spa_fo.gap.fit.repeated import _of_scatter, repeats_say, rest_of
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.mixed import Normal, Prior, solve

Floats = NDArray[np.float64]
ALIKE = np.array([0, 1, 0, 1, 0, 1, 2])  # two experiments run in turn, and one that is not repeated
TRIALS, ROWS = ALIKE.size, 12
NOISE = 1e-3
SCALE = np.array([0.01, 0.2, 0.01])


@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_likelihood_of_the_contrasts_over_all_scatters(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = 0.1 * rng.standard_normal((4, 4))
    noise, seen, prior = root @ root.T + 0.02 * np.eye(4), 0.3 * rng.standard_normal(4), 0.04
    covariance = np.linalg.inv(np.linalg.inv(noise) + np.eye(4) / prior)
    mean = covariance @ np.linalg.solve(noise, seen)
    variances, others = np.array([0.01, 0.1, 1.0]), 0.2 * rng.standard_normal((4, 2))
    moved = covariance @ np.linalg.solve(noise, others)  # the prior holds it as it does the mean
    spread = noise + others @ others.T
    plain = [
        multivariate_normal(np.zeros(4), spread + v * np.eye(4)).logpdf(seen) for v in variances
    ]
    constant = 0.5 * np.linalg.slogdet(2.0 * np.pi * noise)[1]  # alike for all explanations
    expected = logsumexp(plain) - np.log(3.0) + constant
    found = _of_scatter(mean, covariance, moved, prior, variances)
    assert found == pytest.approx(expected, rel=1e-9)


def test_where_noise_says_nothing_there_is_no_evidence() -> None:
    mean, others, prior = np.zeros(3), np.zeros((3, 0)), 0.04
    assert _of_scatter(mean, prior * np.eye(3), others, prior, np.array([0.01, 1.0])) == 0.0


def said(gains: Floats, rests: Floats | None = None, trend: Floats | None = None) -> float:
    """What is said of trials with gains and rest angles of their own; `trend` is a column more."""
    time = np.linspace(0.1, 1.0, ROWS)
    own = np.column_stack([time, np.ones(ROWS), time**2])
    size = 3 * TRIALS + (trend is not None)
    columns = np.zeros((TRIALS * ROWS, size))
    for i in range(TRIALS):
        columns[i * ROWS : (i + 1) * ROWS, 3 * i : 3 * i + 3] = own
    if trend is not None:
        columns[:, -1] = np.repeat(trend, ROWS) * np.tile(time, TRIALS)
    left = np.repeat(gains, ROWS) * np.tile(time, TRIALS)
    if rests is not None:
        left = left + np.repeat(rests, ROWS)
    kinds = [GAIN, REST, TIME_SCALE]
    group = np.append(np.tile(kinds, TRIALS), np.full(size - 3 * TRIALS, -1))
    scale = np.ones(6)
    scale[kinds] = SCALE
    prior = Prior(np.zeros(size), np.full(size, 0.2**2), group, scale)
    square, log_noise = float(left @ left) / NOISE**2, left.size * np.log(2.0 * np.pi * NOISE**2)
    weighted = columns.T / NOISE**2
    normal = Normal(weighted @ columns, weighted @ left, square, float(log_noise), left.size)
    problem = SimpleNamespace(
        evidence=SimpleNamespace(alike=ALIKE),
        trials=np.arange(TRIALS),
        own=np.arange(3 * TRIALS).reshape(TRIALS, 3),
        size=size,
        group=group,
        trends=np.arange(3 * TRIALS, size),
    )
    return repeats_say(cast(Any, problem), solve(normal, prior, scale**2, rounds=0))


def test_repeats_that_differ_less_say_more() -> None:
    rng = np.random.default_rng(1)
    own = rng.standard_normal(TRIALS)
    assert said(0.003 * own) > said(0.02 * own) + 3.0


@settings(max_examples=20, deadline=None)
@given(missed=st.lists(st.floats(-0.05, 0.05), min_size=3, max_size=3))
def test_what_is_missed_of_all_repeats_alike_changes_nothing(missed: list[float]) -> None:
    own = 0.01 * np.random.default_rng(2).standard_normal(TRIALS)
    assert said(own + np.array(missed)[ALIKE]) == pytest.approx(said(own), abs=1e-6)


def test_what_goes_with_the_order_is_said_by_repeats() -> None:
    order = np.arange(TRIALS) / (TRIALS - 1.0)
    drift = 0.1 * order + 0.003 * np.random.default_rng(3).standard_normal(TRIALS)
    assert said(drift, trend=order) > said(drift) + 4.0


def test_rest_angles_are_weighed_elsewhere() -> None:
    own = 0.01 * np.random.default_rng(4).standard_normal(TRIALS)
    jumps = np.where(np.arange(TRIALS) > 3, 0.5, 0.0)
    assert said(own, jumps) == pytest.approx(said(own), abs=0.1)


def test_without_repeats_nothing_is_said() -> None:
    problem = SimpleNamespace(evidence=SimpleNamespace(alike=np.arange(4)), trials=np.arange(4))
    assert repeats_say(cast(Any, problem), cast(Any, None)) == 0.0


def test_with_what_is_tempered_it_counts_whole() -> None:
    nats = 3.0
    assert SETTINGS.temper * (nats + rest_of(nats)) == pytest.approx(nats)
