"""Whether a trial's command does what campaign.yaml says it does."""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Bools, Floats

_MOVING = 0.005  # of the command's range, from one sample to the next
_CHANGE = 0.05  # of the range: the smallest change that counts
_SLOW_S = 2.0  # a change that takes this long is a ramp
_PLATEAU_S = 0.25  # changes nearer to each other than this are one
_AWAY = 5.0  # times what two rows to either side differ by, from which on one is alone. Assumed.


def command_changes(t_s: Floats, command_kpa: Floats) -> Floats:
    """Return the sudden changes of a command (kPa, signed, in order), ramps of a blink merged.

    A command that is constant but not zero rose before its first sample: that is one change.
    Noise, and ramps that last 2 s or creep by less than 0.5 % of the range a sample, are none.
    """
    span = float(np.ptp(command_kpa))
    if span == 0.0:
        return np.array([level for level in command_kpa[:1] if level != 0.0], dtype=np.float64)
    moving = np.flatnonzero(np.abs(np.diff(command_kpa)) > _MOVING * span)
    if moving.size == 0:
        return np.empty(0)
    steps = np.diff(command_kpa)[moving]
    apart = np.diff(t_s[moving + 1]) > _PLATEAU_S
    turned = np.sign(steps[1:]) != np.sign(steps[:-1])
    cuts = np.flatnonzero(apart | turned) + 1
    changes = [
        float(sizes.sum())
        for sizes, times in zip(np.split(steps, cuts), np.split(t_s[moving], cuts), strict=True)
        if times[-1] - times[0] < _SLOW_S
    ]
    return np.array([size for size in changes if abs(size) > _CHANGE * span], dtype=np.float64)


def lone_rows(command_kpa: Floats) -> Bools:
    """Find commands of a single row, far off two alike rows to either side.

    A line that lost two equal bytes passes its checksum: 88.61 becomes .61.
    """
    found = np.zeros(command_kpa.shape, dtype=np.bool_)
    if command_kpa.size < 5:
        return found
    about = np.lib.stride_tricks.sliding_window_view(command_kpa, 5)
    beside = np.delete(about, 2, axis=1)
    low, high = beside.min(axis=1), beside.max(axis=1)
    away = np.maximum(low - about[:, 2], about[:, 2] - high)
    least = _CHANGE * float(np.ptp(command_kpa))
    found[2:-2] = away > np.maximum(_AWAY * (high - low), least)
    return found


def contradiction(protocol: str, t_s: Floats, command_kpa: Floats) -> str | None:
    """Say how a command contradicts its protocol, or return None.

    ``step`` and ``step_release`` must rise exactly once and suddenly (a log may end before the
    release, and begin at its full command: then it rose at the first sample), ``staircase`` at
    least twice one way, ``triangle`` not by jumps; every protocol but ``free`` must command
    something.
    """
    if protocol == "free":
        return None
    if not np.any(command_kpa != 0.0):
        return "its command is 0 throughout"
    changes = command_changes(t_s, command_kpa)
    rises = int(np.count_nonzero(changes > 0.0))
    falls = int(np.count_nonzero(changes < 0.0))
    if rises == 0 and command_kpa[0] >= (1.0 - _CHANGE) * command_kpa.max() > 0.0:
        rises = 1
    if protocol in ("step", "step_release") and rises != 1:
        return f"its command rises {rises} times; expected one step"
    if protocol == "staircase" and max(rises, falls) < 2:
        return f"its command rises {rises} times and falls {falls} times; expected several steps"
    if protocol == "triangle":
        jump = _largest_jump(t_s, command_kpa)
        if jump > 0.5 * np.ptp(command_kpa):
            return f"its command jumps by {jump:g} kPa; expected ramps"
    return None


def _largest_jump(t_s: Floats, command_kpa: Floats) -> float:
    """Largest change of a command within a blink, kPa; a constant one rose before its log."""
    if np.ptp(command_kpa) == 0.0:
        return float(abs(command_kpa[0]))
    later = np.interp(t_s + _PLATEAU_S, t_s, command_kpa)
    return float(np.abs(later - command_kpa).max())


def odd_level(levels_kpa: Floats) -> int | None:
    """Find the trial that does not belong to its experiment by its level of command.

    Parameters
    ----------
    levels_kpa : ndarray, shape (n,)
        The largest command of each trial of one experiment with one setpoint.

    Returns
    -------
    int or None
        The one farthest from the median, if that is by more than a factor of 1.5.
    """
    ratio = np.abs(np.log(levels_kpa / np.median(levels_kpa)))
    worst = int(np.argmax(ratio))
    return worst if ratio[worst] > np.log(1.5) else None
