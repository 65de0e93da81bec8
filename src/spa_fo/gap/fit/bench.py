"""A campaign made ready to be explained: rows, noise, and what is plausible of the coefficients."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.data.evidence import Evidence, angle_chain
from spa_fo.gap.data.searched import to_x, to_z
from spa_fo.gap.fit.coefficients import Coefficients, identified, usual
from spa_fo.gap.noise.bench_noise import BenchNoise, Beyond, bench_noise
from spa_fo.gap.noise.coloured import level_spread
from spa_fo.gap.noise.whitening import Rows, Whitening, lay_rows
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.chain import Chain
from spa_fo.plant.effects.library import absent
from spa_fo.plant.memory import STEPS_S

GAIN, REST, TIME_SCALE, DWELL, SLIP, LINE, BRANCH, DELAY = range(8)
"""Groups of nuisances, each of one variance."""
LEVELS = tuple(float(2.0 ** (k / 2.0)) for k in range(-3, 6))
"""Levels of the coloured noise that are tried, against what repeats say."""
SHARES = (0.0, 0.03, 0.08, 0.2, 0.5, 1.0)
"""Shares of the gap that an explanation may miss."""

_MOST_ROWS = 1000  # a factor of their covariance costs the third power of an experiment's
_ABOUT = 7  # rows that say how large a gap is at one of them
_LOCAL = 0.5  # of a gap's size at a row, the rest is the campaign's mean
_SLIP_DEG = 0.4
_BRANCH = 0.5  # of half a loop, by which trials begin on other branches. Assumed.
_DELAY = 0.2  # of a delay, by which it differs from trial to trial. Assumed.
_MOST_LEVEL = 2.0  # against what a reference says, or repeats: what is beyond is no noise


@dataclass(frozen=True)
class Bench:
    """A campaign ready to be explained."""

    evidence: Evidence
    noise: BenchNoise  # what repeated trials differ by
    whitening: Whitening  # of the rows of the trials that take part
    chain: Chain  # the simulator
    scales: Floats  # (8,), typical standard deviations of the groups of nuisances
    given: Floats  # (5,), searched coefficients of the given model
    centre: Floats  # (5,), those that are most plausible
    coefficients: Coefficients  # what is known of them
    own: bool  # whether the given model was fitted to this very campaign: it has bent with it
    line: float | None = None  # frequency of an interference that the rows show, Hz
    level: float = 1.0  # of the coloured noise beside which it is searched

    @property
    def starts(self) -> list[Floats]:
        """Coefficients that a search may begin with."""
        return [self.centre, self.given] if self.own else [self.centre]

    @cached_property
    def shifted(self) -> Coefficients:
        """What is known of the coefficients where the parameters have shifted since."""
        return self.coefficients.shifted(self.centre)

    def freed(self) -> Bench:
        """Return the bench of an actuator whose coefficients give way to a law beside them."""
        return replace(self, coefficients=self.coefficients.about(self.centre))

    def with_gap(self, residual_deg: Floats, predicted_deg: Floats) -> Bench:
        """Say how large the gap is at each row, by what a plain model leaves, (n,) arrays.

        What noise and scatter make of it is taken off.
        """
        rows, spectrum, scatter = self.whitening.rows, self.noise.spectrum, self.noise.scatter
        expected = (scatter.gain * rows.merged(predicted_deg)) ** 2
        times = 1.0 if self.whitening.times is None else self.whitening.times
        expected += spectrum.coloured.sum() * times**2 + scatter.rest_deg**2
        for group in rows.groups:
            expected[group.rows] += spectrum.white / group.count
        size = local_size(rows, rows.merged(residual_deg) ** 2 - expected)
        return replace(self, whitening=replace(self.whitening, spectrum=spectrum, gap=size))

    def missed_deg(self, predicted_deg: Floats) -> float:
        """RMS of what a prediction, (n,), misses over the rows."""
        rows = self.whitening.rows
        left = rows.merged(self.evidence.grid.angle_deg - predicted_deg)
        return float(np.sqrt(np.mean(left**2)))

    def without(self, trials: NDArray[np.bool_]) -> Bench:
        """Return the bench of all trials but some, (trials,) bool."""
        evidence = replace(self.evidence, takes_part=~trials)
        rows = rows_of(evidence)
        none = replace(
            self.whitening,
            rows=rows,
            gap=np.zeros(rows.size),
            times=_times_foreseen(evidence, rows, self.noise),
        )
        return replace(self, evidence=evidence, whitening=none)

    @property
    def gap_deg(self) -> float:
        """RMS of the gap over the rows."""
        return float(np.sqrt(np.mean(self.whitening.gap**2)))


def rows_of(evidence: Evidence, fixed: Floats | None = None) -> Rows:
    """Lay out the rows of the trials that take part; `fixed`, (n,), is their known variance."""
    grid = evidence.grid
    if fixed is None:
        fixed = evidence.variance - evidence.noise_deg**2 / grid.counts
    groups: dict[int, list[Integers]] = {}
    for trial in np.flatnonzero(evidence.takes_part).tolist():
        groups.setdefault(int(evidence.alike[trial]), []).append(evidence.rows[trial])
    width = np.asarray(STEPS_S[grid.level[grid.sample_step]], dtype=np.float64)
    samples = evidence.course_s, width, grid.counts, fixed, grid.sample_trial
    return lay_rows(list(groups.values()), *samples, _MOST_ROWS)


def bench_for(
    evidence: Evidence,
    given: Floats,
    own: bool,
    pressure_kpa: Floats | None,
    beyond: Beyond | None = None,
    error_deg: float | None = 0.0,
) -> Bench:
    """Make a campaign ready.

    Parameters
    ----------
    evidence : Evidence
        The campaign; `takes_part` says which trials.
    given : (5,) array
        Coefficients of the given model.
    own : bool
        Whether that was fitted to this very campaign.
    pressure_kpa : (cells,) array or None
        True pressure, where it is known.
    beyond : Beyond, optional
        What is to be expected beside the bench's own noise.
    error_deg : float or None
        By how much the given model errs by its own identification; None where it does not say.
    """
    noise, rows, grid = bench_noise(evidence, given, beyond), rows_of(evidence), evidence.grid
    lasted, horizon = evidence.lasted_s, evidence.horizon_s
    if own:
        coefficients = usual(given, horizon)
        centre = coefficients.mean
    else:
        # A sensor that came off may read nothing at all.
        angle = max(float(np.sqrt(np.mean(grid.angle_deg**2))), evidence.noise_deg)
        centre, coefficients = identified(given, noise, horizon, max(lasted), angle, error_deg)
    scatter = noise.scatter
    dwell = SETTINGS.dwell_error_deg if noise.fixture.deg is None else noise.fixture.deg
    of_trials = [scatter.gain, scatter.rest_deg, scatter.time_scale]
    scales = [*of_trials, dwell, _SLIP_DEG, 0.5, _BRANCH, _DELAY]
    return Bench(
        evidence=evidence,
        noise=noise,
        whitening=Whitening(
            rows,
            noise.spectrum,
            np.zeros(rows.size),
            hidden_deg(evidence),
            _times_foreseen(evidence, rows, noise),
        ),
        chain=angle_chain(evidence, to_x(centre), pressure_kpa),
        scales=np.array(scales),
        given=to_z(given),
        centre=centre,
        coefficients=coefficients,
        own=own,
    )


def _times_foreseen(evidence: Evidence, rows: Rows, noise: BenchNoise) -> Floats | None:
    """Say how many times as large the noise is at each row, (rows,), as a reference foresees it."""
    if evidence.foreseen_deg is None or not noise.foreseen_deg:
        return None
    unsure = evidence.foreseen_deg
    if evidence.late_deg is not None:
        unsure = np.hypot(unsure, evidence.late_deg)
    return rows.merged(unsure) / noise.foreseen_deg


def hidden_deg(evidence: Evidence) -> float:
    """Say what the converter's step hides of an angle, 1 sigma, deg.

    What noise of σ leaves of the error of a rounding to steps q, a wave of period q, is its first
    harmonic, e^{-2π²σ²/q²} of it (dither; Widrow and Kollár 2008, doi:10.1017/CBO9780511754661).
    """
    q = evidence.step_deg
    if q <= 0.0:
        return 0.0
    rounding = q / float(np.sqrt(12.0))  # which stands in the noise of neighbours, too
    # An interference dithers, too.
    dither = max(evidence.noise_deg**2 + evidence.line_deg**2 - rounding**2, 0.0)
    return rounding * float(np.exp(-2.0 * np.pi**2 * dither / q**2))


def plain_deg(bench: Bench) -> Floats:
    """Angle of the plain model with the most plausible coefficients, (n,), deg."""
    return bench.chain.run(to_x(bench.centre), absent())[0]


def local_size(rows: Rows, squares: Floats) -> Floats:
    """Root of squares about each row, (rows,): partly those near it, partly all."""
    near = np.empty(rows.size)
    kernel = np.ones(_ABOUT) / _ABOUT
    for group in rows.groups:
        for trial in np.unique(group.trial):
            here = np.arange(group.rows.start, group.rows.stop)[group.trial == trial]
            padded = np.pad(squares[here], _ABOUT // 2, mode="edge")
            near[here] = np.convolve(padded, kernel, mode="valid")
    total = max(float(near.mean()), 0.0)
    return np.asarray(np.sqrt(_LOCAL * np.maximum(near, 0.0) + (1.0 - _LOCAL) * total))


def level_prior(bench: Bench, level: float) -> float:
    """Log prior of a level of the coloured noise."""
    repeats = bench.noise.spectrum.repeats
    if (bench.noise.compared or repeats > 1) and level > _MOST_LEVEL:
        return -np.inf
    return -0.5 * float(np.log(level) / level_spread(repeats)) ** 2
