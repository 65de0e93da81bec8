"""What a delimited file of unknown make looks like: its delimiter, its header, its numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from spa_fo.errors import BadInput
from spa_fo.rig.csv_log import (
    DECIMAL_COMMA,
    NOT_FINITE,
    NUMBER,
    THOUSANDS,
    read_lines,
    split_fields,
)

Floats = npt.NDArray[np.float64]
Row = Sequence[str]

_DELIMITERS = ("\t", ";", ",", "|", "whitespace")
_SAMPLE = 400  # rows looked at to tell the delimiter
_SHOWN = 40  # characters of a line in a message


@dataclass(frozen=True)
class Table:
    """A delimited file before anyone has said what its columns mean.

    Attributes
    ----------
    delimiter : str
        As `LogFormat` has it.
    header : bool
        Whether a line that is neither numbers nor a comment comes first.
    names : tuple of str
        What the header calls the columns; empty where it does not, or cannot be trusted: another
        number of names than of columns.
    units : tuple of str
        A row of units below the names; empty where there is none.
    values : ndarray, shape (n, width)
        The rows; nan where there is no finite number.
    lines : int
        Of the file.
    notes : tuple of str
        What is odd about its shape.
    """

    delimiter: str
    header: bool
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Floats
    lines: int
    notes: tuple[str, ...]

    @property
    def width(self) -> int:
        """The number of columns."""
        return int(self.values.shape[1])

    def label(self, place: int) -> str:
        """Name the column at the 0-based `place`: ``2 pressure_psi``."""
        return f"{place + 1} {self.names[place]}" if self.names else f"{place + 1}"


def read_table(path: Path | str) -> Table:
    """Read a delimited file, telling delimiter and header by what the rows hold.

    Parameters
    ----------
    path : Path or str
        Any file.

    Returns
    -------
    Table
        At least two rows and two columns of numbers.

    Raises
    ------
    BadInput
        Not readable, empty, binary, no table of numbers, or numbers in a notation that the csv
        reader does not take (decimal commas, thousands grouped by dots).
    """
    path = Path(path)
    lines, whole = read_lines(path)
    delimiter = _delimiter(lines)
    rows = [
        (number, row)
        for number, line in enumerate(lines, start=1)
        if (row := split_fields(line, delimiter)) is not None
    ]
    width = _usual_width([row for _, row in rows if not _is_comment(row)])
    first = next((i for i, (_, row) in enumerate(rows) if _is_numeric(row)), None)
    if first is None or width < 2:
        shown = next((line.strip() for line in lines if line.strip()), "")
        raise BadInput(path, f"holds no rows of numbers but '{_short(shown)}'; expected a csv log")
    head = [row for _, row in rows[:first]]
    body = [(number, row) for number, row in rows[first:] if not _is_comment(row)]
    _refuse_notation(body, path)
    if len(body) < 2:
        raise BadInput(path, f"holds 1 row of numbers in {len(lines)} lines; expected at least 2")
    names, units, notes = _names(head, width)
    widths = Counter(_width(row) for _, row in body)
    if len(widths) > 1:
        kinds = ", ".join(f"{count} of {fields}" for fields, count in widths.most_common(4))
        notes = (*notes, f"ragged rows: {kinds} fields")
    if not whole:
        notes = (*notes, f"line {len(lines)} has no end: it may be cut")
    return Table(
        delimiter,
        any(not _is_comment(row) for row in head),
        names,
        units,
        _numbers([row for _, row in body], width),
        len(lines),
        notes,
    )


def _delimiter(lines: Sequence[str]) -> str:
    """Return the delimiter that splits most rows into the same number of numbers."""
    sample = [line for line in lines if line.strip() and line.lstrip()[:1] != "#"]
    sample = sample[:: max(1, len(sample) // _SAMPLE)]
    return max(_DELIMITERS, key=lambda delimiter: _fitness(sample, delimiter))


def _fitness(lines: Sequence[str], delimiter: str) -> float:
    rows = [row for line in lines if (row := split_fields(line, delimiter)) is not None]
    width = _usual_width(rows)
    if width < 2:
        return 0.0
    usual = [row for row in rows if _width(row) == width]
    fields = [field for row in usual for field in row if field]
    numbers = sum(map(_like_a_number, fields)) / max(1, len(fields))
    return numbers * len(usual) / len(rows)


def _like_a_number(text: str) -> bool:
    return (
        any(kind.fullmatch(text) for kind in (NUMBER, DECIMAL_COMMA, THOUSANDS))
        or text.lower() in NOT_FINITE
    )


def _is_numeric(row: Row) -> bool:
    """Say whether `row` is one of numbers: half of its fields, and two at least."""
    fields = [field for field in row if field]
    numbers = sum(map(_like_a_number, fields))
    return not _is_comment(row) and numbers >= max(2, len(fields) / 2)


def _is_comment(row: Row) -> bool:
    return row[0][:1] == "#"


def _width(row: Row) -> int:
    """Count the fields; what a delimiter at the line's end opens is none."""
    return len(row) - (row[-1] == "")


def _usual_width(rows: Sequence[Row]) -> int:
    widths = Counter(map(_width, rows))
    return widths.most_common(1)[0][0] if widths else 0


def _names(
    head: Sequence[Row], width: int
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return names, units and notes from the lines above the numbers."""
    named = [row for row in head if _width(row) > 1]
    if not named:
        return (), (), ()
    units: tuple[str, ...] = ()
    names = named[0]
    if len(named) > 1 and _width(named[0]) == _width(named[1]) == width:
        units = tuple(named[1][:width])
    if _width(names) != width:
        if _is_comment(names):
            return (), (), ()
        return (), (), (f"the header has {_width(names)} names, the rows {width} fields",)
    return (names[0].lstrip("# "), *names[1:width]), units, ()


def _numbers(rows: Sequence[Row], width: int) -> Floats:
    values = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        for j, text in enumerate(row[:width]):
            if NUMBER.fullmatch(text):
                values[i, j] = float(text)
    values[~np.isfinite(values)] = np.nan
    return values


def _refuse_notation(rows: Sequence[tuple[int, Row]], path: Path) -> None:
    """Refuse numbers written as 0,01 or 1.035.000 where they are the rule in a column."""
    for kind, message in (
        (THOUSANDS, "looks like thousands grouped by dots"),
        (DECIMAL_COMMA, "has a decimal comma"),
    ):
        found: dict[int, list[tuple[int, str]]] = {}
        for number, row in rows:
            for place, text in enumerate(row):
                if kind.fullmatch(text):
                    found.setdefault(place, []).append((number, text))
        for place, hits in found.items():
            if len(hits) > 0.01 * len(rows):
                line, text = hits[0]
                raise BadInput(
                    path,
                    f"'{text}' {message} ({len(hits)} such lines in column {place + 1}); "
                    "expected plain decimal numbers",
                    f"line {line}",
                )


def _short(text: str) -> str:
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."
