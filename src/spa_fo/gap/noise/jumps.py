"""Whether the zeros of trials jump or wander with their order, beyond scatter and a trend.

Repeats of one experiment say it without any explanation: what an explanation misses of them, it
misses of all alike. Their zeros scatter independently, with a variance that is not known, and may
go with the order of the campaign as what creeps, softens or warms up does. A sensor that slips
moves all zeros that follow: once, twice, or a little before every trial,

    ζ = σ ε + τ T b + { 0;  a H_j;  a H_j + a' H_k;  w Σ_j ε_j H_j },    H_j = [order ≥ j],

each by its marginal likelihood, integrated over the variances and summed over the places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import logsumexp, softmax

Floats = NDArray[np.float64]

_SCATTER_DEG = np.geomspace(0.02, 3.0, 12)
_SHIFT_DEG = np.geomspace(0.1, 10.0, 7)
_WALK_DEG = np.geomspace(0.05, 3.0, 6)
"""Standard deviations that are tried, alike in weight: wide, assumed."""
_TREND = 3.0  # scatters that zeros may go with their order by
_FEWEST = 3  # contrasts, which a jump and a scatter take two of


@dataclass(frozen=True)
class Zeros:
    """Contrasts of the zeros of repeated trials.

    Attributes
    ----------
    values : (n,) array
        Orthonormal contrasts, deg.
    variance : (n,) array
        Of the error of each.
    between : (n, trials) array
        What they are contrasts of, in the order of the campaign.
    """

    values: Floats
    variance: Floats
    between: Floats


@dataclass(frozen=True)
class Jumps:
    """What is known of moving zeros.

    Attributes
    ----------
    nats : float
        Log evidence that they move, against scatter and a trend alone.
    zeros_deg : (trials,) array
        Expected zeros if they do.
    """

    nats: float
    zeros_deg: Floats

    def expected_deg(self, log_odds: float) -> Floats:
        """Give the zeros that are expected, deg, where moving ones have these odds beforehand."""
        share = 1.0 / (1.0 + np.exp(-np.clip(self.nats + log_odds, -50.0, 50.0)))
        return np.asarray(share * self.zeros_deg)


def jumps(zeros: Zeros) -> Jumps:
    """Weigh zeros that jump or wander.

    Parameters
    ----------
    zeros : Zeros
        What repeats say of them.
    """
    trials = zeros.between.shape[1]
    if zeros.values.size < _FEWEST:
        return Jumps(0.0, np.zeros(trials))
    after = np.tri(trials)[:, 1:]
    place = (np.arange(trials) + 0.5) / trials
    trend = zeros.between @ np.column_stack([place - place.mean(), np.exp(-6.0 * place)])
    still, moving, means = [], [], []
    for scatter in _SCATTER_DEG:
        covariance = (_TREND * scatter) ** 2 * (trend @ trend.T)
        covariance[np.diag_indices_from(covariance)] += scatter**2 + zeros.variance
        root = np.linalg.cholesky(covariance)
        y = solve_triangular(root, zeros.values, lower=True)
        steps = solve_triangular(root, zeros.between @ after, lower=True)
        log = -0.5 * float(y @ y) - float(np.sum(np.log(np.diag(root))))
        still.append(log)
        for gains, amounts in (_one(y, steps), _two(y, steps), _walk(y, steps)):
            weights = softmax(gains)
            moving.append(log + float(logsumexp(gains)) - np.log(gains.size))
            means.append(after @ (weights @ amounts))
    nats = float(logsumexp(moving) - np.log(len(moving)) - logsumexp(still) + np.log(len(still)))
    return Jumps(nats, np.asarray(softmax(moving) @ np.array(means)))


def _one(y: Floats, steps: Floats) -> tuple[Floats, Floats]:
    """Weigh one jump: nats by place and size, and the steps that are expected of each."""
    gains, amounts = [], []
    squares, shadows = np.sum(steps**2, axis=0), steps.T @ y
    for shift in _SHIFT_DEG:
        share = shift**2 / (1.0 + shift**2 * squares)
        gains.append(0.5 * share * shadows**2 - 0.5 * np.log1p(shift**2 * squares))
        amounts.append(np.diag(share * shadows))
    return np.concatenate(gains), np.vstack(amounts)


def _two(y: Floats, steps: Floats) -> tuple[Floats, Floats]:
    """Weigh two jumps."""
    first, second = np.triu_indices(steps.shape[1], 1)
    matrix, shadows = steps.T @ steps, steps.T @ y
    a, b, c = matrix[first, first], matrix[second, second], matrix[first, second]
    u, v = shadows[first], shadows[second]
    gains, amounts = [], []
    for shift in _SHIFT_DEG:
        p, q = a + shift**-2, b + shift**-2
        determinant = p * q - c**2
        one, other = (q * u - c * v) / determinant, (p * v - c * u) / determinant
        gains.append(0.5 * (u * one + v * other) - 0.5 * np.log(shift**4 * determinant))
        both = np.zeros((first.size, steps.shape[1]))
        both[np.arange(first.size), first], both[np.arange(first.size), second] = one, other
        amounts.append(both)
    return np.concatenate(gains), np.vstack(amounts)


def _walk(y: Floats, steps: Floats) -> tuple[Floats, Floats]:
    """Weigh a step before every trial."""
    u, s, v = np.linalg.svd(steps, full_matrices=False)
    along = u.T @ y
    gains, amounts = [], []
    for walk in _WALK_DEG:
        spread = (walk * s) ** 2
        gains.append(0.5 * np.sum(spread / (1.0 + spread) * along**2 - np.log1p(spread)))
        amounts.append((walk**2 * s / (1.0 + spread) * along) @ v)
    return np.array(gains), np.array(amounts)
