"""What a law that was learned on the reference misses, and so lets expect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.compare.fading_memory import FadingMemoryLaw, Signal
from spa_fo.gap.noise.bench_noise import TYPICAL
from spa_fo.gap.noise.coloured import Scatter, Spectrum, estimate, misfit, scatter

Expected = tuple[Floats, Floats]
"""What is expected of each of the rows of a trial, and its deviation."""

WHITE = 1e-3
"""deg or kPa: what is averaged holds next to no white noise."""


def expected_rms(law: FadingMemoryLaw, found: Sequence[Expected]) -> float:
    """RMS of what a law lets expect that it misses where it was asked, or missed before."""
    deviation = np.concatenate([each for _, each in found])
    return max(float(np.sqrt(np.mean(deviation**2))), law.left_rms)


def best(found: Sequence[Expected], unvisited: Sequence[NDArray[np.bool_]]) -> float:
    """Return the harmonic mean of the variances that are foreseen, as a deviation, deg."""
    deviation = np.concatenate([each for _, each in found])
    known = ~np.concatenate(unvisited)
    if not known.any():
        known[:] = True
    return float(np.mean(deviation[known] ** -2.0) ** -0.5)


def noise_of(
    law: FadingMemoryLaw, signals: Sequence[Signal], shapes: Sequence[Floats], size: float
) -> tuple[Spectrum, Scatter]:
    """Estimate the noise that the law's own misses are on trials it did not learn from.

    Each is taken over what was expected there, and made as large as `size`. `shapes` are what a
    gain of a trial's own would multiply.
    """
    differences = [
        misfit(signal.t_s, size / deviation * left, size / deviation * shape)
        for signal, left, deviation, shape in zip(
            signals, law.left, law.expected, shapes, strict=True
        )
    ]
    spectrum = estimate(differences, WHITE)
    return replace(spectrum, white=0.0), scatter(differences, spectrum, TYPICAL)


def of_a_day(angle_deg: Floats) -> Floats:
    """Say by how much one day's angles differ from another's, at each row, deg."""
    return np.asarray(np.hypot(TYPICAL.gain * angle_deg, TYPICAL.rest_deg))
