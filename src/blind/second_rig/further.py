"""Effects beyond effects.yaml that libraries may name: the form of each, drawn anew each case."""

from __future__ import annotations

import numpy as np

from blind.second_rig.effect import Draw, Effect, Scene, log_uniform, pick, sign

_MOST_TRIALS = 200  # of a campaign and its later one

Rng = np.random.Generator


def _gain_growth(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "membrane", "bellows", "tension", "opposed")
    shape = {"top": scene.top_input}
    if form == "opposed":
        shape["stretch"] = rng.uniform(0.3, 0.6)
    unit, limit = {
        "membrane": ("largest pressure over the bursting one", 0.6),
        "bellows": ("gain at the top over that at zero, - 1", 0.6),
        "tension": ("gain at zero over that at the top, - 1", 1.2),
        "opposed": ("share of the moment opposed at the top", 0.35),
    }[form]
    return Effect("gain_growth", form, unit, limit, shape)


def _pressure_set(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "ratchet", "networks", "flow")
    slowest = log_uniform(rng, 60.0, 500.0)
    shape = {"elements": 1.0, "shortest_s": slowest, "longest_s": slowest}
    if form == "networks":
        shape = {"elements": 3.0, "shortest_s": log_uniform(rng, 10.0, 30.0), "longest_s": 800.0}
    if form == "flow":
        shape |= {
            "setting_s": rng.uniform(3.0, 15.0),
            "yield_rad": rng.uniform(0.2, 0.5) * scene.top_rad,
            "top_rad": scene.top_rad,
        }
    else:
        shape |= {
            "setting_s": rng.uniform(0.5, 3.0) if form == "ratchet" else rng.uniform(4.0, 12.0),
            "knee": rng.uniform(0.3, 0.8),
            "top": scene.top_input,
        }
    return Effect("pressure_set", form, "most of a set over the largest angle", 0.3, shape)


def _body_mode(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "struck", "struck_in_air", "carried")
    shape = {
        "frequency_hz": log_uniform(rng, 0.3, 2.0 if form != "carried" else 1.0),
        "damping": log_uniform(rng, 0.01, 0.06),
    }
    if form == "struck_in_air":
        shape |= {"damping": 0.005, "drag": rng.uniform(0.05, 0.2)}
    if form == "carried":
        return Effect("body_mode", form, "lever of the carried mass over the body's", 2.5, shape)
    return Effect("body_mode", form, "swing over the settled angle", 0.5, shape)


def _drive_overshoot(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "second_order", "kick", "windup")
    if form == "second_order":
        shape = {"damping": rng.uniform(0.15, 0.5)}
        return Effect("drive_overshoot", form, "period of the swing, s", 4.0, shape)
    if form == "kick":
        shape = {"rise_s": rng.uniform(0.02, 0.15), "fall_s": log_uniform(rng, 0.7, 4.0)}
        return Effect("drive_overshoot", form, "share of a step that comes on top", 0.6, shape)
    shape = {
        "top": scene.top_kpa,
        "proportion": rng.uniform(2.0, 4.0),
        "integral": rng.uniform(3.0, 7.0),
    }
    return Effect("drive_overshoot", form, "time from zero to the top, s", 2.5, shape)


def _drive_hunting(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "sine", "relay", "stick_slip")
    shape = {
        "top": scene.top_kpa,
        "frequency_hz": log_uniform(rng, 0.15, 0.5),
        "lively_s": rng.uniform(0.4, 2.0),
        "still": rng.uniform(0.01, 0.03),
        "power": rng.uniform(0.3, 1.0),
    }
    if form == "sine":
        shape["second"] = rng.uniform(0.0, 0.25)
    else:
        shape["skew"] = rng.uniform(0.3, 0.7)
    uneven = rng.normal(size=97)  # of the cycles' lengths
    unit = "amplitude over the largest pressure"
    return Effect("drive_hunting", form, unit, 0.35, shape, series=uneven)


def _opening_fold(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "crease", "hinge", "snap")
    opens = rng.uniform(0.3, 0.65)
    if form == "hinge":
        shape = {"opens_rad": opens * scene.top_rad}
        return Effect("opening_fold", form, "stiffness lost beyond the angle", 0.7, shape)
    shape = {"opens": opens, "top": scene.top_input}
    if form == "crease":
        shape["knee"] = rng.uniform(0.03, 0.12)
        return Effect("opening_fold", form, "added slope beyond the pressure", 1.5, shape)
    shape |= {"shuts": rng.uniform(0.4, 0.85), "snap_s": rng.uniform(0.03, 0.2)}
    return Effect("opening_fold", form, "added slope of the open fold", 1.0, shape)


def _pressure_damping(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "fractional", "dashpot", "touching")
    shape = {"top": scene.top_input}
    if form == "fractional":
        shape |= {"sign": sign(rng, 0.7), "power": rng.uniform(0.7, 1.5)}
        limit = 5.0 if shape["sign"] > 0.0 else 0.9
        return Effect("pressure_damping", form, "change of a1 at the top over a1", limit, shape)
    if form == "dashpot":
        shape["power"] = rng.uniform(0.7, 2.0)
    else:
        shape["touches"] = rng.uniform(0.2, 0.5)
    return Effect("pressure_damping", form, "drag at the top over stiffness, s", 5.0, shape)


def _unsigned_reading(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "absolute", "norm", "rectifier")
    shape = {"lowest_deg": -20.0}  # below what is ever reached
    if form == "norm":
        shape["across"] = rng.uniform(0.03, 0.12)
    else:
        shape["mirrored"] = 1.0 if form == "absolute" else rng.uniform(0.6, 1.3)
    return Effect("unsigned_reading", form, "fold above the lowest angle, deg", 50.0, shape)


def _sensor_detachment(rng: Rng, scene: Scene) -> Effect:
    what = pick(rng, "gain", "gain_and_zero", "zero")
    lasting = rng.random() < 0.6
    trial = int(rng.integers(scene.trials))
    started_s, length_s = scene.starts_s[trial], scene.lengths_s[trial]
    shape = {
        "trial": trial + 1.0,
        "at_s": started_s + rng.uniform(0.12, 0.45) * length_s,
        "peel_s": log_uniform(rng, 0.02, 0.6),
        "gain": 0.0 if what == "zero" else 1.0,
        "zero_deg": 0.0,
    }
    if not lasting:  # it is pressed on again before the next one
        shape["until_s"] = started_s + length_s + 1.0
    form = what if lasting else f"{what}_for_a_trial"
    if what == "zero":
        shape["zero_deg"] = sign(rng, 0.7)
        return Effect("sensor_detachment", form, "jump of the zero, deg", 40.0, shape)
    if what == "gain_and_zero":
        shape["zero_deg"] = sign(rng) * rng.uniform(5.0, 30.0)
    return Effect("sensor_detachment", form, "share of the gain that is lost", 0.9, shape)


def _sensor_freeze(rng: Rng, scene: Scene) -> Effect:
    form = pick(rng, "for_a_while", "to_the_end")
    ends = np.full(_MOST_TRIALS, np.nan)
    count = 1 if rng.random() < 0.5 else max(1, round(0.3 * scene.trials))
    where = 1 + rng.permutation(scene.trials)[:count]
    shape = {"trials": float(count), "first_trial": float(where.min())}
    if count > 1:  # so it goes on
        after = np.arange(scene.trials + 1, _MOST_TRIALS)
        where = np.concatenate([where, after[rng.random(after.size) < 0.3]])
    ends[where] = 1.0 if form == "to_the_end" else rng.uniform(0.3, 0.9, where.size)
    longest = max(scene.lengths_s[k - 1] for k in where[:count])
    unit = "length of a freeze, s"
    return Effect("sensor_freeze", form, unit, longest, shape, series=ends, searched=True)


DRAWS: dict[str, Draw] = {
    "gain_growth": _gain_growth,
    "pressure_set": _pressure_set,
    "body_mode": _body_mode,
    "drive_overshoot": _drive_overshoot,
    "drive_hunting": _drive_hunting,
    "opening_fold": _opening_fold,
    "pressure_damping": _pressure_damping,
    "unsigned_reading": _unsigned_reading,
    "sensor_detachment": _sensor_detachment,
    "sensor_freeze": _sensor_freeze,
}
