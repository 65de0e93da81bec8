"""What a model misses, as a smooth function of where the actuator's input has been.

Any operator of fading memory is a static function of a bank of linear filters (Boyd and Chua 1985,
doi:10.1109/TCS.1985.1085649). Here the filters are first-order lags, and the function is drawn from
a Gaussian process (Rasmussen and Williams 2006, doi:10.7551/mitpress/3206.001.0001): it says how
well it knows itself, and goes back to zero where nothing like it was seen. Each row is predicted
from the nearest ones alone (Vecchia 1988, doi:10.1111/j.2517-6161.1988.tb01729.x), so that all rows
of a log are kept: where the very same was done before, that is what is expected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.signal import lfilter
from scipy.spatial import cKDTree

from spa_fo.gap.data.evidence import same_course

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]

_MOST_SAMPLES = 4000  # that are learned from
_MOST_ASKED = 4000  # of a campaign; what is between is interpolated
_MOST_TRIED = 500  # by which hyperparameters are chosen, of each way to leave out
_NEAREST = 32
_QUICKEST_S = 0.05  # lag
_BANKS = ((5, 0.3), (7, 3.0))  # lags, the slowest in longest trials: without what is left to others
_STEP_S = 0.02
_LENGTHS = (1.0, 2.0, 4.0, 8.0)  # of the function, in standard deviations of the inputs
_NOISES = (1e-4, 1e-3, 1e-2)  # variance of what it does not hold, against what it does
_ROOM = 0.05  # of the range of an input, by which it may go beyond what was learned from
_PIECES = 4  # of what is left out in pieces
_SAME = 0.15  # standard deviations of the inputs: the very same was done before
_QUIETEST = 0.1  # of what repeats of an ordinary bench differ by: none is quieter
_FEW = 0.05  # of the rows, which do not say what that differs by
_ROUNDS = 6
_TRIED = 0.99  # quantile
_NOTHING = 1e-12


@dataclass(frozen=True)
class Signal:
    """One trial's input, and what is missed at the same times.

    Attributes
    ----------
    started_s : float
        Campaign time at the trial's start: trials of one campaign follow each other, at rest in
        between.
    t_s, input : (n,) arrays
        Times from the trial's start, and what drives the actuator.
    missed : (n,) array
    doubtful : (n,) bool array, optional
        Samples that a law is neither learned from nor judged on.
    """

    started_s: float
    t_s: Floats
    input: Floats
    missed: Floats
    doubtful: Bools | None = None

    @property
    def sound(self) -> Bools:
        """Samples that a law is learned from, (n,)."""
        every = np.ones(self.t_s.size, dtype=bool)
        return every if self.doubtful is None else ~self.doubtful


@dataclass(frozen=True)
class Kernel:
    """What the function is like: the correlation of its values, and what it does not hold.

    Attributes
    ----------
    length, noise, amplitude : float
        Of a Matérn kernel of 3/2, in scaled inputs; variance of what the function does not hold,
        against what it does; its standard deviation, deg.
    """

    length: float
    noise: float
    amplitude: float

    def of(self, apart: Floats) -> Floats:
        """Correlate values at inputs that are so far apart."""
        scaled = np.sqrt(3.0) * apart / self.length
        return np.asarray((1.0 + scaled) * np.exp(-scaled))


@dataclass(frozen=True)
class Neighbours:
    """The rows that are nearest to those that are asked for, n of them, k each."""

    which: Integers  # (n, k)
    apart: Floats  # (n, k): distances to them
    between: Floats  # (n, k, k): and among them

    def predict(self, law: Kernel, values: Floats) -> tuple[Floats, Floats]:
        """Predict, (n,), from values at all rows that were learned from; and a variance."""
        k = self.which.shape[1]
        own = law.of(self.apart)
        covariance = law.of(self.between) + law.noise * np.eye(k)
        right = np.stack([own, values[self.which]], axis=-1)
        solved = np.linalg.solve(covariance, right)
        mean = np.einsum("nk,nk->n", own, solved[..., 1])
        known = np.einsum("nk,nk->n", own, solved[..., 0])
        return mean, law.amplitude**2 * np.maximum(1.0 - known, 0.0)


@dataclass(frozen=True)
class FadingMemoryLaw:
    """A Gaussian process over a bank of lags.

    Attributes
    ----------
    lags_s : (k,) array
        Time constants of the filters.
    centre, scale : (k + 2,) arrays
        Of the inputs of the function.
    at, missed : (n, k + 2), (n,) arrays
        Inputs that it learned from, scaled, and what was missed there.
    kernel : Kernel
    scatter, trust : float
        The variance of what it misses is `scatter` and `trust` times its own; learned from what
        took no part.
    repeats : bool
        Whether anything was done more than once, so that `scatter` was learned.
    farthest : float
        Its largest variance that was tried in this way: beyond, nobody knows what it misses.
    left, expected : tuple of (rows,) arrays
        By trial: what was missed by the law learned without that trial, or without that piece, and
        the standard deviation that it expected.
    sound : tuple of bool arrays
        By trial: samples that it may be judged on.
    """

    lags_s: Floats
    centre: Floats
    scale: Floats
    at: Floats
    missed: Floats
    kernel: Kernel
    scatter: float
    trust: float
    farthest: float
    repeats: bool
    left: tuple[Floats, ...]
    expected: tuple[Floats, ...]
    sound: tuple[Bools, ...]

    @property
    def left_rms(self) -> float:
        """RMS of what is missed on trials that took no part."""
        left = np.concatenate(self.left)[np.concatenate(self.sound)]
        return float(np.sqrt(np.mean(left**2)))

    def predict(self, signals: Sequence[Signal]) -> list[tuple[Floats, Floats]]:
        """Predict what is missed in the trials of a campaign, and how well that is known.

        Returns
        -------
        list of pairs of (n,) arrays
            By trial: the prediction, and its standard deviation.
        """
        return [self._predicted(x) for x in inputs(signals, self.lags_s)]

    def unvisited(self, signals: Sequence[Signal]) -> list[Bools]:
        """Say by trial which rows the law was not taught.

        The input or a lag of it is beyond, or farther from all that was than any row by which the
        law was tried.
        """
        low, high = self.at.min(axis=0), self.at.max(axis=0)
        room = _ROOM * (high - low)
        found = []
        for x in inputs(signals, self.lags_s):
            scaled = (x - self.centre) / self.scale
            beyond = ((scaled < low - room) | (scaled > high + room)).any(axis=1)
            found.append(beyond | (self._asked(scaled)[1] > self.farthest))
        return found

    def _predicted(self, inputs: Floats) -> tuple[Floats, Floats]:
        mean, variance = self._asked((inputs - self.centre) / self.scale)
        return mean, np.sqrt(np.maximum(self.scatter + self.trust * variance, _NOTHING))

    def _asked(self, x: Floats) -> tuple[Floats, Floats]:
        """Ask at scaled inputs, (n, k + 2); the variance is the function's own."""
        asked, every = telling(x, _MOST_ASKED), np.arange(len(x))
        which = _nearest(x[asked], self.at, min(_NEAREST, len(self.at)))
        found = _neighbours(x[asked], self.at, which).predict(self.kernel, self.missed)
        mean, variance = (np.interp(every, asked, each) for each in found)
        return mean, variance


def inputs(signals: Sequence[Signal], lags_s: Floats) -> list[Floats]:
    """Return by trial the input, its lags, and its largest value so far, (n, k + 2)."""
    lagged, ended = np.zeros(lags_s.size), 0.0
    found: dict[int, Floats] = {}
    for i in sorted(range(len(signals)), key=lambda i: signals[i].started_s):
        signal = signals[i]
        # The steps are the law's own: logs jitter, and rows are missing.
        t = np.arange(signal.t_s[0], signal.t_s[-1] + _STEP_S, _STEP_S)
        last = np.maximum(np.searchsorted(signal.t_s, t, side="right") - 1, 0)
        held = signal.input[last]
        rest = max(signal.started_s + signal.t_s[0] - ended, 0.0) if found else 0.0
        lagged = lagged * np.exp(-rest / lags_s)
        columns = [held]
        for k, lag in enumerate(lags_s):
            columns.append(_lag(held, float(lag), float(lagged[k])))
        columns.append(np.maximum.accumulate(held))
        lagged = np.array([column[-1] for column in columns[1:-1]])
        ended = signal.started_s + float(signal.t_s[-1])
        found[i] = np.column_stack([np.interp(signal.t_s, t, column) for column in columns])
    return [found[i] for i in range(len(signals))]


def _lag(held: Floats, lag_s: float, before: float) -> Floats:
    a = float(np.exp(-_STEP_S / lag_s))
    return np.asarray(lfilter([1.0 - a], [1.0, -a], held, zi=np.array([a * before]))[0])


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
    all_inputs = np.concatenate(inputs(signals, lags))
    centre = all_inputs.mean(axis=0)
    scale = np.maximum(all_inputs.std(axis=0), 1e-9)
    x = (all_inputs - centre) / scale
    y = np.concatenate([s.missed for s in signals])
    sound = np.concatenate([s.sound for s in signals])
    chosen = telling(x, _MOST_SAMPLES)
    chosen = chosen[sound[chosen]]
    span = np.gradient(chosen.astype(np.float64))  # samples that each stands for
    amplitude = float(np.sqrt(np.mean(y[sound] ** 2)))
    some, groups = slice(None, None, -(-chosen.size // _MOST_TRIED)), ways(signals)
    tried = chosen[some]
    apart = [_apart(group, x, chosen, tried) for group in groups]
    again = apart[0].apart[:, 0] < _SAME
    if again.mean() < _FEW:
        again[:] = False
    weights = span[some]
    best = (np.inf, Kernel(_LENGTHS[0], _NOISES[0], amplitude), 0.0, 1.0, np.inf)
    for length, noise in product(_LENGTHS, _NOISES):
        kernel, scatter = Kernel(length, noise, amplitude), least**2
        found = [each.predict(kernel, y[chosen]) for each in apart]
        squares = [(y[tried] - mean) ** 2 for mean, _ in found]
        if again.any():  # by the first way
            scatter, _ = calibrated(squares[0][again], found[0][1][again], weights[again])
            scatter = max(scatter, (_QUIETEST * least) ** 2)
        square, variance = np.concatenate(squares), np.concatenate([v for _, v in found])
        every = np.tile(weights, len(groups))
        trust = beyond_scatter(square, variance, every, scatter)
        expected = np.maximum(scatter + trust * variance, _NOTHING)
        lost = float(np.average(np.log(expected) + square / expected, weights=every))
        if lost < best[0]:
            best = lost, kernel, scatter, trust, float(np.quantile(variance, _TRIED))
    lost, kernel, scatter, trust, farthest = best
    asked = telling(x, _MOST_ASKED)
    mean, variance = _apart(groups[0], x, chosen, asked).predict(kernel, y[chosen])
    rows, ends = np.arange(y.size), np.cumsum([s.t_s.size for s in signals])[:-1]
    expected = np.interp(rows, asked, np.sqrt(np.maximum(scatter + trust * variance, _NOTHING)))
    return lost, FadingMemoryLaw(
        lags_s=lags,
        centre=centre,
        scale=scale,
        at=x[chosen],
        missed=y[chosen],
        kernel=kernel,
        scatter=scatter,
        trust=trust,
        farthest=farthest,
        repeats=bool(again.any()),
        left=tuple(np.split(y - np.interp(rows, asked, mean), ends)),
        expected=tuple(np.split(expected, ends)),
        sound=tuple(s.sound for s in signals),
    )


def calibrated(squares: Floats, variance: Floats, weights: Floats) -> tuple[float, float]:
    """Fit the mean of squares, (n,), as a constant and a multiple of a variance, neither negative.

    By iteratively reweighted least squares, as the error of a square goes with what is expected.
    """
    columns = np.column_stack([np.ones(variance.size), variance])
    expected = np.full(variance.size, max(float(np.average(squares, weights=weights)), _NOTHING))
    found = np.zeros(2)
    for _ in range(_ROUNDS):
        root = np.sqrt(weights) / expected
        scaled = columns * root[:, None]
        unit = np.maximum(np.abs(scaled).max(axis=0), _NOTHING)
        found = nnls(scaled / unit, squares * root)[0] / unit
        expected = np.maximum(columns @ found, _NOTHING)
    return float(found[0]), float(found[1])


def beyond_scatter(squares: Floats, variance: Floats, weights: Floats, scatter: float) -> float:
    """Fit what squares, (n,), are beyond a known constant as a multiple of a variance, likewise."""
    expected = np.full(variance.size, max(float(np.average(squares, weights=weights)), _NOTHING))
    trust = 0.0
    for _ in range(_ROUNDS):
        own = weights / expected**2
        above = float(np.sum(own * variance * (squares - scatter)))
        trust = max(above / max(float(np.sum(own * variance**2)), _NOTHING), 0.0)
        expected = np.maximum(scatter + trust * variance, _NOTHING)
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
    t = np.arange(signal.t_s[0], signal.t_s[-1], _STEP_S)
    return np.interp(t, signal.t_s, signal.input)


def _apart(group: Integers, x: Floats, chosen: Integers, asked: Integers) -> Neighbours:
    """Find, for rows that are asked for, the nearest of those chosen that are of other groups."""
    k = min(_NEAREST, *(int(np.sum(group[chosen] != one)) for one in np.unique(group[asked])))
    which = np.empty((asked.size, k), dtype=np.int64)
    for one in np.unique(group[asked]):
        others = np.flatnonzero(group[chosen] != one)
        mine = group[asked] == one
        which[mine] = others[_nearest(x[asked[mine]], x[chosen[others]], k)]
    return _neighbours(x[asked], x[chosen], which)


def _nearest(asked: Floats, learned: Floats, k: int) -> Integers:
    return np.asarray(cKDTree(learned).query(asked, k=[*range(1, k + 1)])[1])


def _neighbours(asked: Floats, learned: Floats, which: Integers) -> Neighbours:
    x = learned[which]
    apart = np.sqrt(np.sum((x - asked[:, None, :]) ** 2, axis=2))
    square = np.einsum("nkd,nkd->nk", x, x)
    between = square[:, :, None] + square[:, None, :] - 2.0 * x @ x.transpose(0, 2, 1)
    return Neighbours(which, apart, np.sqrt(np.maximum(between, 0.0)))


def telling(x: Floats, most: int) -> Integers:
    """Choose samples, (n,) of them: evenly along the way, and denser where much happens."""
    moved = np.sqrt(np.sum(np.diff(x, axis=0, prepend=x[:1]) ** 2, axis=1))
    way = np.cumsum(moved / max(float(moved.sum()), 1e-9) + 1.0 / moved.size)
    marks = np.linspace(way[0], way[-1], min(most, x.shape[0]))
    return np.unique(np.searchsorted(way, marks).clip(0, x.shape[0] - 1))
