"""The ``log:`` section of campaign.yaml: how logs are written, and which column is what."""

from __future__ import annotations

import codecs
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from spa_fo.errors import BadInput
from spa_fo.rig.timestamps import is_format

ANGLES = frozenset({"angle", "flex_adc"})
"""Columns that say how far the actuator bends."""
NO_UNIT = "1"
"""Unit of counts, and of a command that is no pressure."""
DATETIME = "datetime"
"""Unit of a time that is written as a date and time, or as a time of day."""


@dataclass(frozen=True)
class Column:
    """One column of a csv log: value = raw·scale + offset in `unit`.

    `column` is a header name, or a 1-based index. `format` is that of a time in unit ``datetime``,
    as for `datetime.strptime`; None is ISO 8601.
    """

    column: str | int
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    rest: Literal["zero", "keep"] = "keep"
    format: str | None = None


@dataclass(frozen=True)
class LogFormat:
    """How the logs are written: ``spa-rig``, or ``csv`` with the meaning of its columns.

    `header_row` is the 1-based line of the names, where it is neither the first one nor the one
    that holds the names of `columns`; lines above it are not read.
    """

    format: Literal["spa-rig", "csv"]
    delimiter: str = ","
    header: bool = True
    columns: Mapping[str, Column] | None = None
    decimal: str = "."
    encoding: str = "utf-8"
    header_row: int | None = None


def log_format(entry: Mapping[str, Any], path: Path, angle: bool = True) -> LogFormat:
    """Return what the ``log:`` section `entry`, which holds to the schema, says.

    `angle` says whether one has to be logged.

    Raises
    ------
    BadInput
        It contradicts itself; `path` is the campaign.yaml that the message names.
    """
    if entry["format"] == "spa-rig":
        extra = sorted(set(entry) - {"format"})
        if extra:
            raise BadInput(path, "belongs to format csv only", f"log.{extra[0]}")
        return LogFormat("spa-rig")
    header = entry.get("header", True)
    if not header and "header_row" in entry:
        raise BadInput(path, "belongs to header: true only", "log.header_row")
    columns = {
        role: _column(item, header, path, f"log.columns.{role}")
        for role, item in entry["columns"].items()
    }
    if angle and not ANGLES & columns.keys():
        raise BadInput(path, "expected a column 'angle' or 'flex_adc'", "log.columns")
    return LogFormat(
        "csv",
        entry.get("delimiter", ","),
        header,
        columns,
        entry.get("decimal", "."),
        _encoding(entry.get("encoding", "utf-8"), path),
        entry.get("header_row"),
    )


def _column(item: Mapping[str, Any], header: bool, path: Path, where: str) -> Column:
    if not header and isinstance(item["column"], str):
        raise BadInput(
            path,
            f"is '{item['column']}'; expected a 1-based index, as header is false",
            f"{where}.column",
        )
    unit, form = _unit(item.get("unit", "1")), item.get("format")
    for key in ("scale", "offset"):
        if unit == DATETIME and key in item:
            raise BadInput(path, "belongs to numbers, not to unit datetime", f"{where}.{key}")
    if form is not None and unit != DATETIME:
        raise BadInput(path, "belongs to unit datetime only", f"{where}.format")
    if form is not None and not is_format(form):
        raise BadInput(
            path,
            f"is '{form}'; expected the format of a date and time, such as '%d.%m.%Y %H:%M:%S.%f'",
            f"{where}.format",
        )
    return Column(
        column=item["column"],
        unit=unit,
        scale=float(item.get("scale", 1.0)),
        offset=float(item.get("offset", 0.0)),
        rest=item.get("rest", "keep"),
        format=form,
    )


def _unit(written: Any) -> str:
    """Name of a unit; the dimensionless one may be written as any number 1."""
    return str(int(written)) if isinstance(written, float) else str(written)


def _encoding(name: str, path: Path) -> str:
    try:
        "".encode(name)
        codecs.lookup(name)
    except (LookupError, ValueError):
        raise BadInput(
            path,
            f"is '{name}'; expected a text encoding such as utf-8, cp1252 or utf-16",
            "log.encoding",
        ) from None
    return name
