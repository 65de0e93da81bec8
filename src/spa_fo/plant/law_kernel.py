"""The linear plant under a law that follows its motion, solved step by step."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.memory import STEPS_S, coast, keep_modes, push, rises, stepper

Complexes = NDArray[np.complex128]

MOMENT, DAMPING, RELAXATION = range(3)
"""What a law is of: the middle of a step, its rate, or what is left of all changes."""

_TURNS = 60  # of Newton's method, bisecting where it leaves its bracket
_SETTLED_DEG = 1e-9


@njit
def follow(
    load: Floats,
    level: Integers,
    x: Floats,
    nodes: Complexes,
    angles: Floats,
    node_weights: Complexes,
    keep: Complexes,
    gain: Complexes,
    tilt: Complexes,
    modes: Complexes,
    kind: int,
    over: Floats,
    values: Floats,
    reference_kpa: float,
) -> Floats:
    """Step the angle (deg) to the end of each step; NaN from where no motion agrees with the law.

    Parameters
    ----------
    load, level, x, nodes, angles, node_weights, keep, gain, tilt, modes
        As for `spa_fo.plant.effects.actuator.move`; `modes` is carried on in place.
    kind : int
        What the law is of.
    over, values : (k,) arrays
        The law as an even table, in degrees or degrees per second and kPa; relaxation times (s)
        and kPa per degree where it is a spectrum.
    reference_kpa : float
        Pressure at which u = 1.
    """
    linear = stepper(x, nodes, angles, node_weights, keep, gain, tilt, modes)
    rising = rises(load, level)
    direct = np.degrees(linear.direct)
    stress = np.zeros(over.size)
    out = np.empty(load.size)
    angle = 0.0
    for i in range(load.size):
        k = level[i]
        h = STEPS_S[k]
        free = math.degrees(coast(linear, k) + linear.leaning[k] * rising[i])
        new = angle
        low, high = -math.inf, math.inf
        solved = False
        for _ in range(_TURNS):
            added, slope = _law(kind, over, values, angle, new, h, stress)
            excess = new - free - direct[k] * (load[i] + added / reference_kpa)
            if excess > 0.0:
                high = min(high, new)
            else:
                low = max(low, new)
            steep = 1.0 - direct[k] * slope / reference_kpa
            after = new - excess / steep if steep > 0.0 else math.nan
            if not low <= after <= high:
                after = 0.5 * (low + high)
            solved = abs(after - new) < _SETTLED_DEG
            new = after
            if solved or not math.isfinite(new):
                break
        if not solved:
            out[i:] = math.nan
            break
        added, _ = _law(kind, over, values, angle, new, h, stress)
        v = load[i] + added / reference_kpa
        push(linear, k, v, rising[i])
        if kind == RELAXATION:
            for j in range(over.size):
                lost = -math.expm1(-h / over[j])
                stress[j] = stress[j] * (1.0 - lost) + (new - angle) * lost * over[j] / h
        angle = new
        out[i] = angle
    keep_modes(linear, modes)
    return out


@njit
def _law(
    kind: int, over: Floats, values: Floats, angle: float, new: float, h: float, stress: Floats
) -> tuple[float, float]:
    """Give what the law adds over a step from `angle` to `new`, kPa, and its slope over `new`."""
    if kind == RELAXATION:
        added, slope = 0.0, 0.0
        for j in range(over.size):
            ratio = h / over[j]
            lost = -math.expm1(-ratio)
            kept = (1.0 - lost / ratio) / ratio
            added -= values[j] * ((new - angle) * kept + stress[j] * lost / ratio)
            slope -= values[j] * kept
        return added, slope
    share = 0.5 if kind == MOMENT else 1.0 / h
    at = 0.5 * (angle + new) if kind == MOMENT else (new - angle) / h
    step = over[1] - over[0]
    k = min(max(int((at - over[0]) / step), 0), over.size - 2)
    rise = (values[k + 1] - values[k]) / step
    return values[k] + rise * (at - over[k]), rise * share
