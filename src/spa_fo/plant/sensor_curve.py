"""An unknown error of the sensor's curve: where its knots stand, how well a calibration says."""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import USUAL_DEG
from spa_fo.plant.effects.shared import CURVE_KNOTS_DEG, CURVE_SPLINES
from spa_fo.rig import Calibration

SHORTEST = 0.01
"""Of the usual reach: a campaign of noise alone has some, too."""
_CURVE_FLOOR_DEG = 0.08
_ZERO_KNOT = CURVE_KNOTS_DEG.index(0.0)


def curve_columns(angle_deg: Floats, stretch: float) -> Floats:
    """Give what a unit error of the sensor curve at each knot but 0° makes, (n, knots).

    The knots are `stretch` times `CURVE_KNOTS_DEG`.
    """
    return np.asarray(CURVE_SPLINES(angle_deg / stretch))


def curve_stretch_of(largest_deg: float) -> float:
    """Let knots lie as close over a small range as over a usual one, and reach as far as a large.

    Over 20° two of them stood, between which no curve could bend.
    """
    reach = max(largest_deg, SHORTEST * USUAL_DEG)
    return max(min(reach / USUAL_DEG, 1.0), reach / CURVE_KNOTS_DEG[-1])


def curve_sigma(calibration: Calibration | None, stretch: float, loop: bool = True) -> Floats:
    """Error of the curve at its knots, with half the calibration's loop or without."""
    knots = stretch * np.delete(np.array(CURVE_KNOTS_DEG), _ZERO_KNOT)
    if calibration is None:
        return np.full(knots.size, _CURVE_FLOOR_DEG)
    sigma = sigma_at(calibration, knots, loop)
    low, high = calibration.range_deg
    # The curve is a line beyond its ends, and real sensors are not.
    sigma = np.where(knots < low, 0.3 * (low - knots), sigma)
    sigma = np.where(knots > high, np.hypot(sigma, 0.2 * (knots - high)), sigma)
    return np.asarray(np.hypot(sigma, _CURVE_FLOOR_DEG))


def sigma_at(calibration: Calibration, angle_deg: Floats, loop: bool) -> Floats:
    """Error of the curve at some angles, half the loop between its ways in it or not."""
    rising = np.argsort(calibration.angles_deg)  # counts may fall with the angle
    knots = calibration.angles_deg[rising], calibration.sigma_knots_deg[rising]
    sigma = np.interp(angle_deg, *knots)
    if loop or not calibration.hysteresis_deg:
        return sigma
    known = sorted(calibration.hysteresis_deg)
    half = [0.5 * abs(calibration.hysteresis_deg[angle]) for angle in known]
    return np.asarray(np.sqrt(np.maximum(sigma**2 - np.interp(angle_deg, known, half) ** 2, 0.0)))
