"""The sensor in the calibration fixture: what only its own effects explain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from spa_fo.arrays import Floats, Integers
from spa_fo.plant.chain import log_delays
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.shared import CREEP_TIMES_S
from spa_fo.plant.memory import STEPS_S
from spa_fo.plant.specimen import Mounting
from spa_fo.plant.stages import felt_angle
from spa_fo.rig import Calibration, Dwell

_WINDOWS = 4  # of a calibration dwell
_STEP_LEVEL = 1  # of the fixture's simulation: 0.04 s
_REST_LEVEL = 7  # of the time the sensor lies flat: 2.6 s
_STEP_S = float(STEPS_S[_STEP_LEVEL])
_FLOOR_DEG = 0.06
_UNKNOWN_DEG = 10.0  # of what a sensor may be on its way from
_SHORTEST_REST_S = 100.0
_LONGEST_REST_S = 10.0 * float(CREEP_TIMES_S[-1])  # by then every creep is forgotten


@dataclass(frozen=True)
class Fixture:
    """The sensor in the calibration fixture, in rows: windows of every calibration's dwells."""

    deviation_deg: Floats  # (rows,): what the first curve reads, less the settled mean there
    sigma_deg: Floats  # (rows,)
    curve: Calibration  # the first one
    known_deg: Floats  # (rows,): the fixture's angle
    log: Integers  # (rows,): which calibration
    dwell: Integers  # (rows,): which dwell, all calibrations counted through
    average: Floats  # (rows, rows): takes the settled mean at each angle away
    # By calibration, the fixture's angle and the lengths of the simulation's steps, as levels; the
    # time that the sensor lies flat afterwards belongs to it.
    paths: tuple[tuple[Floats, Integers], ...]
    steps: Integers  # (rows, 2): first and last step of each window, the calibrations in a row

    @cached_property
    def of_dwell(self) -> Floats:
        """Which dwell each row is of, (rows, dwells)."""
        return np.eye(int(self.dwell.max()) + 1)[self.dwell]

    @cached_property
    def drifted(self) -> Floats:
        """What an error of each dwell's known angle makes of the later drifts, (m, dwells)."""
        later = [np.zeros((0, self.of_dwell.shape[1]))]
        for log, angles in enumerate(self._later_deg, start=1):
            later.append(self._mean_at(log, angles) - self._mean_at(0, angles))
        return np.concatenate(later) + self.misread_later @ self.of_known

    @cached_property
    def misread_later(self) -> Floats:
        """What errors of known angles make of the later drifts by the curve, (m, known angles).

        At an angle of the first calibration it is what that read, too.
        """
        known = np.unique(self.known_deg[self.log == 0])
        angles = np.concatenate([np.zeros(0), *self._later_deg])
        return np.where(np.isin(angles, known)[:, None], 0.0, self.misread(angles))

    @cached_property
    def _later_deg(self) -> list[Floats]:
        """Angles of each later calibration, deg."""
        return [np.unique(self.known_deg[self.log == k]) for k in range(1, len(self.paths))]

    def _mean_at(self, log: int, angles_deg: Floats) -> Floats:
        """Weights of the mean over a calibration's dwells at some angles, (angles, dwells)."""
        rows = (self.log == log) & (self.known_deg == angles_deg[:, None])
        dwells = (rows @ self.of_dwell > 0.0).astype(np.float64)
        return np.asarray(dwells / np.maximum(dwells.sum(axis=1, keepdims=True), 1.0))

    def misread(self, angle_deg: Floats) -> Floats:
        """Give what an error of each known angle makes of readings, (n, known angles)."""
        return -self.curve.misread_deg(angle_deg)

    @cached_property
    def _smooth(self) -> Floats:
        """Weights of the first calibration's known angles at each of them, by its curve."""
        of_known = self.curve.of_known
        if of_known.shape[0] != of_known.shape[1]:  # some were pooled
            return np.eye(of_known.shape[1])
        return of_known if self.curve.angles_deg[0] < self.curve.angles_deg[-1] else of_known[::-1]

    @cached_property
    def of_known(self) -> Floats:
        """Weights of the mean over the first calibration's dwells, (known angles, dwells)."""
        return self._mean_at(0, np.unique(self.known_deg[self.log == 0]))

    def simulate(self, effects: Floats) -> tuple[Floats, Mounting]:
        """Simulate what the sensor's effects make of the fixture.

        Parameters
        ----------
        effects : array
            Parameters of all effects, NaN where absent.

        Returns
        -------
        (rows,) array, Mounting
            Of `deviation_deg`; what the first calibration leaves the sensor with.
        """
        own = effects.copy()
        for effect in LIBRARY.values():
            if not effect.in_fixture:
                own[effect.slots] = np.nan  # of the mounting: the fixture does not show it
        if np.isnan(own).all():
            return np.zeros(self.deviation_deg.size), Mounting()
        film = Mounting().film
        read, films = [], []
        for angle, level in self.paths:
            read.append(felt_angle(angle, level, own, film))
            film[0] = 0.0  # which way the film is turned until it is used again nobody knows
            films.append(film.copy())
        total = cumulative_trapezoid(np.concatenate([read[0][:1], *read]), initial=0)
        delays = log_delays(effects)
        late = np.zeros(1) if delays is None else delays / _STEP_S
        edges = self.steps - late[:, None, None]
        rise = np.diff(np.interp(edges, np.arange(total.size), total), axis=-1)
        mean = np.mean(rise / np.diff(self.steps), axis=0)[:, 0]
        raw = mean - self.known_deg
        known, rows = np.unique(self.known_deg[self.log == 0], return_index=True)
        # Each row less itself centred is the settled mean at its angle: what the curve took up.
        bias = (raw - self.average @ raw)[self.log == 0][rows]
        taken = self._smooth @ bias
        # The curve is as smooth as dwells speak for, and takes up no more of them than that.
        mounting = Mounting(films[0], np.maximum.accumulate(known + bias - taken), taken)
        return self.average @ (mounting.logged_deg(mean) - self.known_deg), mounting


def fixture_of(calibrations: Sequence[Calibration], starts_s: float) -> Fixture | None:
    """Lay every calibration's dwells on a common time line, the curve being the first one's.

    The trials begin at `starts_s` (campaign time). Without a calibration there is no fixture.
    """
    if not calibrations:
        return None
    rows: list[tuple[float, ...]] = []
    ways: list[str] = []
    moves: list[float] = []  # into each dwell, deg
    paths: list[tuple[Floats, Integers]] = []
    start = dwells = 0
    for log, calibration in enumerate(calibrations):
        known = [dwell.angle_deg for dwell in calibration.dwells]
        begun_s = np.array([dwell.started_s for dwell in calibration.dwells])
        lasted_s = np.array([dwell.t_s[-1] for dwell in calibration.dwells])
        pause_s = np.append(2.0, np.clip(np.diff(begun_s) - lasted_s[:-1], 0.1, 30.0))
        move = np.maximum(1, np.rint(pause_s / _STEP_S)).astype(np.int64)
        stay = np.maximum(_WINDOWS, np.rint(lasted_s / _STEP_S)).astype(np.int64)
        ends = np.cumsum(move + stay)
        corners = np.append(0, np.column_stack([ends - stay, ends]))
        held = np.interp(np.arange(ends[-1]) + 1, corners, [0.0, *np.repeat(known, 2)])
        before = known[0]
        for dwell, at in zip(calibration.dwells, start + ends - stay, strict=True):
            first = dwell is calibration.dwells[0]
            for window in _windows(dwell, calibrations[0], int(at), first):
                rows.append((log, dwells, dwell.angle_deg, *window))
            ways.append(dwell.direction)
            moves.append(dwell.angle_deg - before)
            before = dwell.angle_deg
            dwells += 1
        # Until the trials begin the sensor lies flat; after them its past hardly matters.
        rest_s = _SHORTEST_REST_S
        if log == 0:
            ended_s = calibration.started_s + begun_s[-1] - begun_s[0] + lasted_s[-1]
            rest_s = min(max(starts_s - ended_s, rest_s), _LONGEST_REST_S)
        rest = round(rest_s / float(STEPS_S[_REST_LEVEL]))
        level = np.repeat([_STEP_LEVEL, _REST_LEVEL], [held.size, rest])
        paths.append((np.append(held, np.zeros(rest)), level))
        start += level.size
    log_of, dwell_of, known, deviation, sigma, begin, end, settled = np.array(rows).T
    which = dwell_of.astype(np.int64)
    own = wandering(deviation, sigma, which, np.array(ways), np.array(moves))
    sigma = np.hypot(sigma, own)
    same = (log_of == log_of[:, None]) & (known == known[:, None])
    still = same & (settled > 0.0)
    taken = np.where(still.any(axis=1, keepdims=True), still, same)
    average = np.eye(known.size) - taken / taken.sum(axis=1, keepdims=True)
    return Fixture(
        deviation_deg=average @ deviation,
        sigma_deg=sigma,
        curve=calibrations[0],
        known_deg=known,
        log=log_of.astype(np.int64),
        dwell=which,
        average=average,
        paths=tuple(paths),
        steps=np.column_stack([begin, end]).astype(np.int64),
    )


def wandering(
    deviation: Floats, sigma: Floats, dwell: Integers, ways: NDArray[np.str_], moves_deg: Floats
) -> float:
    """Estimate by how much windows differ beyond their white noise, 1 sigma: noise is coloured.

    The last two windows of each dwell say it, where a sensor has settled. By what it still moves
    there all dwells of one of the `ways`, (dwells,), differ alike, or in proportion to the way into
    them, `moves_deg`, (dwells,). Of the rows, (rows,), those of a first dwell say nothing.
    """
    last = np.flatnonzero(np.diff(dwell, append=-1))
    last = last[(last > 0) & (sigma[last] < _UNKNOWN_DEG)]
    last = last[dwell[last - 1] == dwell[last]]
    of, difference = dwell[last], deviation[last] - deviation[last - 1]
    square, freedom = 0.0, 0
    for one in np.unique(ways[of]):
        here = ways[of] == one
        moving = np.column_stack([np.ones(here.sum()), moves_deg[of[here]]])
        expected, _, rank, _ = np.linalg.lstsq(moving, difference[here], rcond=1e-6)
        square += float(np.sum((difference[here] - moving @ expected) ** 2))
        freedom += int(here.sum() - rank)
    if freedom < 1:
        return 0.0
    white = float(np.mean(sigma[last] ** 2))
    return float(np.sqrt(max(0.5 * square / freedom - white, 0.0)))


def _windows(dwell: Dwell, curve: Calibration, at: int, first: bool) -> Iterator[tuple[float, ...]]:
    """Yield what the row of each window of a dwell is, which begins with step `at`.

    That is deviation (deg), its error, first and last step, and whether the sensor has settled. Of
    the first dwell nobody knows how the sensor came there: how it settles says nothing.
    """
    slope = float(curve.angle_deg(dwell.mean + 0.5) - curve.angle_deg(dwell.mean - 0.5))
    edges = np.linspace(0.0, float(dwell.t_s[-1]) + 1e-9, _WINDOWS + 1)
    counts = np.histogram(dwell.t_s, edges)[0]
    sums = np.histogram(dwell.t_s, edges, weights=dwell.counts)[0]
    for w in np.flatnonzero(counts >= 2).tolist():
        deviation = float(curve.angle_deg(sums[w] / counts[w])) - dwell.angle_deg
        noise = max(dwell.noise, 0.3) * slope / np.sqrt(counts[w])
        begin, end = (at + round(edge / _STEP_S) for edge in edges[w : w + 2])
        sigma = float(np.hypot(noise, _UNKNOWN_DEG if first else _FLOOR_DEG))
        yield deviation, sigma, begin, max(begin + 1, end), w >= _WINDOWS // 2
