"""Effects and their parameters, one a row: words, value, interval, unit, typical size."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import exp
from typing import Any

import numpy as np

from spa_fo.gap.diagnosis import Cause, Diagnosis
from spa_fo.plant.effects.effect import Parameter, Reach
from spa_fo.report.causes import named
from spa_fo.report.effect_words import parameter_words, phrase, words_of

_LEAST = 0.05  # probability from which the parameters of an explanation are listed
Fitted = Mapping[str, Mapping[str, Any]]
"""Parameters of an effect by name, as `Cause.parameters` has them of each."""
HEAD = ("effect", "parameter", "value", "95 % interval", "unit", "typical size", "what it is")


@dataclass(frozen=True)
class Entry:
    """One parameter.

    Attributes
    ----------
    effect : str
        Name of the effect, as people say it.
    name, unit : str
        Of the parameter; the unit is empty where there is none.
    value, interval : str
        As fitted; the interval is empty where there is none.
    typical : str
        Where the library expects two thirds of all cases.
    means : str
        What it is.
    """

    effect: str
    name: str
    value: str
    interval: str
    unit: str
    typical: str
    means: str

    @property
    def cells(self) -> tuple[str, ...]:
        """In the order of `HEAD`."""
        return (
            *(self.effect, self.name, self.value, self.interval, self.unit),
            *(self.typical, self.means),
        )


def listed(diagnosis: Diagnosis) -> list[Cause]:
    """Return the explanations whose parameters are listed: those that stand or are probable."""
    return [
        cause
        for cause in named(diagnosis.causes, len(diagnosis.causes))
        if cause.set in diagnosis.sets or cause.probability >= _LEAST
    ]


def entries(cause: Cause, reach: Reach, but: Collection[str] = ()) -> list[Entry]:
    """List the parameters of an explanation on a rig of a reach, but those of some effects."""
    return [
        _entry(effect, name, fitted, reach)
        for effect, parameters in cause.parameters.items()
        for name, fitted in parameters.items()
        if effect not in but
    ]


def agree(own: Fitted, others: Fitted) -> bool:
    """Say whether all values of an effect lie in the intervals that another fit of it has."""
    return all(_within(fitted["value"], others[name]) for name, fitted in own.items())


def _within(value: float, other: Mapping[str, Any]) -> bool:
    low, high = other.get("ci95") or [other["value"]] * 2
    return bool(low <= value <= high)


def meanings(causes: Sequence[Cause]) -> Iterator[tuple[str, str]]:
    """Name every effect of some explanations once, and say what it does."""
    for effect in dict.fromkeys(name for cause in causes for name in cause.set):
        yield phrase((effect,)), words_of(effect).means


def _entry(effect: str, name: str, fitted: Mapping[str, Any], reach: Reach) -> Entry:
    words, unit = parameter_words(effect, name)
    ci95 = fitted.get("ci95")
    form = next((p for p in words_of(effect).parameters if p.name == name), None)
    return Entry(
        effect=phrase((effect,)),
        name=words,
        value=number(fitted["value"]),
        interval="" if ci95 is None else " to ".join(number(end) for end in ci95),
        unit=unit,
        typical="about 1" if form is None else typical(form.at(reach)),
        means=words_of(effect).meanings.get(name, ""),
    )


def typical(parameter: Parameter) -> str:
    """Say where the library expects a parameter, in two thirds of all cases: its prior's 1 sigma.

    Parameters
    ----------
    parameter : Parameter
        Of an effect.
    """
    centre, spread = parameter.centre, parameter.spread
    if parameter.log:
        low, high = centre * exp(-spread), centre * exp(spread)
    else:
        low, high = centre - spread, centre + spread
    low, high = max(low, parameter.low), min(high, parameter.high)
    if centre == 0.0 and low == 0.0:
        return f"up to {number(high, 2)}"
    return f"{number(low, 2)} to {number(high, 2)}"


def number(value: float, digits: int = 3) -> str:
    """Write the digits that count, without exponents."""
    text = np.format_float_positional(value, precision=digits, fractional=False, trim="-")
    return text.replace("-", "−")
