"""A campaign made ready to be explained: rows, noise, and what is plausible of the coefficients."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares

from spa_fo.fractional import step_response
from spa_fo.gap.data.evidence import Evidence, angle_chain
from spa_fo.gap.data.searched import HIGHEST, LOWEST, searched_spread, to_x, to_z
from spa_fo.gap.fit.typical import typical
from spa_fo.gap.noise.bench_noise import BenchNoise, Beyond, bench_noise
from spa_fo.gap.noise.whitening import Rows, Whitening, lay_rows
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.chain import Chain
from spa_fo.plant.effects.library import absent
from spa_fo.plant.memory import STEPS_S

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

GAIN, REST, TIME_SCALE, DWELL, SLIP, LINE = range(6)
"""Groups of nuisances, each of one variance."""
LEVELS = tuple(float(2.0 ** (k / 2.0)) for k in range(-3, 6))
"""Levels of the coloured noise that are tried, against what repeats say."""
SHARES = (0.0, 0.03, 0.08, 0.2, 0.5, 1.0)
"""Shares of the gap that an explanation may miss."""

_MOST_ROWS = 1000  # a factor of their covariance costs the third power of an experiment's
_ABOUT = 7  # rows that say how large a gap is at one of them
_LOCAL = 0.5  # of a gap's size at a row, the rest is the campaign's mean
_SLIP_DEG = 0.4
_MOST_LEVEL = 2.0  # against what a reference says: what is beyond has changed
_RESPONSE_S = np.geomspace(0.05, 8.0, 14)
"""Times at which the given model's step response is known; most models are fitted to these."""
_SLOPE_STEP = 1e-4


@dataclass(frozen=True)
class Bench:
    """A campaign ready to be explained.

    Attributes
    ----------
    evidence : Evidence
        The campaign.
    noise : BenchNoise
        What repeated trials differ by.
    whitening : Whitening
        Of the rows of the trials that take part.
    chain : Chain
        The simulator.
    scales : (6,) array
        Typical standard deviations of the groups of nuisances.
    given, centre : (5,) arrays
        The given model's searched coefficients, and those that are most plausible.
    spread, shifted : (5, 5) arrays
        Covariance of the searched coefficients: as the given model leaves it, and where the
        parameters have shifted.
    own : bool
        Whether the given model was fitted to this very campaign: its coefficients have bent.
    line : float or None
        Frequency of an interference that the rows show, Hz.
    """

    evidence: Evidence
    noise: BenchNoise
    whitening: Whitening
    chain: Chain
    scales: Floats
    given: Floats
    centre: Floats
    spread: Floats
    shifted: Floats
    own: bool
    line: float | None = None

    @property
    def starts(self) -> list[Floats]:
        """Coefficients that a search may begin with."""
        return [self.centre, self.given] if self.own else [self.centre]

    def with_gap(self, residual_deg: Floats, predicted_deg: Floats) -> Bench:
        """Say how large the gap is at each row, by what a plain model leaves, (n,) arrays."""
        rows = self.whitening.rows
        size = _gap_size(rows, self.noise, rows.merged(residual_deg), rows.merged(predicted_deg))
        return replace(self, whitening=Whitening(rows, self.noise.spectrum, size))

    def without(self, trials: NDArray[np.bool_]) -> Bench:
        """Return the bench of all trials but some, (trials,) bool."""
        evidence = replace(self.evidence, takes_part=~trials)
        rows = rows_of(evidence)
        none = Whitening(rows, self.noise.spectrum, np.zeros(rows.size))
        return replace(self, evidence=evidence, whitening=none)

    @property
    def gap_deg(self) -> float:
        """RMS of the gap over the rows."""
        return float(np.sqrt(np.mean(self.whitening.gap**2)))


def rows_of(evidence: Evidence, fixed: Floats | None = None, most: int = _MOST_ROWS) -> Rows:
    """Lay out the rows of the trials that take part; `fixed` is their known variance."""
    grid = evidence.grid
    if fixed is None:
        fixed = evidence.variance - evidence.noise_deg**2 / grid.counts
    groups: dict[int, list[Integers]] = {}
    for trial in np.flatnonzero(evidence.takes_part).tolist():
        groups.setdefault(int(evidence.alike[trial]), []).append(evidence.rows[trial])
    width = np.asarray(STEPS_S[grid.level[grid.sample_step]], dtype=np.float64)
    return lay_rows(
        list(groups.values()), grid.time_s, width, grid.counts, fixed, grid.sample_trial, most
    )


def bench_for(
    evidence: Evidence,
    given: Floats,
    own: bool,
    pressure_kpa: Floats | None,
    beyond: Beyond | None = None,
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
    """
    noise = bench_noise(evidence, given, beyond)
    rows = rows_of(evidence)
    horizon = _horizon_s(evidence)
    if own:
        centre = to_z(typical(given, horizon))
        spread = shifted = _own(centre)
    else:
        angle = float(np.sqrt(np.mean(evidence.grid.angle_deg**2)))
        centre, spread = known_response(given, noise, horizon, angle)
        shifted = spread + _shift(centre)
    scatter = noise.scatter
    dwell = SETTINGS.dwell_error_deg if noise.fixture_deg is None else noise.fixture_deg
    scales = [scatter.gain, scatter.rest_deg, scatter.time_scale, dwell, _SLIP_DEG, 0.5]
    return Bench(
        evidence=evidence,
        noise=noise,
        whitening=Whitening(rows, noise.spectrum, np.zeros(rows.size)),
        chain=angle_chain(evidence, to_x(centre), pressure_kpa),
        scales=np.array(scales),
        given=to_z(given),
        centre=centre,
        spread=spread,
        shifted=shifted,
        own=own,
    )


def _own(z: Floats) -> Floats:
    s = SETTINGS
    return searched_spread(z, s.own_orders, s.own_logs, s.own_gain)


def _shift(z: Floats) -> Floats:
    s = SETTINGS
    return searched_spread(z, s.shift_orders, s.shift_logs, s.shift_gain)


def _horizon_s(evidence: Evidence) -> float:
    """Half a trial: about as long as its first step."""
    time = evidence.grid.time_s
    return 0.5 * float(np.median([np.ptp(time[rows]) for rows in evidence.rows]))


def known_response(
    given: Floats, noise: BenchNoise, horizon_s: float, angle_deg: float = np.inf
) -> tuple[Floats, Floats]:
    """Say what a model that was identified elsewhere tells of the coefficients.

    Its step response is known, and its coefficients only as far as that decides them: along the
    rest they are a usual actuator's. Its gain and time scale are the mean of a few trials, and its
    angles, about `angle_deg` in size, were read by a sensor calibrated as well as this one.

    Returns
    -------
    centre : (5,) array
        Searched coefficients.
    covariance : (5, 5) array
        Of these.
    """
    gain = given[4] / given[3]
    target = step_response(_RESPONSE_S, *given) / gain
    usual = to_z(typical(given, horizon_s))
    prior = _own(usual)
    root = np.linalg.cholesky(prior)
    read = (noise.fixture_deg or 0.0) / angle_deg
    error = float(np.hypot(SETTINGS.response_error, read))

    def response(z: Floats) -> Floats:
        return np.asarray(step_response(_RESPONSE_S, *to_x(z)) / gain)

    def left(z: Floats) -> Floats:
        away = solve_triangular(root, z - usual, lower=True)
        return np.concatenate([(response(z) - target) / error, away])

    inside = LOWEST + 1e-2, HIGHEST - 5e-3
    found = [
        least_squares(left, np.clip(start, *inside), bounds=(LOWEST, HIGHEST))
        for start in (usual, to_z(given))
    ]
    z = np.asarray(min(found, key=lambda f: float(f.cost)).x)
    slopes = [
        (response(z + d) - response(z - d)) / (2.0 * _SLOPE_STEP) for d in _SLOPE_STEP * np.eye(5)
    ]
    j = np.column_stack(slopes) / error
    covariance = np.linalg.inv(j.T @ j + np.linalg.inv(prior))
    quicker = np.array([0.0, 0.0, z[0] * (1.0 - z[1]), z[0], 0.0])
    scatter, trials = noise.scatter, SETTINGS.model_trials
    covariance += scatter.time_scale**2 / trials * np.outer(quicker, quicker)
    covariance[4, 4] += scatter.gain**2 / trials + read**2
    return z, np.asarray(covariance, dtype=np.float64)


def plain_deg(bench: Bench) -> Floats:
    """Angle of the plain model with the most plausible coefficients, (n,), deg."""
    return bench.chain.run(to_x(bench.centre), absent())[0]


def _gap_size(rows: Rows, noise: BenchNoise, left: Floats, predicted: Floats) -> Floats:
    """Size of the gap at each row, deg; what noise and scatter make of it taken off."""
    spectrum, scatter = noise.spectrum, noise.scatter
    expected = spectrum.coloured.sum() + scatter.rest_deg**2 + (scatter.gain * predicted) ** 2
    for group in rows.groups:
        expected[group.rows] += spectrum.white / group.count
    return local_size(rows, left**2 - expected)


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
    if bench.noise.compared and level > _MOST_LEVEL:
        return -np.inf
    repeats = bench.noise.spectrum.repeats
    spread = SETTINGS.level_alone
    if repeats:
        spread = SETTINGS.level_repeated / float(np.sqrt(repeats)) + 0.15
    return -0.5 * float(np.log(level) / spread) ** 2
