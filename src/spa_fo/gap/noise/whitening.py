"""Rows of a campaign and their covariance: coloured noise, and what a right form still misses.

Within a trial the noise is that of `noise.Spectrum`. Trials that were run alike share what an
explanation's form misses: a smooth error whose size goes with the gap about it,

    V = κ² C + W + s² g gᵀ ∘ K,

C and W being the coloured and the white noise, g the size of the gap at each row, K(t, t') a
correlation over the time within a trial, κ the noise's level and s the share that is missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from spa_fo.gap.noise.coloured import Spectrum, averaged

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

MISSED_OVER_S = np.array([0.3, 1.5, 8.0])
"""Correlation times of what a form misses, s, alike in weight; assumed."""


@dataclass(frozen=True)
class Group:
    """Rows of trials that were run alike.

    Attributes
    ----------
    rows : slice
        Its rows among all.
    trial : (n,) array
        Each row's trial, as an index into the grid's.
    time_s, width_s, count : (n,) arrays
        Middle and length of what each row is averaged over, and samples in it.
    fixed : (n,) array
        Variance that is known, deg².
    """

    rows: slice
    trial: Integers
    time_s: Floats
    width_s: Floats
    count: Floats
    fixed: Floats


@dataclass(frozen=True)
class Rows:
    """Averaged samples of the trials that take part, neighbours merged, experiment by experiment.

    Attributes
    ----------
    order : (n,) array
        Samples of the grid, trial after trial.
    first, number : (rows,) arrays
        Where each row begins in `order`, and how many samples it holds.
    groups : tuple of Group
        By experiment.
    """

    order: Integers
    first: Integers
    number: Floats
    groups: tuple[Group, ...]

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
    """Lay samples out in rows, `most` of them about.

    Parameters
    ----------
    groups : sequence of sequences of arrays
        By experiment and trial, the samples.
    time_s, width_s, count, fixed, trial : (n,) arrays
        Of all samples of the grid.
    most : int
        Rows in all; neighbours are merged until there are no more.
    """
    total = sum(own.size for group in groups for own in group)
    merge = -(-total // most)
    order, first, laid = [], [], []
    at = begin = 0
    for group in groups:
        for own in group:
            starts = np.arange(0, own.size, merge)
            first.append(at + starts)
            order.append(own)
            at += own.size
    all_first, all_order = np.concatenate(first), np.concatenate(order)
    number = np.diff(np.append(all_first, all_order.size)).astype(np.float64)

    def summed(values: Floats) -> Floats:
        return np.asarray(np.add.reduceat(values[all_order], all_first))

    middle, lengths, counts = summed(time_s) / number, summed(width_s), summed(count)
    known, trials = summed(fixed) / number**2, trial[all_order[all_first]]
    index = iter(first)
    for group in groups:
        end = begin + sum(next(index).size for _ in group)
        here = slice(begin, end)
        laid.append(
            Group(here, trials[here], middle[here], lengths[here], counts[here], known[here])
        )
        begin = end
    return Rows(all_order, all_first, number, tuple(laid))


@dataclass(frozen=True)
class Factor:
    """A covariance taken apart: inverses of its lower-triangular factors by group, and ½ log|V|.

    Some ten thousand short vectors are whitened by one factor: a product each, and no solution.
    """

    whiteners: tuple[Floats, ...]
    half_log: float


@dataclass
class Whitening:
    """Covariances of the rows for levels of the noise and shares that a form misses.

    Parameters
    ----------
    rows : Rows
        The rows.
    spectrum : Spectrum
        Noise within a trial.
    gap : (rows,) array
        Size of the gap at each row, deg.
    """

    rows: Rows
    spectrum: Spectrum
    gap: Floats
    _parts: list[tuple[Floats, Floats, Floats]] = field(default_factory=list)
    _factors: dict[tuple[float, float], Factor] = field(default_factory=dict)

    def _components(self) -> list[tuple[Floats, Floats, Floats]]:
        if not self._parts:
            for group in self.rows.groups:
                same = group.trial[:, None] == group.trial[None, :]
                coloured = np.tensordot(
                    self.spectrum.coloured, averaged(group.time_s, group.width_s), axes=1
                )
                apart = np.abs(group.time_s[:, None] - group.time_s[None, :])
                kernel = sum(np.exp(-apart / tau) for tau in MISSED_OVER_S) / MISSED_OVER_S.size
                gap = self.gap[group.rows]
                self._parts.append(
                    (
                        np.where(same, coloured, 0.0),
                        self.spectrum.white / group.count + group.fixed,
                        np.outer(gap, gap) * kernel,
                    )
                )
        return self._parts

    def factor(self, level: float, share: float) -> Factor:
        """Factor the covariance for a level of the coloured noise and a share that is missed."""
        key = (level, share)
        if key not in self._factors:
            whiteners: list[Floats] = []
            half_log = 0.0
            for coloured, white, missed in self._components():
                covariance = level**2 * coloured
                if share > 0.0:
                    covariance = covariance + share**2 * missed
                covariance[np.diag_indices_from(covariance)] += white
                lower = np.linalg.cholesky(covariance)
                half_log += float(np.sum(np.log(np.diag(lower))))
                eye = np.eye(lower.shape[0])
                whiteners.append(solve_triangular(lower, eye, lower=True, check_finite=False))
            self._factors[key] = Factor(tuple(whiteners), half_log)
        return self._factors[key]

    def beyond_noise(self, left: Floats, level: float = 1.0) -> float:
        """RMS of what is left at the rows, (rows,), less what noise of a level makes of it.

        Rows that are noisier than most, such as those beside a jump, count as little as they tell.
        """
        noise, weight = np.empty(left.size), np.empty(left.size)
        for group, (coloured, white, _) in zip(self.rows.groups, self._components(), strict=True):
            noise[group.rows] = level**2 * np.diag(coloured) + white
            weight[group.rows] = group.count
        usual = float(np.median(noise))
        weight *= (usual / np.maximum(noise, usual)) ** 2
        return float(np.sqrt(max(np.average(left**2 - noise, weights=weight), 0.0)))

    def white(self, factor: Factor, values: Floats) -> Floats:
        """Whiten values at the rows, (rows,) or (rows, k)."""
        out = np.empty_like(values)
        for group, whitener in zip(self.rows.groups, factor.whiteners, strict=True):
            out[group.rows] = whitener @ values[group.rows]
        return out
