"""Beyond some angle something pushes back."""

from __future__ import annotations

from spa_fo._jit import njit
from spa_fo.plant.effects.effect import Check, Effect, shape

EFFECT = Effect(
    id="contact_stop",
    stage="actuator",
    place="moment",
    parameters=(
        shape(
            "angle_deg",
            "deg",
            "angle from which something pushes back",
            centre=45.0,
            factor=1.6,
            low=1.0,
            high=360.0,
            starts=(30.0, 50.0),
        ),
        shape(  # from a cushion to a wall
            "stiffness",
            "1",
            "its stiffness, as a multiple of the actuator's",
            centre=1.5,
            factor=4.0,
            low=0.02,
            high=100.0,
            starts=(0.6, 10.0),
        ),
        shape(
            "softness_deg",
            "deg",
            "angle over which the contact closes",
            centre=4.0,
            factor=2.5,
            low=0.05,
            high=120.0,
        ),
    ),
    name="contact",
    means="beyond some angle something pushes back",
    remedy="look for what the actuator touches there: frame, cable, table, or itself",
    shown_in=("levels",),
    neutral={"angle_deg": 360.0},
    check=Check(
        "clear the space round the actuator and repeat the largest step",
        "what it touched is gone then",
    ),
)


@njit
def contact_moment(beyond: float, stiffness: float, soft: float) -> tuple[float, float]:
    """Moment (rad) of a spring, soft at first, that is pressed this far; and its slope."""
    if beyond <= 0.0:
        return 0.0, 0.0
    moment = stiffness * beyond * beyond / (beyond + soft)
    return moment, stiffness * beyond * (beyond + 2.0 * soft) / (beyond + soft) ** 2
