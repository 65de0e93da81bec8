"""What the bench adds to a campaign: noise in trials, scatter between them, the fixture's error.

Said beside a diagnosis; what explains the gap is weighed without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.evidence import Evidence, angle_chain
from spa_fo.gap.data.floor import Repeats, repeats
from spa_fo.gap.data.searched import at_rate
from spa_fo.gap.noise.coloured import (
    CORRELATION_S,
    Differences,
    Scatter,
    Spectrum,
    contrasts,
    estimate,
    scatter,
)
from spa_fo.gap.noise.jumps import Jumps, Zeros, jumps
from spa_fo.gap.prior import log_prior
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import absent, at_port
from spa_fo.plant.memory import STEPS_S
from spa_fo.rig import Calibration

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

TYPICAL = Scatter(
    gain=SETTINGS.gain_scatter,
    rest_deg=SETTINGS.rest_scatter_deg,
    time_scale=SETTINGS.time_scatter,
)
"""Scatter of trials before they are seen."""
_FIXED_DEG = 0.03  # error of averaging a curve over a step
_RATE_STEP = 2e-3
_FEWEST_ROWS = 12  # averaged samples that trials must share
_NO_FIXTURE_DEG = 0.005  # is as exact: readings that agree to the count say no more
_FEWEST_ANGLES = 3  # that two ways through a calibration must share
_SURE = 4.0  # second differences; what is missing of so many is an ordinary fixture's


@dataclass(frozen=True)
class BenchNoise:
    """What repeated trials of a campaign differ by, and by how much its fixture errs.

    Attributes
    ----------
    spectrum : Spectrum
        Within a trial.
    scatter : Scatter
        From trial to trial.
    fixture_deg : float or None
        Error of a calibration dwell's known angle; None where no angle was held twice.
    compared : bool
        Whether a reference says what is to be expected beside it.
    moving_nats : float
        Log evidence, of repeats alone, that the zeros of trials move and do not scatter.
    zeros_deg : (trials,) array
        How they are expected to move: no scatter. Empty where nothing says it.
    """

    spectrum: Spectrum
    scatter: Scatter
    fixture_deg: float | None
    compared: bool = False
    moving_nats: float = 0.0
    zeros_deg: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def correlation_s(self) -> float:
        """Typical correlation time of the coloured part, s."""
        shares = self.spectrum.coloured / self.spectrum.coloured.sum()
        return float(np.exp(shares @ np.log(CORRELATION_S)))

    def moved_deg(self, trial: Integers) -> Floats:
        """Give how the zeros of these trials are expected to move, deg."""
        return self.zeros_deg[trial] if self.zeros_deg.size else np.zeros(trial.size)

    def floor_deg(self, angle_deg: Floats) -> float:
        """Give what trials of these angles would differ by from their mean, RMS, deg."""
        own = self.scatter
        gain = own.gain * float(np.sqrt(np.mean(angle_deg**2)))
        return float(np.hypot(np.hypot(self.spectrum.deviation_deg, own.rest_deg), gain))

    def sentence(self) -> str:
        """Say it to a reader; empty where no experiment has a repeat."""
        if not self.spectrum.repeats:
            return ""
        noise_deg, own = self.spectrum.deviation_deg, self.scatter
        text = (
            f"What repeated trials differ by: within a trial noise of {noise_deg:.2g}°, correlated "
            f"over about {self.correlation_s:.1g} s; from trial to trial {100.0 * own.gain:.2g} % "
            f"in gain, {own.rest_deg:.2g}° at rest, {100.0 * own.time_scale:.2g} % in time scale."
        )
        if self.fixture_deg is not None:
            text += f" The calibration's known angles err by about {self.fixture_deg:.2g}°."
        return text


@dataclass(frozen=True)
class Beyond:
    """What is to be expected beside a bench's own noise: what a learned correction misses.

    Attributes
    ----------
    angle : Spectrum
        Of the angle, deg².
    scatter : Scatter
        From one campaign to another.
    angle_deg : float
        RMS of all of it.
    pressure : Spectrum or None
        Of the pressure, kPa²; None where that was not logged.
    pressure_kpa : float
        RMS of all of it.
    usual : tuple of pairs of (rows,) arrays
        The correction itself, by trial of the campaign, and how well it is known, deg.
    """

    angle: Spectrum
    scatter: Scatter
    angle_deg: float
    pressure: Spectrum | None = None
    pressure_kpa: float = 0.0
    usual: tuple[tuple[Floats, Floats], ...] = ()


def bench_noise(evidence: Evidence, x: Floats, beyond: Beyond | None = None) -> BenchNoise:
    """Estimate what the bench adds to a campaign.

    Parameters
    ----------
    evidence : Evidence
        The campaign.
    x : (5,) array
        Coefficients of the given model: they say what a trial's own time scale does to it.
    beyond : Beyond, optional
        What is to be expected beside it.
    """
    chain = angle_chain(evidence, x, None)
    plain, quick = (chain.run(at_rate(x, rate), absent())[0] for rate in (1.0, 1.0 + _RATE_STEP))
    quicker = (quick - plain) / _RATE_STEP
    every = np.ones(len(evidence.grid.trials), dtype=bool)
    differences = [
        found
        for repeated in repeats(evidence, evidence.grid.angle_deg, every)
        if (found := _differences(evidence, repeated, quicker)) is not None
    ]
    spectrum = estimate(differences, evidence.noise_deg)
    nats, zeros_deg = 0.0, np.zeros(0)
    name = at_port("zeros")
    if beyond is None and differences and name is not None:
        moving = _moving(differences, spectrum)
        nats, zeros_deg = moving.nats, moving.expected_deg(log_prior((name,)) - log_prior(()))
    scattered = scatter(differences, spectrum, TYPICAL, zeros_deg=zeros_deg)
    if beyond is not None:
        spectrum, scattered = spectrum.beside(beyond.angle), scattered.beside(beyond.scatter)
    return BenchNoise(
        spectrum=spectrum,
        scatter=scattered,
        fixture_deg=dwell_error(evidence.data.calibrations),
        compared=beyond is not None,
        moving_nats=nats,
        zeros_deg=zeros_deg,
    )


def _moving(differences: Sequence[Differences], spectrum: Spectrum) -> Jumps:
    """Weigh whether zeros move with the trials' order."""
    own = [d.own(spectrum) for d in differences]
    return jumps(
        Zeros(
            values=np.concatenate([values[:, 0] for values, _ in own]),
            variance=np.concatenate([np.full(len(values), var[0]) for values, var in own]),
            between=np.vstack([d.between for d in differences]),
        )
    )


def _differences(evidence: Evidence, repeated: Repeats, quicker: Floats) -> Differences | None:
    """Take trials that were run alike apart, where all of them have samples."""
    seen = np.isfinite(repeated.values).all(axis=0)
    if repeated.values.shape[0] < 2 or np.count_nonzero(seen) < _FEWEST_ROWS:
        return None
    rows, grid = repeated.rows[seen], evidence.grid
    return contrasts(
        repeated.values[:, seen],
        grid.time_s[rows],
        np.asarray(STEPS_S[grid.level[grid.sample_step[rows]]], dtype=np.float64),
        repeated.weight[seen],
        np.full(rows.size, _FIXED_DEG**2),
        quicker[rows],
        np.eye(len(grid.trials))[repeated.trials],
    )


def dwell_error(calibrations: Sequence[Calibration]) -> float | None:
    """Estimate the error of a calibration dwell's known angle, deg; None where nothing says it.

    Between the ways up and down a sensor differs smoothly over the angle, and so it does from one
    calibration to the next: what second differences over the angle hold is the fixture's error, of
    two dwells at each angle.
    """
    squares = freedom = 0.0
    for one, other in pairwise(_ways(calibrations)):
        shared = sorted(one.keys() & other.keys())
        if len(shared) < _FEWEST_ANGLES:
            continue
        angles = np.array(shared)
        differences = np.array([one[angle] - other[angle] for angle in shared])
        # Divided differences: the angles need not lie evenly.
        before, after = np.diff(angles)[:-1], np.diff(angles)[1:]
        share = before / (before + after)
        bent = differences[1:-1] - (1.0 - share) * differences[:-2] - share * differences[2:]
        squares += float(np.sum(bent**2 / (2.0 * (1.0 + (1.0 - share) ** 2 + share**2))))
        freedom += bent.size
    if not freedom:
        return None
    usual = max(_SURE - freedom, 0.0)
    variance = (squares + usual * SETTINGS.dwell_error_deg**2) / (freedom + usual)
    return max(float(np.sqrt(variance)), _NO_FIXTURE_DEG)


def _ways(calibrations: Sequence[Calibration]) -> list[dict[float, float]]:
    """List every way up or down: what the first curve misreads at each known angle, deg."""
    ways = [
        {
            d.angle_deg: float(calibrations[0].angle_deg(d.mean)) - d.angle_deg
            for d in calibration.dwells
            if d.direction == direction
        }
        for calibration in calibrations
        for direction in ("up", "down")
    ]
    return [way for way in ways if way]
