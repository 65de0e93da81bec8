"""Interference on the flex channel: a line in the spectrum of what no response can follow.

A line has a phase of its own in every trial, and one amplitude. What keeps its phase from trial to
trial is a response, and the covariance of what repeats explains it as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.ndimage import maximum_filter1d, median_filter
from scipy.sparse.linalg import spsolve

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.gap.data.searched import wave
from spa_fo.gap.noise.whitening import Factor, Rows, Whitening
from spa_fo.rig import Trial

SLOWEST_FAST_HZ = 3.2
"""Lines above do not show in the averaged samples."""
WORTH_A_FIT = 5.0
"""Nats from which a fast line is taken off and a slow one fitted; to be named takes many more.

Assumed.
"""
_PADDED = 8192  # intervals between samples, of a transform
_FINER = 8  # parts of the fastest period by which it is told when a sample was taken
_MAINS_HZ = 130.0  # a mains' own frequency is below, and twice it, as a rectified one has
_ALIAS = 1.1  # times the power of its alias a line above half the rate has to have. Assumed
_ABOUT_HZ = 1.0  # to either side, of the background that a fast line stands out of
_NEAR = 5  # frequencies of a transform among which the top of a line is
_FEWEST = 3  # samples of a step that say something about what is fast
_FEWEST_FAST = 32  # such samples in all
_FAST_AMPLITUDES = np.geomspace(0.003, 30.0, 200)
_MOST_LINES = 4  # that are taken off: a mains' own, harmonics, and what is left of them
_WANDERS_S = 2.0  # over which amplitude and phase of a line may change
_STEADY = 30.0  # samples that say of neighbouring knots that the wave is the same there
_FEWEST_CYCLES = 3.0  # within a trial: a slower wave may be any drift
_LOWEST_CYCLES = 0.3
_MOST_SLOW = 240  # frequencies that are tried
_SLOW_AMPLITUDES = np.geomspace(0.02, 30.0, 60)


@dataclass(frozen=True)
class Line:
    """A spectral line as logged: above half the sampling rate it is an alias."""

    frequency_hz: float
    amplitude_deg: float
    gain: float  # log evidence for it, the search over frequencies paid for; not below 0


NONE = Line(0.0, 0.0, 0.0)


def _best(hz: Floats, chi2: Floats, seen: Floats, amplitudes: Floats, price: float) -> Line:
    """Find the most probable line, given what a wave of any phase explains of each trial.

    That is `chi2`, (trials, frequencies), of two degrees of freedom; a wave of amplitude 1 would
    add `seen` to it.
    """
    kappa = 0.5 * np.multiply.outer(amplitudes**2, seen)
    gains = np.sum(0.5 * chi2 * kappa / (1.0 + kappa) - np.log1p(kappa), axis=1) - price
    a, k = np.unravel_index(int(np.argmax(gains)), gains.shape)
    return Line(float(hz[k]), float(amplitudes[a]), float(gains[a, k])) if gains[a, k] > 0 else NONE


def fast_line(evidence: Evidence) -> Line:
    """Find the strongest line above 3 Hz within the averaging steps.

    It has to stand out of the noise of the frequencies about it, as that need not be white: of what
    they hold beside it, as in short trials a line leaks far. Logs too slow to show one have none.
    Samples count when they were taken: a log that is not regular tells a line above half its rate
    from the alias below, and may show nothing there. A log that holds its readings shows lines of
    its own.
    """
    if evidence.grid.held_s is not None:
        return NONE
    interval_s, pieces = _fast(evidence)
    counts = np.array([[piece.time_s.size] for piece in pieces])
    n, total = int(counts.sum()), float(sum(np.sum(piece.angle_deg**2) for piece in pieces))
    if n < _FEWEST_FAST or total <= 0.0:
        return NONE
    half_rate, step_hz = 0.5 / interval_s, 1.0 / (_PADDED * interval_s)
    fastest_hz = max(half_rate, _MAINS_HZ)
    parts = int(np.ceil(_FINER * fastest_hz * interval_s))
    frequency: Floats = step_hz * np.arange(int(fastest_hz / step_hz) + 1, dtype=np.float64)
    laid = interval_s / parts, frequency.size, parts * _PADDED
    power = np.stack([piece.power(*laid) for piece in pieces]) / counts
    mean = power.mean(axis=0)
    about = 2 * round(_ABOUT_HZ / step_hz) + 1
    least = 1e-6 * total / n
    background = np.maximum(median_filter(mean, size=about, mode="reflect"), least)
    beyond, near = frequency > half_rate, maximum_filter1d(mean, _NEAR)
    stands_out, alias = mean / background, _alias(frequency, half_rate)
    stands_out[beyond] = mean[beyond] / np.maximum(background[beyond], np.median(mean[~beyond]))
    # About the rate are images of what is slow, and of whatever is fast where the log is regular.
    stands_out[beyond & (mean < _ALIAS * np.interp(alias, frequency, near))] = 0.0
    stands_out[alias < SLOWEST_FAST_HZ] = 0.0
    at = int(np.argmax(stands_out))
    left = [piece.without(frequency[at]).power(*laid) for piece in pieces]
    away, own = np.abs(frequency - frequency[at]), 1.0 / (interval_s * float(np.median(counts)))
    beside = (away > own) & (away <= own + _ABOUT_HZ)
    mean_left = (np.stack(left) / counts).mean(axis=0)
    median = float(np.median(mean_left[beside])) if beside.any() else float(background[at])
    # The median of an exponential is ln 2 of its mean.
    noise = max(median, least) / np.log(2.0)
    price = float(np.log(frequency.size / 2.0) + np.log(_FAST_AMPLITUDES.size))
    chi2, seen = 2.0 * power[:, [at]] / noise, counts / (2.0 * noise)
    return _best(frequency[[at]], chi2, seen, _FAST_AMPLITUDES, price)


def _alias(hz: Floats, half_rate: float) -> Floats:
    """Give where a regular log shows frequencies."""
    return np.asarray(np.abs((hz + half_rate) % (2.0 * half_rate) - half_rate))


@dataclass(frozen=True)
class _Piece:
    """What the angle of a trial does within the averaging steps: (n,) each."""

    time_s: Floats
    angle_deg: Floats

    def power(self, step_s: float, size: int, length: int) -> Floats:
        """Squared transform at the first `size` frequencies of `length` steps."""
        at = np.rint(self.time_s / step_s).astype(np.int64)
        laid = np.bincount(at, weights=self.angle_deg, minlength=length)
        return np.asarray(np.abs(np.fft.rfft(laid)[:size]) ** 2)

    def without(self, hz: float) -> _Piece:
        """Take a wave off."""
        waves = wave(hz, self.time_s)
        own = waves @ np.linalg.lstsq(waves, self.angle_deg, rcond=None)[0]
        return replace(self, angle_deg=self.angle_deg - own)


def without_lines(evidence: Evidence) -> Evidence:
    """Take fast lines off the angles, the strongest first: what else is there has its own noise.

    As white noise a line would hide everything below it. `Evidence.line_deg` says how large it was.
    """
    logged = evidence
    for _ in range(_MOST_LINES):
        line = fast_line(evidence)
        if line.gain <= WORTH_A_FIT:
            break
        evidence = _without(evidence, line.frequency_hz)
    if evidence is logged:
        return logged
    pairs = zip(logged.grid.trials, evidence.grid.trials, strict=True)
    line_deg = np.concatenate([before.angle_deg - after.angle_deg for before, after in pairs])
    return replace(
        evidence,
        takes_part=logged.takes_part,
        step_deg=logged.step_deg,
        line_deg=float(np.sqrt(np.mean(line_deg**2))),
    )


def _without(evidence: Evidence, hz: float) -> Evidence:
    """Take one line off, its amplitude and phase straight between knots `_WANDERS_S` apart."""
    trials = []
    for i, trial in enumerate(evidence.grid.trials):
        t = trial.t_s
        if t[-1] <= t[0]:
            trials.append(trial)
            continue
        knots = np.linspace(t[0], t[-1], max(round(float(t[-1] - t[0]) / _WANDERS_S), 1) + 1)
        hats, phase = _hats(t, knots), 2.0 * np.pi * hz * t[:, None]
        both: list[Any] = [hats.multiply(np.sin(phase)), hats.multiply(np.cos(phase))]
        waves = sparse.csr_matrix(sparse.hstack(both))
        within, dense = _within_steps(evidence, i)
        seen, none = waves[dense], 1e-9 * sparse.identity(waves.shape[1])
        steps = sparse.diags([-1.0, 1.0], [0, 1], shape=(knots.size - 1, knots.size))
        change = sparse.block_diag([steps, steps])
        normal = seen.T @ seen + _STEADY * change.T @ change + none
        line_deg = waves @ spsolve(normal.tocsc(), seen.T @ within[dense])
        line_deg[trial.after_reset] = 0.0  # whose times are estimates
        trials.append(replace(trial, angle_deg=trial.angle_deg - line_deg))
    without = collect(replace(evidence.data, trials=tuple(trials)))
    return replace(without, rise_s=evidence.rise_s)


def _hats(t: Floats, knots: Floats) -> sparse.csr_matrix:
    """Shares of the two knots about each time, (n, knots): a long trial has many."""
    after = np.clip(np.searchsorted(knots, t, side="right"), 1, knots.size - 1)
    share = (t - knots[after - 1]) / (knots[after] - knots[after - 1])
    rows = np.tile(np.arange(t.size), 2)
    at = rows, np.concatenate([after - 1, after])
    return sparse.csr_matrix((np.concatenate([1.0 - share, share]), at), (t.size, knots.size))


def _within_steps(evidence: Evidence, i: int) -> tuple[Floats, NDArray[np.bool_]]:
    """Take what a trial's angle does within the averaging steps, and where that can be told."""
    grid, rows = evidence.grid, evidence.rows[i]
    trial: Trial = grid.trials[i]
    smooth = np.interp(trial.t_s, grid.time_s[rows], grid.angle_deg[rows])
    dense = np.interp(trial.t_s, grid.time_s[rows], grid.counts[rows]) >= _FEWEST
    return trial.angle_deg - smooth, dense & ~trial.after_reset


def _fast(evidence: Evidence) -> tuple[float, list[_Piece]]:
    """Take the usual interval between samples, s, and what the angle does within the steps."""
    trials, pieces = evidence.grid.trials, []
    interval_s = float(np.median(np.concatenate([np.diff(trial.t_s) for trial in trials])))
    for i in np.flatnonzero(evidence.takes_part).tolist():
        within, dense = _within_steps(evidence, i)
        time_s = trials[i].t_s - trials[i].t_s[0]
        dense &= time_s < (_PADDED - 1) * interval_s
        if dense.any():
            own = within[dense]
            pieces.append(_Piece(time_s[dense], own - own.mean()))
    return interval_s, pieces


def slow_line(
    rows: Rows, whitening: Whitening, factor: Factor, left: Floats, taken: Floats
) -> Line:
    """Find the line below 3 Hz that stands out of what an explanation leaves.

    Parameters
    ----------
    rows, whitening, factor : Rows, Whitening, Factor
        The rows and their covariance.
    left, taken : (rows,), (q, rows) arrays
        Whitened residual; orthonormal directions that nuisances and parameters may have taken.
    """
    lengths = [np.ptp(g.time_s[g.trial == t]) for g in rows.groups for t in np.unique(g.trial)]
    length = max(float(np.median(lengths)), 1e-9)
    slowest = _FEWEST_CYCLES / length
    if slowest >= SLOWEST_FAST_HZ:
        return NONE
    # Slower ones are tried as well: their feet would look like a line else.
    lowest = _LOWEST_CYCLES / length
    count = int(np.clip(np.ceil(3.0 * (SLOWEST_FAST_HZ - lowest) * length), 2, _MOST_SLOW))
    tried = np.linspace(lowest, SLOWEST_FAST_HZ, count)
    residual = left - taken.T @ (taken @ left)
    chi2, seen = [], []
    for g, own in zip(rows.groups, factor.whiteners, strict=True):
        waves = wave(tried, g.time_s, g.width_s).reshape(g.time_s.size, -1)
        for trial in np.unique(g.trial):
            white = own @ (waves * (g.trial == trial)[:, None])
            score = white.T @ residual[g.rows]
            left_of_it = np.sum(white**2, axis=0) - np.sum((taken[:, g.rows] @ white) ** 2, axis=0)
            seen.append(np.maximum(left_of_it.reshape(-1, 2).mean(axis=1), 1e-9))
            chi2.append(np.sum(score.reshape(-1, 2) ** 2, axis=1) / seen[-1])
    price = float(np.log(count * 4.0))
    best = _best(tried, np.array(chi2), np.array(seen), _SLOW_AMPLITUDES, price)
    return best if best.frequency_hz >= slowest else NONE
