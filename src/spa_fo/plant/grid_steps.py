"""How long the simulator's steps are: fine after a jump or a corner, and growing in a rest."""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.plant.memory import FINEST_STEP_S, LEVELS

_JUMP = 0.02  # of the largest input, within one cell
_CORNER = 0.02  # of the largest input, by which it leaves its line within `_CORNER_S`
_CORNER_S = 0.32
_GROWTH = 10.0  # a step is at most this part of the time since the last jump or corner
_GROWTH_IN_REST = 5.0  # the same of the time since a rest began, of which no log tells


def step_levels(drive: Floats, largest: float, longest: int) -> Integers:
    """Choose the step levels of one trial."""
    jumps = np.flatnonzero(np.abs(np.diff(drive, prepend=0.0)) > _JUMP * largest)
    jumps = np.union1d(jumps, _corners(drive, jumps, _CORNER * largest))
    jumps = np.append(jumps, drive.size)
    levels = []
    at, since, following = 0, -drive.size, 0
    while at < drive.size:
        while jumps[following] <= at and following < jumps.size - 1:
            since = int(jumps[following])
            following += 1
        room = int(jumps[following] if jumps[following] > at else drive.size) - at
        allowed = max(1.0, (at - since) / _GROWTH)
        level = min(longest, int(np.log2(allowed)), int(np.log2(room)))
        levels.append(level)
        at += 2**level
    return np.array(levels, dtype=np.int64)


def _corners(drive: Floats, jumps: Integers, least: float) -> Integers:
    """Find where a ramp begins, turns or ends: a response bends there nearly as after a jump."""
    width = round(_CORNER_S / FINEST_STEP_S)
    # Three windows about every cell, the drive held before its begin and after its end.
    padded = np.pad(drive, (width + width // 2, 2 * width), mode="edge")
    total = np.concatenate([[0.0], np.cumsum(padded)])
    mean = (total[width:] - total[:-width]) / width
    bend = np.abs(mean[2 * width :] - 2.0 * mean[width:-width] + mean[: -2 * width])[: drive.size]
    for jump in jumps.tolist():
        bend[max(jump - 2 * width, 0) : jump + 2 * width] = 0.0
    found = []
    while bend.max() > least:
        at = int(np.argmax(bend))
        found.append(at)
        bend[max(at - 2 * width, 0) : at + 2 * width] = 0.0
    return np.array(found, dtype=np.int64)


def rest_levels(seconds: float) -> Integers:
    """Split a rest into steps that grow: it may begin with a vent, or while a response goes on."""
    left = max(0, round(seconds / FINEST_STEP_S))
    levels, gone = [], 0
    while left > 0:
        grown = max(1.0, gone / _GROWTH_IN_REST)
        level = min(int(np.log2(grown)), int(np.log2(left)), LEVELS - 1)
        levels.append(level)
        left, gone = left - 2**level, gone + 2**level
    return np.array(levels, dtype=np.int64)
