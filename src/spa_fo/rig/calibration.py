"""The flex sensor against known angles: dwells, the monotone curve, its error, and its drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator
from scipy.optimize import isotonic_regression

from spa_fo.errors import BadInput

Floats = npt.NDArray[np.float64]

_SETTLED = 0.5  # the part of a dwell, from its end, that counts as settled
_FEWEST_SAMPLES = 8  # of a dwell
_LONGEST_PAUSE_S = 1.0  # within a dwell
_QUANTISATION = 1.0 / np.sqrt(12.0)  # counts: an undithered converter's error
_WORST_FOLD = 0.2  # of the counts' range: knots farther off a monotone curve are no noise
_END_SLOPE_ERROR = 0.2  # assumed relative error of the slope beyond the ends, 1 sigma


@dataclass(frozen=True)
class Dwell:
    """The sensor held at one known angle.

    `mean` (counts) over the settled latter half, `noise` its scatter about a line (counts, one
    sample), `standard_error` that of the mean; `drift` the slope of a line through the settled
    half (counts/s) and `drift_error` its standard error; `settling` how much the settled mean
    lies above the mean of the first quarter (counts): a lag or creep of the sensor itself.
    `t_s` and `counts` are the whole dwell, from its first sample.
    """

    angle_deg: float
    direction: Literal["up", "down"]
    started_s: float
    mean: float
    noise: float
    standard_error: float
    drift: float
    drift_error: float
    settling: float
    t_s: Floats = field(repr=False)
    counts: Floats = field(repr=False)


@dataclass(frozen=True)
class Calibration:
    """A monotone curve from flex counts to degrees.

    Knots are the dwells' settled means, up and down averaged at each angle, made monotone where
    noise breaks it; between them a monotone cubic (Fritsch and Carlson 1980,
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
    dwells: tuple[Dwell, ...]
    notes: tuple[str, ...] = ()

    @property
    def range_deg(self) -> tuple[float, float]:
        """The smallest and largest calibrated angle."""
        return float(self.angles_deg.min()), float(self.angles_deg.max())

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
    means = np.array([_both_ways(dwells, angle) for angle in angles])
    variance = np.array([_variance(dwells, angle) for angle in angles])
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
    counts, knot_angles, knot_variance, spread = _pool(fit.x, angles, variance + moved**2)
    if counts.size < 3:
        raise BadInput(path, f"its counts differ at {counts.size} angles only; expected 3 or more")
    bare = Calibration(file, started_s, counts, knot_angles, np.zeros_like(counts), {}, dwells)
    hysteresis = _hysteresis(bare, dwells)
    sigma = np.hypot(_sigma(bare, knot_variance, hysteresis), spread)
    if not hysteresis:
        notes.append("no angle was visited both ways: hysteresis not known")
    return Calibration(
        file, started_s, counts, knot_angles, sigma, hysteresis, dwells, tuple(notes)
    )


def find_dwells(
    t_s: Floats, angle_deg: Floats, flex_adc: Floats
) -> tuple[tuple[Dwell, ...], list[str]]:
    """Cut a calibration log into its dwells: stretches of one known angle.

    Returns
    -------
    dwells : tuple of Dwell
        In the order of the log; stretches of fewer than 8 samples are left out.
    notes : list of str
        What was left out.
    """
    cuts = np.flatnonzero((np.diff(angle_deg) != 0.0) | (np.diff(t_s) > _LONGEST_PAUSE_S)) + 1
    stretches = np.split(np.arange(len(t_s)), cuts)
    long = [stretch for stretch in stretches if len(stretch) >= _FEWEST_SAMPLES]
    notes = []
    if len(long) < len(stretches):
        left = len(stretches) - len(long)
        notes.append(f"{left} stretches of fewer than {_FEWEST_SAMPLES} samples left out")
    at = [float(angle_deg[stretch[0]]) for stretch in long]
    dwells: list[Dwell] = []
    for i, stretch in enumerate(long):
        rising = at[i] > at[i - 1] if i else len(at) < 2 or at[1] > at[0]
        if i and at[i] == at[i - 1]:
            rising = dwells[-1].direction == "up"
        dwells.append(_dwell(at[i], "up" if rising else "down", t_s[stretch], flex_adc[stretch]))
    return tuple(dwells), notes


def drift(earliest: Calibration, later: Calibration) -> Drift:
    """Compare a later calibration with the earliest one, angle by angle."""
    angles, values = [], []
    known = {dwell.angle_deg for dwell in earliest.dwells}
    for angle in sorted({dwell.angle_deg for dwell in later.dwells}):
        now = float(earliest.angle_deg(_both_ways(later.dwells, angle)))
        then = (
            float(earliest.angle_deg(_both_ways(earliest.dwells, angle)))
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


def _dwell(angle: float, direction: Literal["up", "down"], t_s: Floats, counts: Floats) -> Dwell:
    t = t_s - t_s[0]
    settled = t >= (1.0 - _SETTLED) * t[-1]
    x, y = t[settled] - t[settled].mean(), counts[settled]
    slope = float(x @ y / (x @ x))
    noise = float(np.sqrt(np.sum((y - y.mean() - slope * x) ** 2) / (y.size - 2)))
    # Without noise to dither it, a converter's mean is no better than its step.
    floor = _QUANTISATION if noise < 0.5 else 0.0
    return Dwell(
        angle_deg=angle,
        direction=direction,
        started_s=float(t_s[0]),
        mean=float(y.mean()),
        noise=noise,
        standard_error=float(np.hypot(noise / np.sqrt(y.size), floor)),
        drift=slope,
        drift_error=float(max(noise, _QUANTISATION) / np.sqrt(x @ x)),
        settling=float(y.mean() - counts[t <= 0.25 * t[-1]].mean()),
        t_s=t,
        counts=counts,
    )


def _ways(dwells: Sequence[Dwell], angle: float) -> list[float]:
    """Return the means at `angle`, averaged over the dwells up and over those down."""
    ways = []
    for direction in ("up", "down"):
        means = [d.mean for d in dwells if d.angle_deg == angle and d.direction == direction]
        if means:
            ways.append(float(np.mean(means)))
    return ways


def _both_ways(dwells: Sequence[Dwell], angle: float) -> float:
    return float(np.mean(_ways(dwells, angle)))


def _variance(dwells: Sequence[Dwell], angle: float) -> float:
    errors = np.array([d.standard_error for d in dwells if d.angle_deg == angle])
    return float(np.sum(errors**2)) / errors.size**2


def _pool(
    counts: Floats, angles: Floats, variance: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Merge knots of equal counts into one: counts (rising), angles, variance, angles' spread."""
    values, group = np.unique(counts, return_inverse=True)
    sizes = np.bincount(group)
    mean = np.bincount(group, weights=angles) / sizes
    spread = np.sqrt(np.bincount(group, weights=(angles - mean[group]) ** 2) / sizes)
    return values, mean, np.bincount(group, weights=variance) / sizes, spread


def _hysteresis(curve: Calibration, dwells: Sequence[Dwell]) -> dict[float, float]:
    result = {}
    for angle in sorted({dwell.angle_deg for dwell in dwells}):
        ways = _ways(dwells, angle)
        if len(ways) == 2:
            up, down = curve.angle_deg(ways)
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
