"""Plain slow twins of the free-form laws."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from spa_fo.plant.chain import Chain
from spa_fo.plant.effects.library import absent
from spa_fo.plant.law import Law
from spa_fo.plant.memory import STEPS_S


def stepped(chain: Chain, law: Law, x: np.ndarray) -> np.ndarray:
    """Angles (deg) found step by step, each solved by trial for the load that agrees with it."""
    step_s = STEPS_S[chain.grid.fading]
    added = np.zeros(step_s.size)
    bare = chain._load(absent(), np.zeros(2))
    # By linearity: the response to a unit load in each step.
    reply = np.empty((step_s.size, step_s.size))
    for j in range(step_s.size):
        unit = np.zeros(step_s.size)
        unit[j] = 1.0 / chain.reference_kpa
        reply[:, j] = chain._moved(unit, x, absent(), chain.memory.copy())[0]
    free = chain._moved(bare.copy(), x, absent(), chain.memory.copy())[0]
    for i in range(step_s.size):
        for _ in range(60):
            angle = free[: i + 1] + reply[: i + 1, : i + 1] @ added[: i + 1]
            added[i] = law.of_motion(angle, step_s[: i + 1])[0][i]
    return free + reply @ added


def relaxing(angle: np.ndarray, step_s: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """∫ e^{−(t−s)/τ} dθ by many small steps, mean over each step."""
    out = np.empty((angle.size, times_s.size))
    for k, tau in enumerate(times_s):
        state, before = 0.0, 0.0
        for i, length in enumerate(step_s):
            pieces = 4000
            h = length / pieces
            total = 0.0
            for _ in range(pieces):
                after = (state + (angle[i] - before) / pieces) * np.exp(-h / tau)
                total += 0.5 * (state + after) / pieces
                state = after
            out[i, k] = total
            before = angle[i]
    return out


def filled(command: np.ndarray, starts: np.ndarray, law: Law) -> np.ndarray:
    """Pressure by Euler's rule with steps a hundred times as short, mean over each cell."""
    out = np.empty(command.size)
    for first, end in pairwise(starts):
        p = 0.0
        for i in range(first, end):
            total = 0.0
            for _ in range(100):
                after = p + 0.02 / 100 * float(law.at(np.array([command[i] - p]))[0])
                total += 0.5 * (p + after) / 100
                p = after
            out[i] = total
    return out


def curvature(law: Law) -> float:
    """∫ f''² over the knots' range, that range being 1, by differences."""
    t = np.linspace(0.0, 1.0, 20001)
    width = float(np.ptp(law.knots))
    f = law.at(law.knots[0] + width * t)
    second = np.diff(f, 2) / (t[1] - t[0]) ** 2
    return float(np.sum(second**2) * (t[1] - t[0]))
