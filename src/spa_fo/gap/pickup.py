"""Interference on the flex channel: a line in the spectrum of what no response can follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc

from spa_fo.gap.evidence import Evidence
from spa_fo.gap.explain import (
    HARMONIC,
    PICKUP,
    SWELL,
    AngleProblem,
    Fit,
    drift_wave,
    fixture_wave,
    misread,
    ripple,
    wave,
)
from spa_fo.gap.mixed import Prior, bordered, solve
from spa_fo.gap.search import Point, linearised, point_at
from spa_fo.gap.together import each

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_PADDED = 8192
_SLOWEST_FAST_HZ = 3.2  # of the lines that the averaged samples do not show
_SLOWEST_HZ = 0.02
_MOST_SLOW = 400  # frequencies that are tried
_BARE = (PICKUP, PICKUP)
_RIPPLED = (*_BARE, SWELL, SWELL, HARMONIC, HARMONIC, HARMONIC, HARMONIC)
_LOCKED = 0.01  # probability of phases so much alike by chance
_SHOWS = 0.3  # of the trials' amplitude
_UNEVEN = 1.6
_LEFT = 0.5  # of a wave in the average over a window
_FEWEST = 4  # samples of a step that say something about what is fast
_FEWEST_FAST = 32  # such samples in all


@dataclass(frozen=True)
class Pickup:
    """A spectral line.

    Attributes
    ----------
    frequency_hz, amplitude_deg : float
        As logged: above half the sampling rate it is an alias.
    fast_gain : float
        Log evidence for it from within the averaging steps; 0 where it is slower.
    is_slow : bool
        Whether the averaged samples show it.
    search_price : float
        What the search for a slow one costs in log evidence; in `fast_gain` it is paid.
    """

    frequency_hz: float
    amplitude_deg: float
    fast_gain: float
    is_slow: bool
    search_price: float = 0.0


def fast_line(evidence: Evidence) -> Pickup:
    """Find the strongest line above 3 Hz, and how much it explains.

    Its phase is each trial's own, its amplitude one for all; the search over frequencies is paid
    for. Logs too slow to show one have none.
    """
    rate, pieces = _fast(evidence)
    frequency = np.fft.rfftfreq(_PADDED, 1.0 / rate)
    power = np.zeros(frequency.size)
    per_trial = []
    for piece in pieces:
        known = np.isfinite(piece)
        count = int(np.count_nonzero(known))
        spectrum = np.abs(np.fft.rfft(np.where(known, piece, 0.0), _PADDED)) ** 2
        per_trial.append((count, spectrum))
        power += 2.0 * spectrum / max(count, 1)
    power[frequency < _SLOWEST_FAST_HZ] = 0.0
    best = int(np.argmax(power))
    n = sum(count for count, _ in per_trial)
    total = sum(float(np.nansum(piece**2)) for piece in pieces)
    if n < _FEWEST_FAST or total <= 0.0:
        return Pickup(0.0, 0.0, 0.0, False)
    noise = max(total - float(power[best]), 1e-9 * total) / n
    q = np.array([spectrum[best] / (max(count, 1) * noise) for count, spectrum in per_trial])
    counts = np.array([count for count, _ in per_trial])
    # By amplitude, one for all trials, its phases integrated out.
    amplitudes = np.geomspace(0.003, 30.0, 200)
    kappa = np.outer(amplitudes**2, counts) / (4.0 * noise)
    gains = np.sum(q * kappa / (1.0 + kappa) - np.log1p(kappa), axis=1)
    at = int(np.argmax(gains))
    gain = float(gains[at]) - np.log(_PADDED / 2.0) - np.log(amplitudes.size)
    return Pickup(float(frequency[best]), float(amplitudes[at]), max(gain, 0.0), False)


def _fast(evidence: Evidence) -> tuple[float, list[Floats]]:
    """Take what the angle does within the averaging steps: on a uniform grid, NaN in its gaps.

    Of the trials that take part.
    """
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
        pieces.append(piece[:_PADDED] - np.nanmean(piece) if dense.any() else piece[:_PADDED])
    return 1.0 / interval, pieces


def slow_line(problem: AngleProblem, z: Floats) -> Pickup:
    """Find the line below 3 Hz that explains most beside the problem's effects at `z`."""
    point = linearised(problem, point_at(problem, z, problem.scales**2))
    tried, width = _slow_frequencies(problem.evidence)
    found, amplitude = _best_of(problem, point, tried)
    for _ in range(4):  # a calibration takes longer than a trial, and tells neighbours apart
        around = found + width * np.linspace(-1.0, 1.0, 13)
        around = np.maximum(around, _SLOWEST_HZ)
        found, amplitude = _best_of(problem, point, around, _RIPPLED)
        width /= 6.0
    return Pickup(found, amplitude, 0.0, True, float(np.log(tried.size)))


def _slow_frequencies(evidence: Evidence) -> tuple[Floats, float]:
    """Give frequencies near enough to each other that no line falls between, and their distance.

    A wave of a phase of its own in every trial is as broad as the inverse of a trial's length.
    Beyond a minute (`_MOST_SLOW`) they lie further apart than that asks for.
    """
    time = evidence.grid.time_s
    length = float(np.median([np.ptp(time[rows]) for rows in evidence.rows]))
    reach = _SLOWEST_FAST_HZ - _SLOWEST_HZ
    count = int(np.clip(np.ceil(2.0 * reach * length), 2, _MOST_SLOW))
    return np.linspace(_SLOWEST_HZ, _SLOWEST_FAST_HZ, count), reach / (count - 1)


def is_locked(evidence: Evidence, fit: Fit) -> bool:
    """Whether a wave keeps its phase from trial to trial: then the response makes it, no mains.

    Rayleigh's test within the experiments (Mardia and Jupp 2000, section 6.3.1), their statistics
    added up.
    """
    groups: dict[int, list[complex]] = {}
    for trial in np.flatnonzero(evidence.takes_part).tolist():
        wave = complex(*fit.waves_deg[trial])
        groups.setdefault(int(evidence.support_index[trial][0]), []).append(wave)
    repeated = [np.array(waves) for waves in groups.values() if len(waves) >= 2]
    if not repeated:
        return False
    statistic = sum(float(abs(np.sum(w)) ** 2 / np.sum(np.abs(w) ** 2)) for w in repeated)
    return float(gammaincc(len(repeated), statistic)) < _LOCKED


def is_uneven(evidence: Evidence, fit: Fit) -> bool:
    """Whether a wave is strong in some trials only: a transient is, pick-up hardly.

    By the amplitudes' fourth moment: 1 where all are alike, 2 for random ones.
    """
    trials = len(evidence.grid.trials)
    power = np.sum(fit.waves_deg[:trials] ** 2, axis=1)[evidence.takes_part]
    return bool(np.mean(power**2) > _UNEVEN * np.mean(power) ** 2)


def shows_in_fixture(evidence: Evidence, hz: float) -> bool:
    """Whether the windows of the calibrations' dwells are too short to average a wave away."""
    fixture = evidence.fixture
    return fixture is not None and bool(np.median(np.sinc(hz * fixture.window_s)) > _LEFT)


def is_other_in_fixture(evidence: Evidence, fit: Fit) -> bool:
    """Whether the calibrations show a far smaller or larger wave: pick-up is on the channel."""
    if evidence.fixture is None:
        return False
    trials = len(evidence.grid.trials)
    amplitude = np.sqrt(np.sum(fit.waves_deg**2, axis=1))
    logs = amplitude[trials:]
    usual = float(np.median(amplitude[:trials][evidence.takes_part]))
    return bool(logs.size and (logs.max() < _SHOWS * usual or logs.min() > usual / _SHOWS))


def _best_of(
    problem: AngleProblem, point: Point, frequencies: Floats, groups: tuple[int, ...] = _BARE
) -> tuple[float, float]:
    """Add a wave of each frequency to the linearised problem; the most probable, its amplitude.

    With the wave alone (`_BARE`) the trials decide; with what goes with it, the calibrations too.
    """
    prior, trials = problem.prior(point.z), len(problem.used_rows())
    columns_each = len(groups)
    in_calibrations = groups is _RIPPLED and problem.evidence.fixture is not None
    logs = len(problem.evidence.data.calibrations) if in_calibrations else 0
    own = columns_each * trials
    size = problem.size + own + 2 * logs
    wider = Prior(
        np.concatenate([prior.mean, np.zeros(own + 2 * logs)]),
        np.concatenate([prior.variance, np.ones(own + 2 * logs)]),
        np.concatenate([prior.group, np.tile(groups, trials), np.full(2 * logs, PICKUP)]),
        prior.scale,
    )
    in_trials = problem.size + np.arange(own).reshape(trials, columns_each)
    in_logs = np.arange(size - 2 * logs, size)
    index = [np.concatenate([mine, in_logs[:2]]) for mine in in_trials]
    index += [in_logs] * (len(point.blocks) - trials)

    def weighed(hz: float) -> tuple[float, float]:
        columns = _waves(problem, point, hz, columns_each, logs)
        normal = bordered(point.normal, point.blocks, columns, index, size)
        solution = solve(normal, wider, problem.scales**2, rounds=2)
        return solution.log_evidence, float(solution.variances[PICKUP])

    answers = each(weighed, frequencies.tolist())
    best = int(np.argmax([evidence for evidence, _ in answers]))
    return float(frequencies[best]), float(np.sqrt(2.0 * answers[best][1]))


def _waves(problem: AngleProblem, point: Point, hz: float, count: int, logs: int) -> list[Floats]:
    """By block, `count` columns of a wave, and what the calibrations' waves make of it."""
    evidence, fixture = problem.evidence, problem.evidence.fixture
    columns = []
    for used in problem.used_rows():
        time = evidence.grid.time_s[used]
        mine = wave(hz, time) if count == 2 else np.hstack([wave(hz, time), ripple(hz, time)])
        if logs and fixture is not None:
            mine = np.hstack([mine, misread(hz, fixture, point.y[used])])
        columns.append(mine)
    if not logs or fixture is None:
        rest = point.blocks[len(columns) :]
        return columns + [np.zeros((block.residual.size, 0)) for block in rest]
    columns.append(fixture_wave(hz, fixture, logs))
    if evidence.drift_deg.size:
        columns.append(drift_wave(hz, fixture, evidence))
    return columns
