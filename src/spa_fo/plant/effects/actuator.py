"""True pressure -> true angle: G(s) with further moments in its loop.

An extra restoring moment n, in rad as the angle that the static actuator loses to it, is a smaller
load: the angle is G applied to v = u - n/K. Steps hold v constant and take n at the middle of the
step, found by Newton's method, so the scheme is implicit and of second order.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spa_fo._jit import njit
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.memory import LEVELS, STEPS_S, Complexes, Floats, mode_weights

Integers = NDArray[np.int64]

STIFFENING = LIBRARY["stiffening"].first
GRAVITY_LOAD = LIBRARY["gravity_load"].first
CONTACT_STOP = LIBRARY["contact_stop"].first
MULLINS_SOFTENING = LIBRARY["mullins_softening"].first
CREEP = LIBRARY["creep"].first
HYSTERESIS = LIBRARY["hysteresis"].first
THERMAL_DRIFT = LIBRARY["thermal_drift"].first

CREEP_TIMES_S = np.logspace(-1.0, 3.5, 10)  # two a decade
_DECADE = 0.5  # of creep time that one element stands for
STOPS = 4
MULLINS_LEVELS = 9
_REFERENCE = math.radians(60.0)
_NEWTON = 6


@njit
def move(
    load: Floats,
    level: Integers,
    time_s: Floats,
    x: Floats,
    e: Floats,
    nodes: Complexes,
    angles: Floats,
    node_weights: Complexes,
    keep: Complexes,
    gain: Complexes,
    modes: Complexes,
    creep: Floats,
    stops: Floats,
    virgin: Floats,
) -> Floats:
    """Step the true angle (rad) to the end of each step.

    Parameters
    ----------
    load : (n,) array
        Mean of u = pressure/reference over each step.
    level : (n,) array
        Step lengths, as indices into `STEPS_S`.
    time_s : (n,) array
        Campaign time at each step's middle.
    x : (5,) array
        alpha2, alpha1, a1, a0, b0.
    e : array
        Parameters of all effects, NaN where absent.
    nodes, angles, node_weights, keep, gain
        The contour.
    modes, creep, stops, virgin
        State, carried on in place: modes of the fractional memory, creep elements (rad), friction
        stops (deg of their own travel; the last entry is the angle, rad), virgin share by level.
    """
    n = nodes.size
    weights, pole = mode_weights(x, nodes, angles, node_weights)
    pole_keep = np.ones(LEVELS, dtype=np.complex128)
    pole_gain = np.zeros(LEVELS, dtype=np.complex128)
    direct = np.zeros(LEVELS)
    creep_keep = np.empty((LEVELS, creep.size))
    for k in range(LEVELS):
        if pole != 0j:
            pole_keep[k] = np.exp(pole * STEPS_S[k])
            pole_gain[k] = (pole_keep[k] - 1.0) / pole
        total = weights[n] * pole_gain[k]
        for j in range(n):
            total += weights[j] * gain[k, j]
        direct[k] = total.imag
        for j in range(creep.size):
            creep_keep[k, j] = math.exp(-STEPS_S[k] / CREEP_TIMES_S[j])

    static = x[4] / x[3]
    stiff = not math.isnan(e[STIFFENING])
    heavy = not math.isnan(e[GRAVITY_LOAD])
    stopped = not math.isnan(e[CONTACT_STOP])
    mullins = not math.isnan(e[MULLINS_SOFTENING])
    rubbing = not math.isnan(e[HYSTERESIS])
    creeping = not math.isnan(e[CREEP])
    drifting = not math.isnan(e[THERMAL_DRIFT])
    looped = stiff or heavy or stopped or mullins or rubbing

    width = math.radians(e[MULLINS_SOFTENING + 4]) / MULLINS_LEVELS if mullins else 0.0
    radii = np.ones(STOPS)
    if rubbing:
        radii = stop_radii(math.radians(e[HYSTERESIS + 1]), e[HYSTERESIS + 2])
    creep_size = np.zeros(creep.size)
    if creeping:
        creep_size = creep_sizes(e[CREEP], e[CREEP + 1], e[CREEP + 2])

    out = np.empty(load.size)
    angle = stops[STOPS]
    for i in range(load.size):
        k = level[i]
        u = load[i]
        if drifting:
            u *= _drift(time_s[i] / 3600.0, e[THERMAL_DRIFT], e[THERMAL_DRIFT + 1])
        free = 0.0
        for j in range(n):
            z = keep[k, j] * modes[j]
            modes[j] = z
            free += weights[j].real * z.imag + weights[j].imag * z.real
        z = pole_keep[k] * modes[n]
        modes[n] = z
        free += weights[n].real * z.imag + weights[n].imag * z.real
        v = u
        if looped:
            new = free + direct[k] * u
            for _ in range(_NEWTON):
                middle = 0.5 * (angle + new)
                moment, slope = 0.0, 0.0
                if stiff:
                    ratio = abs(middle) / _REFERENCE
                    part = e[STIFFENING] * ratio ** e[STIFFENING + 1]
                    moment += part * middle
                    slope += part * (1.0 + e[STIFFENING + 1])
                if heavy:
                    a, b = e[GRAVITY_LOAD], e[GRAVITY_LOAD + 1]
                    moment += a * math.sin(middle) + b * (1.0 - math.cos(middle))
                    slope += a * math.cos(middle) + b * math.sin(middle)
                if stopped:
                    beyond = middle - math.radians(e[CONTACT_STOP])
                    if beyond > 0.0:
                        soft = math.radians(e[CONTACT_STOP + 2])
                        moment += e[CONTACT_STOP + 1] * beyond * beyond / (beyond + soft)
                        slope += (
                            e[CONTACT_STOP + 1]
                            * beyond
                            * (beyond + 2.0 * soft)
                            / (beyond + soft) ** 2
                        )
                if mullins:
                    part, tangent = _virgin_moment(middle, virgin, width, e[MULLINS_SOFTENING + 3])
                    moment += e[MULLINS_SOFTENING] * part
                    slope += e[MULLINS_SOFTENING] * tangent
                if rubbing:
                    part, tangent = _friction(middle - angle, stops, radii)
                    moment += math.radians(e[HYSTERESIS]) * part
                    slope += math.radians(e[HYSTERESIS]) * tangent
                v = u - moment / static
                excess = new - free - direct[k] * v
                change = excess / (1.0 + 0.5 * direct[k] * slope / static)
                new -= change
                if abs(change) < 1e-9:
                    break
            v = (new - free) / direct[k]
        for j in range(n):
            modes[j] += gain[k, j] * v
        modes[n] += pole_gain[k] * v
        new = free + direct[k] * v
        if rubbing:
            _rub(new - angle, stops, radii)
        if mullins:
            _soften(
                angle,
                new,
                STEPS_S[k],
                virgin,
                width,
                e[MULLINS_SOFTENING + 1],
                e[MULLINS_SOFTENING + 2],
            )
        angle = new
        out[i] = angle
        if creeping:
            for j in range(creep.size):
                creep[j] += (1.0 - creep_keep[k, j]) * (creep_size[j] * static * u - creep[j])
                out[i] += creep[j]
    stops[STOPS] = angle
    return out


@njit
def creep_sizes(per_decade: float, typical_s: float, decades: float) -> Floats:
    """Share of the static value that each of the elements at `CREEP_TIMES_S` adds in the end."""
    sizes = np.empty(CREEP_TIMES_S.size)
    for j in range(sizes.size):
        away = math.log10(CREEP_TIMES_S[j] / typical_s) / decades
        sizes[j] = per_decade * _DECADE * math.exp(-0.5 * away * away)
    return sizes


@njit
def _drift(hours: float, rate: float, fading: float) -> float:
    """Gain after so many hours: 1 + rate·t at first, slowing as e^{-fading·t}."""
    if abs(fading * hours) < 1e-6:
        return 1.0 + rate * hours
    return 1.0 - rate * math.expm1(-fading * hours) / fading


@njit
def _virgin_moment(angle: float, virgin: Floats, width: float, share: float) -> tuple[float, float]:
    """Moment of what has not been softened yet, and its slope.

    Chains of the levels that the angle has passed pull (`share` of it), and the whole bundle
    stiffens the actuator as a whole (the rest). Levels are `width` (rad) apart.
    """
    whole = 0.0
    local = 0.0
    tangent = 0.0
    for j in range(virgin.size):
        whole += virgin[j]
        part = min(max(angle - j * width, 0.0), width)
        local += virgin[j] * part
        if 0.0 < part < width:
            tangent += virgin[j]
    whole /= virgin.size
    return share * local + (1.0 - share) * whole * angle, share * tangent + (1.0 - share) * whole


@njit
def _soften(
    before: float,
    after: float,
    step: float,
    virgin: Floats,
    width: float,
    loadings: float,
    dwell: float,
) -> None:
    """Soften each level as far as it is passed upwards, and while the angle stays beyond it."""
    for j in range(virgin.size):
        beyond = min(max(after / width - j, 0.0), 1.0)
        if beyond > 0.0:
            newly = max(beyond - min(max(before / width - j, 0.0), 1.0), 0.0)
            virgin[j] *= math.exp(-beyond * step / dwell - newly / loadings)


@njit
def stop_radii(turn: float, tail: float) -> Floats:
    """Travel over which each stop yields: `turn` for the last, the others by a power law."""
    radii = np.empty(STOPS)
    for j in range(STOPS):
        radii[j] = turn * ((j + 1.0) / STOPS) ** tail
    return radii


@njit
def _friction(moved: float, stops: Floats, radii: Floats) -> tuple[float, float]:
    """Mean stop of a Prandtl-Ishlinskii stack after moving further, -1 to 1; and its slope."""
    total, slope = 0.0, 0.0
    for j in range(STOPS):
        state = stops[j] + moved / radii[j]
        if state > 1.0:
            state = 1.0
        elif state < -1.0:
            state = -1.0
        else:
            slope += 1.0 / radii[j]
        total += state
    return total / STOPS, slope / STOPS


@njit
def _rub(moved: float, stops: Floats, radii: Floats) -> None:
    for j in range(STOPS):
        stops[j] = min(max(stops[j] + moved / radii[j], -1.0), 1.0)
