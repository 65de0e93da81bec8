"""Explanations that a diagnosis leaves standing, as read from its file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.gap.diagnosis import SCHEMA
from spa_fo.plant import PARAMETERS, TransferFunction
from spa_fo.plant.effects.effect import Parameter
from spa_fo.plant.effects.library import LIBRARY, Ids, absent
from spa_fo.validation import validate

_FEWEST = {"no_gap": 0, "cause": 1, "ambiguous": 2, "unknown": 0}
"""Sets that each kind of verdict has at least."""
_UNSIMULATED = ("coefficients", "line")
"""Ports of what stands in the coefficients, and of what has a phase of its own in every trial."""


@dataclass(frozen=True)
class Rival:
    """One explanation: its effects (none for the plain model), coefficients, and parameters.

    `effects` holds those of all effects in the library's order, NaN where absent or not simulated.
    """

    ids: Ids
    x: Floats
    effects: Floats

    @property
    def label(self) -> str:
        """For tables and sentences."""
        return " + ".join(self.ids) or "the plain model"


@dataclass(frozen=True)
class Standing:
    """What a diagnosis left open: the kind of its verdict, the sets, and the noise floor.

    `plain` is no effect at all, identified again; None where the file does not hold it.
    `reference_kpa` is the pressure that the coefficients' input is in units of; None, as in files
    of before, is the campaign's own.
    """

    kind: str
    rivals: tuple[Rival, ...]
    plain: Rival | None
    floor_deg: float
    reference_kpa: float | None = None


def rival(
    ids: Sequence[str],
    parameters: Mapping[str, Mapping[str, Any]],
    coefficients: Mapping[str, Any],
) -> Rival:
    """Put one together as a diagnosis holds it, each parameter taken to its bounds.

    `parameters` leads from effect to parameter to value, or ``{"value": ...}``.

    Raises
    ------
    KeyError, TypeError, ValueError
        A key is missing, or something is no finite number or no coefficient of a model.
    """
    effects = absent()
    for name in ids:
        effect = LIBRARY[name]
        if effect.port not in _UNSIMULATED:
            effects[effect.slots] = [
                min(max(_number(_given(parameters[name], p)), p.low), p.high)
                for p in effect.parameters
            ]
    values = [_number(coefficients[name]) for name in PARAMETERS]
    if not values[-1] > 0.0:
        raise ValueError(f"expected a positive b0, found {values[-1]:g}")
    return Rival(tuple(ids), TransferFunction.from_array(values).as_array(), effects)


def _given(values: Mapping[str, Any], parameter: Parameter) -> Any:
    """Return a parameter as it was written; 0 where it came to its effect later."""
    return values.get(parameter.name, 0.0) if parameter.is_addition else values[parameter.name]


def _number(given: Any) -> float:
    value = given["value"] if isinstance(given, Mapping) else given
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"expected a finite number, found {value!r}")
    return float(value)


def read_standing(path: Path | str, campaign: str) -> Standing:
    """Read diagnosis.json, which must be of the campaign of this name.

    Raises
    ------
    BadInput
        The file cannot be read, is no diagnosis, or of another campaign; a key is missing, an
        effect unknown. The text names the key.
    """
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(path, f"cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise BadInput(path, f"is not JSON: {error}") from error
    return standing_of(document, campaign, path)


def standing_of(document: Any, campaign: str, source: Path | str = "diagnosis") -> Standing:
    """Return what a diagnosis at hand left open; see `read_standing`."""
    found = document.get("campaign", campaign) if isinstance(document, Mapping) else campaign
    if found != campaign:
        expected = f"expected a diagnosis of '{campaign}', found {found!r}"
        raise BadInput(source, expected, "campaign")
    validate(document, _schema(), source)
    kind, sets = document["verdict"]["kind"], document["verdict"]["sets"]
    if len(sets) < _FEWEST[kind]:
        expected = f"expected more sets with the verdict '{kind}'"
        raise BadInput(source, expected, "verdict.sets")
    at = {tuple(cause["set"]): index for index, cause in enumerate(document["causes"])}

    def found_as(ids: Ids, named: Ids) -> Rival:
        if named not in at:
            raise BadInput(source, f"none of them has the verdict's set {list(named)}", "causes")
        cause, where = document["causes"][at[named]], f"causes[{at[named]}]"
        try:
            return rival(ids, cause["parameters"], cause["transfer_function"])
        except KeyError as error:
            raise BadInput(source, f"misses the key '{error.args[0]}'", where) from error
        except (TypeError, ValueError) as error:
            raise BadInput(source, str(error), where) from error

    try:
        plain = found_as((), ("none",))
    except BadInput:
        plain = None
    rivals = tuple(found_as(tuple(ids), tuple(ids)) for ids in sets)
    reference_kpa = document.get("reference_kpa")
    return Standing(kind, rivals, plain, float(document["gap"]["noise_floor_deg"]), reference_kpa)


def _schema() -> dict[str, Any]:
    """JSON schema of what is read of a diagnosis."""
    effects = {"type": "array", "minItems": 1, "items": {"enum": list(LIBRARY)}}
    names = {"type": "array", "items": {"type": "string"}}
    positive = {"type": "number", "exclusiveMinimum": 0}
    schema = _object(
        schema={"const": SCHEMA},
        campaign={},
        gap=_object(noise_floor_deg=positive),
        verdict=_object(kind={"enum": list(_FEWEST)}, sets={"type": "array", "items": effects}),
        causes={"type": "array", "items": _object(set=names)},
    )
    schema["properties"]["reference_kpa"] = positive  # files of before lack it
    return schema


def _object(**properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "required": list(properties), "properties": properties}
