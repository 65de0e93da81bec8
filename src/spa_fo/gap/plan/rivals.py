"""Explanations that a diagnosis leaves standing, as read from its file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from spa_fo.errors import BadInput
from spa_fo.gap.diagnosis import SCHEMA
from spa_fo.plant import PARAMETERS, TransferFunction
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.validation import suggestion

Floats = NDArray[np.float64]
Ids = tuple[str, ...]
KINDS = ("no_gap", "cause", "ambiguous", "unknown")

_UNSIMULATED = ("coefficients", "line")
"""Ports of what stands in the coefficients, and of what has a phase of its own in every trial."""


@dataclass(frozen=True)
class Rival:
    """One explanation with its fitted values.

    Attributes
    ----------
    ids : tuple of str
        Its effects; empty for the plain model.
    x : (5,) array
        alpha2, alpha1, a1, a0, b0.
    effects : array
        Parameters of all effects in the library's order, NaN where absent or not simulated.
    """

    ids: Ids
    x: Floats
    effects: Floats

    @property
    def label(self) -> str:
        """For tables and sentences."""
        return " + ".join(self.ids) or "the plain model"


def rival(
    ids: Sequence[str],
    parameters: Mapping[str, Mapping[str, Any]],
    coefficients: Mapping[str, float] | Floats,
) -> Rival:
    """Put one together from a cause's parameters and coefficients.

    Parameters
    ----------
    ids : sequence of str
        Its effects.
    parameters : mapping
        Effect -> parameter -> value, or ``{"value": ...}``.
    coefficients : mapping or (5,) array
        alpha2, alpha1, a1, a0, b0.

    Raises
    ------
    KeyError
        An effect or parameter is missing or unknown; its argument is the key.
    ValueError
        Something is no finite number, or no coefficient of a model.
    """
    effects = absent()
    for name in ids:
        form = LIBRARY[name]
        if form.port in _UNSIMULATED:
            continue
        given = parameters[name]
        for place, parameter in enumerate(form.parameters, start=form.first):
            value = _number(given[parameter.name])
            effects[place] = min(max(value, parameter.low), parameter.high)
    if isinstance(coefficients, Mapping):
        values = [_number(coefficients[name]) for name in PARAMETERS]
    else:
        values = [float(value) for value in coefficients]
    if not values[-1] > 0.0:
        raise ValueError(f"expected a positive b0, found {values[-1]:g}")
    return Rival(tuple(ids), TransferFunction.from_array(values).as_array(), effects)


def _number(given: Any) -> float:
    value = given["value"] if isinstance(given, Mapping) else given
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"expected a finite number, found {value!r}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise ValueError("expected a finite number")
    return number


@dataclass(frozen=True)
class Standing:
    """What a diagnosis left open.

    Attributes
    ----------
    kind : str
        Of the verdict.
    rivals : tuple of Rival
        The verdict's sets; with `unknown`, the part that is explained.
    plain : Rival or None
        No effect at all, identified again; None where the file does not hold it.
    floor_deg : float
        Noise floor.
    """

    kind: str
    rivals: tuple[Rival, ...]
    plain: Rival | None
    floor_deg: float


def read_standing(path: Path | str, campaign: str) -> Standing:
    """Read diagnosis.json.

    Parameters
    ----------
    path : Path or str
        The file.
    campaign : str
        Name of the campaign that it must be of.

    Raises
    ------
    BadInput
        The file cannot be read, is no diagnosis, or of another campaign; a key is missing, an
        effect unknown. The text names the key.
    """
    reader = _Reader(Path(path))
    return reader.standing(reader.document(), campaign)


def standing_of(document: Mapping[str, Any], campaign: str) -> Standing:
    """Return what a diagnosis at hand left open; see `read_standing`."""
    return _Reader(Path("diagnosis")).standing(document, campaign)


class _Reader:
    """Checks one document; every refusal names the file and the key."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def refuse(self, where: str, expected: str) -> NoReturn:
        raise BadInput(self.path, expected, where)

    def standing(self, document: Mapping[str, Any], campaign: str) -> Standing:
        if document.get("schema") != SCHEMA:
            self.refuse("schema", f'expected "{SCHEMA}", found {document.get("schema")!r}')
        if document.get("campaign") != campaign:
            found = document.get("campaign")
            self.refuse("campaign", f"expected a diagnosis of '{campaign}', found {found!r}")
        verdict = self._section(document, "verdict", "verdict")
        kind = verdict.get("kind")
        if kind not in KINDS:
            self.refuse("verdict.kind", f"expected one of {', '.join(KINDS)}, found {kind!r}")
        causes = self._list(document, "causes", "causes")
        sets = self._list(verdict, "sets", "verdict.sets")
        if len(sets) < {"ambiguous": 2, "cause": 1}.get(kind, 0):
            self.refuse("verdict.sets", f"expected more sets with the verdict '{kind}'")
        gap = self._section(document, "gap", "gap")
        floor = gap.get("noise_floor_deg")
        if isinstance(floor, bool) or not isinstance(floor, int | float) or not 0.0 < floor < 1e6:
            self.refuse("gap.noise_floor_deg", f"expected a positive number, found {floor!r}")
        return Standing(
            kind=kind,
            rivals=tuple(self._rival(ids, causes) for ids in sets),
            plain=self._plain(causes),
            floor_deg=float(floor),
        )

    def document(self) -> Mapping[str, Any]:
        try:
            document = json.loads(self.path.read_text(encoding="utf-8"))
        except OSError as error:
            raise BadInput(self.path, f"cannot be read: {error.strerror}") from error
        except ValueError as error:
            raise BadInput(self.path, f"is not JSON: {error}") from error
        if not isinstance(document, Mapping):
            raise BadInput(self.path, "expected a JSON object")
        return document

    def _section(self, parent: Mapping[str, Any], key: str, where: str) -> Mapping[str, Any]:
        found = parent.get(key)
        if not isinstance(found, Mapping):
            self.refuse(where, "expected an object" if key in parent else "missing")
        return found

    def _list(self, parent: Mapping[str, Any], key: str, where: str) -> Sequence[Any]:
        found = parent.get(key)
        if not isinstance(found, list):
            self.refuse(where, "expected a list" if key in parent else "missing")
        return found

    def _plain(self, causes: Sequence[Any]) -> Rival | None:
        for cause in causes:
            if isinstance(cause, Mapping) and cause.get("set") == ["none"]:
                try:
                    return rival((), {}, cause.get("transfer_function", {}))
                except (KeyError, TypeError, ValueError):
                    return None
        return None

    def _rival(self, ids: Any, causes: Sequence[Any]) -> Rival:
        if not isinstance(ids, list) or not ids:
            self.refuse("verdict.sets", f"expected lists of effects, found {ids!r}")
        for name in ids:
            if not isinstance(name, str) or name not in LIBRARY:
                near = suggestion(str(name), LIBRARY)
                self.refuse("verdict.sets", f"'{name}' is no known effect{near}")
        for index, cause in enumerate(causes):
            if isinstance(cause, Mapping) and cause.get("set") == ids:
                return self._from_cause(ids, cause, f"causes[{index}]")
        return self.refuse("causes", f"none of them has the verdict's set {ids}")

    def _from_cause(self, ids: list[str], cause: Mapping[str, Any], where: str) -> Rival:
        parameters = self._section(cause, "parameters", f"{where}.parameters")
        coefficients = self._section(cause, "transfer_function", f"{where}.transfer_function")
        try:
            return rival(ids, parameters, coefficients)
        except KeyError as error:
            self.refuse(where, f"misses the key '{error.args[0]}'")
        except (TypeError, ValueError) as error:
            self.refuse(where, str(error))
