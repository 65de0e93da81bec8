"""What goes with the trials' order: zeros and gains that jump, wander or follow a trend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import expit, logsumexp, softmax

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.noise.coloured import Differences, Spectrum
from spa_fo.gap.prior import log_prior
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY

OF_ZERO, OF_GAIN = 0, 1
"""Which number each contrast of repeats is fitted with; see `Differences.own`."""
# Standard deviations that are tried, wide: those of jumps are alike in weight, assumed.
_SCATTER_DEG = np.geomspace(0.02, 3.0, 12)
_SHIFT_DEG = np.geomspace(0.1, 10.0, 7)
_WALK_DEG = np.geomspace(0.05, 3.0, 6)
_MOST_IS = 2.0  # standard deviations of what is said of an ordinary scatter
_TREND = 3.0  # scatters that zeros may go with their order by
_FEWEST = 3  # contrasts that say something of a trend, which takes two


def of_order(
    differences: Sequence[Differences],
    spectrum: Spectrum,
    which: int,
    ordinary_deg: float,
    unit: float = 1.0,
) -> tuple[float, Floats]:
    """Weigh whether zeros, or gains in `unit` deg, go with the trials' order.

    They scatter by about `ordinary_deg` on an ordinary bench.

    Returns nats that they jump or wander, and what is expected of all trials by that and a trend.
    """
    own = [d.own(spectrum) for d in differences]
    seen = (
        unit * np.concatenate([values[:, which] for values, _ in own]),
        unit**2
        * np.concatenate([np.full(len(values), variance[which]) for values, variance in own]),
        np.vstack([d.between for d in differences]),
    )
    one = log_prior(tuple(LIBRARY)[:1]) - log_prior(())
    (nats, jumped), (more, trended) = jumps(*seen, ordinary_deg), trends(*seen, ordinary_deg)
    jump, trend = expit(nats + one), expit(more + one)
    return nats, jump * jumped + (1.0 - jump) * trend * trended


def jumps(
    values: Floats, variance: Floats, between: Floats, ordinary_deg: float
) -> tuple[float, Floats]:
    """Weigh whether the zeros of trials jump or wander, beyond scatter and a trend.

    Repeats of one experiment say it without any explanation: what an explanation misses of them, it
    misses of all alike. Their zeros scatter independently, with a variance that is not known, and
    may go with the order of the campaign as what creeps, softens or warms up does. A sensor that
    slips moves all zeros that follow: once, twice, or a little before every trial,

        ζ = σ ε + τ T b + { 0;  a H_j;  a H_j + a' H_k;  w Σ_j ε_j H_j },    H_j = [order ≥ j],

    each by its marginal likelihood, integrated over the variances and summed over the places.

    Parameters
    ----------
    values, variance : (n,) arrays
        Orthonormal contrasts of the zeros, deg, and variance of their errors.
    between : (n, trials) array
        What they are contrasts of, in the order of the campaign.
    ordinary_deg : float
        What zeros scatter by on an ordinary bench.

    Returns
    -------
    nats, zeros_deg : float, (trials,) array
        Log evidence that zeros move, against scatter and a trend alone; what they are if so.
    """
    trials = between.shape[1]
    if not values.size:
        return 0.0, np.zeros(trials)
    after = np.tri(trials)[:, 1:]
    trend = between @ trend_shapes(trials)
    every = np.arange(trials - 1)
    pairs = np.column_stack(np.triu_indices(trials - 1, 1))
    hypotheses = [(every[:, None], _SHIFT_DEG), (every[None, :], _WALK_DEG)]
    if pairs.size:  # of two trials there are none
        hypotheses.append((pairs, _SHIFT_DEG))
    still, moving, means = [], [], []
    for sigma, beforehand in zip(_SCATTER_DEG, _ordinarily(ordinary_deg), strict=True):
        covariance = (_TREND * sigma) ** 2 * (trend @ trend.T) + np.diag(sigma**2 + variance)
        root = np.linalg.cholesky(covariance)
        y = solve_triangular(root, values, lower=True)
        steps = solve_triangular(root, between @ after, lower=True)
        log = beforehand - 0.5 * float(y @ y) - float(np.sum(np.log(np.diag(root))))
        still.append(log)
        for which, sizes in hypotheses:
            gains, amounts = _weigh(y, steps, which, sizes)
            moving.append(log + float(logsumexp(gains)) - np.log(gains.size))
            means.append(after @ (softmax(gains) @ amounts))
    nats = float(logsumexp(moving) - np.log(len(hypotheses)) - logsumexp(still))
    return nats, np.asarray(softmax(moving) @ np.array(means))


def _ordinarily(ordinary_deg: float) -> Floats:
    """Log weights of `_SCATTER_DEG`: alike up to an ordinary scatter, hardly any far beyond."""
    beyond = np.maximum(np.log(_SCATTER_DEG / ordinary_deg) / np.log(SETTINGS.most_scatter), 0.0)
    logs = -0.5 * (_MOST_IS * beyond) ** 2
    return np.asarray(logs - logsumexp(logs))


def trend_shapes(trials: int) -> Floats:
    """Two ways of going with the trials' order: evenly, and early, (trials, 2)."""
    place = (np.arange(trials) + 0.5) / trials
    return np.column_stack([place - place.mean(), np.exp(-6.0 * place)])


def trends(
    values: Floats, variance: Floats, between: Floats, ordinary_deg: float
) -> tuple[float, Floats]:
    """Weigh a trend with the trials' order, ζ = σ ε + τ T b, against scatter alone; see `jumps`.

    Returns
    -------
    nats, trended : float, (trials,) array
        Log evidence that there is a trend; what it is if so.
    """
    shapes = trend_shapes(between.shape[1])
    if values.size < _FEWEST:
        return 0.0, np.zeros(len(shapes))
    still, going, means = [], [], []
    for sigma, beforehand in zip(_SCATTER_DEG, _ordinarily(ordinary_deg), strict=True):
        root = np.sqrt(sigma**2 + variance)
        y, steps = values / root, (between @ shapes) / root[:, None]
        log = beforehand - 0.5 * float(y @ y) - float(np.sum(np.log(root)))
        still.append(log)
        gains, amounts = _weigh(y, steps, np.array([[0, 1]]), _SHIFT_DEG)
        going.append(log + float(logsumexp(gains)) - np.log(gains.size))
        means.append(shapes @ (softmax(gains) @ amounts))
    nats = float(logsumexp(going) - logsumexp(still))
    return nats, np.asarray(softmax(going) @ np.array(means))


def _weigh(y: Floats, steps: Floats, which: Integers, sizes: Floats) -> tuple[Floats, Floats]:
    """Weigh steps that come together, (m, k), of every size: nats, and what is expected of each."""
    products = (steps.T @ steps)[which[:, :, None], which[:, None, :]]
    shadows = (steps.T @ y)[which]
    gains, amounts = [], []
    for size in sizes:
        precision = products + np.eye(which.shape[1]) / size**2
        expected = np.linalg.solve(precision, shadows[..., None])[..., 0]
        half_log = 0.5 * np.linalg.slogdet(size**2 * precision)[1]
        gains.append(0.5 * np.sum(shadows * expected, axis=1) - half_log)
        amounts.append(np.zeros((len(which), steps.shape[1])))
        np.put_along_axis(amounts[-1], which, expected, axis=1)
    return np.concatenate(gains), np.vstack(amounts)
