"""Interference on the flex channel: a line in the spectrum of what no response can follow.

A line has a phase of its own in every trial, and one amplitude. What keeps its phase from trial to
trial is a response, and the covariance of what repeats explains it as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.noise.whitening import Factor, Rows, Whitening

Floats = NDArray[np.float64]

_PADDED = 8192
SLOWEST_FAST_HZ = 3.2
"""Lines above do not show in the averaged samples."""
_ABOUT_HZ = 1.0  # to either side, of the background that a fast line stands out of
_FEWEST = 4  # samples of a step that say something about what is fast
_FEWEST_FAST = 32  # such samples in all
_FEWEST_CYCLES = 3.0  # within a trial: a slower wave may be any drift
_LOWEST_CYCLES = 0.3
_MOST_SLOW = 240  # frequencies that are tried
_AMPLITUDES = np.geomspace(0.02, 30.0, 60)


@dataclass(frozen=True)
class Line:
    """A spectral line.

    Attributes
    ----------
    frequency_hz, amplitude_deg : float
        As logged: above half the sampling rate it is an alias.
    gain : float
        Log evidence for it, the search over frequencies paid for; not below 0.
    """

    frequency_hz: float
    amplitude_deg: float
    gain: float


NONE = Line(0.0, 0.0, 0.0)


def fast_line(evidence: Evidence) -> Line:
    """Find the strongest line above 3 Hz within the averaging steps.

    It has to stand out of the noise of the frequencies about it, as that need not be white. Logs
    too slow to show one have none.
    """
    rate, pieces = _fast(evidence)
    frequency = np.fft.rfftfreq(_PADDED, 1.0 / rate)
    power = np.zeros(frequency.size)
    per_trial = []
    for piece in pieces:
        known = np.isfinite(piece)
        count = int(np.count_nonzero(known))
        if count == 0:
            continue
        spectrum = np.abs(np.fft.rfft(np.where(known, piece, 0.0), _PADDED)) ** 2
        per_trial.append((count, spectrum))
        power += spectrum / count
    n = sum(count for count, _ in per_trial)
    total = sum(float(np.nansum(piece**2)) for piece in pieces)
    if n < _FEWEST_FAST or total <= 0.0:
        return NONE
    power /= len(per_trial)
    about = 2 * round(_ABOUT_HZ / (frequency[1] - frequency[0])) + 1
    background = np.maximum(median_filter(power, size=about, mode="reflect"), 1e-6 * total / n)
    standing = np.where(frequency < SLOWEST_FAST_HZ, 0.0, power / background)
    best = int(np.argmax(standing))
    # The median of an exponential is ln 2 of its mean.
    noise = float(background[best]) / np.log(2.0)
    q = np.array([spectrum[best] / (count * noise) for count, spectrum in per_trial])
    counts = np.array([count for count, _ in per_trial])
    amplitudes = np.geomspace(0.003, 30.0, 200)
    kappa = np.outer(amplitudes**2, counts) / (4.0 * noise)
    gains = np.sum(q * kappa / (1.0 + kappa) - np.log1p(kappa), axis=1)
    at = int(np.argmax(gains))
    gain = float(gains[at]) - np.log(_PADDED / 2.0) - np.log(amplitudes.size)
    return Line(float(frequency[best]), float(amplitudes[at]), max(gain, 0.0))


def _fast(evidence: Evidence) -> tuple[float, list[Floats]]:
    """Take what the angle does within the averaging steps: on a uniform grid, NaN in its gaps."""
    grid = evidence.grid
    interval = float(np.median(np.concatenate([np.diff(trial.t_s) for trial in grid.trials])))
    pieces = []
    for trial, rows, used in zip(grid.trials, evidence.rows, evidence.takes_part, strict=True):
        if not used:
            continue
        good = ~trial.after_reset
        t = trial.t_s[good]
        smooth = np.interp(t, grid.time_s[rows], grid.angle_deg[rows])
        dense = np.interp(t, grid.time_s[rows], grid.counts[rows]) >= _FEWEST
        piece = np.full(round(t[-1] / interval) + 1, np.nan)
        piece[np.rint(t[dense] / interval).astype(int)] = (trial.angle_deg[good] - smooth)[dense]
        piece = piece[:_PADDED]
        pieces.append(piece - np.nanmean(piece) if np.isfinite(piece).any() else piece)
    return 1.0 / interval, pieces


def slow_line(
    rows: Rows, whitening: Whitening, factor: Factor, left: Floats, taken: Floats
) -> Line:
    """Find the line below 3 Hz that stands out of what an explanation leaves.

    Parameters
    ----------
    rows : Rows
        The rows.
    whitening, factor : Whitening, Factor
        Their covariance.
    left : (rows,) array
        Whitened residual.
    taken : (q, rows) array
        Orthonormal rows: directions that nuisances and parameters may have taken.
    """
    lengths = [np.ptp(g.time_s[g.trial == t]) for g in rows.groups for t in np.unique(g.trial)]
    length = float(np.median(lengths))
    slowest = _FEWEST_CYCLES / max(length, 1e-9)
    if slowest >= SLOWEST_FAST_HZ:
        return NONE
    # Slower ones are tried as well: their feet would look like a line else.
    lowest = _LOWEST_CYCLES / length
    count = int(np.clip(np.ceil(3.0 * (SLOWEST_FAST_HZ - lowest) * length), 2, _MOST_SLOW))
    tried = np.linspace(lowest, SLOWEST_FAST_HZ, count)
    residual = left - taken.T @ (taken @ left)
    pairs = []  # by frequency and trial: what a wave explains, and how much of it could be seen
    for g, whitener in zip(rows.groups, factor.whiteners, strict=True):
        waves = np.zeros((g.time_s.size, 0))
        trials = np.unique(g.trial)
        phase = 2.0 * np.pi * np.outer(g.time_s, tried)
        blur = np.sinc(np.outer(g.width_s, tried))
        both = np.stack([np.cos(phase) * blur, np.sin(phase) * blur], axis=-1)
        for t in trials:
            mine = (g.trial == t)[:, None]
            waves = both.reshape(g.time_s.size, -1) * mine
            white = whitener @ waves
            shadow = taken[:, g.rows] @ white
            score = (white.T @ residual[g.rows]).reshape(-1, 2)
            seen = np.einsum("ij,ij->j", white, white) - np.einsum("ij,ij->j", shadow, shadow)
            seen = np.maximum(seen.reshape(-1, 2).mean(axis=1), 1e-9)
            pairs.append((np.sum(score**2, axis=1) / seen, seen))
    q = np.array([pair[0] for pair in pairs])  # (trials, frequencies): chi² of two
    seen = np.array([pair[1] for pair in pairs])
    best = NONE
    for amplitude in _AMPLITUDES:
        kappa = 0.5 * amplitude**2 * seen
        gains = np.sum(0.5 * q * kappa / (1.0 + kappa) - np.log1p(kappa), axis=0)
        at = int(np.argmax(gains))
        gain = float(gains[at]) - float(np.log(tried.size * 4.0))
        if gain > best.gain:
            best = Line(float(tried[at]), float(amplitude), gain)
    return best if best.frequency_hz >= slowest else NONE
