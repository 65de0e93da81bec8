"""The sensor in the calibration fixture: what only its own effects explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from spa_fo.plant.chain import Mounting, log_delays
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.shared import CREEP_TIMES_S
from spa_fo.plant.memory import STEPS_S
from spa_fo.plant.stages import felt_angle
from spa_fo.rig import Calibration, Dwell

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_WINDOWS = 4  # of a calibration dwell
_FIXTURE_LEVEL = 1  # steps of the fixture's simulation: 0.04 s
_RELAX_LEVEL = 7  # and of the time the sensor lies flat: 2.6 s
_FIXTURE_FLOOR_DEG = 0.06
_FORGOTTEN = 10.0  # times the longest time of a creep: nothing is left of it


@dataclass(frozen=True)
class Fixture:
    """The sensor in the calibration fixture: readings that only its own effects explain.

    Attributes
    ----------
    deviation_deg, sigma_deg : (rows,) arrays
        What the first curve reads in each window of a dwell, less the settled mean at that angle.
    angle_deg, level : (steps,) arrays
        Angle of the fixture on the simulation's steps, and their lengths as levels.
    step_of : (rows, 2) array
        First and last step of each window.
    average : (rows, rows) array
        Takes the settled mean at each angle away.
    time_s, window_s : (rows,) arrays
        Middle of each window in its log, and its length.
    log : (rows,) array
        Which calibration it is from.
    known_deg : (rows,) array
        The fixture's angle.
    log_starts : (logs + 1,) array
        First step of each calibration; the time the sensor lies flat after it belongs to it.
    dwell : (rows,) array
        Which dwell each window is of, all calibrations counted through.
    drifted : (m, dwells) array
        What an error of each dwell's known angle makes of the later calibrations' drift.
    """

    deviation_deg: Floats
    sigma_deg: Floats
    angle_deg: Floats
    level: Integers
    step_of: Integers
    average: Floats
    time_s: Floats
    window_s: Floats
    log: Integers
    known_deg: Floats
    log_starts: Integers
    dwell: Integers
    drifted: Floats

    @property
    def of_dwell(self) -> Floats:
        """Which dwell each row is of, (rows, dwells)."""
        return np.eye(int(self.dwell.max()) + 1)[self.dwell]

    def misread(self, angle_deg: Floats) -> Floats:
        """Give what an error of each dwell's known angle makes of readings, (n, dwells)."""
        out = np.zeros((angle_deg.size, int(self.dwell.max()) + 1))
        first = self.log == 0
        angles = np.unique(self.known_deg[first])
        hats = np.array([np.interp(angle_deg, angles, row) for row in np.eye(angles.size)]).T
        for j, angle in enumerate(angles):
            at = np.unique(self.dwell[first & (self.known_deg == angle)])
            out[:, at] = -hats[:, j : j + 1] / at.size
        return out

    def simulate(self, effects: Floats, film_turned: float = 0.0) -> tuple[Floats, Mounting]:
        """Simulate what the sensor's effects make of the fixture.

        Parameters
        ----------
        effects : array
            Parameters of all effects, NaN where absent.
        film_turned : float
            State, -1 to 1, in which a sensor with hysteresis comes to the later calibrations.

        Returns
        -------
        predicted_deg : (rows,) array
            Of `deviation_deg`.
        mounting : Mounting
            What the first calibration leaves the sensor with.
        """
        own = effects.copy()
        for effect in LIBRARY.values():
            if not effect.in_fixture:
                own[effect.slots] = np.nan  # of the mounting: the fixture does not show it
        if np.isnan(own).all():
            return np.zeros(self.deviation_deg.size), Mounting()
        film = np.zeros(4 + CREEP_TIMES_S.size)
        read = np.empty(self.angle_deg.size)
        start = film
        for log, (first, end) in enumerate(pairwise(self.log_starts.tolist())):
            if log > 0:
                film[0] = film_turned  # by what happened to it since
            read[first:end] = felt_angle(
                self.angle_deg[first:end], self.level[first:end], own, film
            )
            if log == 0:
                start = film.copy()
        delays = log_delays(effects)
        over_step = 0.5 * (read + np.concatenate([read[:1], read[:-1]]))
        total = np.concatenate([[0.0], np.cumsum(over_step)])
        at = np.arange(total.size)
        mean = np.zeros(self.step_of.shape[0])
        delays = np.zeros(1) if delays is None else delays
        for late in delays / STEPS_S[_FIXTURE_LEVEL]:
            first, last = self.step_of[:, 0] - late, self.step_of[:, 1] - late
            rise = np.interp(last, at, total) - np.interp(first, at, total)
            mean += rise / (last - first) / delays.size
        raw = mean - self.known_deg
        known, rows = np.unique(self.known_deg[self.log == 0], return_index=True)
        # Each row less itself centred is the settled mean at its angle: what the curve took up.
        bias = (raw - self.average @ raw)[self.log == 0][rows]
        mounting = Mounting(start, known, bias)
        return self.average @ (mounting.logged_deg(mean) - self.known_deg), mounting


def _drifted(
    dwell: Integers, log: Integers, known: Floats, drift_angles: Sequence[Floats]
) -> Floats:
    """Give what an error of each dwell's known angle makes of the later calibrations' drift."""
    total = int(dwell.max()) + 1
    rows = []
    for number, angles in enumerate(drift_angles, start=1):
        for angle in angles:
            row = np.zeros(total)
            for sign, which in ((1.0, number), (-1.0, 0)):
                here = (log == which) & (np.abs(known - angle) < 1e-6)
                at = np.unique(dwell[here])
                row[at] += sign / max(at.size, 1)
            rows.append(row)
    return np.array(rows).reshape(-1, total)


def fixture_of(
    calibrations: Sequence[Calibration], starts_s: float, drift_angles: Sequence[Floats] = ()
) -> Fixture | None:
    """Lay every calibration's dwells on a common time line, the curve being the first one's.

    Parameters
    ----------
    calibrations : sequence of Calibration
        Sorted by time.
    starts_s : float
        Campaign time at which the trials begin.
    drift_angles : sequence of arrays
        Angles that each later calibration is compared at, deg.

    Returns
    -------
    Fixture or None
        None without a calibration.
    """
    if not calibrations:
        return None
    curve = calibrations[0]
    step = STEPS_S[_FIXTURE_LEVEL]
    angle: list[Floats] = []
    level: list[Integers] = []
    windows, deviation, sigma, groups, settled, times, lengths = [], [], [], [], [], [], []
    dwell_of: list[int] = []
    counted = -1
    at, log_starts = 0, [0]
    for number, calibration in enumerate(calibrations):
        before, start = 0.0, at
        for k, dwell in enumerate(calibration.dwells):
            gap = 2.0 if k == 0 else _pause(calibration.dwells[k - 1], dwell)
            move = max(1, round(gap / step))
            stay = max(_WINDOWS, round(float(dwell.t_s[-1]) / step))
            angle.append(np.linspace(before, dwell.angle_deg, move + 1)[1:])
            angle.append(np.full(stay, dwell.angle_deg))
            slope = float(curve.angle_deg(dwell.mean + 0.5) - curve.angle_deg(dwell.mean - 0.5))
            edges = np.linspace(0.0, float(dwell.t_s[-1]) + 1e-9, _WINDOWS + 1)
            counted += 1
            for w in range(_WINDOWS):
                inside = (dwell.t_s >= edges[w]) & (dwell.t_s < edges[w + 1])
                count = int(np.count_nonzero(inside))
                if count < 2:
                    continue
                mean = float(dwell.counts[inside].mean())
                deviation.append(float(curve.angle_deg(mean)) - dwell.angle_deg)
                noise = max(dwell.noise, 0.3) * slope / np.sqrt(count)
                sigma.append(float(np.hypot(noise, _FIXTURE_FLOOR_DEG)))
                first = at + move + round(edges[w] / step)
                windows.append((first, max(first + 1, at + move + round(edges[w + 1] / step))))
                groups.append((number, dwell.angle_deg))
                dwell_of.append(counted)
                times.append(dwell.started_s + 0.5 * float(edges[w] + edges[w + 1]))
                lengths.append(float(edges[w + 1] - edges[w]))
                settled.append(w >= _WINDOWS // 2)
            at += move + stay
            before = dwell.angle_deg
        # Until the trials begin the sensor lies flat; after them its past hardly matters.
        last = calibration.dwells[-1]
        finish = calibration.started_s + last.started_s - calibration.dwells[0].started_s
        rest = max(starts_s - finish - float(last.t_s[-1]), 100.0) if number == 0 else 100.0
        rest = min(rest, _FORGOTTEN * CREEP_TIMES_S[-1])
        relax = round(rest / STEPS_S[_RELAX_LEVEL])
        level.append(np.full(at - start, _FIXTURE_LEVEL))
        level.append(np.full(relax, _RELAX_LEVEL))
        angle.append(np.zeros(relax))
        at += relax
        log_starts.append(at)
    average = np.eye(len(groups))
    for key in set(groups):
        members = [i for i, group in enumerate(groups) if group == key]
        still = [i for i in members if settled[i]] or members
        for i in members:
            average[i, still] -= 1.0 / len(still)
    centred = average @ np.array(deviation)
    dwell_rows = np.array(dwell_of)
    log = np.array([number for number, _ in groups])
    known = np.array([angle for _, angle in groups])
    return Fixture(
        deviation_deg=centred,
        sigma_deg=np.array(sigma),
        angle_deg=np.concatenate(angle),
        level=np.concatenate(level),
        step_of=np.array(windows),
        average=average,
        time_s=np.array(times),
        window_s=np.array(lengths),
        log=log,
        known_deg=known,
        log_starts=np.array(log_starts),
        dwell=dwell_rows,
        drifted=_drifted(dwell_rows, log, known, drift_angles),
    )


def _pause(earlier: Dwell, later: Dwell) -> float:
    return float(np.clip(later.started_s - earlier.started_s - earlier.t_s[-1], 0.1, 30.0))
