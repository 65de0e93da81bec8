"""Effects that a campaign or an installed package brings along.

A Python file in the campaign's folder ``effects/``, or an entry point of the group
``spa_fo.effects``, gives an `Effect` under the name ``EFFECT``. It is code: it runs with the
rights of whoever reads the campaign. Its ``act`` takes the series at its stage, the times of it in
seconds, and its parameters in their order; it returns the series as the effect leaves it:

- drive: ``act(pressure_kpa, time_s, ...)``, each trial by itself, from rest
- actuator: ``act(pressure_kpa, angle_deg, time_s, ...)``, the pressure that then moves it; without
  the angle where `Effect.sees_angle` is false
- sensor: ``act(angle_deg, time_s, ...)``
- acquisition: ``act(reading_deg, time_s, ...)``, each trial by itself

Actuator and sensor see a whole campaign in one series, rests included, in steps of unequal length.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.plant.effects.effect import STAGES, Check, Effect, Parameter, Stage
from spa_fo.plant.effects.library import IDS, LIBRARY
from spa_fo.plant.law import PLACES

FOLDER = "effects"
GROUP = "spa_fo.effects"
_NAME = "EFFECT"
_RESERVED = ("none", "unknown", "law")  # what an answer may hold beside effects


def use_effects_of(folder: Path | str) -> tuple[str, ...]:
    """Let the library hold what installed packages and this campaign bring along.

    Those of a campaign that was read before leave it.

    Parameters
    ----------
    folder : Path or str
        The campaign's.

    Returns
    -------
    tuple of str
        Their identifiers.

    Raises
    ------
    BadInput
        A file cannot be run, or what it holds is no effect; the text names the file and the key.
    """
    found = {effect.id: effect for effect in _installed()}
    for path in sorted((Path(folder) / FOLDER).glob("*.py")):
        effect = read_effect(path)
        if effect.id in found:
            raise BadInput(path, f"is '{effect.id}', as in {found[effect.id].source}", "id")
        found[effect.id] = effect
    LIBRARY.hold(tuple(found.values()))
    return tuple(found)


def read_effect(path: Path | str) -> Effect:
    """Run one file and return its effect.

    Raises
    ------
    BadInput
        See `use_effects_of`.
    """
    path = Path(path)
    module = ModuleType(path.stem)
    try:
        # Not imported: that would write its bytecode beside raw data.
        code = compile(path.read_text(encoding="utf-8"), str(path), "exec", dont_inherit=True)
        exec(code, module.__dict__)
    except Exception as error:
        raise BadInput(path, f"cannot be run: {_words(error)}", _line_of(error, path)) from error
    if not hasattr(module, _NAME):
        raise BadInput(path, "is missing; expected an Effect of this name", _NAME)
    return checked(getattr(module, _NAME), path)


@cache
def _installed() -> tuple[Effect, ...]:
    found = []
    for point in entry_points(group=GROUP):
        source = f"entry point {point.value}"
        try:
            effect = point.load()
        except Exception as error:
            raise BadInput(source, f"cannot be loaded: {_words(error)}") from error
        found.append(checked(effect, source))
    return tuple(found)


def checked(effect: object, source: Path | str) -> Effect:
    """Return an effect that the chain can run, with its source in it.

    Raises
    ------
    BadInput
        It is none; the text names the key.
    """
    if not isinstance(effect, Effect):
        kind = type(effect).__name__
        raise BadInput(source, f"is of type {kind}; expected an Effect", _NAME)

    def refuse_unless(holds: bool, key: str, expected: str) -> None:
        if not holds:
            raise BadInput(source, expected, key)

    name = effect.id
    refuse_unless(
        isinstance(name, str) and name.isidentifier() and name == name.lower(),
        "id",
        f"is {name!r}; expected lower-case letters, digits and _",
    )
    refuse_unless(
        name not in (*IDS, *_RESERVED), "id", f"is '{name}', which is taken; expected another"
    )
    refuse_unless(
        effect.stage in STAGES,
        "stage",
        f"is {effect.stage!r}; expected one of {', '.join(STAGES)}",
    )
    refuse_unless(
        effect.port == "chain", "port", f"is '{effect.port}'; expected 'chain', the default"
    )
    listed = isinstance(effect.parameters, tuple) and len(effect.parameters) > 0
    refuse_unless(listed, "parameters", "expected a tuple of one Parameter at least")
    for place, parameter in enumerate(effect.parameters):
        wrong = _wrong_of(parameter)
        refuse_unless(not wrong, f"parameters[{place}]", wrong)
    names = [parameter.name for parameter in effect.parameters]
    refuse_unless(
        len(set(names)) == len(names), "parameters", "expected a name of its own for each"
    )
    wanted = (*effect.series, *names)
    refuse_unless(
        callable(effect.act) and _takes(effect.act, len(wanted)),
        "act",
        f"expected a function of ({', '.join(wanted)})",
    )
    refuse_unless(
        effect.half_loop is None or _takes(effect.half_loop, 1 + len(names)),
        "half_loop",
        f"expected a function of (angle_deg, {', '.join(names)})",
    )
    refuse_unless(
        isinstance(effect.odds, int | float) and 0.0 < effect.odds < math.inf,
        "odds",
        f"is {effect.odds!r}; expected a positive number",
    )
    refuse_unless(
        effect.place in ("", *PLACES),
        "place",
        f"is {effect.place!r}; expected one of {', '.join(PLACES)}",
    )
    checks = [*effect.equivalents.values(), *([effect.check] if effect.check else [])]
    refuse_unless(
        all(isinstance(check, Check) for check in checks),
        "check",
        "expected a Check, also of equivalents",
    )
    return replace(effect, source=source)


def _takes(function: Callable[..., Any], count: int) -> bool:
    """Whether a function takes so many arguments by position."""
    try:
        inspect.signature(function).bind(*range(count))
    except TypeError:
        return False
    return True


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


def _wrong_of(parameter: Any) -> str:
    """Say what is wrong with a parameter; nothing where it is right."""
    if not isinstance(parameter, Parameter):
        return f"is of type {type(parameter).__name__}; expected a Parameter"
    low, high = parameter.low, parameter.high
    numbers = (parameter.centre, parameter.spread, low, high, *parameter.starts)
    if not all(math.isfinite(number) for number in numbers):
        return "expected finite numbers"
    if not (low < high and parameter.spread > 0.0):
        return f"is {low:g} to {high:g} by {parameter.spread:g}; expected low < high, spread > 0"
    if parameter.log and not (low > 0.0 and parameter.centre > 0.0):
        return "is searched by its logarithm; expected positive bounds and centre"
    if not low <= parameter.centre <= high:
        return f"is centred at {parameter.centre:g}; expected {low:g} to {high:g}"
    powers = (0.0, 0.0) if parameter.goes_with is None else parameter.goes_with
    if not (isinstance(powers, tuple) and len(powers) == 2 and all(map(_is_number, powers))):
        return "goes with what is no pair of numbers; expected powers of angle and pressure"
    if not parameter.starts or not all(low <= start <= high for start in parameter.starts):
        return f"expected starts from {low:g} to {high:g}"
    return ""


def _words(error: Exception) -> str:
    said = error.msg if isinstance(error, SyntaxError) else error
    return f"{type(error).__name__}: {said}"


def _line_of(error: Exception, path: Path | str) -> str:
    """Name the last line of a file that an error went through."""
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return f"line {error.lineno}"
    line, at = "", error.__traceback__
    while at is not None:
        if at.tb_frame.f_code.co_filename == str(path):
            line = f"line {at.tb_lineno}"
        at = at.tb_next
    return line


def acting(parameters: Floats, stage: Stage) -> Iterator[tuple[Effect, Floats]]:
    """Yield the effects of a stage that a vector of all parameters holds, with their own."""
    for effect in LIBRARY.acting:
        if effect.stage == stage and not math.isnan(parameters[effect.first]):
            yield effect, parameters[effect.slots]


def acted(effect: Effect, values: Floats, *series: Floats) -> Floats:
    """Let an effect act on the first of some series.

    Raises
    ------
    BadInput
        It fails, or returns something other than as many finite numbers.
    """
    act: Callable[..., Any] | None = effect.act
    assert act is not None
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused below
            found = np.asarray(act(*(one.copy() for one in series), *values.tolist()), dtype=float)
    except Exception as error:
        where = _line_of(error, effect.source) or "act"
        raise BadInput(effect.source, f"fails: {_words(error)}", where) from error
    size = series[0].size
    if found.shape != series[0].shape:
        given = " x ".join(map(str, found.shape)) or "one number"
        raise BadInput(effect.source, f"returned {given}; expected {size} numbers", "act")
    if not np.isfinite(found).all():
        given = ", ".join(
            f"{p.name} {value:.6g}" for p, value in zip(effect.parameters, values, strict=True)
        )
        raise BadInput(effect.source, f"is not finite at {given}; expected finite numbers", "act")
    return found
