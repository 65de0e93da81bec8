"""How a law of fading memory is learned from a reference, and how well it says it knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import nnls

from spa_fo.arrays import Floats, Integers
from spa_fo.compare.fading_memory import (
    MOST_ASKED,
    NEAREST,
    NOTHING,
    STEP_S,
    Chosen,
    FadingMemoryLaw,
    Kernel,
    Neighbours,
    Signal,
    inputs,
    nearest,
    neighbours,
    telling,
)
from spa_fo.plant.alike import same_course

_MOST_SAMPLES = 4000  # that are learned from
_MOST_TRIED = 500  # by which hyperparameters are chosen, of each way to leave out
_QUICKEST_S = 0.05  # lag
_BANKS = ((5, 0.3), (7, 3.0))  # lags, the slowest in longest trials: without what is left to others
_LENGTHS = (1.0, 2.0, 4.0, 8.0)  # of the function, in standard deviations of the inputs
_NOISES = (1e-4, 1e-3, 1e-2)  # variance of what it does not hold, against what it does
_POWERS = (0.5, 1.0, 1.5)  # of its own variance, by which it misses more where that is larger
_PIECES = 4  # of what is left out in pieces
_SAME = 0.15  # standard deviations of the inputs: the very same was done before
_QUIETEST = 0.1  # of what repeats of an ordinary bench differ by: none is quieter
_FEW = 0.05  # of the rows, which do not say what that differs by
_ROUNDS = 6
_TRIED = 0.99  # quantile


@dataclass(frozen=True)
class _Rows:
    """All rows of a reference, and which of them a law is taught."""

    centre: Floats  # (k + 2,)
    scale: Floats
    x: Floats  # (rows, k + 2): inputs, scaled
    y: Floats  # (rows,): what was missed
    taught: Integers


def learn(signals: Sequence[Signal], least: float) -> FadingMemoryLaw:
    """Learn what is missed from the trials of a reference.

    Lags and hyperparameters are those whose law says best what it did not learn from; see `ways`.
    `least` is the standard deviation of what repeats differ by, where nothing was repeated.
    """
    course = courses(signals)
    # Of two alike nobody knows whether what they differ by is scatter, or what one left the other.
    banks = _BANKS if max(map(course.count, course)) > 2 else _BANKS[:1]
    found = [_learned(signals, lags, slowest, least) for lags, slowest in banks]
    return min(found, key=lambda each: each[0])[1]


def _learned(
    signals: Sequence[Signal], number: int, slowest: float, least: float
) -> tuple[float, FadingMemoryLaw]:
    """Learn with a bank of so many lags, up to a multiple of the longest trial; and what is lost.

    That is the mean of -2 log p, but for a constant, of what it did not learn from.
    """
    longest = max(float(s.t_s[-1] - s.t_s[0]) for s in signals)
    lags = np.geomspace(_QUICKEST_S, max(slowest * longest, 1.0), number)
    rows, groups = _rows(signals, lags), ways(signals)
    lost, chosen = _chosen(rows, groups, least)
    asked, every = telling(rows.x, MOST_ASKED), np.arange(rows.y.size)
    known = _apart(groups[0], rows.x, rows.taught, asked)
    mean, variance = known.predict(chosen.kernel, rows.y[rows.taught])
    expected = np.interp(every, asked, np.sqrt(chosen.expected(variance)))
    ends = np.cumsum([s.t_s.size for s in signals])[:-1]
    return lost, FadingMemoryLaw(
        lags_s=lags,
        centre=rows.centre,
        scale=rows.scale,
        at=rows.x[rows.taught],
        missed=rows.y[rows.taught],
        chosen=chosen,
        left=tuple(np.split(rows.y - np.interp(every, asked, mean), ends)),
        expected=tuple(np.split(expected, ends)),
        sound=tuple(s.sound for s in signals),
    )


def _rows(signals: Sequence[Signal], lags_s: Floats) -> _Rows:
    every = np.concatenate(inputs(signals, lags_s))
    centre, scale = every.mean(axis=0), np.maximum(every.std(axis=0), 1e-9)
    x = (every - centre) / scale
    taught = telling(x, _MOST_SAMPLES)
    sound = np.concatenate([s.sound for s in signals])
    y = np.concatenate([s.missed for s in signals])
    return _Rows(centre, scale, x, y, taught[sound[taught]])


def _chosen(rows: _Rows, groups: Sequence[Integers], least: float) -> tuple[float, Chosen]:
    """Choose the kernel that says best what it did not learn from; and what is lost with it."""
    every = -(-rows.taught.size // _MOST_TRIED)
    # Samples that each stands for.
    weights = np.gradient(rows.taught.astype(np.float64))[::every]
    tried, values = rows.taught[::every], rows.y[rows.taught]
    apart = [_apart(group, rows.x, rows.taught, tried) for group in groups]
    again = apart[0].apart[:, 0] < _SAME
    if again.mean() < _FEW:
        again[:] = False
    each = np.tile(weights, len(groups))
    amplitude = float(np.sqrt(np.mean(values**2)))
    found = []
    for length, noise in product(_LENGTHS, _NOISES):
        kernel = Kernel(length, noise, amplitude)
        means, variances = zip(*(one.predict(kernel, values) for one in apart), strict=True)
        squares = [(rows.y[tried] - mean) ** 2 for mean in means]
        square, variance = np.concatenate(squares), np.concatenate(variances)
        farthest = float(np.quantile(variance, _TRIED))
        for power in _POWERS:
            scatter, doubt = least**2, kernel.doubt(variance, power)
            if again.any():  # by the first way
                first = doubt[: tried.size][again]
                scatter, _ = calibrated(squares[0][again], first, weights[again])
                scatter = max(scatter, (_QUIETEST * least) ** 2)
            trust = beyond_scatter(square, doubt, each, scatter)
            chosen = Chosen(kernel, scatter, trust, power, farthest, bool(again.any()))
            expected = chosen.expected(variance)
            lost = float(np.average(np.log(expected) + square / expected, weights=each))
            found.append((lost, chosen))
    return min(found, key=lambda one: one[0])


def calibrated(squares: Floats, variance: Floats, weights: Floats) -> tuple[float, float]:
    """Fit the mean of squares, (n,), as a constant and a multiple of a variance, neither negative.

    By iteratively reweighted least squares, as the error of a square goes with what is expected.
    """
    columns = np.column_stack([np.ones(variance.size), variance])
    expected = np.full(variance.size, max(float(np.average(squares, weights=weights)), NOTHING))
    found = np.zeros(2)
    for _ in range(_ROUNDS):
        root = np.sqrt(weights) / expected
        scaled = columns * root[:, None]
        unit = np.maximum(np.abs(scaled).max(axis=0), NOTHING)
        found = nnls(scaled / unit, squares * root)[0] / unit
        expected = np.maximum(columns @ found, NOTHING)
    return float(found[0]), float(found[1])


def beyond_scatter(
    squares: Floats, variance: Floats, weights: Floats, scatter: float | Floats
) -> float:
    """Fit what squares, (n,), are beyond a known part as a multiple of a variance, likewise."""
    expected = np.full(variance.size, max(float(np.average(squares, weights=weights)), NOTHING))
    trust = 0.0
    for _ in range(_ROUNDS):
        own = weights / expected**2
        above = float(np.sum(own * variance * (squares - scatter)))
        trust = max(above / max(float(np.sum(own * variance**2)), NOTHING), 0.0)
        expected = np.maximum(scatter + trust * variance, NOTHING)
    return trust


def ways(signals: Sequence[Signal]) -> list[Integers]:
    """Say in which ways rows are left out together, (rows,) numbers of what each belongs to.

    A trial at a time, or a piece of a lone one: how well is known what was done before. And all
    trials of one course of the input at a time, or, where all are alike, the same piece of each:
    how well is known what was not.
    """
    trials = [np.full(s.t_s.size, i) for i, s in enumerate(signals)]
    pieces = [np.arange(s.t_s.size) * _PIECES // s.t_s.size for s in signals]
    if len(signals) == 1:
        return [np.concatenate(pieces)]
    course = courses(signals)
    alike = [np.full(s.t_s.size, c) for s, c in zip(signals, course, strict=True)]
    if len(set(course)) == len(signals):
        return [np.concatenate(trials)]
    together = pieces if len(set(course)) == 1 else alike
    return [np.concatenate(trials), np.concatenate(together)]


def courses(signals: Sequence[Signal]) -> list[int]:
    """Give each trial the number of the first one whose input took the same course."""
    drives = [_stepped(signal) for signal in signals]
    return [
        next(j for j in range(i + 1) if j == i or same_course(drives[j], drives[i]))
        for i in range(len(drives))
    ]


def _stepped(signal: Signal) -> Floats:
    """Return the input at even times from the trial's start."""
    t = np.arange(signal.t_s[0], signal.t_s[-1], STEP_S)
    return np.interp(t, signal.t_s, signal.input)


def _apart(group: Integers, x: Floats, chosen: Integers, asked: Integers) -> Neighbours:
    """Find, for rows that are asked for, the nearest of those chosen that are of other groups."""
    k = min(NEAREST, *(int(np.sum(group[chosen] != one)) for one in np.unique(group[asked])))
    which = np.empty((asked.size, k), dtype=np.int64)
    for one in np.unique(group[asked]):
        others = np.flatnonzero(group[chosen] != one)
        mine = group[asked] == one
        which[mine] = others[nearest(x[asked[mine]], x[chosen[others]], k)]
    return neighbours(x[asked], x[chosen], which)
