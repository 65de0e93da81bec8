"""The 22 effects of effects.yaml: the form and the constants of each, drawn anew for each case."""

from __future__ import annotations

import numpy as np

from blind.second_rig.actuator import COEFFICIENTS
from blind.second_rig.effect import Draw, Effect, Scene, log_uniform, pick, sign

ORIFICES = ("iso_6358", "nozzle", "valve")
"""Forms of a line that is an orifice."""
_MOST_TRIALS = 200  # of a campaign and its later one, for effects that change between trials

Rng = np.random.Generator


def _dead_time(rng: Rng, scene: Scene) -> Effect:
    return Effect("dead_time", "transport", "delay, s", 0.8, {})


def _line_lag(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "one_node", "two_node", pick(rng, *ORIFICES))
    if form in ORIFICES:
        return _orifice(rng, scene, form)
    shape = {"second": rng.uniform(0.15, 0.6)} if form == "two_node" else {}
    return Effect("line_lag", form, "time constant of the first node, s", 3.0, shape)


def _orifice(rng: Rng, scene: Scene, form: str) -> Effect:
    shape = {"fill_share": rng.uniform(0.3, 1.0), "laminar": rng.uniform(0.97, 0.995)}
    if form != "nozzle":
        shape["critical"] = rng.uniform(0.2, 0.45)
    if form == "valve":
        shape["supply_kpa"] = rng.uniform(1.4, 4.0) * scene.top_kpa
        shape["band_kpa"] = rng.uniform(0.02, 0.06) * scene.top_kpa
    return Effect("line_lag", form, "time constant of choked venting, s", 8.0, shape)


def _supply_droop(rng: Rng, scene: Scene) -> Effect:
    shape = {"recovery_s": log_uniform(rng, 1.5, 8.0), "top": scene.top_kpa}
    form = pick(rng, "reservoir", "regulator")
    return Effect("supply_droop", form, "share of each rise that is lacking at first", 0.6, shape)


def _leak(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "proportional", "orifice")
    return Effect("leak", form, "rate of loss, 1/s", 0.1, {"top": scene.top_kpa})


def _slew_limit(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "limited", "soft")
    shape = {"top": scene.top_kpa}
    if form == "soft":
        shape["knee"] = rng.uniform(0.03, 0.12)
    return Effect("slew_limit", form, "time from zero to the largest pressure, s", 8.0, shape)


def _drive_backlash(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "play", "soft_play")
    shape = {"top": scene.top_kpa, "engaged": float(rng.choice([1.0, 0.5]))}
    return Effect("drive_backlash", form, "width over the largest pressure", 0.5, shape)


def _stiffening(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "polynomial", "locking")
    if form == "locking":
        return Effect("stiffening", form, "(largest angle / locking angle)^2", 0.9, {})
    shape = {"quadratic_share": rng.uniform(0.1, 0.8)}
    return Effect("stiffening", form, "added stiffness at the largest angle", 2.0, shape)


def _gravity_load(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "hanging", "zeroed")
    shape = {"orientation_rad": np.deg2rad(rng.uniform(-60.0, 100.0))}
    return Effect("gravity_load", form, "weight moment over stiffness, rad", 0.6, shape)


def _contact_stop(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "hertz", "spring")
    shape = {
        "at_rad": rng.uniform(0.45, 0.75) * scene.top_rad,
        "power": 1.5 if form == "hertz" else 1.0,
    }
    return Effect("contact_stop", form, "stiffness over the body's own", 60.0, shape)


def _mullins(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "dose", "networks")
    if form == "dose":
        shape = {"dose": rng.uniform(0.8, 2.5) * scene.top_rad**2}
    else:
        shape = {"break_s": rng.uniform(8.0, 25.0)}
    return Effect("mullins_softening", form, "excess stiffness when virgin", 0.6, shape)


def _creep(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "logarithmic", "voigt")
    shortest = log_uniform(rng, 8.0, 40.0)
    shape = {"elements": 1.0, "shortest_s": shortest, "longest_s": shortest}
    if form == "logarithmic":
        shape = {
            "elements": 6.0,
            "shortest_s": rng.uniform(2.0, 5.0),
            "longest_s": rng.uniform(200.0, 800.0),
        }
    return Effect("creep", form, "slow compliance over the elastic one", 0.6, shape)


def _hysteresis(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "bouc_wen", "iwan")
    shape = {"slip_rad": rng.uniform(0.05, 0.25) * scene.top_rad}
    return Effect("hysteresis", form, "friction moment over stiffness, rad", 0.35, shape)


def _thermal_drift(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "linear", "warming")
    shape = {"length_s": scene.length_s, "sign": sign(rng, 0.6)}
    if form == "warming":
        shape["time_s"] = rng.uniform(0.7, 1.2) * scene.length_s
    return Effect("thermal_drift", form, "change of gain over the campaign", 0.4, shape)


def _parameter_shift(rng: Rng, scene: Scene) -> Effect:
    drawn = rng.normal(size=5) * np.array([0.12, 0.12, 1.0, 0.8, 0.8])
    drawn /= np.abs(drawn).max()
    shape = dict(zip(COEFFICIENTS, drawn.tolist(), strict=True))
    return Effect("parameter_shift", "relative", "largest relative change", 0.4, shape)


def _sensor_nonlinearity(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "bow", "wave")
    top = np.rad2deg(scene.top_rad)
    shape = {"span_deg": rng.uniform(1.1, 1.6) * top, "sign": sign(rng)}
    limit = 0.2 if form == "bow" else 0.7
    return Effect("sensor_nonlinearity", form, "bend of the curve over its span", limit, shape)


def _sensor_saturation(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "clipped", "rounded")
    shape = {"top_deg": float(np.rad2deg(scene.top_rad))}
    if form == "rounded":
        shape["knee_deg"] = rng.uniform(1.0, 4.0)
    return Effect("sensor_saturation", form, "1.6 - rail over the largest angle", 1.2, shape)


def _sensor_lag(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "one_pole", "two_poles")
    return Effect("sensor_lag", form, "sum of time constants, s", 3.0, {})


def _sensor_creep(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "logarithmic", "one_time")
    shortest = log_uniform(rng, 8.0, 50.0)
    shape = {"elements": 1.0, "shortest_s": shortest, "longest_s": shortest}
    if form == "logarithmic":
        shape = {"elements": 5.0, "shortest_s": 1.5, "longest_s": rng.uniform(100.0, 400.0)}
    return Effect("sensor_creep", form, "final drift over the angle", 0.5, shape)


def _sensor_hysteresis(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "dahl", "stop")
    shape = {"turn_deg": rng.uniform(3.0, 15.0)}
    return Effect("sensor_hysteresis", form, "half the loop's width, deg", 12.0, shape)


def _sensor_slip(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "jumps", "walk")
    steps = rng.normal(size=_MOST_TRIALS)
    if form == "jumps":
        steps *= rng.random(_MOST_TRIALS) < max(0.2, 1.5 / scene.trials)
        first = min(2, scene.trials)
        steps[int(rng.integers(first, scene.trials + 1))] = sign(rng) * rng.uniform(1.0, 2.0)
    steps[0] = 0.0  # the first calibration sees the sensor where it was put
    zero = np.cumsum(steps)
    used = np.sqrt(np.mean(zero[1 : scene.trials + 1] ** 2))
    return Effect("sensor_slip", form, "rms shift of the zero, deg", 15.0, {}, series=zero / used)


def _channel_latency(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "buffer", "moving_average")
    return Effect("channel_latency", form, "delay, s", 1.0, {})


def _mains_pickup(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "sine", "with_third")
    nominal = float(rng.choice([50.0, 60.0]))
    shape = {
        "frequency_hz": nominal * (1.0 + rng.normal(0.0, 5e-4)),
        "phase": rng.uniform(0.0, 2.0 * np.pi),
    }
    if form == "with_third":
        shape["third_harmonic"] = rng.uniform(0.15, 0.4)
    return Effect("mains_pickup", form, "amplitude, deg", 15.0, shape)


LIBRARY: dict[str, Draw] = {
    "dead_time": _dead_time,
    "line_lag": _line_lag,
    "supply_droop": _supply_droop,
    "leak": _leak,
    "slew_limit": _slew_limit,
    "drive_backlash": _drive_backlash,
    "stiffening": _stiffening,
    "gravity_load": _gravity_load,
    "contact_stop": _contact_stop,
    "mullins_softening": _mullins,
    "creep": _creep,
    "hysteresis": _hysteresis,
    "thermal_drift": _thermal_drift,
    "parameter_shift": _parameter_shift,
    "sensor_nonlinearity": _sensor_nonlinearity,
    "sensor_saturation": _sensor_saturation,
    "sensor_lag": _sensor_lag,
    "sensor_creep": _sensor_creep,
    "sensor_hysteresis": _sensor_hysteresis,
    "sensor_slip": _sensor_slip,
    "channel_latency": _channel_latency,
    "mains_pickup": _mains_pickup,
}
