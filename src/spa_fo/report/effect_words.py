"""The library's effects in words that a person at the rig understands."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from spa_fo.plant.effects.effect import Effect
from spa_fo.plant.effects.library import LIBRARY

STAGE_WORDS: Mapping[str, str] = {
    "drive": "the drive (command to pressure)",
    "actuator": "the actuator (pressure to angle)",
    "sensor": "the sensor (angle to reading)",
    "acquisition": "the acquisition (reading to log)",
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


def words_of(effect: str) -> Effect:
    """Return an effect, which says what it is called and means; one no longer known by its id."""
    return LIBRARY[effect] if effect in LIBRARY else Effect(effect, "actuator")


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
    return words_of(effect).name


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

    Those of a shift of the coefficients are ratios to the plain model's.
    """
    form = words_of(effect)
    if parameter in form.coefficients:
        return f"{parameter} ×", ""
    unit = next((p.unit for p in form.parameters if p.name == parameter), "1")
    name = parameter.removesuffix(_SUFFIXES.get(unit, "")).replace("_", " ")
    return re.sub(r"(\d)deg", r"\1°", name.replace("minus ", "−")), _UNITS.get(unit, unit)
