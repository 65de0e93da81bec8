"""The fractional damping as a bank of Maxwell elements (infinite-state representation).

With 0 < β < 1 the operator s^β is a continuous mixture of first-order relaxations,

    s^β = sin(βπ)/π ∫ ξ^β · s/(s + ξ) d(ln ξ),

each a spring and a dashpot in series. The trapezoidal rule in ln ξ converges exponentially, so a
few elements a decade do; those slower than the slowest one kept are a plain dashpot, those faster
than the fastest one a plain mass, and both tails of the sum are geometric series.

For D^α2 y + a1 D^α1 y with 1 < α < 2 the elements follow the velocity, and one bank serves both
orders. What results is an ordinary mechanical body, and nonlinear moments can act on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_SPACING = 0.9  # of ln ξ: an error of about exp(-π²/spacing) on the imaginary axis
_SLOWEST = 1e-5  # 1/s, far below any log's length
_FASTEST = 3e4  # 1/s, far above any step


@dataclass(frozen=True)
class Core:
    """The plain model G(s) = b0 / (s^alpha2 + a1 s^alpha1 + a0), angle in rad for u = 1."""

    alpha2: float
    alpha1: float
    a1: float
    a0: float
    b0: float

    @property
    def gain(self) -> float:
        """Settled angle for a unit input (rad)."""
        return self.b0 / self.a0


class Bank(NamedTuple):
    """Maxwell elements and the constants of one time step.

    Attributes
    ----------
    pull : ndarray, shape (k,)
        Moment of each element for its unit state.
    decay, from_old, from_new : ndarray, shape (k,)
        One step of each state for a velocity that is linear in between.
    mass, drag : float
        Moment for unit acceleration and unit velocity.
    step : float
        Length of the step (s), as the body feels it.
    """

    pull: Floats
    decay: Floats
    from_old: Floats
    from_new: Floats
    mass: float
    drag: float
    step: float


class Damper(NamedTuple):
    """A damping that can be had in any measure beside the body's own.

    Attributes
    ----------
    pull : ndarray, shape (k,)
        Moment of each of the body's elements for its unit state.
    mass, drag : float
        Moment for unit acceleration and unit velocity.
    """

    pull: Floats
    mass: float
    drag: float


def elements() -> int:
    """Count the elements of a bank."""
    return int(np.ceil(np.log(_FASTEST / _SLOWEST) / _SPACING)) + 1


def bank(core: Core, step: float) -> Bank:
    """Build the elements of a body for time steps of `step` seconds.

    Parameters
    ----------
    core : Core
        Its orders and a1; 1 < alpha1 < alpha2 < 2.
    step : float
        Time step (s).
    """
    rates = _SLOWEST * np.exp(_SPACING * np.arange(elements()))
    weights = np.zeros_like(rates)
    mass = drag = 0.0
    for order, factor in ((core.alpha2 - 1.0, 1.0), (core.alpha1 - 1.0, core.a1)):
        share = factor * np.sin(order * np.pi) / np.pi * _SPACING
        weights += share * rates**order
        drag += share * rates[0] ** order / np.expm1(order * _SPACING)
        mass += share * rates[-1] ** (order - 1.0) / np.expm1((1.0 - order) * _SPACING)
    mean = -np.expm1(-rates * step) / (rates * step)
    from_new = (1.0 - mean) / rates
    return Bank(
        pull=weights * rates,
        decay=np.exp(-rates * step),
        from_old=mean * step - from_new,
        from_new=from_new,
        mass=float(mass),
        drag=float(drag + weights.sum()),
        step=step,
    )


def fractional_damper(core: Core, step: float) -> Damper:
    """Return the part of a body's damping that is a1 D^alpha1, to be had once more or less."""
    without = bank(replace(core, a1=0.0), step)
    whole = bank(core, step)
    return Damper(whole.pull - without.pull, whole.mass - without.mass, whole.drag - without.drag)


def dashpot(drag: float) -> Damper:
    """Return a plain dashpot."""
    return Damper(np.zeros(elements()), 0.0, drag)
