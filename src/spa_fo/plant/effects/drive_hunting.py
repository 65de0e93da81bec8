"""The regulator hunts: within its dead band the pressure falls, and is corrected, over and over.

A limit cycle. On a line that loses air a regulator that acts only beyond a threshold makes a saw's
teeth below the command; one whose loop rings goes to and fro about it. The dead band alone, without
a loss, is the play of `drive_backlash`: a small reversal of the command changes nothing. Not seen
in the logs at hand, whose regulators hold within 0.1 kPa.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude, shape, share

_STILL_KPA = 1e-9
_SUDDEN = 0.01  # of a period, in which it comes back all at once


def hunt(
    pressure_kpa: Floats,
    time_s: Floats,
    fall: float,
    period_s: float,
    back: float,
    about: float,
) -> Floats:
    """Let a held pressure fall by a share and come back each period, from each change on."""
    step_s = float(time_s[1] - time_s[0]) if time_s.size > 1 else 0.02
    moved = np.abs(np.diff(pressure_kpa, prepend=0.0)) > _STILL_KPA
    since = np.maximum.accumulate(np.where(moved, np.arange(moved.size), 0))
    cell = step_s / period_s
    begins = np.asarray((np.arange(moved.size) - since) * cell, dtype=np.float64)
    turn = 1.0 - max(0.5 * back, _SUDDEN)
    begins += about * turn  # from the command itself on
    lost = (_teeth(begins + cell, turn) - _teeth(begins, turn)) / cell - about
    return np.asarray(pressure_kpa * (1.0 - fall * lost))


def _teeth(x: Floats, turn: float) -> Floats:
    """Integral of teeth that rise from 0 to 1 up to `turn` of a length of 1, and fall again."""
    whole = np.floor(x)
    rises, falls = np.minimum(x - whole, turn), np.maximum(x - whole - turn, 0.0)
    own = 0.5 * rises**2 / turn + falls - 0.5 * falls**2 / (1.0 - turn)
    return np.asarray(0.5 * whole + own)


EFFECT = Effect(
    id="drive_hunting",
    stage="drive",
    parameters=(
        amplitude(
            "fall",
            "1",
            "share of the pressure that is lost before it is corrected",
            spread=0.1,
            high=1.0,
            start=0.08,
        ),
        shape(
            "period_s",
            "s",
            "time from one correction to the next",
            centre=2.0,
            factor=3.0,
            low=0.1,
            high=60.0,
            starts=(0.7, 2.0, 6.0),
        ),
        share("back", "how slowly it comes back: at 1 as slowly as it falls", centre=0.1),
        share("about", "part of it that is above the command", centre=0.1),
    ),
    name="hunting of the regulator",
    means="a held pressure falls within the regulator's dead band and is corrected, over and over, "
    "or swings about the command",
    remedy="seal the line, or narrow the regulator's dead band",
    shown_in=("hold",),
    check=Check(
        "hold one pressure for a minute, and look at the measured pressure for a saw's teeth",
        "a regulator that hunts shows them, as regular as its loss",
    ),
    equivalents={
        "leak": Check(
            "close a valve at the regulator's outlet while a pressure is held",
            "a leak lets it fall on and on, a regulator's corrections stop",
        )
    },
    act=hunt,
    odds=RARER,
)
