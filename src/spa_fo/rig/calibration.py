"""The flex sensor against known angles: dwells, the monotone curve, its error, and its drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline, PchipInterpolator, make_interp_spline
from scipy.optimize import isotonic_regression

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.rig.dwells import Direction, Dwell, both_ways, count_at, find_dwells, variance_at, ways
from spa_fo.rig.smooth_knots import Series, smoother

_WORST_FOLD = 0.2  # of the counts' range: knots farther off a monotone curve are no noise
_BEYOND = 0.5  # of the counts' range: as far as an error of the known angles is followed
_MISREAD_AT, _MISREAD_STEP = 201, 0.01  # counts that it is computed at, and degrees
_END_SLOPE_ERROR = 0.2  # assumed relative error of the slope beyond the ends, 1 sigma


@dataclass(frozen=True)
class Calibration:
    """A monotone curve from flex counts to degrees.

    Knots are the dwells' settled means, up and down averaged at each angle, made monotone where
    noise breaks it, at angles as smooth as the scatter of the known ones speaks for
    (`smooth_knots`); between them a monotone cubic (Fritsch and Carlson 1980,
    doi:10.1137/0717021), beyond them a line of the end's slope.

    Attributes
    ----------
    file : str
        The log it came from.
    started_s : float
        Campaign time (s).
    counts, angles_deg : ndarray, shape (k,)
        The knots, counts rising.
    sigma_knots_deg : ndarray, shape (k,)
        Their error, 1 sigma: noise, interpolation, and half the hysteresis.
    hysteresis_deg : dict of float to float
        By angle: how much more the curve reads going up than going down.
    of_known : ndarray, shape (k, m)
        What the knots' angles are made of: weights of the m known angles, rising.
    dwells : tuple of Dwell
        In the order of the log.
    notes : tuple of str
        What a reader should know, for example that the knots were not monotone.
    """

    file: str
    started_s: float
    counts: Floats
    angles_deg: Floats
    sigma_knots_deg: Floats
    hysteresis_deg: dict[float, float]
    of_known: Floats
    dwells: tuple[Dwell, ...]
    notes: tuple[str, ...] = ()

    @property
    def range_deg(self) -> tuple[float, float]:
        """The smallest and largest calibrated angle."""
        angles = [dwell.angle_deg for dwell in self.dwells]
        return min(angles), max(angles)

    @property
    def max_hysteresis_deg(self) -> float | None:
        """The largest |up - down|, or None if no angle was visited both ways."""
        return max(map(abs, self.hysteresis_deg.values()), default=None)

    @cached_property
    def _curve(self) -> PchipInterpolator:
        return PchipInterpolator(self.counts, self.angles_deg)

    @cached_property
    def _end_slopes(self) -> tuple[float, float]:
        slopes = self._curve.derivative()(self.counts[[0, -1]])
        # A cubic may arrive at its end flat; the chord keeps the line beyond it monotone.
        chords = np.diff(self.angles_deg)[[0, -1]] / np.diff(self.counts)[[0, -1]]
        slopes = np.where(np.abs(slopes) > 0.1 * np.abs(chords), slopes, chords)
        return float(slopes[0]), float(slopes[1])

    def angle_deg(self, counts: npt.ArrayLike) -> Floats:
        """Return the angle (deg) of flex `counts`, same shape."""
        x = np.asarray(counts, dtype=np.float64)
        inside = np.clip(x, self.counts[0], self.counts[-1])
        low, high = self._end_slopes
        angle = np.asarray(self._curve(inside), dtype=np.float64)
        return angle + np.where(x < inside, low, high) * (x - inside)

    def sigma_deg(self, counts: npt.ArrayLike) -> Floats:
        """Return the curve's standard error (deg) at `counts`, same shape.

        Beyond the ends it grows by the assumed error of the end's slope, 20 %.
        """
        x = np.asarray(counts, dtype=np.float64)
        inside = np.clip(x, self.counts[0], self.counts[-1])
        low, high = self._end_slopes
        beyond = _END_SLOPE_ERROR * np.where(x < inside, low, high) * (x - inside)
        return np.hypot(np.interp(inside, self.counts, self.sigma_knots_deg), beyond)

    def misread_deg(self, angle_deg: npt.ArrayLike) -> Floats:
        """Give what a degree more at each known angle makes of readings, shape (n, m)."""
        read, moved = self._misread
        return np.asarray(moved(np.clip(angle_deg, read[0], read[-1])))

    @cached_property
    def _misread(self) -> tuple[Floats, BSpline]:
        """Readings, rising, and lines between what known angles make of them."""
        room = _BEYOND * np.ptp(self.counts)
        counts = np.linspace(self.counts[0] - room, self.counts[-1] + room, _MISREAD_AT)
        read = self.angle_deg(counts)
        moved = [
            replace(self, angles_deg=self.angles_deg + _MISREAD_STEP * own).angle_deg(counts)
            for own in self.of_known.T
        ]
        rising = np.unique(read, return_index=True)[1]
        slopes = (np.column_stack(moved) - read[:, None])[rising] / _MISREAD_STEP
        return read[rising], make_interp_spline(read[rising], slopes, k=1)

    def outside(self, counts: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Say which `counts` lie beyond the calibrated range, same shape."""
        x = np.asarray(counts, dtype=np.float64)
        return np.asarray((x < self.counts[0]) | (x > self.counts[-1]), dtype=np.bool_)

    def to_dict(self) -> dict[str, Any]:
        """Return plain dicts, lists and numbers, ready for JSON (without the raw samples)."""
        return {
            "file": self.file,
            "started_s": self.started_s,
            "counts": self.counts.tolist(),
            "angles_deg": self.angles_deg.tolist(),
            "sigma_deg": self.sigma_knots_deg.tolist(),
            "range_deg": list(self.range_deg),
            "hysteresis_deg": [
                {"angle_deg": angle, "up_minus_down_deg": value}
                for angle, value in sorted(self.hysteresis_deg.items())
            ],
            "max_hysteresis_deg": self.max_hysteresis_deg,
            "dwells": [
                {
                    "angle_deg": dwell.angle_deg,
                    "direction": dwell.direction,
                    "mean": dwell.mean,
                    "noise": dwell.noise,
                    "standard_error": dwell.standard_error,
                    "drift_per_s": dwell.drift,
                    "drift_error_per_s": dwell.drift_error,
                    "settling": dwell.settling,
                }
                for dwell in self.dwells
            ],
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class Drift:
    """A later calibration seen through the earliest curve.

    `drift_deg[i]` is what the earliest curve reads at the known `angles_deg[i]`, less that angle
    less what it misread there at first; `slope` is its slope over the angle (deg per deg).
    """

    file: str
    started_s: float
    angles_deg: Floats
    drift_deg: Floats
    mean_deg: float
    max_deg: float
    slope: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain dicts, lists and numbers, ready for JSON."""
        return {
            "file": self.file,
            "started_s": self.started_s,
            "angles_deg": self.angles_deg.tolist(),
            "drift_deg": self.drift_deg.tolist(),
            "mean_deg": self.mean_deg,
            "max_deg": self.max_deg,
            "slope": self.slope,
        }


def calibrate(
    t_s: Floats,
    angle_deg: Floats,
    flex_adc: Floats,
    file: str,
    started_s: float = 0.0,
    path: str | None = None,
) -> Calibration:
    """Fit the curve to a log of dwells at known angles, usually up and then down.

    Parameters
    ----------
    t_s, angle_deg, flex_adc : ndarray, shape (n,)
        Time (s), known angle (deg) and sensor counts.
    file : str
        Its name in the campaign.
    started_s : float
        Campaign time (s).
    path : str, optional
        What messages call it; `file` by default.

    Raises
    ------
    BadInput
        Dwells at fewer than three angles, or counts that do not change with the angle.
    """
    path = path or file
    dwells, notes = find_dwells(t_s, angle_deg, flex_adc)
    angles = np.unique([dwell.angle_deg for dwell in dwells])
    if angles.size < 3:
        raise BadInput(
            path,
            f"holds dwells at {angles.size} known angles; expected a calibration of at least 3",
        )
    means = np.array([both_ways(dwells, angle) for angle in angles])
    variance = np.array([variance_at(dwells, angle) for angle in angles])
    rising = bool(np.polyfit(angles, means, 1)[0] > 0)
    if np.ptp(means) < 3.0:
        raise BadInput(path, f"its counts hardly change ({np.ptp(means):.2g}) over all angles")
    fit = isotonic_regression(means, weights=1.0 / variance, increasing=rising)
    moved = np.abs(fit.x - means)
    if moved.max() > _WORST_FOLD * np.ptp(means):
        raise BadInput(
            path,
            f"its counts neither rise nor fall with the angle (off by {moved.max():.0f} counts at "
            f"{angles[np.argmax(moved)]:g} deg); expected a monotone sensor",
        )
    if np.any(moved > 0):
        notes.append(
            f"knots not monotone: {np.count_nonzero(moved)} moved by up to {moved.max():.2g} counts"
        )
    counts, pooled = _pool(fit.x)
    if counts.size < 3:
        raise BadInput(path, f"its counts differ at {counts.size} angles only; expected 3 or more")
    knots, none = pooled @ angles, np.zeros_like(counts)
    spread = np.sqrt(np.maximum(pooled @ angles**2 - knots**2, 0.0))
    raw = Calibration(file, started_s, counts, knots, none, {}, pooled, dwells)
    noise = pooled @ (variance + moved**2)
    of_known = _smoother(raw, noise, angles) @ pooled
    knots = isotonic_regression(of_known @ angles, increasing=rising).x
    smooth = replace(raw, angles_deg=knots, of_known=of_known)
    hysteresis = _hysteresis(smooth, dwells)
    if not hysteresis:
        notes.append("no angle was visited both ways: hysteresis not known")
    sigma = np.hypot(_sigma(smooth, noise, hysteresis), spread)
    return replace(smooth, sigma_knots_deg=sigma, hysteresis_deg=hysteresis, notes=tuple(notes))


def drift(earliest: Calibration, later: Calibration) -> Drift:
    """Compare a later calibration with the earliest one, angle by angle."""
    angles, values = [], []
    known = {dwell.angle_deg for dwell in earliest.dwells}
    for angle in sorted({dwell.angle_deg for dwell in later.dwells}):
        now = float(earliest.angle_deg(both_ways(later.dwells, angle)))
        then = (
            float(earliest.angle_deg(both_ways(earliest.dwells, angle)))
            if angle in known
            else angle
        )
        angles.append(angle)
        values.append(now - then)
    x, y = np.array(angles), np.array(values)
    return Drift(
        later.file,
        later.started_s,
        x,
        y,
        mean_deg=float(y.mean()),
        max_deg=float(np.abs(y).max()),
        slope=float(np.polyfit(x, y, 1)[0]),
    )


def _pool(counts: Floats) -> tuple[Floats, Floats]:
    """Merge angles of equal counts into knots: their counts, rising, and means over angles."""
    values, group = np.unique(counts, return_inverse=True)
    same = np.eye(values.size)[:, group]
    return values, same / same.sum(axis=1, keepdims=True)


def _smoother(raw: Calibration, noise: Floats, angles: Floats) -> Floats:
    """Smooth a curve as far as its known angles scatter; `noise` is the variance of its counts."""
    at = (raw.counts - raw.counts[0]) / np.ptp(raw.counts)
    square = raw._curve.derivative()(raw.counts) ** 2
    directions: tuple[Direction, ...] = ("up", "down")
    each = np.array([[count_at(raw.dwells, a, way) for way in directions] for a in angles])
    pooled = raw.of_known
    known = Series(at, raw.angles_deg, square * noise, pooled**2 @ (1.0 / each.sum(axis=1)))
    both = (each > 0).all(axis=1)
    if np.count_nonzero(both) <= 3:
        return smoother(known)
    where = np.argmax(pooled[:, both] > 0.0, axis=0)
    order = np.argsort(where)
    apart = np.array(list(_hysteresis(raw, raw.dwells).values()))  # of the same angles
    share = np.sum(1.0 / each[both], axis=1)
    noise = 4.0 * (square * noise)[where]
    return smoother(known, Series(at[where[order]], apart[order], noise[order], share[order]))


def _hysteresis(curve: Calibration, dwells: Sequence[Dwell]) -> dict[float, float]:
    result = {}
    for angle in sorted({dwell.angle_deg for dwell in dwells}):
        counts = ways(dwells, angle)
        if len(counts) == 2:
            up, down = curve.angle_deg(counts)
            result[angle] = float(up - down)
    return result


def _sigma(curve: Calibration, variance: Floats, hysteresis: dict[float, float]) -> Floats:
    """Combine noise, interpolation and half the hysteresis at the knots (deg)."""
    slopes = np.abs(curve._curve.derivative()(curve.counts))
    noise = slopes * np.sqrt(variance)
    half = np.zeros_like(noise)
    if hysteresis:
        known = np.array(sorted(hysteresis))
        size = np.array([abs(hysteresis[angle]) for angle in known]) / 2.0
        half = np.interp(curve.angles_deg, known, size)
    sigma: Floats = np.sqrt(noise**2 + half**2 + _interpolation_error(curve) ** 2)
    return sigma


def _interpolation_error(curve: Calibration) -> float:
    """Estimate the error between knots (deg, rms): leave each inner one out in turn.

    Leaving one out doubles the distance, and the cubic's error there is about 8 times as large;
    a quarter of it is kept, as a monotone cubic loses an order next to flat places.
    """
    counts, angles = curve.counts, curve.angles_deg
    if counts.size < 4:
        return float(np.ptp(angles)) * 0.01
    missed = [
        float(PchipInterpolator(np.delete(counts, i), np.delete(angles, i))(counts[i])) - angles[i]
        for i in range(1, counts.size - 1)
    ]
    return 0.25 * float(np.sqrt(np.mean(np.square(missed))))
