"""Effects that benches show and effects.yaml has no name for, and what could pass for them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from blind.second_rig.effect import Draw, Effect, Scene, log_uniform

Rng = np.random.Generator

# Which ids would be a fair answer as well, by physics: what nobody could tell from it.
EQUIVALENTS: Mapping[str, tuple[str, ...]] = {
    "regulator_overshoot": ("drive_overshoot",),
    "slow_vent": ("line_lag",),  # filling alone is a low-pass
    "valve_limit_cycle": ("drive_hunting",),
    "supply_wander": (),
    # a static curve before the body, or behind it
    "ballooning": ("gain_growth", "sensor_nonlinearity"),
    # rises that wait; the pressure tells backlash apart
    "fold_threshold": ("opening_fold", "drive_backlash"),
    "body_mode": ("body_mode",),
    "quadratic_drag": (),
    # a zero that walks; creep that does not come back
    "shape_set": ("pressure_set", "sensor_slip", "creep"),
    "tear": ("tear", "thermal_drift"),  # a drift where trials are too few to see the moment
    "pressure_cross_talk": (),
    "frozen_reading": ("sensor_freeze", "sensor_detachment"),
    "baseline_wander": ("mains_pickup",),  # an alias may be as slow
}


def _regulator_overshoot(rng: Rng, scene: Scene) -> Effect:
    shape = {"damping": rng.uniform(0.12, 0.35)}
    return Effect("regulator_overshoot", "second_order", "period of the swing, s", 4.0, shape)


def _slow_vent(rng: Rng, scene: Scene) -> Effect:
    shape = {"fill_share": rng.uniform(0.1, 0.35)}
    return Effect("slow_vent", "two_orifices", "time constant of venting, s", 6.0, shape)


def _valve_limit_cycle(rng: Rng, scene: Scene) -> Effect:
    shape = {"frequency_hz": rng.uniform(0.2, 0.6)}
    return Effect("valve_limit_cycle", "triangle", "amplitude over the pressure", 0.4, shape)


def _supply_wander(rng: Rng, scene: Scene) -> Effect:
    knots = rng.uniform(4.0, 9.0)
    count = int(4.0 * scene.length_s / knots) + 800
    noise = rng.normal(size=count)
    return Effect(
        "supply_wander", "random", "rms over the pressure", 0.3, {"knot_s": knots}, series=noise
    )


def _ballooning(rng: Rng, scene: Scene) -> Effect:
    return Effect(
        "ballooning",
        "cubic",
        "gain at the top over that at zero, - 1",
        0.5,
        {"top": scene.top_input},
    )


def _fold_threshold(rng: Rng, scene: Scene) -> Effect:
    shape = {"knee": rng.uniform(0.15, 0.5), "top": scene.top_input}
    return Effect("fold_threshold", "soft_threshold", "threshold over the largest", 0.6, shape)


def _body_mode(rng: Rng, scene: Scene) -> Effect:
    shape = {"frequency_hz": rng.uniform(0.35, 0.7), "damping": log_uniform(rng, 0.02, 0.1)}
    return Effect("body_mode", "linear_mode", "swing over the settled angle", 0.6, shape)


def _quadratic_drag(rng: Rng, scene: Scene) -> Effect:
    return Effect("quadratic_drag", "squared", "moment over squared rate, s^2", 6.0, {})


def _shape_set(rng: Rng, scene: Scene) -> Effect:
    shape = {"yield_rad": rng.uniform(0.2, 0.6) * scene.top_rad}
    return Effect("shape_set", "plastic_flow", "set a second for each rad beyond", 0.02, shape)


def _tear(rng: Rng, scene: Scene) -> Effect:
    shape = {"at_s": rng.uniform(0.3, 0.7) * scene.length_s}
    return Effect("tear", "step_of_gain", "gain lost", 0.5, shape)


def _cross_talk(rng: Rng, scene: Scene) -> Effect:
    return Effect(
        "pressure_cross_talk", "instant", "reading at the largest pressure, deg", 20.0, {}
    )


def _frozen_reading(rng: Rng, scene: Scene) -> Effect:
    shape = {"every_s": rng.uniform(2.5, 4.0), "share": rng.uniform(0.5, 0.9)}
    series = rng.random(997)
    return Effect(
        "frozen_reading", "held", "length of a freeze, s", shape["every_s"], shape, series=series
    )


def _baseline_wander(rng: Rng, scene: Scene) -> Effect:
    shape = {
        "frequency_hz": log_uniform(rng, 0.02, 0.15),
        "phase": rng.uniform(0.0, 2.0 * np.pi),
    }
    return Effect("baseline_wander", "sine", "amplitude, deg", 12.0, shape)


DRAWS: dict[str, Draw] = {
    "regulator_overshoot": _regulator_overshoot,
    "slow_vent": _slow_vent,
    "valve_limit_cycle": _valve_limit_cycle,
    "supply_wander": _supply_wander,
    "ballooning": _ballooning,
    "fold_threshold": _fold_threshold,
    "body_mode": _body_mode,
    "quadratic_drag": _quadratic_drag,
    "shape_set": _shape_set,
    "tear": _tear,
    "pressure_cross_talk": _cross_talk,
    "frozen_reading": _frozen_reading,
    "baseline_wander": _baseline_wander,
}
