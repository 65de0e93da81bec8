"""What a command does, in the contract's words, and whether two trials command the same."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.rig.campaign import Protocol
from spa_fo.rig.protocol_check import command_changes, contradiction

_POINTS = 400  # a command is looked at on so many evenly spaced points
_HOLD_S = 30.0  # a pressure held longer than a step's is a hold
_RESTLESS = 0.1  # share of rows in which a staircase's command moves, at most
_RAMPING = 0.4  # share of a triangle's time in which its command moves
_ALIKE = 0.02  # of the range: mean difference of two commands that are one
_LONGER = 1.2  # durations of two trials of one command differ by less than this factor


def guess_protocol(t_s: Floats, command: Floats) -> tuple[Protocol, str]:
    """Guess the protocol of a trial.

    Parameters
    ----------
    t_s, command : ndarray, shape (n,)
        Rising times, s, and the command in any unit.

    Returns
    -------
    (str, str)
        The protocol, and a doubt in words, empty where there is none. ``free`` is always right.
    """
    protocol, doubt = _by_changes(t_s, command)
    if contradiction(protocol, t_s, command) is not None:
        return "free", ""
    return protocol, doubt


def same_command(first: tuple[Floats, Floats], second: tuple[Floats, Floats]) -> bool:
    """Say whether two trials, each of times (s) and command, were driven alike.

    What counts is the command from its first change on: rests before it may differ.
    """
    (t, u), (s, v) = _from_first_change(*first), _from_first_change(*second)
    if not 1.0 / _LONGER < t[-1] / s[-1] < _LONGER:
        return False
    reach = max(np.abs(u).max(), np.abs(v).max())
    if reach == 0.0:
        return False
    grid = np.linspace(0.0, min(t[-1], s[-1]), _POINTS)
    difference = np.abs(_held(grid, t, u) - _held(grid, s, v))
    return bool(difference.mean() < _ALIKE * reach)


def _by_changes(t_s: Floats, command: Floats) -> tuple[Protocol, str]:
    if np.ptp(command) == 0.0:
        return "hold", "its command never changes"
    if _is_triangle(t_s, command):
        return "triangle", ""
    changes = command_changes(t_s, command)
    signs = np.sign(changes).tolist()
    if signs == [1.0]:
        return "step", ""
    if signs == [1.0, -1.0]:
        held = _longest_above(t_s, command)
        if held > _HOLD_S:
            return "hold", f"held for {held:.0f} s; or step_release"
        return "step_release", ""
    if any(a == b for a, b in pairwise(signs)) and _is_held(command):
        return "staircase", ""
    return "free", ""


def _longest_above(t_s: Floats, command: Floats) -> float:
    middle = 0.5 * (command.max() + command.min())
    above = t_s[command > middle]
    return float(above[-1] - above[0])


def _is_held(command: Floats) -> bool:
    """Say whether a command keeps to its levels: a controller's output does not."""
    moving = np.abs(np.diff(command)) > 0.005 * np.ptp(command)
    return bool(np.mean(moving) < _RESTLESS)


def _is_triangle(t_s: Floats, command: Floats) -> bool:
    """Say whether a command ramps up and down at one slope, which a sine does not."""
    grid = np.linspace(t_s[0], t_s[-1], _POINTS)
    slopes = np.diff(np.interp(grid, t_s, command)) / np.ptp(command)
    steepness = np.abs(slopes)
    moving = steepness > 0.1 * np.percentile(steepness, 90.0)
    if np.mean(moving) < _RAMPING or steepness.max() > 0.2:
        return False
    usual = float(np.median(steepness[moving]))
    even = float(np.mean(np.abs(steepness[moving] - usual) < 0.3 * usual))
    up, down = float(np.mean(slopes[moving] > 0)), float(np.mean(slopes[moving] < 0))
    return even > 0.7 and min(up, down) > 0.2


def _from_first_change(t_s: Floats, command: Floats) -> tuple[Floats, Floats]:
    moved = np.abs(command - command[0]) > _ALIKE * np.ptp(command)
    begin = max(int(np.argmax(moved)) - 1, 0) if np.ptp(command) else 0
    return t_s[begin:] - t_s[begin], command[begin:]


def _held(grid: Floats, t_s: Floats, command: Floats) -> Floats:
    return command[np.maximum(np.searchsorted(t_s, grid, side="right") - 1, 0)]
