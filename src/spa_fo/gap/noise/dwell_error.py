"""By how much the known angles of a calibration's dwells err."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.settings import SETTINGS
from spa_fo.rig import Calibration
from spa_fo.rig.dwells import both_ways

Floats = NDArray[np.float64]

_LEAST_TOLD = 1.0  # degree of freedom: a curve through every angle tells nothing
_NO_FIXTURE_DEG = 0.005  # is as exact: readings that agree to the count say no more
_FEWEST_ANGLES = 3  # that two ways through a calibration must share
_SURE = 4.0  # second differences; what is missing of so many is an ordinary fixture's


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
