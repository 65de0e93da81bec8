"""After each change the pressure goes too far, and settles.

Seen in the pressures of regulators, which are loops with little damping: one overshoot, or a few
swings that end before the actuator has settled.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
from scipy.signal import lfilter

from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude, shape
from spa_fo.plant.effects.shared import Floats


def overshoot(
    pressure_kpa: Floats, time_s: Floats, fraction: float, period_s: float, damping: float
) -> Floats:
    """Add to each change a swing that begins at zero and has its peak at `fraction` of it."""
    step_s = float(time_s[1] - time_s[0]) if time_s.size > 1 else 0.02
    rate = 2.0 * math.pi / period_s
    split = cmath.sqrt(damping**2 - 1.0) * rate
    if abs(split) < 1e-6 * rate:
        split = 1e-6 * rate + 0j
    # Of a unit step: (e^{+t} - e^{-t}) with both poles, of which each step takes the mean.
    out = np.zeros(pressure_kpa.size, dtype=np.complex128)
    change = np.diff(pressure_kpa, prepend=0.0)
    for sign in (1.0, -1.0):
        pole = -damping * rate + sign * split
        keep = np.exp(pole * step_s)
        mean = (keep - 1.0) / (pole * step_s)
        out += sign * mean * lfilter([1.0], [1.0, -keep], change)
    return np.asarray(pressure_kpa + fraction * (out / (2.0 * split)).real * rate / peak(damping))


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
            "log the pressure with a tap in the line, close to the actuator",
            "a regulator that overshoots shows there, a body that swings does not",
        )
    },
    act=overshoot,
    odds=RARER,
)
