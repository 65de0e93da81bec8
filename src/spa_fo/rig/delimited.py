"""What a delimited file of unknown make looks like: its delimiter, its header, its numbers."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.rig.fields import (
    DECIMAL_COMMA,
    NOT_FINITE,
    NUMBER,
    THOUSANDS,
    THOUSANDS_AND_COMMA,
    comma_number,
    guess_encoding,
    number,
    read_lines,
    split_fields,
)
from spa_fo.rig.raw import read_bytes
from spa_fo.rig.timestamps import guess_format, unwrapped
from spa_fo.rig.timestamps import reader as stamp_reader
from spa_fo.rig.units import read_unit

Row = Sequence[str]

_DELIMITERS = ("\t", ";", ",", "|", "whitespace")
_SAMPLE = 400  # rows looked at to tell the delimiter
_USUAL = 0.8  # share of the rows that have numbers in a column of numbers
_NUMBERS = (NUMBER, DECIMAL_COMMA, THOUSANDS, THOUSANDS_AND_COMMA)
_TIME = re.compile(
    r"(?:^|[ T])\d{1,2}:\d{2}(?::\d{2})?(?:[.,]\d+)?(?: ?[APap][Mm]|Z|[+-]\d\d:?\d\d)?$"
)
_SHOWN = 40  # characters of a line in a message


@dataclass(frozen=True)
class Stamp:
    """How a column's dates and times are written, None for ISO 8601, and what is unsure of it."""

    format: str | None
    doubt: str = ""


@dataclass(frozen=True)
class Table:
    """A delimited file before anyone has said what its columns mean.

    Attributes
    ----------
    delimiter : str
        As `LogFormat` has it.
    decimal : str
        "." or ",".
    encoding : str
        Of the text.
    header : bool
        Whether a line that is neither numbers nor a comment comes first.
    header_row : int
        The 1-based line of the names; 0 where there is none.
    names : tuple of str
        What the header calls the columns; empty where it does not, or cannot be trusted: another
        number of names than of columns.
    units : tuple of str
        A row of units below the names; empty where there is none.
    values : ndarray, shape (n, width)
        The rows; nan where there is no finite number, seconds where there is a time stamp.
    stamps : dict of int to Stamp
        By 0-based place: columns that hold dates and times.
    lines : int
        Of the file.
    notes : tuple of str
        What is odd about its shape.
    """

    delimiter: str
    decimal: str
    encoding: str
    header: bool
    header_row: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Floats
    stamps: Mapping[int, Stamp]
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
        Not readable, empty, binary, no table of numbers, or numbers with thousands grouped by
        dots, which the csv reader does not take.
    """
    path = Path(path)
    encoding = guess_encoding(read_bytes(path, "a csv log"))
    lines, whole = read_lines(path, encoding)
    delimiter = _delimiter(lines)
    rows = [
        (number, row)
        for number, line in enumerate(lines, start=1)
        if (row := split_fields(line, delimiter)) is not None
    ]
    width = _usual_width([row for _, row in rows if not _is_comment(row)])
    first = _first_of_body(rows, width)
    if first is None or width < 2:
        shown = next((line.strip() for line in lines if line.strip()), "")
        raise BadInput(path, f"holds no rows of numbers but '{_short(shown)}'; expected a csv log")
    head = rows[:first]
    body = [(number, row) for number, row in rows[first:] if not _is_comment(row)]
    decimal = _decimal([row for _, row in body])
    _refuse_thousands(body, path)
    if len(body) < 2:
        raise BadInput(path, f"holds 1 row of numbers in {len(lines)} lines; expected at least 2")
    header_row, names, units, notes = _names(head, width, _usual_length(body))
    widths = Counter(_width(row) for _, row in body)
    if len(widths) > 1:
        kinds = ", ".join(f"{count} of {fields}" for fields, count in widths.most_common(4))
        notes = (*notes, f"ragged rows: {kinds} fields")
    if not whole:
        notes = (*notes, f"line {len(lines)} has no end: it may be cut")
    values, stamps = _columns([row for _, row in body], width, decimal)
    return Table(
        delimiter=delimiter,
        decimal=decimal,
        encoding=encoding,
        header=any(not _is_comment(row) for _, row in head),
        header_row=header_row,
        names=names,
        units=units,
        values=values,
        stamps=stamps,
        lines=len(lines),
        notes=notes,
    )


def _first_of_body(rows: Sequence[tuple[int, Row]], width: int) -> int | None:
    """Find the first row of the usual width that has numbers where the rows usually have them.

    A preamble may hold numbers too (``Samples;100;100``), but not where the body has them.
    """
    usual = [row for _, row in rows if _width(row) == width and not _is_comment(row)]
    filled = [place for place in range(width) if _mostly_numbers(usual, place)]
    for i, (_, row) in enumerate(rows):
        if _is_numeric(row) and _width(row) == width and len(usual) > 1:
            fields = [row[place] for place in filled]
            if all(_like_a_number(field) or not field for field in fields) and any(fields):
                return i
    return next((i for i, (_, row) in enumerate(rows) if _is_numeric(row)), None)


def _mostly_numbers(rows: Sequence[Row], place: int) -> bool:
    return sum(_like_a_number(row[place]) for row in rows) > _USUAL * len(rows)


def _decimal(rows: Sequence[Row]) -> str:
    """Return the comma where more fields have one than a point."""
    fields = [field for row in rows for field in row]
    commas = sum(DECIMAL_COMMA.fullmatch(field) is not None for field in fields)
    points = sum("." in field and NUMBER.fullmatch(field) is not None for field in fields)
    return "," if commas > points else "."


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
        any(kind.fullmatch(text) for kind in _NUMBERS)
        or text.lower() in NOT_FINITE
        or _TIME.search(text) is not None
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


def _usual_length(rows: Sequence[tuple[int, Row]]) -> int:
    return Counter(len(row) for _, row in rows).most_common(1)[0][0]


def _names(
    head: Sequence[tuple[int, Row]], width: int, length: int
) -> tuple[int, tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the names' line, names, units and notes from the lines above the numbers.

    The names are the last line of the rows' width, or the one before it where units follow them.
    Rows may end with a field that is always empty: `length` counts it.
    """
    named = [(line, row) for line, row in head if _width(row) > 1]
    if not named:
        return 0, (), (), ()
    fits = [(line, row) for line, row in named if _names_all(row, width, length)]
    fitting = [(line, row) for line, row in fits if not _is_comment(row)] or fits
    # A row of numbers that lost all but one is no row of names.
    fitting = [(line, row) for line, row in fitting if not any(map(_like_a_number, row))] or fitting
    if not fitting:
        line, row = named[-1]
        if _is_comment(row):
            return 0, (), (), ()
        return line, (), (), (f"the header has {_width(row)} names, the rows {width} fields",)
    line, names = fitting[-1]
    units: Row = ()
    if len(fitting) > 1 and fitting[-2][0] == line - 1 and _are_units(names, fitting[-2][1]):
        units = names[:width]
        line, names = fitting[-2]
    return line, (names[0].lstrip("# "), *names[1:width]), tuple(units), ()


def _names_all(row: Row, width: int, length: int) -> bool:
    """Say whether a line may name every column."""
    filled = sum(map(bool, row)) > 0.5 * width
    return filled and not _is_numeric(row) and (_width(row) == width or len(row) == length)


def _are_units(below: Row, names: Row) -> bool:
    """Say whether a line below names is one of units, or of something as short."""
    known = [read_unit(text.strip("[](){} ")) for text in below if text]
    return any(known) or sum(map(len, below)) < 0.5 * sum(map(len, names))


def _columns(rows: Sequence[Row], width: int, decimal: str) -> tuple[Floats, dict[int, Stamp]]:
    """Return the numbers, and the time stamps in seconds, with how these are written."""
    values = np.full((len(rows), width), np.nan)
    stamps = {}
    for place in range(width):
        texts = [row[place] if place < len(row) else "" for row in rows]
        found = guess_format([text for text in texts if text])
        if found is not None:
            stamps[place] = Stamp(*found)
        read = stamp_reader(found[0]) if found else number if decimal == "." else comma_number
        values[:, place] = [_or_nan(read, text) for text in texts]
        if found is not None:
            known = np.isfinite(values[:, place])
            values[known, place] = unwrapped(values[known, place], found[0])
    return values, stamps


def _or_nan(read: Callable[[str], float], text: str) -> float:
    try:
        return read(text)
    except ValueError:
        return np.nan


def _refuse_thousands(rows: Sequence[tuple[int, Row]], path: Path) -> None:
    """Refuse numbers written as 1.035.000 or 1.035,5 where they are the rule in a column."""
    found: dict[int, list[tuple[int, str]]] = {}
    for line, row in rows:
        for place, text in enumerate(row):
            if THOUSANDS.fullmatch(text) or THOUSANDS_AND_COMMA.fullmatch(text):
                found.setdefault(place, []).append((line, text))
    for place, hits in found.items():
        if len(hits) > 0.01 * len(rows):
            line, text = hits[0]
            raise BadInput(
                path,
                f"'{text}' looks like thousands grouped by dots ({len(hits)} such lines in column "
                f"{place + 1}); expected plain decimal numbers",
                f"line {line}",
            )


def _short(text: str) -> str:
    return text if len(text) <= _SHOWN else text[: _SHOWN - 3] + "..."
