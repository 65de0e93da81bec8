"""Rates with intervals, and how well probabilities are calibrated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BINS = 10
_Z = 1.959963984540054
_RESAMPLES = 1000
_SEED = 0


@dataclass(frozen=True)
class Estimate:
    """A figure with its 95 % interval and the number of cases behind it; NaN without any."""

    value: float
    low: float
    high: float
    n: int


@dataclass(frozen=True)
class Bin:
    """Answers of like probability: the mean of it, and how often they were right."""

    claimed: float
    right: Estimate


@dataclass(frozen=True)
class Calibration:
    """How far claimed probabilities are from frequencies.

    Attributes
    ----------
    ece : Estimate
        Expected calibration error: the mean of |claimed - right| over the bins, weighted by their
        cases; its interval by bootstrap over cases.
    by_chance : float
        What the error of perfectly calibrated answers with these probabilities would be on average:
        a finite number of cases never gives zero.
    bins : tuple of Bin
        Those with any case.
    """

    ece: Estimate
    by_chance: float
    bins: tuple[Bin, ...]


def rate(hits: Sequence[bool]) -> Estimate:
    """Share of hits with Wilson's interval.

    Parameters
    ----------
    hits : sequence of bool
        One a case.

    Notes
    -----
    E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209, doi:10.1080/01621459.1927.10502953.
    """
    n = len(hits)
    if n == 0:
        return nothing()
    share = sum(hits) / n
    centre = (share + _Z**2 / (2 * n)) / (1 + _Z**2 / n)
    half = _Z / (1 + _Z**2 / n) * np.sqrt(share * (1 - share) / n + _Z**2 / (4 * n**2))
    # Rounding must not push an interval's end past a share of 0 or 1.
    low, high = min(centre - half, share), max(centre + half, share)
    return Estimate(share, float(max(low, 0.0)), float(min(high, 1.0)), n)


def mean(values: Sequence[float]) -> Estimate:
    """Mean with its percentile bootstrap interval."""
    every = np.asarray(values, dtype=float)
    if every.size == 0:
        return nothing()
    return _bootstrapped(lambda counts: counts @ every / every.size, every.size)


def expected_error(claimed: Sequence[float], right: Sequence[bool]) -> Estimate:
    """Compute the expected calibration error, as in `Calibration`."""
    probability, hit = np.asarray(claimed, dtype=float), np.asarray(right, dtype=float)
    n = probability.size
    if n == 0:
        return nothing()
    excess = np.zeros((n, BINS))
    excess[np.arange(n), _places(probability)] = probability - hit
    return _bootstrapped(lambda counts: np.abs(counts @ excess).sum(axis=-1) / n, n)


def difference(one: Estimate, other: Estimate) -> Estimate:
    """Absolute difference of two independent estimates with its interval, from theirs.

    Notes
    -----
    Square and add: R. G. Newcombe, Stat. Med. 17 (1998) 873; for any estimates G. Y. Zou,
    A. Donner, Stat. Med. 27 (2008) 1693, doi:10.1002/sim.3095.
    """
    if not (one.n and other.n):
        return nothing()
    more, less = (one, other) if one.value >= other.value else (other, one)
    value = more.value - less.value
    down = np.hypot(more.value - more.low, less.high - less.value)
    up = np.hypot(more.high - more.value, less.value - less.low)
    return Estimate(value, float(max(value - down, 0.0)), float(value + up), one.n + other.n)


def calibration(claimed: Sequence[float], right: Sequence[bool]) -> Calibration:
    """Compare claimed probabilities with how often they were right.

    Parameters
    ----------
    claimed, right : sequences, one entry a case
        Probability of the most probable explanation, and whether it was the truth.

    Notes
    -----
    `BINS` equal bins of the probability: M. P. Naeini, G. F. Cooper, M. Hauskrecht, AAAI 2015,
    doi:10.1609/aaai.v29i1.9602.
    """
    probability, hit = np.asarray(claimed, dtype=float), np.asarray(right, dtype=float)
    n = probability.size
    if n == 0:
        return Calibration(nothing(), float("nan"), ())
    place = _places(probability)
    rng = np.random.default_rng(_SEED)
    misses = probability - (rng.random((_RESAMPLES, n)) < probability)
    chance = sum(np.abs(misses[:, place == b].sum(axis=1)) for b in np.unique(place)) / n
    bins = tuple(
        Bin(float(probability[place == b].mean()), rate((hit[place == b] > 0).tolist()))
        for b in np.unique(place)
    )
    return Calibration(expected_error(claimed, right), float(np.mean(chance)), bins)


def _places(probability: Floats) -> NDArray[np.int_]:
    return np.minimum(probability * BINS, BINS - 1).astype(int)


def _bootstrapped(statistic: Callable[[Floats], Any], n: int) -> Estimate:
    """Resample `n` cases; `statistic` takes how often each is there, shape (..., n)."""
    low, high = np.quantile(statistic(_resamples(n)), [0.025, 0.975])
    return Estimate(float(statistic(np.ones(n))), float(low), float(high), n)


@lru_cache(maxsize=4)  # one takes megabytes
def _resamples(n: int) -> Floats:
    """How often each of `n` cases is drawn, shape (resamples, n)."""
    rng = np.random.default_rng(_SEED)
    return rng.multinomial(n, np.full(n, 1.0 / n), size=_RESAMPLES).astype(float)


def nothing() -> Estimate:
    """Make the figure of no case at all."""
    return Estimate(float("nan"), float("nan"), float("nan"), 0)
