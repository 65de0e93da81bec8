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

import numpy as np
from scipy.signal import lfilter
from scipy.spatial import cKDTree

from spa_fo.arrays import Bools, Floats, Integers

MOST_ASKED = 4000  # of a campaign; what is between is interpolated
NEAREST = 32
STEP_S = 0.02
ROOM = 0.05  # of the range of an input, by which it may go beyond what was learned from
NOTHING = 1e-12


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

    def doubt(self, variance: Floats, power: float) -> Floats:
        """Raise the function's own variance to a power, as a share of that of its values.

        A function that is not of this kind misses more nearby than it says, or more far away.
        """
        whole = max(self.amplitude**2, NOTHING)
        return np.asarray(whole * (variance / whole) ** power)


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
class Chosen:
    """What a function is like that says best what it did not learn from.

    Attributes
    ----------
    kernel : Kernel
    scatter, trust, power : float
        The variance of what it misses is `scatter` and `trust` times a power of its own; see
        `Kernel.doubt`.
    farthest : float
        Its largest variance that was tried: beyond, nobody knows what it misses.
    repeats : bool
        Whether anything was done more than once, so that `scatter` was learned.
    """

    kernel: Kernel
    scatter: float
    trust: float
    power: float
    farthest: float
    repeats: bool

    def expected(self, variance: Floats) -> Floats:
        """Variance of what is missed, where the function's own is this."""
        doubt = self.kernel.doubt(variance, self.power)
        return np.maximum(self.scatter + self.trust * doubt, NOTHING)


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
    chosen : Chosen
        What the function is like.
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
    chosen: Chosen
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
        room = ROOM * (high - low)
        found = []
        for x in inputs(signals, self.lags_s):
            scaled = (x - self.centre) / self.scale
            beyond = ((scaled < low - room) | (scaled > high + room)).any(axis=1)
            found.append(beyond | (self._asked(scaled)[1] > self.chosen.farthest))
        return found

    def _predicted(self, inputs: Floats) -> tuple[Floats, Floats]:
        mean, variance = self._asked((inputs - self.centre) / self.scale)
        return mean, np.sqrt(self.chosen.expected(variance))

    def _asked(self, x: Floats) -> tuple[Floats, Floats]:
        """Ask at scaled inputs, (n, k + 2); the variance is the function's own."""
        asked, every = telling(x, MOST_ASKED), np.arange(len(x))
        which = nearest(x[asked], self.at, min(NEAREST, len(self.at)))
        found = neighbours(x[asked], self.at, which).predict(self.chosen.kernel, self.missed)
        mean, variance = (np.interp(every, asked, each) for each in found)
        return mean, variance


def inputs(signals: Sequence[Signal], lags_s: Floats) -> list[Floats]:
    """Return by trial the input, its lags, and its largest value so far, (n, k + 2)."""
    lagged, ended = np.zeros(lags_s.size), 0.0
    found: dict[int, Floats] = {}
    for i in sorted(range(len(signals)), key=lambda i: signals[i].started_s):
        signal = signals[i]
        # The steps are the law's own: logs jitter, and rows are missing.
        t = np.arange(signal.t_s[0], signal.t_s[-1] + STEP_S, STEP_S)
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
    a = float(np.exp(-STEP_S / lag_s))
    return np.asarray(lfilter([1.0 - a], [1.0, -a], held, zi=np.array([a * before]))[0])


def nearest(asked: Floats, learned: Floats, k: int) -> Integers:
    """Find the k rows that are nearest to each that is asked for, (n, k)."""
    return np.asarray(cKDTree(learned).query(asked, k=[*range(1, k + 1)])[1])


def neighbours(asked: Floats, learned: Floats, which: Integers) -> Neighbours:
    """Measure how far rows that are asked for are from those of `which`, and these apart."""
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
