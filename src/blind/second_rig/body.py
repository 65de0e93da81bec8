"""The bending body in time: plain physics and nonlinear moments in one loop.

    mass v' + drag v - Σ pull q + a0 (ε + N) = b0 w,      ε = y - creep - set

y is the angle (rad), v its rate, q the states of the Maxwell elements, w the input. All moments N
are in rad: what they would bend the plain body by. Every one is zero where its size is.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from blind.second_rig.bank import Bank, Damper, dashpot, elements

Floats = npt.NDArray[np.float64]

NETWORKS = 8  # of filler, each broken beyond its own angle
STOPS = 4  # friction elements with spring, each slipping at its own angle
VOIGTS = 6  # slow compliances


class Laws(NamedTuple):
    """Sizes of the moments and their constants; angles in rad, times in s."""

    top: float  # usual largest angle, a scale
    quadratic: float = 0.0
    cubic: float = 0.0
    lock: float = 0.0  # (top / locking angle)²
    weight: float = 0.0
    orientation: float = 0.0
    sag: float = 0.0  # 1: the weight bends the body at rest as well
    contact: float = 0.0
    contact_at: float = 1.0
    contact_power: float = 1.0
    virgin: float = 0.0  # excess stiffness before any loading
    dose: float = 0.0  # ∫|y dy| that takes it down by 1/e; 0: networks break instead
    break_s: float = 1.0
    friction: float = 0.0
    slip: float = 1.0  # angle over which friction turns round
    smooth: float = 0.0  # 1: Bouc-Wen; 0: stops in parallel
    swing: float = 0.0  # quadratic drag, s²
    plastic: float = 0.0  # permanent set a second for each rad beyond the yield angle
    yield_at: float = 1.0
    set_most: float = 0.0  # set at which flow beyond the yield angle ends; 0: it never does
    set_back_s: float = 1.0  # time in which such a set recovers
    loose: float = 0.0  # share of the stiffness that is lost beyond an angle
    loose_at: float = 1.0


@dataclass(frozen=True)
class Pressed:
    """What pressure does to a body beside the moment, at each step.

    Attributes
    ----------
    rest : ndarray, shape (n,)
        Set of the rest angle (rad).
    damping : ndarray, shape (n,)
        How many times the damper acts.
    damper : Damper
        The damping that depends on pressure.
    """

    rest: Floats
    damping: Floats
    damper: Damper


@dataclass
class BodyState:
    """What a body remembers; starts virgin and straight."""

    scalars: Floats = field(default_factory=lambda: np.zeros(5))  # y, v, dose, set, Bouc-Wen z
    maxwell: Floats = field(default_factory=lambda: np.zeros(elements()))
    creep: Floats = field(default_factory=lambda: np.zeros(VOIGTS))
    networks: Floats = field(default_factory=lambda: np.ones(NETWORKS))
    stops: Floats = field(default_factory=lambda: np.zeros(STOPS))


def run(
    body: Bank,
    laws: Laws,
    stiffness: float,
    drive: Floats,
    voigt: tuple[Floats, Floats],
    state: BodyState,
    step_s: float,
    pressed: Pressed | None = None,
) -> Floats:
    """Bend a body and leave its state behind.

    Parameters
    ----------
    body : Bank
        Its elements, for the step as the body feels it.
    laws : Laws
        Moments.
    stiffness : float
        a0.
    drive : ndarray, shape (n,)
        b0 w, held over each step.
    voigt : (ndarray, ndarray), shapes (VOIGTS,)
        Compliances (1) and retardation times (s) of creep.
    state : BodyState
        At the start; changed.
    step_s : float
        Step on the clock; slow effects keep that time.
    pressed : Pressed, optional
        What depends on pressure directly.

    Returns
    -------
    ndarray, shape (n + 1,)
        Angle (rad) at the start and after each step.
    """
    if pressed is None:
        pressed = Pressed(np.zeros(drive.size), np.zeros(drive.size), dashpot(0.0))
    result: Floats = _run(
        body, laws, stiffness, drive, voigt[0], voigt[1], step_s,
        pressed.rest, pressed.damping, pressed.damper,
        state.scalars, state.maxwell, state.creep, state.networks, state.stops,
    )  # fmt: skip
    return result


@njit(cache=True)
def _elastic(laws: Laws, y: float) -> float:
    """Moments that follow from the angle alone."""
    x = abs(y) / laws.top
    moment = y * (laws.quadratic * x + laws.cubic * x * x)
    if laws.lock > 0.0:
        stretch = min(laws.lock * x * x, 0.95)
        moment += y * stretch / (1.0 - stretch)
    if laws.weight > 0.0:
        rest = (1.0 - laws.sag) * np.sin(laws.orientation)
        moment += laws.weight * (np.sin(laws.orientation + y) - rest)
    if laws.contact > 0.0 and y > laws.contact_at:
        depth = (y - laws.contact_at) / laws.top
        moment += laws.contact * laws.top * depth**laws.contact_power
    if laws.loose > 0.0 and y > laws.loose_at:
        moment -= laws.loose * (y - laws.loose_at)
    return moment


@njit(cache=True)
def _friction(laws: Laws, z: float, stops: Floats) -> float:
    if laws.smooth > 0.5:
        return laws.friction * z
    return float(laws.friction * stops.sum() / (laws.slip * 0.5 * (STOPS + 1)))


@njit(cache=True)
def _rub(laws: Laws, z: float, stops: Floats, dy: float) -> float:
    """Turn the friction elements by dy; return Bouc-Wen's z."""
    for i in range(STOPS):
        limit = laws.slip * (i + 1) / STOPS
        stops[i] = min(max(stops[i] + dy, -limit), limit)
    against = 1.0 if z * dy > 0.0 else 0.0
    z += dy / laws.slip * (1.0 - against * z * z)
    return min(max(z, -1.0), 1.0)


@njit(cache=True)
def _soften(laws: Laws, dose: float, networks: Floats, y: float, dy: float, step_s: float) -> float:
    """Break what loading breaks; return the dose so far."""
    if laws.dose > 0.0:
        return dose + abs(y * dy)
    for i in range(NETWORKS):
        if abs(y) > laws.top * i / NETWORKS and abs(y) > 0.05 * laws.top:
            networks[i] *= 1.0 - step_s / laws.break_s
    return dose


@njit(cache=True)
def _flow(laws: Laws, plastic: float, y: float, step_s: float) -> float:
    """Return the set after a step: lasting, or one that saturates and recovers."""
    beyond = max(y - laws.yield_at, 0.0)
    if laws.set_most == 0.0:
        return plastic + laws.plastic * beyond * step_s
    flow = laws.plastic * beyond * (1.0 - plastic / laws.set_most)
    return plastic + step_s * (flow - plastic / laws.set_back_s)


@njit(cache=True)
def _run(
    body: Bank, laws: Laws, stiffness: float, drive: Floats, compliance: Floats,
    retardation: Floats, step_s: float, rest: Floats, damping: Floats, damper: Damper,
    scalars: Floats, maxwell: Floats, creep: Floats, networks: Floats, stops: Floats,
) -> Floats:  # fmt: skip
    h = body.step
    angle = np.empty(drive.size + 1)
    y, v, dose, plastic, z = scalars
    angle[0] = y
    own = body.mass / h + body.drag + 0.5 * stiffness * h - np.sum(body.pull * body.from_new)
    also = damper.mass / h + damper.drag - np.sum(damper.pull * body.from_new)
    for n in range(drive.size):
        pull = 0.0
        for k in range(maxwell.size):
            maxwell[k] = body.decay[k] * maxwell[k] + body.from_old[k] * v
            pull += body.pull[k] * maxwell[k]
        ahead = y + h * v
        slow = plastic + creep.sum() + rest[n]
        moment = _elastic(laws, ahead) + _friction(laws, z, stops)
        if laws.virgin > 0.0:
            left = np.exp(-dose / laws.dose) if laws.dose > 0.0 else networks.mean()
            moment += laws.virgin * left * (ahead - slow)
        moment += laws.swing * v * abs(v)
        known = drive[n] - stiffness * (y + 0.5 * h * v - slow + moment)
        held, against = known + pull + body.mass / h * v, own
        if damping[n] != 0.0:
            held += damping[n] * (np.sum(damper.pull * maxwell) + damper.mass / h * v)
            against += damping[n] * also
        faster = held / against
        for k in range(maxwell.size):
            maxwell[k] += body.from_new[k] * faster
        dy = 0.5 * h * (v + faster)
        y, v = y + dy, faster
        if laws.friction > 0.0:
            z = _rub(laws, z, stops, dy)
        if laws.virgin > 0.0:
            dose = _soften(laws, dose, networks, y, dy, step_s)
        for j in range(creep.size):
            if compliance[j] > 0.0:
                creep[j] += step_s / retardation[j] * (compliance[j] * (y - slow) - creep[j])
        if laws.plastic > 0.0:
            plastic = _flow(laws, plastic, y, step_s)
        angle[n + 1] = y
    scalars[0], scalars[1], scalars[2], scalars[3], scalars[4] = y, v, dose, plastic, z
    return angle
