import numpy as np
import pytest

import naive_gap
from spa_fo.numeric.mixed import WEAK, Normal, Prior, solve


def problem(seed, trials=4, rows=15):
    """Rows of trials with two shared columns and one of their own each: columns, rest, noise."""
    rng = np.random.default_rng(seed)
    dense = np.zeros((trials * rows, 2 + trials))
    for i in range(trials):
        here = slice(i * rows, (i + 1) * rows)
        dense[here, [0, 1, 2 + i]] = rng.standard_normal((rows, 3))
    residual = rng.standard_normal(trials * rows) * 2.0
    return dense, residual, rng.uniform(0.5, 2.0, trials * rows)


def equations(dense, residual, noise, size=None):
    """Normal equations, with idle columns up to `size`."""
    columns = np.pad(dense, ((0, 0), (0, (size or dense.shape[1]) - dense.shape[1])))
    weighted = columns.T / noise
    log_noise = float(np.sum(np.log(2.0 * np.pi * noise)))
    square = float(residual @ (residual / noise))
    return Normal(weighted @ columns, weighted @ residual, square, log_noise, noise.size)


@pytest.mark.parametrize("seed", range(4))
def test_evidence_and_posterior_are_those_of_the_full_covariance(seed):
    dense, residual, noise = problem(seed)
    size = dense.shape[1]
    mean = np.linspace(-0.5, 0.5, size)
    group = np.array([-1, -1] + [0] * (size - 2))
    scale = np.array([0.7])
    variance = np.array([2.0, 0.3] + [np.nan] * (size - 2))
    found = solve(
        equations(dense, residual, noise), Prior(mean, variance, group, scale), scale**2, rounds=0
    )
    known = np.where(group < 0, variance, scale[0] ** 2)
    expected, covariance = naive_gap.posterior(residual, noise, dense, mean, known)
    np.testing.assert_allclose(found.coefficients, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.covariance(), covariance, rtol=1e-8, atol=1e-12)
    # At its scale the variance's own prior adds nothing.
    naive = naive_gap.log_evidence(residual, noise, dense, mean, known)
    assert found.log_evidence == pytest.approx(naive, rel=1e-10)


def test_a_column_that_no_row_has_changes_nothing_and_stays_at_its_prior():
    dense, residual, noise = problem(3)
    size = dense.shape[1]
    group = np.array([-1, -1] + [0] * (size - 2))
    prior = Prior(np.linspace(-0.5, 0.5, size), np.full(size, 0.4), group, np.array([0.7]))
    plain = solve(equations(dense, residual, noise), prior, np.array([0.3]), rounds=3)
    wider = Prior(
        np.append(prior.mean, [0.0, 0.2]),
        np.append(prior.variance, [np.nan, 1.7]),
        np.append(group, [0, -1]),
        prior.scale,
    )
    found = solve(equations(dense, residual, noise, size + 2), wider, np.array([0.3]), rounds=3)
    assert found.log_evidence == pytest.approx(plain.log_evidence, rel=1e-12)
    np.testing.assert_allclose(found.variances, plain.variances, rtol=1e-12)
    np.testing.assert_allclose(found.coefficients[:size], plain.coefficients, rtol=1e-12)
    np.testing.assert_allclose(found.coefficients[size:], [0.0, 0.2])
    covariance = found.covariance()
    np.testing.assert_allclose(covariance[:size, :size], plain.covariance(), rtol=1e-10)
    np.testing.assert_allclose(np.diag(covariance)[size:], [found.variances[0], 1.7])
    assert not covariance[size:, :size].any()


def test_variance_of_a_group_is_found():
    rng = np.random.default_rng(5)
    trials, rows, true = 60, 20, 1.5
    own = true * rng.standard_normal(trials)
    residual = np.repeat(own, rows) + 0.3 * rng.standard_normal(trials * rows)
    normal = equations(
        np.repeat(np.eye(trials), rows, axis=0), residual, np.full(residual.size, 0.09)
    )
    prior = Prior(np.zeros(trials), np.ones(trials), np.zeros(trials, int), np.array([0.5]))
    found = solve(normal, prior, np.array([0.25]), rounds=40)
    assert np.sqrt(found.variances[0]) == pytest.approx(true, rel=0.2)


def test_more_rounds_never_lower_the_evidence():
    dense, residual, noise = problem(7, trials=8)
    size = dense.shape[1]
    group = np.array([-1, -1] + [0] * (size - 2))
    prior = Prior(np.zeros(size), np.ones(size), group, np.array([0.2]))
    normal = equations(dense, residual, noise)
    evidence = [solve(normal, prior, np.array([0.04]), rounds=k).log_evidence for k in range(6)]
    assert np.all(np.diff(evidence) > -1e-6)


@pytest.mark.parametrize("strength", [WEAK, 30.0])
def test_few_rounds_reach_what_em_creeps_towards(strength):
    dense, residual, noise = problem(3, trials=12)
    size = dense.shape[1]
    group = np.array([-1, -1] + [0] * (size - 2))
    prior = Prior(np.zeros(size), np.ones(size), group, np.array([0.2]), strength=strength)
    normal = equations(dense, residual, noise)
    quick = solve(normal, prior, np.array([0.04]), rounds=12)
    slow = naive_gap.em(normal, prior, np.array([0.04]), rounds=500)
    np.testing.assert_allclose(quick.variances, slow, rtol=0.02)


def test_a_variance_that_was_measured_gives_way_less():
    trials = 8
    normal = equations(
        np.repeat(np.eye(trials), 5, axis=0), np.full(5 * trials, 2.0), np.full(5 * trials, 0.01)
    )
    found = {}
    for strength in (WEAK, 50.0):
        prior = Prior(
            np.zeros(trials),
            np.ones(trials),
            np.zeros(trials, int),
            np.array([0.5]),
            strength=strength,
        )
        found[strength] = solve(normal, prior, np.array([0.25]), rounds=30)
    # Eight values of 2 and so many of 0.5 squared: their mean, for the most probable variance.
    known = 50.0 * 0.25 + 8 * 4.0
    assert found[50.0].variances[0] == pytest.approx(known / (50.0 + 8 + 2.0), rel=0.01)
    assert found[50.0].log_evidence < found[WEAK].log_evidence - 5.0
