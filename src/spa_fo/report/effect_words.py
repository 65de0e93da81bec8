"""The library's effects in words that a person at the rig understands."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from spa_fo.plant.effects.library import LIBRARY

STAGE_WORDS: Mapping[str, str] = {
    "drive": "the drive (command to pressure)",
    "actuator": "the actuator (pressure to angle)",
    "sensor": "the sensor (angle to reading)",
    "acquisition": "the acquisition (reading to log)",
}


@dataclass(frozen=True)
class Words:
    """What to call an effect, what happens on the rig, and what to do about it there."""

    name: str
    means: str
    remedy: str


EFFECT_WORDS: Mapping[str, Words] = {
    "dead_time": Words(
        "dead time of the drive",
        "the pressure follows the command after a pure delay",
        "look for the delay in the valve, the tube and the control loop; a shorter tube or a "
        "faster loop removes it",
    ),
    "line_lag": Words(
        "pneumatic lag of the line",
        "tube and chamber fill slowly, so the pressure is a smoothed command",
        "shorten or widen the tube, or put the regulator's sensor at the actuator",
    ),
    "supply_droop": Words(
        "droop of the supply",
        "the supply sags at each rise and recovers while the command is held",
        "add a reservoir or a supply of more flow, and log the supply pressure",
    ),
    "leak": Words(
        "leak",
        "pressure is lost while the command is held",
        "hold the pressure with the valves closed, find the fitting or seam that leaks and seal it",
    ),
    "slew_limit": Words(
        "slew limit of the drive",
        "the pump changes the pressure at a limited rate only",
        "command ramps the pump can follow, or fit a faster pump",
    ),
    "drive_backlash": Words(
        "backlash of the drive",
        "after a reversal of the command the pressure waits",
        "take the play out of the pump's spindle, or approach every level from the same side",
    ),
    "stiffening": Words(
        "stiffening of the actuator",
        "the restoring moment grows faster than the angle",
        "keep it in the model: it belongs to the material and the shape",
    ),
    "gravity_load": Words(
        "gravity",
        "the weight of the actuator or of a mass at its tip adds a moment",
        "note the orientation, and repeat one step with the actuator turned over",
    ),
    "contact_stop": Words(
        "contact",
        "beyond some angle something pushes back",
        "look for what the actuator touches there: frame, cable, table, or itself",
    ),
    "mullins_softening": Words(
        "Mullins softening",
        "the first loadings to a new maximum are stiffer; it fades over a few trials",
        "load the specimen some ten times to the largest pressure before measuring",
    ),
    "creep": Words(
        "creep of the material",
        "the angle keeps growing slowly under held load and comes back at rest",
        "keep it in the model, and keep holds and rests alike from trial to trial",
    ),
    "hysteresis": Words(
        "hysteresis of the actuator",
        "loading and unloading take different paths, and an angle remains after release",
        "keep it in the model, and approach every level from the same side where it matters",
    ),
    "thermal_drift": Words(
        "thermal drift",
        "the gain drifts steadily with the time of day",
        "let rig and specimen warm up, log the temperature, and mix the order of the experiments",
    ),
    "parameter_shift": Words(
        "other coefficients",
        "the physics is the same but the specimen is another one",
        "identify the model again on this specimen: `spa-fo fit`",
    ),
    "sensor_nonlinearity": Words(
        "wrong curve of the sensor",
        "the flex sensor's curve is not the one that was calibrated",
        "calibrate again with the sensor in its pocket, at more angles",
    ),
    "sensor_saturation": Words(
        "saturation of the sensor",
        "the reading stops rising at the top of its range",
        "change the divider's resistor or the gain, so that the whole range of angles fits",
    ),
    "sensor_lag": Words(
        "lag of the sensor",
        "the reading follows the angle as through a low-pass",
        "take filtering out of the sensor's circuit; check against a video of one step",
    ),
    "sensor_creep": Words(
        "creep of the sensor",
        "the reading keeps drifting while the angle is held",
        "calibrate with long dwells, and check one hold against a video or a protractor",
    ),
    "sensor_hysteresis": Words(
        "hysteresis of the sensor",
        "the reading depends on the direction of bending",
        "calibrate up and down, and read angles after approaching them from below",
    ),
    "sensor_slip": Words(
        "slip of the sensor",
        "the sensor shifts in its pocket, and its zero walks or jumps from trial to trial",
        "glue or clamp the sensor, and zero it before every trial",
    ),
    "channel_latency": Words(
        "latency of the flex channel",
        "the angle is logged late against command and pressure",
        "look for a filter or a buffer in the firmware's flex channel; sample all channels at once",
    ),
    "mains_pickup": Words(
        "mains pickup",
        "a periodic interference on the flex channel",
        "shield and ground the sensor's cable, and move it away from the pump's supply",
    ),
}


MAP_WORDS: Mapping[str, str] = {
    "stage": "stage",
    "phase": "phase of the response",
    "amplitude": "amplitude",
    "direction": "direction",
    "trial": "trial order",
    "frequency": "frequency",
}
"""What the maps of where a gap lies are called."""


def phrase(ids: Sequence[str], between: str = " together with ") -> str:
    """Name a set of effects as people say it; ``none`` and ``unknown`` too."""
    return between.join(_name(each) for each in ids)


def bin_words(name: str) -> str:
    """Name a bin of a map."""
    return name.replace("_", " ").replace(" deg", "°")


def joined(parts: Sequence[str], word: str) -> str:
    """Join parts as a sentence does: ``a, b and c``."""
    if len(parts) < 2:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} {word} {parts[-1]}"


def _name(effect: str) -> str:
    if effect == "none":
        return "no effect (the plain model)"
    if effect == "unknown":
        return "a cause that the library lacks"
    return EFFECT_WORDS[effect].name


_SUFFIXES = {
    "s": "_s",
    "deg": "_deg",
    "kPa": "_kpa",
    "kPa/s": "_kpa_s",
    "Hz": "_hz",
    "1/s": "_per_s",
    "1/h": "_per_hour",
    "deg per trial": "_deg",
}
_UNITS = {"1": "", "deg": "°", "deg per trial": "° per trial"}


def parameter_words(effect: str, parameter: str) -> tuple[str, str]:
    """Return a parameter's name without its unit, and the unit to put behind the number.

    Those of ``parameter_shift`` are ratios to the plain model's coefficients.
    """
    if effect == "parameter_shift":
        return f"{parameter} ×", ""
    unit = next((p.unit for p in LIBRARY[effect].parameters if p.name == parameter), "1")
    name = parameter.removesuffix(_SUFFIXES.get(unit, "")).replace("_", " ")
    return re.sub(r"(\d)deg", r"\1°", name.replace("minus ", "−")), _UNITS.get(unit, unit)
