"""Zeros that jump or wander with the order of the trials, against scatter and trends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from spa_fo.gap.noise import order as room
from spa_fo.gap.noise.coloured import Averages, Differences, Scatter, Spectrum, contrasts, scatter
from spa_fo.gap.noise.order import OF_GAIN, OF_ZERO, jumps, of_order, trends
from spa_fo.gap.settings import SETTINGS

Floats = NDArray[np.float64]
Zeros = tuple[Floats, Floats, Floats]
ORDINARY_DEG = 0.2


def between(experiments: list[list[int]], trials: int) -> Floats:
    """Orthonormal contrasts of the trials of each experiment."""
    rows = []
    for own in experiments:
        centre = np.eye(len(own)) - 1.0 / len(own)
        u, s, _ = np.linalg.svd(centre)
        rows.append(u[:, s > 0.5].T @ np.eye(trials)[own])
    return np.vstack(rows)


def seen(zeros: Floats, repeats: int, error_deg: float = 0.01) -> Zeros:
    """Take the zeros of experiments that were run in turn, `repeats` times."""
    trials = zeros.size
    kinds = trials // repeats
    every = between([list(range(k, trials, kinds)) for k in range(kinds)], trials)
    return every @ zeros, np.full(len(every), error_deg**2), every


def beforehand(scatters: Floats) -> Floats:
    """Weigh scatters alike up to an ordinary one, as half a bell over their logarithm beyond."""
    bell = norm(0.0, np.log(SETTINGS.most_scatter) / 2.0)
    weights = np.array([bell.pdf(max(np.log(one / ORDINARY_DEG), 0.0)) for one in scatters])
    return np.asarray(np.log(weights / weights.sum()))


def plain_twin(zeros: Zeros, shifts: Floats, walks: Floats, scatters: Floats) -> float:
    """Weigh every hypothesis by the density of the contrasts under it."""
    values, variance, contrasts = zeros
    trials = contrasts.shape[1]
    place = (np.arange(trials) + 0.5) / trials
    trend = np.column_stack([place - place.mean(), np.exp(-6.0 * place)])
    after = [(np.arange(trials) >= j).astype(float) for j in range(1, trials)]

    def log(covariance: Floats) -> float:
        own = contrasts @ covariance @ contrasts.T + np.diag(variance)
        mean = np.zeros(len(own))
        return float(multivariate_normal(mean, own).logpdf(values))

    still, moving = [], []
    for size, weight in zip(scatters, beforehand(scatters), strict=True):
        base = size**2 * (np.eye(trials) + 9.0 * trend @ trend.T)
        still.append(weight + log(base))
        once = [base + s**2 * np.outer(h, h) for s in shifts for h in after]
        twice = [
            base + s**2 * (np.outer(h, h) + np.outer(g, g))
            for s in shifts
            for k, h in enumerate(after)
            for g in after[k + 1 :]
        ]
        walk = [base + w**2 * sum(np.outer(h, h) for h in after) for w in walks]
        for hypotheses in (once, twice, walk):
            logs = [log(np.asarray(covariance)) for covariance in hypotheses]
            moving.append(weight + float(logsumexp(logs)) - np.log(len(logs)))
    return float(logsumexp(moving) - np.log(3) - logsumexp(still))


@pytest.mark.parametrize("jump_deg", [0.0, 1.5])
def test_the_evidence_is_that_of_every_hypothesis_written_out(
    jump_deg: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    few = np.array([0.2, 2.0]), np.array([0.1, 1.0]), np.array([0.1, 0.5])
    for name, values in zip(("_SHIFT_DEG", "_WALK_DEG", "_SCATTER_DEG"), few, strict=True):
        monkeypatch.setattr(room, name, values)
    zeros = seen(0.2 * rng.normal(size=8) + jump_deg * (np.arange(8) >= 5), 4)
    assert jumps(*zeros, ORDINARY_DEG)[0] == pytest.approx(plain_twin(zeros, *few), abs=1e-8)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.05, 1.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_scatter_and_trends_are_no_jumps(
    seed: int, scatter: float, linear: float, early: float
) -> None:
    rng = np.random.default_rng(seed)
    place = np.arange(15) / 15
    zeros = scatter * (rng.normal(size=15) + linear * place + early * np.exp(-6.0 * place))
    assert jumps(*seen(zeros, 5), ORDINARY_DEG)[0] < 7.0


def is_found(weigh: Callable[..., tuple[float, Floats]], truth: Floats) -> None:
    """Zeros that go with the order are told from scatter, and are what is expected then."""
    nats, left = [], []
    for seed in range(40):
        zeros = truth + 0.2 * np.random.default_rng(seed).normal(size=15)
        one, found = weigh(*seen(zeros, 5), ORDINARY_DEG)
        nats.append(one)
        left.append(np.std(found - truth) / np.std(truth))
    assert np.quantile(nats, 0.05) > 3.0
    assert np.quantile(left, 0.95) < 0.3


@pytest.mark.parametrize("at", [4, 7, 11])
def test_a_jump_is_found_and_taken_off(at: int) -> None:
    truth = 2.0 * (np.arange(15) >= at)
    is_found(jumps, truth)


def test_a_walk_is_found() -> None:
    rng = np.random.default_rng(5)
    walks = [np.cumsum(rng.normal(size=20)) + 0.1 * rng.normal(size=20) for _ in range(20)]
    nats = [jumps(*seen(walk, 5), ORDINARY_DEG)[0] for walk in walks]
    assert np.median(nats) > 3.0


def test_a_single_repeat_says_it_too() -> None:
    """Of two trials the zero cannot move twice."""
    nats = [jumps(*seen(np.array([0.0, apart]), 2), ORDINARY_DEG)[0] for apart in (0.2, 9.0)]
    assert nats[0] < 1.0 < nats[1]


def test_a_few_repeats_say_it_where_no_bench_scatters_so() -> None:
    def few(apart_deg: float) -> float:
        return jumps(*seen(np.array([0.0, 0.0, apart_deg, apart_deg]), 2), ORDINARY_DEG)[0]

    assert abs(few(ORDINARY_DEG)) < 1.0
    assert few(9.0) > 3.0
    nats, zeros = jumps(np.zeros(0), np.zeros(0), np.zeros((0, 4)), ORDINARY_DEG)
    assert nats == 0.0
    assert not zeros.any()


def trend_twin(zeros: Zeros, sizes: Floats, scatters: Floats) -> float:
    """Weigh a trend of every size by the density of the contrasts under it."""
    values, variance, contrasts = zeros
    trials = contrasts.shape[1]
    place = (np.arange(trials) + 0.5) / trials
    shapes = contrasts @ np.column_stack([place - place.mean(), np.exp(-6.0 * place)])
    still, going = [], []
    for size, weight in zip(scatters, beforehand(scatters), strict=True):
        own = np.diag(size**2 + variance)
        every = [0.0, *sizes]
        log, *logs = [
            multivariate_normal(np.zeros(len(own)), own + s**2 * shapes @ shapes.T).logpdf(values)
            for s in every
        ]
        still.append(weight + log)
        going.append(weight + float(logsumexp(logs)) - np.log(len(logs)))
    return float(logsumexp(going) - logsumexp(still))


@pytest.mark.parametrize("slope_deg", [0.0, 2.0])
def test_the_evidence_of_a_trend_is_that_of_every_size_written_out(
    slope_deg: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(4)
    few = np.array([0.2, 2.0]), np.array([0.1, 1.0])
    for name, values in zip(("_SHIFT_DEG", "_SCATTER_DEG"), few, strict=True):
        monkeypatch.setattr(room, name, values)
    zeros = seen(0.2 * rng.normal(size=8) + slope_deg * np.arange(8) / 8, 4)
    assert trends(*zeros, ORDINARY_DEG)[0] == pytest.approx(trend_twin(zeros, *few), abs=1e-8)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.05, 1.0))
def test_scatter_is_no_trend(seed: int, scatter: float) -> None:
    zeros = scatter * np.random.default_rng(seed).normal(size=15)
    assert trends(*seen(zeros, 5), ORDINARY_DEG)[0] < 7.0


def test_a_trend_is_found_and_taken_off() -> None:
    truth = 3.0 * np.arange(15) / 15
    is_found(trends, truth)


def repeated(gains: Floats, zeros_deg: Floats, kinds: int) -> list[Differences]:
    """Take experiments apart that were run in turn, each trial with its gain and its zero."""
    time_s, trials = np.linspace(0.0, 12.0, 60), gains.size
    rows = Averages(time_s, 0.2 * np.ones(60), 20.0 * np.ones(60), 1e-4 * np.ones(60))
    found = []
    for kind in range(kinds):
        shape = (30.0 + 10.0 * kind) * np.exp(-(((time_s - 6.0) / 3.0) ** 2))
        own = np.arange(kind, trials, kinds)
        angles = (1.0 + gains[own])[:, None] * shape + zeros_deg[own][:, None]
        found.append(contrasts(angles, rows, np.gradient(shape), np.eye(trials)[own]))
    return found


QUIET = Spectrum(1e-4, np.full(6, 1e-6))
USUAL = Scatter(0.01, 0.1, 0.01)


def test_gains_and_zeros_that_go_with_the_order_are_found_apart_and_are_no_scatter() -> None:
    rng, trials = np.random.default_rng(7), 15
    fallen = -0.1 * (np.arange(trials) >= 8) + 0.005 * rng.normal(size=trials)
    risen = 2.0 * (np.arange(trials) >= 5) + 0.05 * rng.normal(size=trials)
    for gains, zeros in ((fallen, 0.05 * rng.normal(size=trials)), (0.0 * fallen, risen)):
        differences = repeated(gains, zeros, 5)
        of_gain = of_order(differences, QUIET, OF_GAIN, 0.6, 60.0)[1] / 60.0
        of_zero = of_order(differences, QUIET, OF_ZERO, ORDINARY_DEG)[1]
        assert np.std(of_gain - gains) < 0.012
        assert np.std(of_zero - zeros) < 0.12
        apart = scatter(differences, QUIET, USUAL, of_zero, of_gain)
        assert apart.gain < 0.012
        assert apart.rest_deg < 0.15
    # Of what goes with the order most would be scatter.
    assert scatter(repeated(fallen, 0.0 * risen, 5), QUIET, USUAL).gain > 0.03


def test_scatter_of_gains_stays_scatter() -> None:
    rng = np.random.default_rng(8)
    gains = 0.05 * rng.normal(size=15)
    differences = repeated(gains, np.zeros(15), 5)
    found = of_order(differences, QUIET, OF_GAIN, 0.6, 60.0)[1] / 60.0
    assert np.std(found) < 0.02
    assert scatter(differences, QUIET, USUAL, None, found).gain == pytest.approx(0.045, rel=0.3)
