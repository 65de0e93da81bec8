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
from scipy.ndimage import median_filter
from scipy.sparse.linalg import spsolve

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.gap.data.searched import wave
from spa_fo.gap.noise.whitening import Factor, Rows, Whitening
from spa_fo.gap.settings import SETTINGS
from spa_fo.rig import Trial

SLOWEST_FAST_HZ = 3.2
"""Lines above do not show in the averaged samples."""
_PADDED = 8192
_ABOUT_HZ = 1.0  # to either side, of the background that a fast line stands out of
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
    """
    rate, pieces = _fast(evidence)
    known = np.isfinite(pieces)
    pieces, known = pieces[known.any(axis=1)], known[known.any(axis=1)]
    counts = known.sum(axis=1, keepdims=True)
    means = np.sum(pieces, axis=1, keepdims=True, where=known) / counts
    pieces = np.where(known, pieces - means, 0.0)
    n, total = int(counts.sum()), float(np.sum(pieces**2))
    if n < _FEWEST_FAST or total <= 0.0:
        return NONE
    frequency = np.asarray(np.fft.rfftfreq(_PADDED, 1.0 / rate), dtype=np.float64)
    power = np.abs(np.fft.rfft(pieces)) ** 2 / counts
    mean = power.mean(axis=0)
    about = 2 * round(_ABOUT_HZ / (frequency[1] - frequency[0])) + 1
    least = 1e-6 * total / n
    background = np.maximum(median_filter(mean, size=about, mode="reflect"), least)
    at = int(np.argmax(np.where(frequency < SLOWEST_FAST_HZ, 0.0, mean / background)))
    left = np.abs(np.fft.rfft(_cleared(pieces, known, frequency[at] / rate))) ** 2 / counts
    away, own = np.abs(frequency - frequency[at]), rate / float(np.median(counts))
    beside = (away > own) & (away <= own + _ABOUT_HZ)
    median = float(np.median(left.mean(axis=0)[beside])) if beside.any() else float(background[at])
    # The median of an exponential is ln 2 of its mean.
    noise = max(median, least) / np.log(2.0)
    price = float(np.log(_PADDED / 2.0) + np.log(_FAST_AMPLITUDES.size))
    chi2, seen = 2.0 * power[:, [at]] / noise, counts / (2.0 * noise)
    return _best(frequency[[at]], chi2, seen, _FAST_AMPLITUDES, price)


def _cleared(pieces: Floats, known: NDArray[np.bool_], turns: float) -> Floats:
    """Take a wave of so many turns a sample off each trial, (trials, samples)."""
    waves = wave(turns, np.arange(pieces.shape[1], dtype=np.float64))
    left = pieces.copy()
    for own, here in zip(left, known, strict=True):
        own[here] -= waves[here] @ np.linalg.lstsq(waves[here], own[here], rcond=None)[0]
    return left


def without_lines(evidence: Evidence) -> Evidence:
    """Take fast lines off the angles, the strongest first: what else is there has its own noise.

    As white noise a line would hide everything below it. `Evidence.line_deg` says how large it was.
    """
    logged = evidence
    for _ in range(_MOST_LINES):
        line = fast_line(evidence)
        if line.gain <= SETTINGS.line_nats:
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


def _fast(evidence: Evidence) -> tuple[float, Floats]:
    """Take what the angle does within the averaging steps: (trials, samples), NaN in the gaps."""
    trials = evidence.grid.trials
    interval = float(np.median(np.concatenate([np.diff(trial.t_s) for trial in trials])))
    used = np.flatnonzero(evidence.takes_part)
    pieces = np.full((used.size, _PADDED), np.nan)
    for piece, i in zip(pieces, used.tolist(), strict=True):
        within, dense = _within_steps(evidence, i)
        at = np.rint(trials[i].t_s / interval).astype(np.int64)
        dense &= at < _PADDED
        piece[at[dense]] = within[dense]
    return 1.0 / interval, pieces


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
