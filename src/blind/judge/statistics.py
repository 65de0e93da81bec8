"""Rates with intervals, and how well probabilities are calibrated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

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
        return _nothing()
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
        return _nothing()
    return _bootstrapped(lambda picked: float(every[picked].mean()), every.size)


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
    if probability.size == 0:
        return Calibration(_nothing(), float("nan"), ())
    place = np.minimum((probability * BINS).astype(int), BINS - 1)
    ece = _bootstrapped(lambda i: _ece(probability[i], hit[i], place[i]), probability.size)
    rng = np.random.default_rng(_SEED)
    chance = [
        _ece(probability, (rng.random(probability.size) < probability).astype(float), place)
        for _ in range(_RESAMPLES)
    ]
    bins = tuple(
        Bin(float(probability[place == b].mean()), rate((hit[place == b] > 0).tolist()))
        for b in np.unique(place)
    )
    return Calibration(ece, float(np.mean(chance)), bins)


def _ece(probability: Floats, hit: Floats, place: NDArray[np.int_]) -> float:
    excess = np.bincount(place, weights=probability - hit, minlength=BINS)
    return float(np.abs(excess).sum() / probability.size)


def _bootstrapped(statistic: Callable[[NDArray[np.int_]], float], n: int) -> Estimate:
    rng = np.random.default_rng(_SEED)
    draws = [statistic(rng.integers(n, size=n)) for _ in range(_RESAMPLES)]
    low, high = np.quantile(draws, [0.025, 0.975])
    return Estimate(statistic(np.arange(n)), float(low), float(high), n)


def _nothing() -> Estimate:
    return Estimate(float("nan"), float("nan"), float("nan"), 0)
