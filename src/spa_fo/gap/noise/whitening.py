"""Rows of a campaign and their covariance: coloured noise, and what a right form still misses.

Within a trial the noise is that of `coloured.Spectrum`. Trials that were run alike share what an
explanation's form misses: a smooth error whose size goes with the gap about it,

    V = κ² f fᵀ ∘ C + W + s² g gᵀ ∘ K,

C and W being the coloured and the white noise, f 1 or what a reference says that it is times as
large by, g the size of the gap at each row, K(t, t') a correlation over the time within a trial, κ
the noise's level and s the share that is missed. What
a converter's step hides is the same whenever the value is, so trials share it, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import blas

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.noise.coloured import CORRELATION_S, Averages, Spectrum, whitener

_MANY = 20  # columns, among which those that are 0 are worth looking for
MISSED_OVER_S = np.array([0.3, 1.5, 8.0])
"""Correlation times of what a form misses, s, alike in weight; assumed."""


@dataclass(frozen=True)
class Group(Averages):
    """Rows of trials that were run alike."""

    rows: slice  # among all
    trial: Integers  # (n,): each row's trial, as an index into the grid's


@dataclass(frozen=True)
class Rows:
    """Averaged samples of the trials that take part, neighbours merged; by experiment."""

    order: Integers  # (n,): samples of the grid, trial after trial
    first: Integers  # (rows,): where each row begins in `order`
    number: Floats  # (rows,): how many samples it holds
    groups: tuple[Group, ...]  # by experiment

    @property
    def size(self) -> int:
        """How many rows there are."""
        return self.first.size

    def merged(self, values: Floats) -> Floats:
        """Average values at the grid's samples, (n,) or (n, k), over the rows."""
        sums = np.add.reduceat(values[self.order], self.first, axis=0)
        return np.asarray((sums.T / self.number).T)


def lay_rows(
    groups: Sequence[Sequence[Integers]],
    time_s: Floats,
    width_s: Floats,
    count: Floats,
    fixed: Floats,
    trial: Integers,
    most: int,
) -> Rows:
    """Lay samples out in rows, `most` of them about: neighbours are merged until there are no more.

    Parameters
    ----------
    groups : sequence of sequences of arrays
        By experiment and trial, the samples.
    time_s, width_s, count, fixed, trial : (n,) arrays
        Of all samples of the grid; see `Averages`.
    """
    order = np.concatenate([own for group in groups for own in group])
    trials = np.cumsum([0, *(own.size for group in groups for own in group)])
    merge = -(-order.size // most)
    first = np.concatenate([np.arange(at, end, merge) for at, end in pairwise(trials)])
    ends = np.cumsum([0, *(sum(own.size for own in group) for group in groups)])
    rows = Averages(time_s[order], width_s[order], count[order], fixed[order]).merged(first)
    laid = [
        Group(
            **{name: values[here] for name, values in vars(rows).items()},
            rows=here,
            trial=trial[order[first[here]]],
        )
        for here in map(slice, *np.searchsorted(first, [ends[:-1], ends[1:]]).tolist())
    ]
    number = np.diff(np.append(first, order.size)).astype(np.float64)
    return Rows(order, first, number, tuple(laid))


@dataclass(frozen=True)
class Factor:
    """A covariance V taken apart.

    Some ten thousand short vectors are whitened by one factor: a product each, and no solution.
    """

    whiteners: tuple[Floats, ...]  # by group
    half_log: float  # ½ log|V|


def _mean_decay(apart_s: Floats, times_s: Iterable[float]) -> Floats:
    return np.asarray(np.mean([np.exp(-apart_s / tau) for tau in times_s], axis=0))


def _triangular(whitener: Floats, rows: Floats) -> Floats:
    """Whiten vectors, (k, n), to columns: a third faster than a product that reads the zeros.

    The whitener's rows are contiguous; else each call would copy it.
    """
    return np.asarray(blas.dtrmm(1.0, whitener.T, rows, side=1)).T


@dataclass
class Whitening:
    """Covariances of the rows for levels of the noise and shares that a form misses."""

    rows: Rows
    spectrum: Spectrum  # noise within a trial
    gap: Floats  # (rows,): size of the gap at each row, deg
    # What a converter's step hides, 1 sigma: as long as the value stays, and in all repeats alike.
    hidden: float = 0.0
    # (rows,): how many times as large the coloured noise is at each row; alike where None.
    times: Floats | None = None
    _factors: dict[tuple[float, float], Factor] = field(default_factory=dict, init=False)

    @cached_property
    def _parts(self) -> list[tuple[Floats, Floats, Floats]]:
        """By group: coloured noise (n, n), white noise (n,), what a share of 1 misses (n, n)."""
        found = []
        for group in self.rows.groups:
            same = group.trial[:, None] == group.trial
            coloured = np.where(same, self.spectrum.coloured_covariance(group), 0.0)
            if self.times is not None:
                coloured *= np.outer(self.times[group.rows], self.times[group.rows])
            apart = np.abs(group.time_s[:, None] - group.time_s)
            coloured += self.hidden**2 * _mean_decay(apart, CORRELATION_S)
            kernel = _mean_decay(apart, MISSED_OVER_S)
            gap = self.gap[group.rows]
            found.append((coloured, self.spectrum.variance(group), np.outer(gap, gap) * kernel))
        return found

    def factor(self, level: float, share: float) -> Factor:
        """Factor the covariance for a level of the coloured noise and a share that is missed."""
        if (level, share) not in self._factors:
            whiteners = tuple(
                whitener(level**2 * coloured + share**2 * missed + np.diag(white))
                for coloured, white, missed in self._parts
            )
            half_log = -float(sum(np.sum(np.log(np.diag(own))) for own in whiteners))
            self._factors[level, share] = Factor(whiteners, half_log)
        return self._factors[level, share]

    def renumbered(self, samples: Integers) -> Whitening:
        """Return it where what was sample k of the grid is sample `samples[k]` of another one."""
        made = copy(self)
        made.rows = replace(self.rows, order=samples[self.rows.order])
        return made

    def white(self, factor: Factor, values: Floats) -> Floats:
        """Whiten values at the rows, (rows,) or (rows, k)."""
        out = np.zeros_like(values)
        for group, own in zip(self.rows.groups, factor.whiteners, strict=True):
            some = values[group.rows]
            if some.ndim == 1:
                out[group.rows] = blas.dtrmv(own.T, some, trans=1)
            elif some.shape[1] < _MANY:
                out[group.rows] = _triangular(own, some.T)
            else:  # most are a trial's own, and 0 here: two thirds of the time with them
                here = np.flatnonzero(some.any(axis=0))
                out[group.rows, here] = _triangular(own, some.T[here])
        return out

    def variance_of(self, weights: Floats, level: float = 1.0) -> float:
        """Variance of a weighted sum over the rows, (rows,), as noise of a level makes it."""
        total = 0.0
        for group, (coloured, white, _) in zip(self.rows.groups, self._parts, strict=True):
            own = weights[group.rows]
            total += float(level**2 * (own @ coloured @ own) + white @ own**2)
        return total

    def beyond_noise(self, left: Floats, level: float = 1.0) -> float:
        """RMS of what is left at the rows, (rows,), less what noise of a level makes of it.

        Rows that are noisier than most, such as those beside a jump, count as little as they tell.
        """
        noise = np.concatenate([level**2 * np.diag(c) + white for c, white, _ in self._parts])
        usual = float(np.median(noise))
        weight = np.concatenate([group.count for group in self.rows.groups])
        weight = weight * (usual / np.maximum(noise, usual)) ** 2
        return float(np.sqrt(max(np.average(left**2 - noise, weights=weight), 0.0)))
