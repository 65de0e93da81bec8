"""What the bench adds to a campaign: noise in trials, scatter between them, the fixture's error.

Said beside a diagnosis, and known before anything is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats, Integers
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
    level_spread,
    scatter,
    unexplained,
)
from spa_fo.gap.noise.dwell_error import DwellError, dwell_error
from spa_fo.gap.noise.order import OF_GAIN, OF_ZERO, of_order
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.effect import USUAL_DEG
from spa_fo.plant.effects.library import absent
from spa_fo.plant.memory import STEPS_S

TYPICAL = Scatter(
    gain=SETTINGS.scatter,
    rest_deg=SETTINGS.rest_scatter_deg,
    time_scale=SETTINGS.scatter,
)
"""Scatter of trials before they are seen."""
_FIXED_DEG = 0.03  # error of averaging a curve over a step
_RATE_STEP = 2e-3
_CURVE_KNOTS, _CURVE_BENDS = 9, 1e-3  # of readings over predictions; how stiff it is
_FEWEST_ROWS = 12  # averaged samples that trials must share


@dataclass(frozen=True)
class BenchNoise:
    """What repeated trials of a campaign differ by, and by how much its fixture errs."""

    spectrum: Spectrum  # within a trial
    scatter: Scatter  # from trial to trial
    fixture: DwellError  # of the calibration
    compared: bool = False  # whether a reference says what is to be expected
    foreseen_deg: float = 0.0  # how well it does where it does best, 1 sigma
    moving_nats: float = 0.0  # log evidence, of repeats alone, that zeros move and do not scatter
    zeros_deg: Floats | None = None  # (trials,): how they are expected to go with their order
    gains: Floats | None = None  # (trials,): the same of their gains
    paced: float = np.inf  # by how many noise floors the scatter of the time scale moves angles

    def expected(self, trial: Integers) -> tuple[Floats, Floats]:
        """Give by how much gains and zeros (deg) of these trials go with the trials' order."""
        if self.gains is None or self.zeros_deg is None:
            return np.zeros(trial.size), np.zeros(trial.size)
        return self.gains[trial], self.zeros_deg[trial]

    def moved_deg(self, trial: Integers, angle_deg: Floats) -> Floats:
        """Give how angles of these trials are expected to go with the trials' order, deg."""
        gains, zeros_deg = self.expected(trial)
        return zeros_deg + gains * angle_deg

    @property
    def is_ordinary(self) -> bool:
        """Whether gain and rest angle, by their order too, and time scale vary as on benches.

        A time scale is told by a trial's transients alone, so it may be off by as much as its
        repeats leave it unsure; of a quick actuator it hardly moves an angle, whatever it is.
        """
        s, own = SETTINGS, self.scatter
        unsure = float(np.exp(level_spread(self.spectrum.repeats)))
        times = [
            _with_order(own.gain, self.gains) / s.scatter,
            _with_order(own.rest_deg, self.zeros_deg) / s.rest_scatter_deg,
        ]
        if self.paced > s.no_gap:
            times.append(own.time_scale / s.scatter / unsure)
        return max(times) <= s.most_scatter

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
        apart = 0.0 if self.gains is None else float(np.ptp(self.gains))
        if apart > own.gain:
            text += f" Beside that gain goes with their order, by {100.0 * apart:.2g} % in all."
        if not self.is_ordinary:
            text += " Trials of no ordinary bench differ by so much: something varies between them."
        if self.fixture.deg is not None:
            text += f" The calibration's known angles err by about {self.fixture.deg:.2g}°"
            text += " from dwell to dwell." if self.fixture.mark_deg else "."
        return text


def _with_order(scattered: float, ordered: Floats | None) -> float:
    """Give by how much trials differ, 1 sigma, scatter and what goes with their order together."""
    return float(np.hypot(scattered, 0.0 if ordered is None else ordered.std()))


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
    # Where readings saturate less of a trial's gain shows: told by what explains repeats better.
    whole, part = np.ones(plain.size), shown_of_gain(plain, evidence.grid.angle_deg)
    quicker = (quick - plain) / _RATE_STEP
    fixed = np.full(plain.size, _FIXED_DEG**2)
    tried = [
        [taken_apart(evidence, a, fixed, quicker, shown) for a in alike] for shown in (whole, part)
    ]
    differences = min(([d for d in one if d is not None] for one in tried), key=unexplained)
    spectrum = estimate(differences, evidence.noise_deg)
    nats, zeros_deg, gains = 0.0, None, None
    if beyond is None and differences:
        nats, zeros_deg = of_order(differences, spectrum, OF_ZERO, TYPICAL.rest_deg)
        most_deg = evidence.reach.angle * USUAL_DEG
        ordinary_deg = TYPICAL.gain * most_deg
        gains = of_order(differences, spectrum, OF_GAIN, ordinary_deg, most_deg)[1] / most_deg
    scattered = scatter(differences, spectrum, TYPICAL, zeros_deg, gains)
    fixture = dwell_error(evidence.data.calibrations)
    if beyond is None:
        found = BenchNoise(
            spectrum,
            scattered,
            fixture,
            moving_nats=nats,
            zeros_deg=zeros_deg,
            gains=gains,
        )
        grid = evidence.grid
        paced = scattered.time_scale * np.sqrt(np.average(quicker**2, weights=grid.counts))
        return replace(found, paced=float(paced / found.floor_deg(grid.angle_deg)))
    own = Spectrum(evidence.noise_deg**2, np.zeros(CORRELATION_S.size))
    if not beyond.repeats:
        own, scattered = spectrum, scattered.beside(beyond.scatter)
    else:  # a reading that came off in one of them is no noise
        scattered = beyond.scatter
    foreseen = own.beside(beyond.angle)
    return BenchNoise(foreseen, scattered, fixture, compared=True, foreseen_deg=beyond.angle_deg)


def noise_beside(evidence: Evidence, x: Floats, explained_deg: Floats) -> BenchNoise:
    """Estimate what the bench adds beside an explanation, which may let repeats differ.

    What remembers earlier trials does, and what it lets them differ by is no scatter.

    Parameters
    ----------
    evidence, x : Evidence, (5,) array
        The campaign, and the given model's coefficients.
    explained_deg : (n,) array
        What the explanation predicts at the averaged samples.
    """
    grid = evidence.grid
    alike = repeating(evidence, explained_deg, np.ones(len(grid.trials), dtype=bool))
    angle_deg = grid.angle_deg - explained_deg + alike
    return bench_noise(replace(evidence, grid=replace(grid, angle_deg=angle_deg)), x)


def repeating(evidence: Evidence, values: Floats, which: NDArray[np.bool_]) -> Floats:
    """Give what repeats share of a signal at the averaged samples, (n,), at all samples alike.

    `which`, (trials,), are the trials that say it; where none of them was run alike it is 0.
    """
    times, out = evidence.course_s, np.zeros_like(values)
    for repeated in repeats(evidence, values, which):
        mean = np.nanmean(repeated.values, axis=0)
        for trial in np.flatnonzero(evidence.alike == evidence.alike[repeated.trials[0]]):
            rows = evidence.rows[trial]
            out[rows] = np.interp(times[rows], times[repeated.rows], mean)
    return out


def shown_of_gain(plain_deg: Floats, angle_deg: Floats) -> Floats:
    """Say how much of a gain of a trial's own its readings show: less where they saturate.

    With a curve m of readings over what the plain model predicts it is d ln m / d ln y, 0 to 1.

    Parameters
    ----------
    plain_deg, angle_deg : (n,) arrays
        Predictions and readings at the averaged samples.
    """
    most = float(np.max(plain_deg, initial=0.0))
    if most <= 0.0:
        return np.ones(plain_deg.size)
    knots = np.linspace(0.0, most, _CURVE_KNOTS)
    shares = np.clip(plain_deg / most, 0.0, 1.0) * (knots.size - 1)
    hats = np.maximum(1.0 - np.abs(shares[:, None] - np.arange(knots.size)), 0.0)
    bends = np.sqrt(_CURVE_BENDS * plain_deg.size) * np.diff(np.eye(knots.size), 2, axis=0)
    target = np.concatenate([angle_deg, np.zeros(len(bends))])
    curve = np.linalg.lstsq(np.vstack([hats, bends]), target, rcond=None)[0]
    slope = np.interp(plain_deg, knots, np.gradient(curve, knots))
    read = np.interp(plain_deg, knots, curve)
    share = slope * plain_deg / np.where(np.abs(read) > 0.0, read, 1.0)
    return np.where(plain_deg > knots[1], np.clip(share, 0.0, 1.0), 1.0)


def taken_apart(
    evidence: Evidence,
    repeated: Repeats,
    fixed: Floats,
    quicker: Floats | None = None,
    shown: Floats | None = None,
) -> Differences | None:
    """Take trials that were run alike apart, where all of them have samples; None if too few do.

    `fixed` is the known variance of the averaged samples, (n,); for the others see `contrasts`.
    """
    seen = np.isfinite(repeated.values).all(axis=0)
    if len(repeated.trials) < 2 or np.count_nonzero(seen) < _FEWEST_ROWS:
        return None
    rows, grid = repeated.rows[seen], evidence.grid
    width_s = np.asarray(STEPS_S[grid.level[grid.sample_step[rows]]], dtype=np.float64)
    averages = Averages(grid.time_s[rows], width_s, repeated.weight[seen], fixed[rows])
    which = np.eye(len(grid.trials))[repeated.trials]
    scaled = np.zeros(rows.size) if quicker is None else quicker[rows]
    part = None if shown is None else shown[rows]
    return contrasts(repeated.values[:, seen], averages, scaled, which, part)
