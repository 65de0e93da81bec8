"""Air flows through a narrow opening: the pressure follows by the root of the difference.

Flow through a valve or a fitting goes about as the root of the pressure across it (Richer and
Hurmuzlu 2000, doi:10.1115/1.1286336, has the choked regime too). So a step of four times the height
takes twice as long, and ends after a finite time. Seen in the pressures of a three-chamber arm
(zhiqiao0256/Soft-Arm-SMART-Controller-), which fill in 0.8 to 1 s and take 1.4 s to vent nearly
all.
"""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import RARER, Check, Effect, amplitude, shape

REFERENCE_KPA = 10.0

_LEVELS = Check(
    "step to several heights from rest",
    "through an orifice a step of four times the height takes twice as long; a line takes as long "
    "for any, and a limited rate four times as long",
)


def flow(pressure_kpa: Floats, time_s: Floats, filling_s: float, venting_ratio: float) -> Floats:
    """Let the pressure follow through an orifice, from rest."""
    step_s = float(time_s[1] - time_s[0]) if time_s.size > 1 else 0.02
    return np.asarray(followed(pressure_kpa, step_s, filling_s, filling_s * venting_ratio))


@njit
def followed(target: Floats, step_s: float, filling_s: float, venting_s: float) -> Floats:
    """Mean over each step of what follows a held target; the root of what lacks falls evenly."""
    out = np.empty_like(target)
    p = 0.0
    for i in range(target.size):
        lack = target[i] - p
        time = filling_s if lack >= 0.0 else venting_s
        if time <= 1e-9 or lack == 0.0:
            p = target[i]
            out[i] = p
            continue
        fall = math.sqrt(REFERENCE_KPA) / time
        root = math.sqrt(abs(lack))
        left = max(root - fall * step_s, 0.0)
        sign = 1.0 if lack > 0.0 else -1.0
        out[i] = target[i] - sign * (root**3 - left**3) / (3.0 * fall * step_s)
        p = target[i] - sign * left * left
    return out


EFFECT = Effect(
    id="orifice_flow",
    stage="drive",
    parameters=(
        amplitude(
            "filling_s",
            "s",
            "time in which a rise of 10 kPa is made up",
            spread=0.3,
            high=10.0,
            start=0.15,
            goes_with=(0.0, -0.5),  # as long to the largest pressure, by the root
        ),
        shape(
            "venting_ratio",
            "1",
            "how much longer a fall takes",
            centre=1.0,
            factor=1.8,
            low=0.1,
            high=10.0,
            starts=(1.4, 0.7),
        ),
    ),
    name="flow through an orifice",
    means="the supply reaches the actuator through a narrow opening; the rate goes as the root of "
    "the pressure difference",
    remedy="use a wider valve, fitting or line, or keep it in the model",
    shown_in=("release", "levels"),
    equivalents={"line_lag": _LEVELS, "slew_limit": _LEVELS},
    act=flow,
    odds=RARER,
)
