"""How large nuisances are, and may be: what trials differ by beside an explanation."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.stats import chi2

from spa_fo.arrays import Floats
from spa_fo.gap.fit.bench import GAIN, REST, TIME_SCALE, Bench
from spa_fo.gap.settings import SETTINGS

OF_TRIALS = [GAIN, REST, TIME_SCALE]
"""Groups of nuisances by which trials differ."""
_MOST_BESIDE = 3.0  # times what a reference lets expect of trials. Assumed.
_SURELY = 1e-3  # probability that a scatter is larger than its bound


@cache
def most(repeats: int) -> float:
    """Bound a scatter, in units of its estimate from so many differences of repeats."""
    if repeats < 1:
        return SETTINGS.most_scatter
    return min(float(np.sqrt(repeats / chi2.ppf(_SURELY, repeats))), SETTINGS.most_scatter)


def most_of_trials(bench: Bench) -> Floats:
    """Largest standard deviations of what trials differ by, (3,).

    Nuisances do not hide what all trials show: repeats have said how large they are, and so has a
    reference, but for the day's own.
    """
    own = bench.scales[OF_TRIALS]
    ordinary = np.array([SETTINGS.scatter, SETTINGS.rest_scatter_deg, SETTINGS.scatter])
    if bench.noise.compared:
        return np.asarray(_MOST_BESIDE * np.hypot(own, ordinary))
    return np.asarray(most(bench.noise.spectrum.repeats) * np.maximum(own, ordinary))


def told_whole(freedom: float) -> float:
    """Degrees of freedom that so many add to a scatter's beside tempered rows.

    What an explanation misses it misses of all repeats alike: by what these differ no form is in
    doubt. So their evidence counts whole, and what the rows hold of it is tempered.
    """
    return freedom * (1.0 / SETTINGS.temper - 1.0)


def told_by_repeats(bench: Bench) -> float:
    """Degrees of freedom that repeats add to what trials differ by."""
    if bench.noise.compared:
        return 0.0  # a reference has said what is to be expected
    return told_whole(bench.noise.spectrum.repeats)


def nuisance_scales(bench: Bench, slips: bool) -> Floats:
    """Typical standard deviations of the nuisances.

    Beside a slip, which lets repeats differ at rest, the bench's rest scatter is a usual one.
    """
    scales = bench.scales.copy()
    if slips:
        scales[REST] = min(scales[REST], SETTINGS.rest_scatter_deg)
    return scales
