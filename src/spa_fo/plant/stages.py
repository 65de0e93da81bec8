"""The stages of the chain: the library's kernels, and behind them the effects that act."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.drive import drive_pressure
from spa_fo.plant.effects.own import acted, acting
from spa_fo.plant.effects.sensor import read_angle
from spa_fo.plant.memory import FINEST_STEP_S, STEPS_S

_RESTED = 8  # readings at rest that a short series begins with
_KEPT, _MOST, _SETTLED = 5, 60, 1e-8  # of a search for the load that fits the angle that it makes
_FAR = 30.0  # times the largest pressure: no load is searched beyond


def true_pressure(command: Floats, starts: Integers, effects: Floats, play: Floats) -> Floats:
    """Turn the command into the true pressure; for the parameters see `drive_pressure`."""
    pressure = np.asarray(drive_pressure(command, starts, effects, play))
    for effect, values in acting(effects, "drive"):
        for first, end in pairwise(starts.tolist()):
            time = FINEST_STEP_S * (np.arange(end - first) + 0.5)
            pressure[first:end] = acted(effect, values, pressure[first:end], time)
    return pressure


def felt_angle(angle: Floats, level: Integers, effects: Floats, film: Floats) -> Floats:
    """Turn true angles into what the sensor feels; for the parameters see `read_angle`."""
    read = np.asarray(read_angle(angle, level, effects, film))
    for effect, values in acting(effects, "sensor"):
        rest = _RESTED if read.size < _RESTED else 0
        y = np.concatenate([np.full(rest, read[:1]), read])
        time = np.cumsum(STEPS_S[np.concatenate([np.zeros(rest, dtype=np.int64), level])])
        read = acted(effect, values, y, time)[rest:]
    return read


def logged_angle(reading: Floats, time_s: Floats, trial: Integers, effects: Floats) -> Floats:
    """Turn readings at samples, with their times in their trials, into what the log holds."""
    for effect, values in acting(effects, "acquisition"):
        reading = reading.copy()
        for one in np.unique(trial):
            own = trial == one
            reading[own] = acted(effect, values, reading[own], time_s[own])
    return reading


def moving_pressure(
    pressure: Floats, level: Integers, effects: Floats, before: float, angle: Callable[..., Floats]
) -> Floats:
    """Give the pressure (kPa) that moves an actuator whose effects see the angle that comes of it.

    Parameters
    ----------
    pressure : (n,) array
        Mean over each step, kPa.
    level : (n,) array
        Step lengths, as indices into `STEPS_S`.
    effects : array
        Parameters of all effects, NaN where absent.
    before : float
        Angle before the first step, deg.
    angle : callable
        Pressures -> angles (deg) at the ends of the steps, from one and the same state.
    """
    own = list(acting(effects, "actuator"))
    lengths = STEPS_S[level]
    time = np.cumsum(lengths) - 0.5 * lengths
    if not any(effect.sees_angle for effect, _ in own):
        for effect, values in own:
            pressure = acted(effect, values, pressure, time)
        return pressure

    def pushed(moving: Floats) -> Floats:
        ends = angle(moving)
        middle = 0.5 * (ends + np.concatenate([[before], ends[:-1]]))
        found = pressure
        for effect, values in own:
            seen = (middle,) if effect.sees_angle else ()
            found = acted(effect, values, found, *seen, time)
        return found

    return _fixed_point(pushed, pressure)


def _fixed_point(function: Callable[[Floats], Floats], start: Floats) -> Floats:
    """Find what a function leaves as it is (Walker and Ni 2011, doi:10.1137/10078356X).

    What comes nearest to it where none is found: a search may try an effect that is too steep.
    """
    x, size = start, float(np.abs(start).max(initial=1e-9))
    points: list[Floats] = []
    changes: list[Floats] = []
    best, least = start, np.inf
    for _ in range(_MOST):
        points, changes = [*points[-_KEPT:], x], [*changes[-_KEPT:], function(x) - x]
        left = float(np.abs(changes[-1]).max(initial=0.0))
        if left < least:
            best, least = x, left
        if left <= _SETTLED * size:
            break
        x = points[-1] + changes[-1]
        if len(points) > 1:
            d = np.diff(np.array(changes), axis=0).T
            share, *_ = np.linalg.lstsq(d, changes[-1], rcond=1e-10)
            x = x - (np.diff(np.array(points), axis=0).T + d) @ share
        x = np.clip(x, -_FAR * size, _FAR * size)
    return best
