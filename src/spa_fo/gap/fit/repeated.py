"""What repeats say of an explanation, whatever its form misses.

A form that is wrong is wrong in all repeats of an experiment alike, which is why the evidence of
the rows is tempered. By what repeats differ no form is in doubt: how their gain and time scale
differ beside an explanation counts whole. What drifts or softens with the trials' order shows
there, and nothing else does. Of their rest angles, which a slip moves, `order.jumps` says it.

With an explanation's parameters at their best, contrasts c of the repeats' own nuisances have the
likelihood N(ĉ; c, Λ⁻¹) and scatter, c ~ N(B e, γ I), by a variance that only an ordinary bench is
known of; e are coefficients of a law or a trend, where there is one, which are integrated out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, helmert
from scipy.special import logsumexp

from spa_fo.arrays import Floats
from spa_fo.gap.fit.bench import GAIN, TIME_SCALE
from spa_fo.gap.fit.problem import AngleProblem
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.lapack import forward
from spa_fo.numeric.mixed import Solution

_SCATTERS = np.geomspace(0.1, SETTINGS.most_scatter, 12)
"""Of an ordinary bench's, alike in weight: assumed."""
_KINDS, _COLUMNS = (GAIN, TIME_SCALE), (0, 2)  # of a trial's own gain, rest angle and time scale
_LEAST_SAID = 1e-3  # of what was known before: less is rounding


def repeats_say(problem: AngleProblem, solution: Solution) -> float:
    """Weigh by how much repeats differ beside an explanation, nats.

    Parameters
    ----------
    problem : AngleProblem
        The explanation; a law, or what goes with the trials' order, counts as a part of it.
    solution : Solution
        Of its linear problem.

    Returns
    -------
    float
        0 where nothing is repeated.
    """
    between = _between(problem)
    if not between.size:
        return 0.0
    own = _trials_own(problem, solution)
    variances = (SETTINGS.scatter * _SCATTERS) ** 2
    return sum(
        _of_scatter(
            between @ own.mean[here],
            between @ own.covariance[np.ix_(here, here)] @ between.T,
            between @ own.others[here],
            float(solution.variances[kind]),
            variances,
        )
        for kind, here in zip(_KINDS, problem.own[:, _COLUMNS].T, strict=True)
    )


def rest_of(nats: float) -> float:
    """Give what is left of evidence that counts whole, beside rows that hold it and are tempered.

    It is in nats before they are tempered.
    """
    return (1.0 / SETTINGS.temper - 1.0) * nats


def _between(problem: AngleProblem) -> Floats:
    """Orthonormal contrasts of the trials that take part, (contrasts, trials)."""
    alike = problem.evidence.alike[problem.trials]
    order = np.argsort(alike, kind="stable")
    sizes = np.unique(alike, return_counts=True)[1]
    between = block_diag(*(helmert(size) for size in sizes))
    found = np.zeros_like(between)
    found[:, order] = between
    return found


@dataclass(frozen=True)
class _Own:
    """Nuisances, an explanation's parameters at their best and its law and trend at none."""

    mean: Floats  # (q,)
    covariance: Floats  # (q, q)
    others: Floats  # (q, k): by how much coefficients of law and trend, 1 sigma, move them


def _trials_own(problem: AngleProblem, solution: Solution) -> _Own:
    size = problem.group.size
    seen, spread = solution.seen[-size:], solution.spread[-size:]
    rows = solution.factor[-np.count_nonzero(seen) :]
    precision = np.diag(1.0 / spread)
    precision[np.ix_(seen, seen)] = rows @ rows.T
    free = np.setdiff1d(np.arange(problem.size), problem.trends)
    others = np.setdiff1d(np.arange(size), free)
    covariance = np.zeros((size, size))
    covariance[np.ix_(free, free)] = np.linalg.inv(precision[np.ix_(free, free)])
    b = solution.coefficients[-size:]
    slopes = covariance @ precision[:, others]
    return _Own(b + slopes @ b[others], covariance, slopes * np.sqrt(spread[others]))


def _of_scatter(
    mean: Floats, covariance: Floats, others: Floats, prior: float, variances: Floats
) -> float:
    """Log evidence of contrasts whose posterior under one variance is known, over all variances."""
    inverse = np.linalg.inv(covariance)
    sharp, axes = np.linalg.eigh(inverse - np.eye(mean.size) / prior)
    said = sharp > _LEAST_SAID / prior
    sharp = sharp[said]
    turned = axes.T[said] @ inverse / sharp[:, None]
    seen, moved = turned @ mean, turned @ others
    logs = []
    for variance in variances:
        root = np.linalg.cholesky(np.diag(1.0 / sharp + variance) + moved @ moved.T)
        left = forward(root, seen)
        # Against noise alone, whose size is alike for all explanations.
        size = np.sum(np.log(np.diag(root))) + 0.5 * np.sum(np.log(sharp))
        logs.append(-0.5 * float(left @ left) - float(size))
    return float(logsumexp(logs)) - float(np.log(variances.size))
