"""The same linear physics with other coefficients: another specimen or batch."""

from __future__ import annotations

from spa_fo.plant.effects.effect import Check, Effect

EFFECT = Effect(
    id="parameter_shift",
    stage="actuator",
    name="other coefficients",
    means="the physics is the same but the specimen is another one",
    remedy="identify the model again on this specimen: `spa-fo fit`",
    port="coefficients",
    check=Check(
        "repeat a step with the specimen that the model was identified on",
        "a shift stays with the specimen",
    ),
    coefficients={
        "alpha2": "order of the inertia term",
        "alpha1": "order of the damping term",
        "a1": "damping",
        "a0": "stiffness",
        "b0": "strength of the pressure",
    },
)
