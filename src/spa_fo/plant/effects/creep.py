"""Slow viscoelastic flow under held load that recovers at rest."""

from __future__ import annotations

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Effect
from spa_fo.plant.effects.shared import Floats, spectrum

EFFECT = Effect(
    id="creep",
    stage="actuator",
    place="relaxation",
    parameters=spectrum(),
    name="creep of the material",
    means="the angle keeps growing slowly under held load and comes back at rest",
    remedy="keep it in the model, and keep holds and rests alike from trial to trial",
    filter="creep",
    shown_in=("release", "hold"),
)


@njit
def crept(
    angle: float, strain: Floats, keep: Floats, size: Floats, static: float, load: float
) -> float:
    """Add to an angle what Kelvin-Voigt elements have crept towards their share of static·load.

    `strain` is carried on in place, `keep` is what a step leaves of each distance.
    """
    for j in range(strain.size):
        strain[j] += (1.0 - keep[j]) * (size[j] * static * load - strain[j])
        angle += strain[j]
    return angle
