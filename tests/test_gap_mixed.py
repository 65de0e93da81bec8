import numpy as np
import pytest

import naive_gap
from spa_fo.gap.mixed import Block, Prior, bordered, normal_equations, solve


def problem(seed, trials=4, rows=15):
    """Blocks with two shared columns and one of their own each."""
    rng = np.random.default_rng(seed)
    blocks, dense, residuals, noises = [], [], [], []
    for i in range(trials):
        columns = rng.standard_normal((rows, 3))
        index = np.array([0, 1, 2 + i])
        noise = rng.uniform(0.5, 2.0, rows)
        residual = rng.standard_normal(rows) * 2.0
        blocks.append(Block(residual, 1.0 / noise, columns, index))
        full = np.zeros((rows, 2 + trials))
        full[:, index] = columns
        dense.append(full)
        residuals.append(residual)
        noises.append(noise)
    return blocks, np.vstack(dense), np.concatenate(residuals), np.concatenate(noises)


@pytest.mark.parametrize("seed", range(4))
def test_evidence_and_posterior_are_those_of_the_full_covariance(seed):
    blocks, dense, residual, noise = problem(seed)
    size = dense.shape[1]
    mean = np.linspace(-0.5, 0.5, size)
    group = np.array([-1, -1] + [0] * (size - 2))
    scale = np.array([0.7])
    variance = np.array([2.0, 0.3] + [np.nan] * (size - 2))
    found = solve(
        normal_equations(blocks, size), Prior(mean, variance, group, scale), scale**2, rounds=0
    )
    known = np.where(group < 0, variance, scale[0] ** 2)
    expected, covariance = naive_gap.posterior(residual, noise, dense, mean, known)
    np.testing.assert_allclose(found.coefficients, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.covariance(), covariance, rtol=1e-8, atol=1e-12)
    # At its scale the variance's own prior adds nothing.
    naive = naive_gap.log_evidence(residual, noise, dense, mean, known)
    assert found.log_evidence == pytest.approx(naive, rel=1e-10)


@pytest.mark.parametrize("places", [np.array([0, 1]), np.array([2, 5]), np.array([4, 5])])
def test_columns_that_come_later_give_the_same_equations(places):
    rng = np.random.default_rng(2)
    blocks, later, index, whole = [], [], [], []
    others = np.setdiff1d(np.arange(6), places)
    for rows in (7, 9, 3):
        columns, more = rng.standard_normal((rows, 4)), rng.standard_normal((rows, 2))
        k = 0 if rows == 3 else 2  # one block gets none
        block = Block(rng.standard_normal(rows), rng.uniform(0.5, 2.0, rows), columns, others)
        blocks.append(block)
        later.append(more[:, :k])
        index.append(places[:k])
        whole.append(
            Block(
                block.residual,
                block.weight,
                np.hstack([columns, more[:, :k]]),
                np.concatenate([others, places[:k]]),
            )
        )
    at_once = normal_equations(whole, 6)
    known = others.max() + 1  # the equations may be as short as their columns allow
    added = bordered(normal_equations(blocks, known), blocks, later, index, 6)
    np.testing.assert_allclose(added.matrix, at_once.matrix, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(added.vector, at_once.vector, rtol=1e-12)
    assert (added.square, added.log_noise, added.rows) == (
        at_once.square,
        at_once.log_noise,
        at_once.rows,
    )


def test_a_column_that_no_row_has_changes_nothing_and_stays_at_its_prior():
    blocks, dense, _, _ = problem(3)
    size = dense.shape[1]
    group = np.array([-1, -1] + [0] * (size - 2))
    prior = Prior(np.linspace(-0.5, 0.5, size), np.full(size, 0.4), group, np.array([0.7]))
    plain = solve(normal_equations(blocks, size), prior, np.array([0.3]), rounds=3)
    wider = Prior(
        np.append(prior.mean, [0.0, 0.2]),
        np.append(prior.variance, [np.nan, 1.7]),
        np.append(group, [0, -1]),
        prior.scale,
    )
    found = solve(normal_equations(blocks, size + 2), wider, np.array([0.3]), rounds=3)
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
    blocks = []
    for i in range(trials):
        own = true * rng.standard_normal()
        residual = own + 0.3 * rng.standard_normal(rows)
        blocks.append(Block(residual, np.full(rows, 1 / 0.09), np.ones((rows, 1)), np.array([i])))
    prior = Prior(np.zeros(trials), np.ones(trials), np.zeros(trials, int), np.array([0.5]))
    found = solve(normal_equations(blocks, trials), prior, np.array([0.25]), rounds=40)
    assert np.sqrt(found.variances[0]) == pytest.approx(true, rel=0.2)


def test_more_rounds_never_lower_the_evidence():
    blocks, dense, _, _ = problem(7, trials=8)
    size = dense.shape[1]
    group = np.array([-1, -1] + [0] * (size - 2))
    prior = Prior(np.zeros(size), np.ones(size), group, np.array([0.2]))
    normal = normal_equations(blocks, size)
    evidence = [solve(normal, prior, np.array([0.04]), rounds=k).log_evidence for k in range(6)]
    assert np.all(np.diff(evidence) > -1e-6)


def test_few_rounds_reach_what_em_creeps_towards():
    blocks, dense, _, _ = problem(3, trials=12)
    size = dense.shape[1]
    group = np.array([-1, -1] + [0] * (size - 2))
    prior = Prior(np.zeros(size), np.ones(size), group, np.array([0.2]))
    normal = normal_equations(blocks, size)
    quick = solve(normal, prior, np.array([0.04]), rounds=12)
    slow = naive_gap.em(normal, prior, np.array([0.04]), rounds=500)
    np.testing.assert_allclose(quick.variances, slow, rtol=0.02)
