"""What the measured pressure differs by between trials that were run alike."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence, repeats
from spa_fo.gap.noise.bench_noise import taken_apart
from spa_fo.gap.noise.coloured import (
    CORRELATION_S,
    Scatter,
    Spectrum,
    estimate,
    scatter,
)
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.effect import USUAL_DEG, USUAL_KPA

_JUMPS = 9.0  # times the median variance between repeats. Assumed.
_OWN = np.array([0.0, 1.0, 1.0, 0.0])  # a trial's gain and delay, which may be the log's
_TYPICAL = Scatter(SETTINGS.pressure_gain, 0.0, 0.0)  # as well as a pressure sensor's gain is known


@dataclass(frozen=True)
class PressureNoise:
    """What the measured pressure differs by between trials that were run alike."""

    spectrum: Spectrum  # within a trial, kPa²
    gain: float  # from trial to trial, 1 sigma: a regulator comes to a pressure so well; 0: unknown


def pressure_noise(evidence: Evidence, known: Floats) -> PressureNoise:
    """Estimate the noise of the measured pressure as that of the angle (`estimate`, `scatter`).

    A regulator comes to a pressure in each trial with a gain of its own, and wanders within it.
    Where nothing is repeated, only noise from sample to sample is known: gains of trials that all
    differ would make up for what an effect makes of their levels.
    """
    grid, reach = evidence.grid, evidence.reach
    assert grid.measured_kpa is not None
    # Its prior is in degrees: as far as such a pressure usually moves an angle.
    per_kpa = USUAL_DEG / (reach.pressure * USUAL_KPA)
    differences = []
    for repeated in repeats(evidence, per_kpa * grid.measured_kpa, evidence.takes_part):
        # Where trials jump one after the other they differ by far more than anything that wanders.
        seen, fixed = np.isfinite(repeated.values).all(axis=0), per_kpa**2 * known
        if len(repeated.trials) > 1 and seen.any():
            variance = repeated.values[:, seen].var(axis=0, ddof=1)
            jumps = variance > _JUMPS * np.median(variance)
            fixed[repeated.rows[seen]] += np.where(jumps, variance, 0.0)
        one = taken_apart(evidence, repeated, fixed)
        if one is None:
            continue
        differences.append(replace(one, nuisances=one.nuisances * _OWN))
    white = evidence.pressure_noise_kpa
    if not differences:
        return PressureNoise(Spectrum(white**2, np.zeros(CORRELATION_S.size)), 0.0)
    found = estimate(differences, per_kpa * white)
    gain = scatter(differences, found, _TYPICAL).gain
    spectrum = Spectrum(found.white / per_kpa**2, found.coloured / per_kpa**2, found.repeats)
    return PressureNoise(spectrum, gain)


def between_repeats(evidence: Evidence, known: Floats) -> Floats:
    """Variance of repeated trials about their mean, beyond what is known, (n,), kPa².

    No effect makes a pressure that differs where all was the same.
    """
    grid, found, times = evidence.grid, np.zeros(known.size), evidence.course_s
    assert grid.measured_kpa is not None
    for repeated in repeats(evidence, grid.measured_kpa, evidence.takes_part):
        several = np.isfinite(repeated.values).sum(axis=0) > 1
        if not several.any():
            continue
        rows = repeated.rows[several]
        variance = np.nanvar(repeated.values[:, several], axis=0, ddof=1)
        beyond = np.maximum(variance - known[rows], 0.0)
        alike = evidence.alike == evidence.alike[grid.sample_trial[repeated.rows[0]]]
        for trial in np.flatnonzero(alike):
            own = evidence.rows[trial]
            found[own] = np.interp(times[own], times[rows], beyond)
    return found
