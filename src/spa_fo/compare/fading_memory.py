"""What a model misses, as a smooth function of where the actuator's input has been.

Any operator of fading memory is a static function of a bank of linear filters (Boyd and Chua 1985,
doi:10.1109/TCS.1985.1085649). Here the filters are first-order lags, and the function is drawn from
a Gaussian process (Rasmussen and Williams 2006, doi:10.7551/mitpress/3206.001.0001): it says how
well it knows itself, and goes back to zero where nothing like it was seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.signal import lfilter

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]

_MOST_SAMPLES = 600  # a Gaussian process costs the third power of them
_LAGS = 5
_STEP_S = 0.02
_LENGTHS = (0.5, 1.0, 2.0, 4.0)  # of the function, in standard deviations of the inputs
_NOISES = (0.003, 0.03, 0.1, 0.3)  # variance of what it does not hold, against what it does
_ROOM = 0.05  # of the range of an input, by which it may go beyond what was learned from
_PIECES = 4  # of a lone trial: each is predicted from the others


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
class FadingMemoryLaw:
    """A Gaussian process over a bank of lags.

    Attributes
    ----------
    lags_s : (k,) array
        Time constants of the filters.
    centre, scale : (k + 2,) arrays
        Of the inputs of the function.
    at : (n, k + 2) array
        Inputs that it learned from, scaled.
    weights : (n,) array
        Solution of (K + noise) w = missed.
    factor : (n, n) array
        Lower Cholesky factor of K + noise, over `amplitude` squared.
    length, noise, amplitude : float
        Hyperparameters.
    left : tuple of arrays
        By trial: what was missed by the law learned without that trial, or without that piece.
    sound : tuple of bool arrays
        By trial: samples that it may be judged on.
    """

    lags_s: Floats
    centre: Floats
    scale: Floats
    at: Floats
    weights: Floats
    factor: Floats
    length: float
    noise: float
    amplitude: float
    left: tuple[Floats, ...]
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
        """Say by trial which rows the law was not taught: the input or a lag of it is beyond."""
        low, high = self.at.min(axis=0), self.at.max(axis=0)
        room = _ROOM * (high - low)
        found = []
        for x in inputs(signals, self.lags_s):
            scaled = (x - self.centre) / self.scale
            found.append(((scaled < low - room) | (scaled > high + room)).any(axis=1))
        return found

    def _predicted(self, inputs: Floats) -> tuple[Floats, Floats]:
        k = kernel((inputs - self.centre) / self.scale, self.at, self.length)
        solved = cho_solve((self.factor, True), k.T, check_finite=False)
        variance = np.maximum(1.0 - np.sum(k.T * solved, axis=0), 0.0)
        return k @ self.weights, self.amplitude * np.sqrt(variance)


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


def kernel(x: Floats, y: Floats, length: float) -> Floats:
    """Squared exponential, (n, m)."""
    square = np.sum(x**2, axis=1)[:, None] + np.sum(y**2, axis=1)[None, :] - 2.0 * x @ y.T
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0) / length**2))


def learn(signals: Sequence[Signal]) -> FadingMemoryLaw:
    """Learn what is missed from the trials of a reference.

    The hyperparameters are those whose law predicts best what it did not learn from: a trial, or,
    of a lone one, a piece of it.
    """
    longest = max(float(s.t_s[-1] - s.t_s[0]) for s in signals)
    lags = np.geomspace(0.05, max(0.3 * longest, 1.0), _LAGS)
    all_inputs = np.concatenate(inputs(signals, lags))
    centre = all_inputs.mean(axis=0)
    scale = np.maximum(all_inputs.std(axis=0), 1e-9)
    x = (all_inputs - centre) / scale
    y = np.concatenate([s.missed for s in signals])
    group = np.concatenate([_groups(s, i, len(signals)) for i, s in enumerate(signals)])
    sound = np.concatenate([s.sound for s in signals])
    chosen = telling(x)
    chosen = chosen[sound[chosen]]
    span = np.gradient(chosen.astype(np.float64))  # samples that each stands for
    best: tuple[float, float, float] = (np.inf, 0.0, 0.0)
    for length, noise in product(_LENGTHS, _NOISES):
        left = _left_out(x[chosen], y[chosen], group[chosen], length, noise)
        best = min(best, (float(np.average(left**2, weights=span)), length, noise))
    _, length, noise = best
    left = np.empty(y.size)
    for one in np.unique(group):
        mine, others = group == one, chosen[group[chosen] != one]
        _, weights = _solved(x[others], y[others], length, noise)
        left[mine] = y[mine] - kernel(x[mine], x[others], length) @ weights
    at = x[chosen]
    factor, weights = _solved(at, y[chosen], length, noise)
    amplitude = float(np.sqrt(np.mean(y[sound] ** 2)))
    ends = np.cumsum([s.t_s.size for s in signals])[:-1]
    return FadingMemoryLaw(
        lags,
        centre,
        scale,
        at,
        weights,
        factor,
        length,
        noise,
        amplitude,
        tuple(np.split(left, ends)),
        tuple(s.sound for s in signals),
    )


def telling(x: Floats) -> Integers:
    """Choose samples to learn from, (n,): evenly along the way, and denser where much happens."""
    moved = np.sqrt(np.sum(np.diff(x, axis=0, prepend=x[:1]) ** 2, axis=1))
    way = np.cumsum(moved / max(float(moved.sum()), 1e-9) + 1.0 / moved.size)
    marks = np.linspace(way[0], way[-1], min(_MOST_SAMPLES, x.shape[0]))
    return np.unique(np.searchsorted(way, marks).clip(0, x.shape[0] - 1))


def _solved(x: Floats, y: Floats, length: float, noise: float) -> tuple[Floats, Floats]:
    """Factor K + noise, and solve (K + noise) w = y."""
    factor = np.asarray(np.linalg.cholesky(kernel(x, x, length) + noise * np.eye(y.size)))
    return factor, np.asarray(cho_solve((factor, True), y))


def _groups(signal: Signal, trial: int, trials: int) -> Integers:
    """Tell what is left out together by numbers: a trial, or a piece of a lone one."""
    if trials > 1:
        return np.full(signal.t_s.size, trial)
    return np.asarray(np.arange(signal.t_s.size) * _PIECES // signal.t_s.size)


def _left_out(x: Floats, y: Floats, group: Integers, length: float, noise: float) -> Floats:
    """Return what the law misses of each group when it learned from the others, (n,)."""
    covariance = kernel(x, x, length) + noise * np.eye(y.size)
    inverse = cho_solve(cho_factor(covariance, lower=True), np.eye(y.size))
    solved = inverse @ y
    left = np.empty(y.size)
    for one in np.unique(group):
        mine = np.flatnonzero(group == one)
        left[mine] = np.linalg.solve(inverse[np.ix_(mine, mine)], solved[mine])
    return left
