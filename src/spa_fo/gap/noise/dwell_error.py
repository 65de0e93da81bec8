"""By how much the known angles of a calibration's dwells err."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.settings import SETTINGS
from spa_fo.rig import Calibration
from spa_fo.rig.dwells import both_ways

_LEAST_TOLD = 1.0  # degree of freedom: a curve through every angle tells nothing
_NO_FIXTURE_DEG = 0.005  # is as exact: readings that agree to the count say no more
_NOTHING = 1e-9  # what rounding leaves of a curve through every angle
_FEWEST_ANGLES = 3  # that two ways through a calibration must share
_SURE = 4.0  # second differences; what is missing of so many is an ordinary fixture's


@dataclass(frozen=True)
class DwellError:
    """By how much the known angles of a calibration's dwells err."""

    deg: float | None  # of a dwell's known angle, 1 sigma; None where nothing says it
    told: float  # degrees of freedom that say it
    mark_deg: float  # of a mark, beside, that all dwells at an angle share; 0 where `deg` holds it


UNKNOWN = DwellError(None, 0.0, 0.0)
"""Of a fixture that nothing is known of."""


def dwell_error(calibrations: Sequence[Calibration]) -> DwellError:
    """Estimate the error of a calibration dwell's known angle, deg.

    Between the ways up and down a sensor differs smoothly over the angle: what second differences
    over the angle hold is the fixture's error, of two dwells at each angle. Of what both have in
    common, a wrong mark, they say nothing: that is by what the known angles scatter about the
    smooth curve beyond it. Where the first calibration goes one way, its angles scatter about its
    smooth curve by all of it. A later calibration says nothing beside the first: what has become of
    the curve since need not be smooth.

    Neighbouring differences have dwells in common: they are worth fewer degrees of freedom than
    they are (Satterthwaite 1946, doi:10.2307/3002019).
    """
    found = [_bent(*_ways(each, calibrations[0])) for each in calibrations]
    both = any(told > 0.0 for _, told in found)
    if calibrations and not both:
        found = [_scattered_about(calibrations[0])]
    told = sum(each for _, each in found)
    if told < _LEAST_TOLD:
        return UNKNOWN
    deg = _usually(sum(mean * each for mean, each in found) / told, told)
    if not both:
        return DwellError(deg, told, 0.0)
    # About the smooth curve the mean of both ways scatters, by the mark and half a dwell's square.
    square, freedom = _scattered_about(calibrations[0])
    return DwellError(deg, told, _usually(max(square - 0.5 * deg**2, 0.0), freedom))


def _usually(square: float, told: float) -> float:
    """Give an error, deg, of a square that so many degrees of freedom say.

    As far as they are few it is an ordinary fixture's.
    """
    usual = max(_SURE - told, 0.0)
    variance = (told * square + usual * SETTINGS.dwell_error_deg**2) / (told + usual)
    return max(float(np.sqrt(variance)), _NO_FIXTURE_DEG)


def _ways(calibration: Calibration, first: Calibration) -> list[dict[float, float]]:
    """Give by how much the dwells of each way are read beyond their known angles, deg."""
    return [
        {
            d.angle_deg: float(first.angle_deg(d.mean)) - d.angle_deg
            for d in calibration.dwells[1:]  # how the film came to the first nobody knows
            if d.direction == direction
        }
        for direction in ("up", "down")
    ]


def _bent(one: Mapping[float, float], other: Mapping[float, float]) -> tuple[float, float]:
    """Square by which two ways' difference bends over the angle, deg²; its degrees of freedom.

    It is as large as the square of a single dwell's error, on average.
    """
    shared = sorted(one.keys() & other.keys())
    if len(shared) < _FEWEST_ANGLES:
        return 0.0, 0.0
    differences = np.array([one[angle] - other[angle] for angle in shared])
    # Divided differences: the angles need not lie evenly.
    before, after = np.diff(shared)[:-1], np.diff(shared)[1:]
    share, every = before / (before + after), np.arange(before.size)
    bends = np.zeros((before.size, differences.size))
    bends[every, every], bends[every, every + 1] = share - 1.0, 1.0
    bends[every, every + 2] = -share
    bends /= np.sqrt(2.0 * np.sum(bends**2, axis=1, keepdims=True))
    return float(np.mean((bends @ differences) ** 2)), _freedom(bends)


def _scattered_about(calibration: Calibration) -> tuple[float, float]:
    """Square by which known angles err about the smooth curve, deg²; its degrees of freedom."""
    known = np.unique([dwell.angle_deg for dwell in calibration.dwells])
    if calibration.of_known.shape != (known.size, known.size):
        return 0.0, 0.0  # some read the same
    counts = [both_ways(calibration.dwells, angle) for angle in known.tolist()]
    left = np.eye(known.size)[np.argsort(counts)] - calibration.of_known  # counts may fall
    if not np.any(np.abs(left) > _NOTHING):
        return 0.0, 0.0
    return float(np.sum((left @ known) ** 2) / np.sum(left**2)), _freedom(left)


def _freedom(left: Floats) -> float:
    """Degrees of freedom of a sum of squares, `left` @ errors, (m, n)."""
    covariance = left @ left.T
    return float(np.trace(covariance) ** 2 / np.sum(covariance**2))
