"""After each change the pressure goes too far, and settles.

Regulators are loops with more or less damping: one overshoot, or a few swings that end before the
actuator has settled. Seen in the steps of a proportional one (chukhanhhoang/SoftRoboticSetupFesto),
which go too far by 1.5 %.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude, shape


def overshoot(
    pressure_kpa: Floats, time_s: Floats, fraction: float, period_s: float, damping: float
) -> Floats:
    """Add to each change a swing that begins at zero and has its peak at `fraction` of it."""
    step_s = float(time_s[1] - time_s[0]) if time_s.size > 1 else 0.02
    rate = 2.0 * math.pi / period_s
    split = cmath.sqrt(damping**2 - 1.0) * rate
    if abs(split) < 1e-6 * rate:
        split = 1e-6 * rate + 0j
    swing = swings(pressure_kpa, step_s, -damping * rate, split)
    return np.asarray(pressure_kpa + fraction * rate / peak(damping) * swing)


@njit
def swings(signal: Floats, step_s: float, middle: float, split: complex) -> Floats:
    """Mean over each step of a second-order system that changes push, its poles apart by twice."""
    out = np.empty_like(signal)
    above, below = middle + split, middle - split
    keep_above, keep_below = np.exp(above * step_s), np.exp(below * step_s)
    mean_above = (keep_above - 1.0) / (above * step_s) / (2.0 * split)
    mean_below = (keep_below - 1.0) / (below * step_s) / (2.0 * split)
    one, other, before = 0j, 0j, 0.0
    for i in range(signal.size):
        change = signal[i] - before
        before = signal[i]
        one += change
        other += change
        out[i] = (mean_above * one - mean_below * other).real
        one *= keep_above
        other *= keep_below
    return out


def peak(damping: float) -> float:
    """Largest value of the swing that a unit step leaves, its rate being 1."""
    beyond = damping**2 - 1.0
    if abs(beyond) < 1e-6:
        return math.exp(-1.0)
    if beyond < 0.0:
        return math.exp(-damping * math.acos(damping) / math.sqrt(-beyond))
    return math.exp(-damping * math.acosh(damping) / math.sqrt(beyond))


EFFECT = Effect(
    id="drive_overshoot",
    stage="drive",
    parameters=(
        amplitude(
            "fraction",
            "1",
            "share of a change that is too much at the peak",
            spread=0.1,
            high=1.0,
            start=0.08,
        ),
        shape(
            "period_s",
            "s",
            "time of one swing without damping",
            centre=1.5,
            factor=2.0,
            low=0.15,
            high=20.0,
            starts=(1.0, 3.0),
        ),
        shape(
            "damping",
            "1",
            "how soon it settles: 1 is without swings, less rings",
            centre=0.4,
            factor=2.0,
            low=0.03,
            high=2.0,
        ),
    ),
    name="overshoot of the regulator",
    means="after each change of the command the pressure goes too far, and settles or rings",
    remedy="lower the regulator's gain, or let it settle before a reading counts",
    shown_in=("release",),
    equivalents={
        "body_mode": Check(
            "close a valve at the actuator's inlet right after a step",
            "a body goes on swinging, a regulator's overshoot cannot reach it any more",
        )
    },
    act=overshoot,
    odds=RARER,
)
