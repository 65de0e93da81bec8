"""Second forms of the effects in the actuator's restoring moment, in units of a0.

They are added to the moment of the actuator's core; see `second_forms` for what they are for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spa_fo._jit import njit
from spa_fo.virtual_rig.arrays import Array

_STOPS = np.array([0.3, 0.7, 1.1, 1.5, 1.9])  # yield angles over their mean
_LEVELS = 18
_LEVEL_DEG = 5.0
# Gauss-Legendre points and weights of an integral from 0 to 1.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_ARC, _ARC_WEIGHT = 0.5 * (_POINTS + 1.0), 0.5 * _WEIGHTS


@dataclass(frozen=True)
class FungStiffening:
    """Fung's exponential tissue: moment a0 (e^(kθ) - 1) / k with k = `exponent_per_rad`."""

    exponent_per_rad: float


@dataclass(frozen=True)
class OwnWeight:
    """The body's own weight, spread along its arc, adds a restoring moment.

    Its generalised moment is a0 w ∫ 6s(1-s) (sin(ψ+θs) - sin ψ) ds over the arc; nothing at rest.

    Parameters
    ----------
    weight_rad : float
        w, the weight's moment over a0, rad.
    mounting_deg : float
        ψ; 0 hangs down, 90 lies flat.
    """

    weight_rad: float
    mounting_deg: float = 0.0


@dataclass(frozen=True)
class FoamPad:
    """A pad pushes back in proportion beyond `angle_deg`, with an exponential toe.

    Parameters
    ----------
    angle_deg : float
        Where it begins.
    stiffness : float
        Its stiffness over a0.
    toe_deg : float
        Width of the toe.
    """

    angle_deg: float
    stiffness: float
    toe_deg: float = 2.0


@dataclass(frozen=True)
class CycleSoftening:
    """Each level of strain softens with the number of times that it was gone through.

    The angle between 0° and 90° has levels of 5°. A level adds `fraction` of the stiffness within
    itself as long as it is virgin; every unloading through it leaves e^(-1/`cycles`) of that; at
    rest it heals with `heal_s`.
    """

    fraction: float
    cycles: float = 2.0
    heal_s: float = 20000.0


@dataclass(frozen=True)
class StopHysteresis:
    """Five elastic-plastic stops side by side (Prandtl-Ishlinskii), yielding one after another.

    Parameters
    ----------
    moment_deg : float
        Moment of all when all yield, over a0, deg.
    yield_deg : float
        Mean yield angle.
    """

    moment_deg: float
    yield_deg: float = 15.0


class SecondMoment(NamedTuple):
    """Sizes of all these as the kernel wants them (rad; 0 is off)."""

    active: bool
    fung: float
    weight: float
    mounting: float
    pad: float
    pad_stiffness: float
    toe: float
    friction: float
    yields: Array
    virgin: float
    wear_keep: float
    heal_rate: float


class SecondState(NamedTuple):
    """What they remember; the arrays change in place."""

    stops: Array
    levels: Array


def second_moment(effects: list[object]) -> SecondMoment:
    """Gather the sizes of those of the effects that are second forms."""
    fung, weight, pad = FungStiffening(0.0), OwnWeight(0.0), FoamPad(0.0, 0.0)
    wear, stops = CycleSoftening(0.0), StopHysteresis(0.0)
    active = False
    for effect in effects:
        known = True
        match effect:
            case FungStiffening():
                fung = effect
            case OwnWeight():
                weight = effect
            case FoamPad():
                pad = effect
            case CycleSoftening():
                wear = effect
            case StopHysteresis():
                stops = effect
            case _:
                known = False
        active = active or known
    return SecondMoment(
        active=active,
        fung=fung.exponent_per_rad,
        weight=weight.weight_rad,
        mounting=float(np.deg2rad(weight.mounting_deg)),
        pad=float(np.deg2rad(pad.angle_deg)),
        pad_stiffness=pad.stiffness,
        toe=float(np.deg2rad(pad.toe_deg)),
        friction=float(np.deg2rad(stops.moment_deg)),
        yields=np.deg2rad(stops.yield_deg) * _STOPS,
        virgin=wear.fraction,
        wear_keep=float(np.exp(-1.0 / wear.cycles)),
        heal_rate=1.0 / wear.heal_s,
    )


def second_state() -> SecondState:
    """Give a virgin specimen's state."""
    return SecondState(np.zeros(_STOPS.size), np.ones(_LEVELS))


@njit
def restoring_besides(
    angle: float, moved: float, m: SecondMoment, state: SecondState
) -> tuple[float, float]:
    """Moment over a0 that the second forms add at `angle`, after `moved`; and its slope."""
    moment = slope = 0.0
    if m.fung > 0.0:
        size = min(abs(angle), 3.0)  # keeps Newton's first guesses finite
        moment += np.sign(angle) * (np.expm1(m.fung * size) / m.fung - size)
        slope += np.expm1(m.fung * size)
    if m.weight != 0.0:
        for k in range(_ARC.size):
            share = 6.0 * _ARC_WEIGHT[k] * _ARC[k] * (1.0 - _ARC[k])
            direction = m.mounting + angle * _ARC[k]
            moment += m.weight * share * (np.sin(direction) - np.sin(m.mounting))
            slope += m.weight * share * _ARC[k] * np.cos(direction)
    if m.pad_stiffness > 0.0:
        beyond = (angle - m.pad) / m.toe
        moment += m.pad_stiffness * m.toe * np.logaddexp(0.0, beyond)
        slope += m.pad_stiffness / (1.0 + np.exp(-beyond))
    if m.friction > 0.0:
        share = m.friction / m.yields.size
        for k in range(m.yields.size):
            stretched = state.stops[k] + moved
            moment += share * min(max(stretched / m.yields[k], -1.0), 1.0)
            if abs(stretched) < m.yields[k]:
                slope += share / m.yields[k]
    if m.virgin > 0.0:
        width = np.deg2rad(_LEVEL_DEG)
        for k in range(_LEVELS):
            within = min(max(angle - k * width, 0.0), width)
            moment += m.virgin * state.levels[k] * within
            if 0.0 < within < width:
                slope += m.virgin * state.levels[k]
    return moment, slope


@njit
def remember(angle: float, moved: float, step: float, m: SecondMoment, state: SecondState) -> None:
    """Update the state: `angle` was reached by `moved`."""
    for k in range(m.yields.size):
        state.stops[k] = min(max(state.stops[k] + moved, -m.yields[k]), m.yields[k])
    width = np.deg2rad(_LEVEL_DEG)
    for k in range(_LEVELS):
        middle = (k + 0.5) * width
        if angle < middle <= angle - moved:
            state.levels[k] *= m.wear_keep
        elif angle < middle:
            state.levels[k] += step * m.heal_rate * (1.0 - state.levels[k])
