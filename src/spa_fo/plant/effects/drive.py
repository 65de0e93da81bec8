"""Commanded pressure -> true pressure, on the finest grid.

Delay, play, limit and droop are the pump's, and so is a leak about its valves; the line comes last.
Everything but the play of the pump has faded between two trials, so each trial starts from rest.
"""

from __future__ import annotations

import math

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.dead_time import delay_cells
from spa_fo.plant.effects.drive_backlash import follow_with_play
from spa_fo.plant.effects.leak import lose
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.line_lag import through_orifice
from spa_fo.plant.effects.shared import low_pass, poles
from spa_fo.plant.effects.slew_limit import slew
from spa_fo.plant.effects.supply_droop import droop

DEAD_TIME = LIBRARY["dead_time"].first
LINE_LAG = LIBRARY["line_lag"].first
SUPPLY_DROOP = LIBRARY["supply_droop"].first
LEAK = LIBRARY["leak"].first
SLEW_LIMIT = LIBRARY["slew_limit"].first
DRIVE_BACKLASH = LIBRARY["drive_backlash"].first


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
        delay_cells(p, starts, e[DEAD_TIME], e[DEAD_TIME + 1])
    if not math.isnan(e[DRIVE_BACKLASH]):
        width, centre, kept, wait, vented, vent, ready, late = e[
            DRIVE_BACKLASH : DRIVE_BACKLASH + 8
        ]
        follow_with_play(p, starts, width, centre, kept, wait, vented, vent, ready, late, play)
    if not math.isnan(e[SLEW_LIMIT]):
        rise, ratio, approach, backpressure, vent = e[SLEW_LIMIT : SLEW_LIMIT + 5]
        slew(p, starts, rise, ratio, approach, backpressure, vent)
    if not math.isnan(e[SUPPLY_DROOP]):
        fraction, recovery, slow, exponent, throttled, slower, steady, building = e[
            SUPPLY_DROOP : SUPPLY_DROOP + 8
        ]
        droop(p, starts, fraction, recovery, slow, exponent, throttled, slower, steady, building)
    if not math.isnan(e[LEAK]):
        rate, makeup, carried, renewal, below, kept, opens = e[LEAK : LEAK + 7]
        lose(p, starts, rate, makeup, carried, renewal, below, kept, opens)
    if not math.isnan(e[LINE_LAG]):
        share, excess, rooted = e[LINE_LAG + 2], e[LINE_LAG + 3], e[LINE_LAG + 4]
        slow, fast, latest = poles(e[LINE_LAG], e[LINE_LAG + 1], share)
        tail = p.copy()
        if rooted > 0.0:
            orifice = p.copy()
            through_orifice(orifice, starts, e[LINE_LAG], excess)
        low_pass(tail, starts, latest, excess)
        low_pass(p, starts, slow, excess)
        low_pass(p, starts, fast, excess)
        p += share * (tail - p)
        if rooted > 0.0:
            p += rooted * (orifice - p)
    return p
