"""Play in the pump: after a reversal of the command the pressure waits, for so far or so long."""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Effect, Parameter, amplitude, share
from spa_fo.plant.effects.shared import REACHED_KPA
from spa_fo.plant.memory import FINEST_STEP_S

_TURNS = 0.005  # of the largest command: a logged one that goes back by less has not turned

EFFECT = Effect(
    id="drive_backlash",
    stage="drive",
    parameters=(
        amplitude(
            "play_kpa",
            "kPa",
            "change of the command without a change of the pressure",
            spread=2.0,
            high=300.0,
            start=1.0,
        ),
        share(
            "centre",
            "where the play stands about the command: 0.5 is in the middle",
            centre=0.5,
        ),
        Parameter(
            *("kept", "1", 0.5, 0.5, 0.0, 1.0),
            starts=(1.0, 0.0),
            means="part of its position that is kept from one trial to the next: 0 is vented",
        ),
        Parameter(
            *("wait_s", "s", 0.0, 0.12, 0.0, 2.0),
            starts=(0.0, 0.6),
            means="how long the pressure stays after a reversal, however far the command goes",
            is_delay=True,
            is_addition=True,
        ),
        Parameter(
            *("vented", "1", 0.0, 0.5, 0.0, 1.0),
            starts=(0.0, 1.0),
            means="part of the pressure that is let out where the command comes to 0, by a valve",
            is_addition=True,
        ),
        Parameter(
            *("vent_s", "s", 0.0, 0.1, 0.0, 2.0),
            starts=(0.0,),
            means="time in which most of that is let out",
            is_addition=True,
        ),
        Parameter(
            *("ready", "1", 0.0, 0.5, 0.0, 1.0),
            starts=(0.0, 1.0),
            means="part of the wait that is over where a trial's command first moves",
            is_addition=True,
        ),
        Parameter(
            *("catch_up", "1", 0.0, 0.25, 0.0, 1.0),
            starts=(0.2,),
            means="time in which most of what was missed in a wait is caught up, in waits",
            is_addition=True,
        ),
    ),
    name="backlash of the drive",
    means="after a reversal of the command the pressure waits, as in a spindle or a dead band",
    remedy="take the play out of the pump's spindle, or approach every level from the same side",
    shown_in=("release", "levels"),
    carries_on=True,
)


@njit
def fading(time_s: float, part: float = 1.0) -> tuple[float, float]:
    """Say what is left of something that fades after a part of a cell, and on average over it."""
    if time_s <= 0.0:
        return 0.0, 0.0
    keep = math.exp(-part * FINEST_STEP_S / time_s)
    return keep, (1.0 - keep) * time_s / (part * FINEST_STEP_S)


@njit
def follow_with_play(
    p: Floats,
    starts: Integers,
    width: float,
    centre: float,
    kept: float,
    wait: float,
    vented: float,
    vent_s: float,
    ready: float,
    catch_up: float,
    play: Floats,
) -> None:
    """Play operator: the pressure stays between command - width(1 - centre) and + width·centre.

    After a reversal it stays for `wait`, s, as well, and where a trial's command first moves for
    what of that is not over by the part `ready`; what is missed meanwhile it catches up
    exponentially, with `catch_up` times that wait. A command that comes to 0 lets out the part
    `vented` of it, exponentially with the time `vent_s`. `play` is the position, kPa, and whether
    there is any; carried on in place. Of it a trial, whose first cell is in `starts`, begins with
    the part `kept`.
    """
    position, cells = play[0], wait / FINEST_STEP_S
    least = _TURNS * np.abs(p).max() if p.size else 0.0
    idle, letting = True, 0.0  # what is still to be let out
    keep, mean = fading(vent_s)
    behind, waiting = 0.0, False  # what is still to be caught up, and whether that still grows
    takes, late = 0.0, (0.0, 0.0)  # how long that takes, s, and what is left of it
    for trial in range(starts.size - 1):
        position, behind, waiting = kept * (position - behind), 0.0, False
        letting *= kept
        farthest, way, since, told = 0.0, 0.0, cells, 0.0
        for i in range(starts[trial], starts[trial + 1]):
            earlier, told = told, p[i]
            gone = told - farthest
            if abs(gone) > least and (way == 0.0 or way * gone < 0.0):
                since = 0.0 if way != 0.0 else ready * cells
                way = math.copysign(1.0, gone)
                position, behind = position - behind, 0.0
                takes = catch_up * (cells - since) * FINEST_STEP_S
                late = fading(takes)
            if way * gone > 0.0:
                farthest = told
            since += 1.0
            follows = min(max(since - cells, 0.0), 1.0)  # for which part of the cell
            before = position
            waiting = waiting or follows < 1.0
            left = late
            if follows > 0.0:
                position = min(max(position, told - width * (1.0 - centre)), told + width * centre)
                if waiting:  # all was missed that was told until the wait ended
                    ended = earlier + (1.0 - follows) * (told - earlier)
                    missed = max(before, ended - width * (1.0 - centre))
                    behind, waiting = min(missed, ended + width * centre) - before, False
                    left = fading(takes, follows)
                p[i] = before + follows * (position - before - behind * left[1])
                behind *= left[0]
            else:
                p[i] = before
            if abs(told) > least:
                idle, letting = False, 0.0
                continue
            if not idle:
                idle, letting = True, vented * position
            if abs(letting) > REACHED_KPA:
                position, behind = position - behind, 0.0
                letting = math.copysign(min(abs(letting), vented * abs(position)), position)
                p[i] = position - letting * (1.0 - mean)
                position -= letting * (1.0 - keep)
                letting *= keep
    play[0] = position - behind
    play[1] = 1.0


def resting_kpa(width: float, centre: float, kept: float, vented: float) -> float:
    """Pressure that a pump with play leaves in the actuator after a trial, kPa."""
    return (1.0 - vented) * kept * width * centre
