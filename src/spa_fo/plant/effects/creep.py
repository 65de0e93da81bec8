"""Slow viscoelastic flow under held load that recovers at rest.

What creeps goes with the load, or with the angle: with that it looks like a sensor's own creep. It
may grow faster than either, as polymers do beyond small strains (a power of the stress, Findley,
Lai and Onaran 1976, Creep and Relaxation of Nonlinear Viscoelastic Materials).
"""

from __future__ import annotations

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.plant.effects.effect import Effect, Parameter
from spa_fo.plant.effects.shared import GROWTH, spectrum

EFFECT = Effect(
    id="creep",
    stage="actuator",
    place="relaxation",
    parameters=(
        *spectrum(),
        Parameter(
            *("by_angle", "1", 0.5, 0.5, 0.0, 1.0),
            starts=(0.0, 1.0),
            means="part of it that goes with the angle and not with the load",
            is_addition=True,
        ),
        GROWTH,
    ),
    name="creep of the material",
    means="the angle keeps growing slowly under held load and comes back at rest",
    remedy="keep it in the model, and keep holds and rests alike from trial to trial",
    filter="creep",
    shown_in=("release", "hold"),
)


@njit
def crept(strain: Floats, keep: Floats, size: Floats, towards: float) -> float:
    """Give what Kelvin-Voigt elements have crept towards their share of an angle.

    `strain` is carried on in place, `keep` is what a step leaves of each distance.
    """
    total = 0.0
    for j in range(strain.size):
        strain[j] += (1.0 - keep[j]) * (size[j] * towards - strain[j])
        total += strain[j]
    return total
