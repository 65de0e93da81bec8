"""Model files: schema spa-fo/model/1, JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from spa_fo.atomic import write_text
from spa_fo.errors import BadInput
from spa_fo.plant.transfer_function import PARAMETERS, TransferFunction

SCHEMA = "spa-fo/model/1"
SIGNALS = ("command", "pressure")
VERDICT = "verdict"
"""Key of an augmented model: how its diagnosis ended, where it ended as `UNKNOWN`."""
UNKNOWN = "unknown"
_OWN_KEYS = (
    "schema",
    "campaign",
    "material",
    "transfer_function",
    "input",
    "output",
    "effects",
)


@dataclass(frozen=True)
class Model:
    """An identified actuator: the plain transfer function, and effects on top of it.

    Parameters
    ----------
    campaign, material : str
        What it was identified from.
    transfer_function : TransferFunction
        From u = pressure / `reference_kpa` to the angle in rad.
    reference_kpa : float
        Gauge pressure at which u = 1.
    signal : {"command", "pressure"}
        Which pressure drives it.
    effects : tuple of mappings
        Each ``{"id": ..., "stage": ..., "parameters": {...}}``, kept as read; empty for the plain
        model.
    extra : mapping
        Further top-level keys of the file, kept as read.
    """

    campaign: str
    material: str
    transfer_function: TransferFunction
    reference_kpa: float
    signal: str = "command"
    effects: tuple[Mapping[str, Any], ...] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the document of the model file."""
        x = self.transfer_function.as_array()
        return {
            "schema": SCHEMA,
            "campaign": self.campaign,
            "material": self.material,
            "transfer_function": dict(zip(PARAMETERS, x.tolist(), strict=True)),
            "input": {"signal": self.signal, "reference_kpa": self.reference_kpa},
            "output": {"unit": "rad"},
            "effects": [dict(effect) for effect in self.effects],
            **self.extra,
        }


def write_model(path: Path | str, model: Model) -> None:
    """Write a model file, whole or not at all.

    Raises
    ------
    BadInput
        The file cannot be written.
    """
    write_text(path, json.dumps(model.to_dict(), indent=2, allow_nan=False) + "\n")


def read_model(path: Path | str) -> Model:
    """Read and check a model file.

    Raises
    ------
    BadInput
        The file cannot be read, is not JSON, misses a key, or a value is not what the schema
        says; the text names the key.
    """
    return _Reader(Path(path)).model()


class _Reader:
    """Checks one document; every refusal names the file and the key."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def model(self) -> Model:
        document = self._document()
        if document.get("schema") != SCHEMA:
            self._refuse("schema", f'expected "{SCHEMA}", found {document.get("schema")!r}')
        signal = self._section(document, "input")
        if self._section(document, "output").get("unit") != "rad":
            self._refuse("output.unit", 'expected "rad"')
        if signal.get("signal") not in SIGNALS:
            self._refuse("input.signal", f"expected one of {', '.join(SIGNALS)}")
        reference = self._number(signal, "reference_kpa", "input")
        if reference <= 0:
            self._refuse("input.reference_kpa", f"expected a positive number, found {reference}")
        return Model(
            campaign=self._text(document, "campaign"),
            material=self._text(document, "material"),
            transfer_function=self._transfer_function(document),
            reference_kpa=reference,
            signal=signal["signal"],
            effects=self._effects(document),
            extra={key: value for key, value in document.items() if key not in _OWN_KEYS},
        )

    def _document(self) -> dict[str, Any]:
        try:
            text = self.path.read_text(encoding="utf-8-sig")
        except OSError as error:
            raise BadInput(self.path, f"cannot be read: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise BadInput(self.path, "expected a JSON model file, found binary data") from error
        try:
            document = json.loads(text, parse_constant=self._not_json)
        except json.JSONDecodeError as error:
            raise BadInput(
                self.path, f"expected JSON: {error.msg}", f"line {error.lineno}"
            ) from error
        except ValueError as error:  # a whole number of thousands of digits
            raise BadInput(self.path, f"expected JSON: {error}") from error
        except RecursionError as error:
            raise BadInput(self.path, "expected JSON: nested too deeply") from error
        if not isinstance(document, dict):
            raise BadInput(self.path, "expected a JSON object")
        return document

    def _not_json(self, constant: str) -> NoReturn:
        raise BadInput(self.path, f"expected finite numbers, found {constant}")

    def _transfer_function(self, document: dict[str, Any]) -> TransferFunction:
        section = self._section(document, "transfer_function")
        values = {name: self._number(section, name, "transfer_function") for name in PARAMETERS}
        try:
            return TransferFunction(**values)
        except ValueError as error:
            self._refuse("transfer_function", str(error))

    def _effects(self, document: dict[str, Any]) -> tuple[Mapping[str, Any], ...]:
        effects = self._entry(document, "effects")
        if not isinstance(effects, list):
            self._refuse("effects", "expected a list")
        for index, effect in enumerate(effects):
            where = f"effects[{index}]"
            if not isinstance(effect, dict):
                self._refuse(where, "expected an object with id, stage and parameters")
            self._text(effect, "id", where)
            self._text(effect, "stage", where)
            if not isinstance(effect.get("parameters"), dict):
                self._refuse(f"{where}.parameters", "expected an object")
        return tuple(effects)

    def _section(self, document: dict[str, Any], key: str) -> dict[str, Any]:
        section = self._entry(document, key)
        if not isinstance(section, dict):
            self._refuse(key, "expected an object")
        return section

    def _text(self, section: dict[str, Any], key: str, within: str = "") -> str:
        value = self._entry(section, key, within)
        if not isinstance(value, str) or not value:
            self._refuse(_join(within, key), f"expected text, found {value!r}")
        return value

    def _number(self, section: dict[str, Any], key: str, within: str) -> float:
        value = self._entry(section, key, within)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._refuse(_join(within, key), f"expected a number, found {value!r}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self._refuse(_join(within, key), "expected a finite number")
        return number

    def _entry(self, section: dict[str, Any], key: str, within: str = "") -> Any:
        if key not in section:
            self._refuse(_join(within, key), "missing, expected this key")
        return section[key]

    def _refuse(self, where: str, expected: str) -> NoReturn:
        raise BadInput(self.path, expected, where)


def _join(within: str, key: str) -> str:
    return f"{within}.{key}" if within else key
