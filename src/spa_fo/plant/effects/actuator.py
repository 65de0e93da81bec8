"""True pressure -> true angle: G(s) with further moments in its loop.

An extra restoring moment n, in rad as the angle that the static actuator loses to it, is a smaller
load: the angle is G applied to v = u - n/K. In each step v is a line: with n at the middle of the
step, found by Newton's method, and with its slope there. So the scheme is implicit and of second
order, however fast the actuator is.
"""

from __future__ import annotations

import math

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.contact_stop import contact_moment
from spa_fo.plant.effects.creep import crept
from spa_fo.plant.effects.gravity_load import weight_moment
from spa_fo.plant.effects.hysteresis import STOPS, friction, rub, stop_radii
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.mullins_softening import MULLINS_LEVELS, soften, virgin_moment
from spa_fo.plant.effects.shared import CREEP_AT_DEG, CREEP_TIMES_S, creep_sizes, driving
from spa_fo.plant.effects.stiffening import stiffening_moment
from spa_fo.plant.effects.thermal_drift import drifted_gain
from spa_fo.plant.memory import LEVELS, STEPS_S, Complexes, coast, keep_modes, push, stepper

STIFFENING = LIBRARY["stiffening"].first
GRAVITY_LOAD = LIBRARY["gravity_load"].first
CONTACT_STOP = LIBRARY["contact_stop"].first
MULLINS_SOFTENING = LIBRARY["mullins_softening"].first
CREEP = LIBRARY["creep"].first
HYSTERESIS = LIBRARY["hysteresis"].first
THERMAL_DRIFT = LIBRARY["thermal_drift"].first

_NEWTON = 6
# rad. A step of Newton leaves an error of the order of its square, where levels soften 1e-7 deg.
_SETTLED = 1e-6

_CREEP_AT = math.radians(CREEP_AT_DEG)

_LEAST_GAIN = 0.05  # of a stiffness that drifts beyond all measure
_STEEP = 0.2  # of a step's equation over the angle: what is less is hardly solved


@njit
def move(
    load: Floats,
    rise: Floats,
    usual: Floats,
    level: Integers,
    fading: Integers,
    time_s: Floats,
    x: Floats,
    e: Floats,
    nodes: Complexes,
    angles: Floats,
    node_weights: Complexes,
    keep: Complexes,
    gain: Complexes,
    tilt: Complexes,
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
    rise : (n,) array
        By how much it rises within each.
    usual : (n,) array
        What is known to be missed of the angle at the end of each step, rad; effects feel it, too.
    level, fading : (n,) arrays
        Step lengths, as indices into `STEPS_S`: for all else, and for the fractional memory, which
        fades in a rest however short that is.
    time_s : (n,) array
        Campaign time at each step's middle.
    x : (5,) array
        alpha2, alpha1, a1, a0, b0.
    e : array
        Parameters of all effects, NaN where absent.
    nodes, angles, node_weights, keep, gain, tilt
        The contour.
    modes, creep, stops, virgin
        State, carried on in place: modes of the fractional memory, creep elements (rad), friction
        stops (deg of their own travel; the last entry is the angle, rad), virgin share by level.
    """
    linear = stepper(x, nodes, angles, node_weights, keep, gain, tilt, modes)
    direct, leaning = linear.direct, linear.leaning
    creep_keep = np.empty((LEVELS, creep.size))
    for k in range(LEVELS):
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
    of_stiffness, harder = 0.0, 0.0
    if drifting:
        of_stiffness = e[THERMAL_DRIFT + 2]
    looped = stiff or heavy or stopped or mullins or rubbing or of_stiffness > 0.0

    width, by_load, strain, peak, fresh = 1.0, 0.0, stops[STOPS], 0.0, virgin.copy()
    if mullins:
        width = math.radians(e[MULLINS_SOFTENING + 5]) / MULLINS_LEVELS
        by_load = e[MULLINS_SOFTENING + 6]
    below = np.append(0.0, np.cumsum(virgin))
    radii, inside, outside, begins, kept = np.ones(STOPS), 0.0, 0.0, 0.0, 1.0
    if rubbing:
        kept = 1.0 - e[HYSTERESIS + 5]
        begins = e[HYSTERESIS + 4]
        outside = e[HYSTERESIS + 3] * math.radians(e[HYSTERESIS])
        inside = math.radians(e[HYSTERESIS]) - outside
        radii = stop_radii(math.radians(e[HYSTERESIS + 1]), e[HYSTERESIS + 2])
    stop_angle, stop_softness = math.radians(e[CONTACT_STOP]), math.radians(e[CONTACT_STOP + 2])
    creep_size, by_angle, growth = np.zeros(creep.size), 0.0, 0.0
    if creeping:
        by_angle, growth = e[CREEP + 3], e[CREEP + 4]
        creep_size = creep_sizes(e[CREEP], e[CREEP + 1], e[CREEP + 2])

    out = np.empty(load.size)
    angle, known, lost, before = stops[STOPS], 0.0, 0.0, 0.0
    for i in range(load.size):
        k = fading[i]
        u, rising = load[i], rise[i]
        grip = 1.0
        if rubbing and k != level[i]:  # a rest ends
            grip = kept
            for j in range(STOPS):
                stops[j] *= grip
        if mullins and k != level[i]:
            peak, fresh = 0.0, virgin.copy()
        if drifting:
            drifted = drifted_gain(time_s[i] / 3600.0, e[THERMAL_DRIFT], e[THERMAL_DRIFT + 1])
            if of_stiffness > 0.0:
                softer = max(drifted, _LEAST_GAIN) ** of_stiffness
                drifted, harder = drifted / softer, 1.0 / softer - 1.0
            u *= drifted
            rising *= drifted
        free = coast(linear, k)
        v, going = u, rising
        if looped:
            # As much is lost as in the step before, to begin with.
            new = free + direct[k] * (u - lost - (lost - before)) + leaning[k] * rising
            missed = 0.5 * (known + usual[i])
            follows = 1.0 if leaning[k] > 0.0 else 0.0  # one that swings within a step does not
            for _ in range(_NEWTON):
                middle = 0.5 * (angle + new) + missed
                moment, slope = harder * middle, harder
                if stiff:
                    part, tangent = stiffening_moment(
                        middle,
                        static * u,
                        e[STIFFENING],
                        e[STIFFENING + 1],
                        e[STIFFENING + 2],
                    )
                    moment += part
                    slope += tangent
                if heavy:
                    part, tangent = weight_moment(
                        middle, e[GRAVITY_LOAD], e[GRAVITY_LOAD + 1], e[GRAVITY_LOAD + 2]
                    )
                    moment += part
                    slope += tangent
                if stopped:
                    part, tangent = contact_moment(
                        middle - stop_angle, e[CONTACT_STOP + 1], stop_softness
                    )
                    moment += part
                    slope += tangent
                if mullins:
                    part, tangent = virgin_moment(
                        (1.0 - by_load) * middle + by_load * static * u,
                        virgin,
                        below,
                        width,
                        e[MULLINS_SOFTENING + 3],
                        e[MULLINS_SOFTENING + 4],
                        fresh,
                        peak,
                        e[MULLINS_SOFTENING + 8],
                    )
                    moment += e[MULLINS_SOFTENING] * part
                    slope += e[MULLINS_SOFTENING] * (1.0 - by_load) * tangent
                if rubbing:
                    moved = grip * (middle - angle - known)
                    part, tangent = friction(moved, stops, radii, begins)
                    moment += inside * part
                    slope += inside * grip * tangent
                v, stiffness = u - moment / static, slope / static
                if 1.0 + (0.5 * direct[k] + leaning[k]) * stiffness < _STEEP:
                    follows = 0.0  # it gives way as it swings: no line that follows it is stable
                going = rising - follows * stiffness * (new + usual[i] - angle - known)
                excess = new - free - direct[k] * v - leaning[k] * going
                change = excess / (1.0 + (0.5 * direct[k] + follows * leaning[k]) * stiffness)
                new -= change
                if abs(change) < _SETTLED:
                    break
            v = (new - free - leaning[k] * going) / direct[k]
            before, lost = lost, u - v
        push(linear, k, v, going)
        new = free + direct[k] * v + leaning[k] * going
        if rubbing:
            rub(grip * (new - angle + usual[i] - known), stops, radii, begins)
        if mullins:
            strained = (1.0 - by_load) * (new + usual[i]) + by_load * static * u
            peak = max(peak, strained)
            soften(
                strain,
                strained,
                STEPS_S[level[i]],
                virgin,
                below,
                width,
                e[MULLINS_SOFTENING + 1],
                e[MULLINS_SOFTENING + 2],
                math.radians(e[MULLINS_SOFTENING + 7]),
            )
            strain = strained
        angle, known = new, usual[i]
        out[i] = angle + known
        if creeping:
            towards = static * u + by_angle * (angle - static * u)
            pulls = driving(towards, growth, _CREEP_AT)
            out[i] += crept(creep, creep_keep[level[i]], creep_size, pulls)
        if rubbing:
            out[i] -= outside * friction(0.0, stops, radii, begins)[0]
    stops[STOPS] = angle
    keep_modes(linear, modes)
    return out
