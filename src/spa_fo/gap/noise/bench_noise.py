"""What the bench adds to a campaign: noise in trials, scatter between them, the fixture's error.

Said beside a diagnosis; what explains the gap is weighed without it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import expit, logsumexp, softmax

from spa_fo.gap.data.evidence import Evidence, Foreseen, Repeats, angle_chain, repeats
from spa_fo.gap.data.searched import at_rate
from spa_fo.gap.noise.coloured import (
    CORRELATION_S,
    Averages,
    Differences,
    Scatter,
    Spectrum,
    contrasts,
    estimate,
    scatter,
)
from spa_fo.gap.prior import log_prior
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.effect import USUAL_DEG
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.plant.memory import STEPS_S
from spa_fo.rig import Calibration
from spa_fo.rig.dwells import both_ways

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

TYPICAL = Scatter(
    gain=SETTINGS.scatter,
    rest_deg=SETTINGS.rest_scatter_deg,
    time_scale=SETTINGS.scatter,
)
"""Scatter of trials before they are seen."""
_FIXED_DEG = 0.03  # error of averaging a curve over a step
_RATE_STEP = 2e-3
_ZERO, _GAIN = 0, 1  # of what each contrast of repeats is fitted with
_FEWEST_ROWS = 12  # averaged samples that trials must share
_LEAST_TOLD = 1.0  # degree of freedom: a curve through every angle tells nothing
_NO_FIXTURE_DEG = 0.005  # is as exact: readings that agree to the count say no more
_FEWEST_ANGLES = 3  # that two ways through a calibration must share
_SURE = 4.0  # second differences; what is missing of so many is an ordinary fixture's


@dataclass(frozen=True)
class BenchNoise:
    """What repeated trials of a campaign differ by, and by how much its fixture errs."""

    spectrum: Spectrum  # within a trial
    scatter: Scatter  # from trial to trial
    fixture_deg: float | None  # error of a dwell's known angle; None where nothing says it
    compared: bool = False  # whether a reference says what is to be expected
    foreseen_deg: float = 0.0  # how well it does where it does best, 1 sigma
    moving_nats: float = 0.0  # log evidence, of repeats alone, that zeros move and do not scatter
    zeros_deg: Floats | None = None  # (trials,): how they are expected to go with their order
    gains: Floats | None = None  # (trials,): the same of their gains
    fixture_told: float = 0.0  # degrees of freedom that say the fixture's error

    def moved_deg(self, trial: Integers, angle_deg: Floats) -> Floats:
        """Give how angles of these trials are expected to go with the trials' order, deg."""
        if self.zeros_deg is None or self.gains is None:
            return np.zeros(trial.size)
        return self.zeros_deg[trial] + self.gains[trial] * angle_deg

    @property
    def is_ordinary(self) -> bool:
        """Whether gain and time scale scatter by no more than those of benches do."""
        most = SETTINGS.most_scatter * SETTINGS.scatter
        return max(self.scatter.gain, self.scatter.time_scale) <= most

    def floor_deg(self, angle_deg: Floats) -> float:
        """Give what trials of these angles would differ by from their mean, RMS, deg."""
        gain = self.scatter.gain * np.sqrt(np.mean(angle_deg**2))
        parts = self.spectrum.deviation_deg, self.scatter.rest_deg, gain
        return float(np.linalg.norm(parts))

    def sentence(self) -> str:
        """Say it to a reader; empty where no experiment has a repeat."""
        if not self.spectrum.repeats:
            return ""
        noise_deg, own = self.spectrum.deviation_deg, self.scatter
        what = "What a trial may differ by from what the reference lets expect"
        if not self.compared:
            what = "What repeated trials differ by"
        shares = self.spectrum.coloured / self.spectrum.coloured.sum()
        correlation_s = np.exp(shares @ np.log(CORRELATION_S))
        text = (
            f"{what}: within a trial noise of {noise_deg:.2g}°, correlated over "
            f"about {correlation_s:.1g} s; from trial to trial {100.0 * own.gain:.2g} % "
            f"in gain, {own.rest_deg:.2g}° at rest, {100.0 * own.time_scale:.2g} % in time scale."
        )
        if not self.is_ordinary:
            text += " Trials of no ordinary bench differ by so much: something varies between them."
        if self.fixture_deg is not None:
            text += f" The calibration's known angles err by about {self.fixture_deg:.2g}°."
        return text


NOWHERE = 0.9
"""Share of rows where the reference never was: beyond, there is nothing to compare. Assumed."""
_CHANGED, _UNSURE = 1.5, 4.0
"""Times what may differ, of a reference of many trials; its square grows by so much for a lone one.

Chosen on 287 pairs of campaigns in which nothing or something had changed, measured ones and of
the virtual rig, so that a lone trial's border stays and as much is called unchanged as before
(docs/compare.md): the fewer trials a reference has, the less it knows of what its own would differ
by, and a lone one knows nothing.
"""
_MOSTLY = 0.5  # share of rows where the reference never was: beyond, no effect is named. Assumed.


@dataclass(frozen=True)
class Beyond:
    """What is to be expected of a campaign by its reference: what a learned correction misses."""

    angle: Spectrum  # within a trial, where the reference foresees best
    scatter: Scatter  # of single trials
    day: Scatter  # from one campaign to another
    angle_deg: float  # RMS of what a trial has within it, there
    repeats: bool = False  # whether the reference did the same more than once
    zero_deg: float = 0.0  # how unsure each log's own zero is, 1 sigma
    pressure: Spectrum | None = None  # kPa²; None where no pressure was logged
    pressure_kpa: float = 0.0  # RMS of all of it
    usual: tuple[Foreseen, ...] = ()  # by trial of the campaign: the correction itself
    read_deg: float = 0.0  # largest angle that the reference has read
    unvisited: float = 0.0  # share of the campaign's rows where the reference never was
    trials: int = 1  # of the reference
    broken: bool = False  # whether an angle is out of what any of the reference's lets expect

    @property
    def says_nothing(self) -> bool:
        """Whether the reference was hardly ever where the campaign was."""
        return self.unvisited > NOWHERE

    @property
    def changed(self) -> float:
        """Times what may differ from which on something has changed, as probably as not."""
        return _CHANGED * float(np.sqrt(1.0 + _UNSURE / self.trials**2))

    @property
    def says_little(self) -> bool:
        """Whether the reference was elsewhere for the most part."""
        return self.unvisited > _MOSTLY

    def floor_deg(self, evidence: Evidence) -> float:
        """Give by what a sample may differ where most is foreseen, deg: the harmonic mean of v."""
        variance = self.variance(evidence, evidence.grid.angle_deg)
        return float(np.mean(1.0 / variance) ** -0.5)

    def variance(self, evidence: Evidence, angle_deg: Floats) -> Floats:
        """Variance of what the campaign may differ by without any change, (n,), deg².

        `angle_deg`, (n,), is what is predicted: by a share of it one day differs from another.
        """
        foreseen = self.angle_deg if evidence.foreseen_deg is None else evidence.foreseen_deg
        day = (self.day.gain * angle_deg) ** 2 + self.day.rest_deg**2
        return np.asarray(foreseen**2 + day + evidence.variance)


def bench_noise(evidence: Evidence, x: Floats, beyond: Beyond | None = None) -> BenchNoise:
    """Estimate what the bench adds to a campaign.

    Parameters
    ----------
    evidence, beyond : Evidence, Beyond or None
        The campaign, and what is to be expected beside it.
    x : (5,) array
        Coefficients of the given model: they say what a trial's own time scale does to it.
    """
    chain, trials = angle_chain(evidence, x, None), len(evidence.grid.trials)
    plain, quick = (chain.run(at_rate(x, rate), absent())[0] for rate in (1.0, 1.0 + _RATE_STEP))
    alike = repeats(evidence, evidence.grid.angle_deg, np.ones(trials, dtype=bool))
    found = [_taken_apart(evidence, each, (quick - plain) / _RATE_STEP) for each in alike]
    differences = [each for each in found if each is not None]
    spectrum = estimate(differences, evidence.noise_deg)
    nats, zeros_deg, gains = 0.0, None, None
    if beyond is None and differences:
        nats, zeros_deg = _of_order(differences, spectrum, _ZERO)
        largest_deg = evidence.reach.angle * USUAL_DEG
        gains = _of_order(differences, spectrum, _GAIN, largest_deg)[1] / largest_deg
    scattered = scatter(differences, spectrum, TYPICAL, zeros_deg, gains)
    fixture_deg, told = dwell_error(evidence.data.calibrations)
    if beyond is None:
        return BenchNoise(
            spectrum,
            scattered,
            fixture_deg,
            moving_nats=nats,
            zeros_deg=zeros_deg,
            gains=gains,
            fixture_told=told,
        )
    own = Spectrum(evidence.noise_deg**2, np.zeros(CORRELATION_S.size))
    if not beyond.repeats:
        own, scattered = spectrum, scattered.beside(beyond.scatter)
    else:  # a reading that came off in one of them is no noise
        scattered = beyond.scatter
    foreseen = own.beside(beyond.angle)
    known = fixture_deg, True, beyond.angle_deg
    return BenchNoise(foreseen, scattered, *known, fixture_told=told)


def _taken_apart(evidence: Evidence, repeated: Repeats, quicker: Floats) -> Differences | None:
    """Take trials that were run alike apart, where all of them have samples."""
    seen = np.isfinite(repeated.values).all(axis=0)
    if len(repeated.trials) < 2 or np.count_nonzero(seen) < _FEWEST_ROWS:
        return None
    rows, grid = repeated.rows[seen], evidence.grid
    width_s = np.asarray(STEPS_S[grid.level[grid.sample_step[rows]]], dtype=np.float64)
    fixed = np.full(rows.size, _FIXED_DEG**2)
    averages = Averages(grid.time_s[rows], width_s, repeated.weight[seen], fixed)
    which = np.eye(len(grid.trials))[repeated.trials]
    return contrasts(repeated.values[:, seen], averages, quicker[rows], which)


def _of_order(
    differences: Sequence[Differences], spectrum: Spectrum, which: int, unit: float = 1.0
) -> tuple[float, Floats]:
    """Weigh whether zeros, or gains in `unit` deg, go with the trials' order.

    Returns nats that they jump or wander, and what is expected of all trials by that and a trend.
    """
    own = [d.own(spectrum) for d in differences]
    seen = (
        unit * np.concatenate([values[:, which] for values, _ in own]),
        unit**2
        * np.concatenate([np.full(len(values), variance[which]) for values, variance in own]),
        np.vstack([d.between for d in differences]),
    )
    one = log_prior(tuple(LIBRARY)[:1]) - log_prior(())
    (nats, jumped), (more, trended) = jumps(*seen), trends(*seen)
    jump, trend = expit(nats + one), expit(more + one)
    return nats, jump * jumped + (1.0 - jump) * trend * trended


# Standard deviations that are tried, alike in weight: wide, assumed.
_SCATTER_DEG = np.geomspace(0.02, 3.0, 12)
_SHIFT_DEG = np.geomspace(0.1, 10.0, 7)
_WALK_DEG = np.geomspace(0.05, 3.0, 6)
_TREND = 3.0  # scatters that zeros may go with their order by
_FEWEST = 3  # contrasts, which a jump and a scatter take two of


def jumps(values: Floats, variance: Floats, between: Floats) -> tuple[float, Floats]:
    """Weigh whether the zeros of trials jump or wander, beyond scatter and a trend.

    Repeats of one experiment say it without any explanation: what an explanation misses of them, it
    misses of all alike. Their zeros scatter independently, with a variance that is not known, and
    may go with the order of the campaign as what creeps, softens or warms up does. A sensor that
    slips moves all zeros that follow: once, twice, or a little before every trial,

        ζ = σ ε + τ T b + { 0;  a H_j;  a H_j + a' H_k;  w Σ_j ε_j H_j },    H_j = [order ≥ j],

    each by its marginal likelihood, integrated over the variances and summed over the places.

    Parameters
    ----------
    values, variance : (n,) arrays
        Orthonormal contrasts of the zeros, deg, and variance of their errors.
    between : (n, trials) array
        What they are contrasts of, in the order of the campaign.

    Returns
    -------
    nats, zeros_deg : float, (trials,) array
        Log evidence that zeros move, against scatter and a trend alone; what they are if so.
    """
    trials = between.shape[1]
    if values.size < _FEWEST:
        return 0.0, np.zeros(trials)
    after = np.tri(trials)[:, 1:]
    trend = between @ trend_shapes(trials)
    every = np.arange(trials - 1)
    pairs = np.column_stack(np.triu_indices(trials - 1, 1))
    hypotheses = [(every[:, None], _SHIFT_DEG), (pairs, _SHIFT_DEG), (every[None, :], _WALK_DEG)]
    still, moving, means = [], [], []
    for sigma in _SCATTER_DEG:
        covariance = (_TREND * sigma) ** 2 * (trend @ trend.T) + np.diag(sigma**2 + variance)
        root = np.linalg.cholesky(covariance)
        y = solve_triangular(root, values, lower=True)
        steps = solve_triangular(root, between @ after, lower=True)
        log = -0.5 * float(y @ y) - float(np.sum(np.log(np.diag(root))))
        still.append(log)
        for which, sizes in hypotheses:
            gains, amounts = _weigh(y, steps, which, sizes)
            moving.append(log + float(logsumexp(gains)) - np.log(gains.size))
            means.append(after @ (softmax(gains) @ amounts))
    nats = float(logsumexp(moving) - np.log(len(moving)) - logsumexp(still) + np.log(len(still)))
    return nats, np.asarray(softmax(moving) @ np.array(means))


def trend_shapes(trials: int) -> Floats:
    """Two ways of going with the trials' order: evenly, and early, (trials, 2)."""
    place = (np.arange(trials) + 0.5) / trials
    return np.column_stack([place - place.mean(), np.exp(-6.0 * place)])


def trends(values: Floats, variance: Floats, between: Floats) -> tuple[float, Floats]:
    """Weigh a trend with the trials' order, ζ = σ ε + τ T b, against scatter alone; see `jumps`.

    Returns
    -------
    nats, trended : float, (trials,) array
        Log evidence that there is a trend; what it is if so.
    """
    shapes = trend_shapes(between.shape[1])
    if values.size < _FEWEST:
        return 0.0, np.zeros(len(shapes))
    still, going, means = [], [], []
    for sigma in _SCATTER_DEG:
        root = np.sqrt(sigma**2 + variance)
        y, steps = values / root, (between @ shapes) / root[:, None]
        log = -0.5 * float(y @ y) - float(np.sum(np.log(root)))
        still.append(log)
        gains, amounts = _weigh(y, steps, np.array([[0, 1]]), _SHIFT_DEG)
        going.append(log + float(logsumexp(gains)) - np.log(gains.size))
        means.append(shapes @ (softmax(gains) @ amounts))
    nats = float(logsumexp(going) - logsumexp(still))
    return nats, np.asarray(softmax(going) @ np.array(means))


def _weigh(y: Floats, steps: Floats, which: Integers, sizes: Floats) -> tuple[Floats, Floats]:
    """Weigh steps that come together, (m, k), of every size: nats, and what is expected of each."""
    products = (steps.T @ steps)[which[:, :, None], which[:, None, :]]
    shadows = (steps.T @ y)[which]
    gains, amounts = [], []
    for size in sizes:
        precision = products + np.eye(which.shape[1]) / size**2
        expected = np.linalg.solve(precision, shadows[..., None])[..., 0]
        half_log = 0.5 * np.linalg.slogdet(size**2 * precision)[1]
        gains.append(0.5 * np.sum(shadows * expected, axis=1) - half_log)
        amounts.append(np.zeros((len(which), steps.shape[1])))
        np.put_along_axis(amounts[-1], which, expected, axis=1)
    return np.concatenate(gains), np.vstack(amounts)


def dwell_error(calibrations: Sequence[Calibration]) -> tuple[float | None, float]:
    """Estimate the error of a calibration dwell's known angle, deg; None where nothing says it.

    Between the ways up and down a sensor differs smoothly over the angle: what second differences
    over the angle hold is the fixture's error, of two dwells at each angle. Where the first
    calibration goes one way, its angles scatter about its smooth curve by it. A later calibration
    says nothing beside the first: what has become of the curve since need not be smooth.

    Returns
    -------
    float or None, float
        The error, and the degrees of freedom that say it.
    """
    squares, told = 0.0, 0.0
    for calibration in calibrations:
        up, down = (
            {
                d.angle_deg: float(calibrations[0].angle_deg(d.mean)) - d.angle_deg
                for d in calibration.dwells
                if d.direction == direction
            }
            for direction in ("up", "down")
        )
        own = _bent(up, down)
        squares, told = squares + float(np.sum(own)), told + own.size
    if not told and calibrations:
        squares, told = _scattered_about(calibrations[0])
    if told < _LEAST_TOLD:
        return None, 0.0
    usual = max(_SURE - told, 0.0)
    variance = (squares + usual * SETTINGS.dwell_error_deg**2) / (told + usual)
    return max(float(np.sqrt(variance)), _NO_FIXTURE_DEG), told


def _bent(one: Mapping[float, float], other: Mapping[float, float]) -> Floats:
    """Square of each second difference over the angle of what two ways differ by, deg².

    Each is as large as the square of a single dwell's error, on average.
    """
    shared = sorted(one.keys() & other.keys())
    if len(shared) < _FEWEST_ANGLES:
        return np.zeros(0)
    differences = np.array([one[angle] - other[angle] for angle in shared])
    # Divided differences: the angles need not lie evenly.
    before, after = np.diff(shared)[:-1], np.diff(shared)[1:]
    share = before / (before + after)
    bent = differences[1:-1] - (1.0 - share) * differences[:-2] - share * differences[2:]
    return np.asarray(bent**2 / (2.0 * (1.0 + (1.0 - share) ** 2 + share**2)))


def _scattered_about(calibration: Calibration) -> tuple[float, float]:
    """Square by which known angles scatter about the smooth curve, deg²; its degrees of freedom."""
    known = np.unique([dwell.angle_deg for dwell in calibration.dwells])
    if calibration.of_known.shape != (known.size, known.size):
        return 0.0, 0.0  # some read the same
    counts = [both_ways(calibration.dwells, angle) for angle in known.tolist()]
    left = np.eye(known.size)[np.argsort(counts)] - calibration.of_known  # counts may fall
    return float(np.sum((left @ known) ** 2)), float(np.sum(left**2))
