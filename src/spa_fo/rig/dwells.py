"""The dwells of a calibration log: the sensor held at known angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from spa_fo.arrays import Floats

Direction = Literal["up", "down"]

_SETTLED = 0.5  # the part of a dwell, from its end, that counts as settled
_FEWEST_SAMPLES = 8  # of a dwell
_LONGEST_PAUSE_S = 1.0  # within a dwell
_SHORTEST_PAUSE_S = 0.25  # from which it may be a move: lines are lost, and logs come in bursts
_MOVING = 0.5  # of what the fixture takes from one angle to the next: a pause as long is a move
_WHOLE = 0.6  # of what a dwell typically lasts
_MOST_SAMPLES = 0.95  # of them come at the log's own interval, or in bursts
_PAUSED = 5.0  # sampling intervals: where a move takes fewer, the log goes on while it moves
_QUANTISATION = 1.0 / np.sqrt(12.0)  # counts: an undithered converter's error


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
    direction: Direction
    started_s: float
    mean: float
    noise: float
    standard_error: float
    drift: float
    drift_error: float
    settling: float
    t_s: Floats = field(repr=False)
    counts: Floats = field(repr=False)


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
    turned, pause_s = np.diff(angle_deg) != 0.0, np.diff(t_s)
    paused = pause_s > _longest_pause_s(turned, pause_s)
    cuts = np.flatnonzero(turned | paused) + 1
    # What pauses for less than any dwell may is cut into two whole dwells, or lines were lost.
    typical = float(np.median(np.diff([0, *np.flatnonzero(turned) + 1, len(t_s)])))
    parts = np.diff([0, *cuts, len(t_s)])
    whole = np.minimum(parts[:-1], parts[1:]) >= _WHOLE * typical
    cuts = cuts[turned[cuts - 1] | (pause_s[cuts - 1] > _LONGEST_PAUSE_S) | whole]
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


def _longest_pause_s(turned: npt.NDArray[np.bool_], pause_s: Floats) -> float:
    """Say how long a log may pause within a dwell.

    Two dwells at one angle, as at the turn from up to down, are told by the move between them: the
    fixture comes to stand anew, a little elsewhere.
    """
    if not turned.any():
        return _LONGEST_PAUSE_S
    moving_s = float(np.median(pause_s[turned]))
    within_s = pause_s[~turned]
    if not within_s.size or moving_s < _PAUSED * float(np.quantile(within_s, _MOST_SAMPLES)):
        return _LONGEST_PAUSE_S
    return float(np.clip(_MOVING * moving_s, _SHORTEST_PAUSE_S, _LONGEST_PAUSE_S))


def _dwell(angle: float, direction: Direction, t_s: Floats, counts: Floats) -> Dwell:
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


def ways(dwells: Sequence[Dwell], angle: float) -> list[float]:
    """Return the means at `angle`, averaged over the dwells up and over those down."""
    found = []
    for direction in ("up", "down"):
        means = [d.mean for d in dwells if d.angle_deg == angle and d.direction == direction]
        if means:
            found.append(float(np.mean(means)))
    return found


def both_ways(dwells: Sequence[Dwell], angle: float) -> float:
    """Return the mean at `angle` over both ways."""
    return float(np.mean(ways(dwells, angle)))


def variance_at(dwells: Sequence[Dwell], angle: float) -> float:
    """Return the variance of the mean at `angle`, counts²."""
    errors = np.array([d.standard_error for d in dwells if d.angle_deg == angle])
    return float(np.sum(errors**2)) / errors.size**2


def count_at(dwells: Sequence[Dwell], angle: float, way: Direction) -> int:
    """Count the dwells at an angle that were come to in one way."""
    return sum(d.angle_deg == angle and d.direction == way for d in dwells)
