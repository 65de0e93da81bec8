"""Commanded pressure -> true pressure, on the finest grid.

Everything but the play of the pump has faded between two trials, so each trial starts from rest.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spa_fo._jit import njit
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.memory import FINEST_STEP_S

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

DEAD_TIME = LIBRARY["dead_time"].first
LINE_LAG = LIBRARY["line_lag"].first
SUPPLY_DROOP = LIBRARY["supply_droop"].first
LEAK = LIBRARY["leak"].first
SLEW_LIMIT = LIBRARY["slew_limit"].first
DRIVE_BACKLASH = LIBRARY["drive_backlash"].first

_SLOWER = 5.0  # the slow part of the supply's recovery, against the fast one
_DT = FINEST_STEP_S


@njit
def drive_pressure(command: Floats, starts: Integers, e: Floats, play: Floats) -> Floats:
    """Turn the command into the true pressure (kPa), both as means over cells of `FINEST_STEP_S`.

    Parameters
    ----------
    command : (n,) array
        All trials one after the other.
    starts : (trials + 1,) array
        First cell of each trial, and n.
    e : array
        Parameters of all effects, NaN where absent.
    play : (2,) array
        Position of a pump with play, kPa, and whether it has one; carried on in place.
    """
    p = command.copy()
    if not math.isnan(e[DEAD_TIME]):
        _delay(p, starts, e[DEAD_TIME])
    if not math.isnan(e[DRIVE_BACKLASH]):
        _backlash(p, e[DRIVE_BACKLASH], e[DRIVE_BACKLASH + 1], play)
    if not math.isnan(e[SLEW_LIMIT]):
        _slew(p, starts, e[SLEW_LIMIT], e[SLEW_LIMIT + 1], e[SLEW_LIMIT + 2])
    if not math.isnan(e[SUPPLY_DROOP]):
        _droop(p, starts, e[SUPPLY_DROOP], e[SUPPLY_DROOP + 1], e[SUPPLY_DROOP + 2])
    if not math.isnan(e[LINE_LAG]):
        slow, fast = poles(e[LINE_LAG], e[LINE_LAG + 1])
        _low_pass(p, starts, slow)
        _low_pass(p, starts, fast)
    if not math.isnan(e[LEAK]):
        _leak(p, starts, e[LEAK], e[LEAK + 1])
    return p


@njit
def poles(time_constant: float, second: float) -> tuple[float, float]:
    """Share a time constant out to two poles."""
    return time_constant * (1.0 - second), time_constant * second


@njit
def _delay(p: Floats, starts: Integers, delay: float) -> None:
    """Delay by a fraction of cells; the means are held cell by cell."""
    cells = delay / _DT
    whole = int(cells)
    part = cells - whole
    for trial in range(starts.size - 1):
        first, end = starts[trial], starts[trial + 1]
        for i in range(end - 1, first - 1, -1):
            near = p[i - whole] if i - whole >= first else 0.0
            far = p[i - whole - 1] if i - whole - 1 >= first else 0.0
            p[i] = (1.0 - part) * near + part * far


@njit
def _backlash(p: Floats, width: float, centre: float, play: Floats) -> None:
    """Play operator: the pressure stays between command - width(1 - centre) and + width·centre."""
    position = play[0]
    for i in range(p.size):
        position = min(max(position, p[i] - width * (1.0 - centre)), p[i] + width * centre)
        p[i] = position
    play[0] = position
    play[1] = 1.0


@njit
def _slew(p: Floats, starts: Integers, rise: float, ratio: float, approach: float) -> None:
    """Follow the command at a limited rate, exponentially at the end; exact over a cell."""
    decay = math.exp(-_DT / approach)
    for trial in range(starts.size - 1):
        now = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            before = now
            rest = p[i] - now
            rate = rise if rest > 0.0 else rise * ratio
            ramp = abs(rest) - rate * approach  # so much of the way at full rate
            sign = 1.0 if rest > 0.0 else -1.0
            if ramp <= 0.0:
                now = p[i] - rest * decay
            elif ramp >= rate * _DT:
                now += sign * rate * _DT
            else:
                left = _DT - ramp / rate
                now = p[i] - sign * rate * approach * math.exp(-left / approach)
            p[i] = 0.5 * (before + now)


@njit
def _droop(p: Floats, starts: Integers, fraction: float, recovery: float, slow: float) -> None:
    """Miss `fraction` of each rise, recovering by two exponentials."""
    quick = math.exp(-_DT / recovery)
    lazy = math.exp(-_DT / (_SLOWER * recovery))
    for trial in range(starts.size - 1):
        before = fast_missing = slow_missing = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            rise = fraction * max(p[i] - before, 0.0)
            before = p[i]
            fast_missing = quick * fast_missing + (1.0 - slow) * rise
            slow_missing = lazy * slow_missing + slow * rise
            missing = fast_missing + slow_missing
            if missing > 0.0 and missing > before:  # an empty chamber misses nothing
                share = max(before, 0.0) / missing
                fast_missing *= share
                slow_missing *= share
                missing *= share
            p[i] = before - missing


@njit
def _low_pass(p: Floats, starts: Integers, time_constant: float) -> None:
    """First-order lag; means over cells of an input that is constant in each."""
    if time_constant < 1e-4:
        return
    x = _DT / time_constant
    keep = math.exp(-x)
    mean = -math.expm1(-x) / x
    for trial in range(starts.size - 1):
        now = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            distance = now - p[i]
            p[i] += distance * mean
            now = p[i] - distance * mean + distance * keep


@njit
def _leak(p: Floats, starts: Integers, rate: float, makeup: float) -> None:
    """Lose pressure in proportion to itself; the supply makes good in proportion to the loss."""
    for trial in range(starts.size - 1):
        lost = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            lost += _DT * (rate * max(p[i] - lost, 0.0) - makeup * lost)
            lost = min(lost, max(p[i], 0.0))
            p[i] -= lost
