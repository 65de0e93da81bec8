"""The names of a csv log's columns: on which line they are, and which column is meant."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from spa_fo.errors import BadInput
from spa_fo.rig.fields import NOT_FINITE, NUMBER
from spa_fo.rig.log_format import Column, LogFormat
from spa_fo.validation import suggestion

Row = tuple[int, list[str] | None]
"""1-based line and its fields, None for a blank one."""

_HEAD_LINES = 200  # within which the names stand


@dataclass(frozen=True)
class Head:
    """The names of the columns, where they are, and the rows that are left.

    `line` is the names' 1-based line, `lines` how many it takes with a row of units, `above` how
    many lines stand over it that nothing is read from.
    """

    names: list[str] | None
    rows: list[Row]
    line: int = 1
    lines: int = 0
    above: int = 0


def take_header(rows: list[Row], log: LogFormat, needed: Iterable[Column], path: Path) -> Head:
    """Find the names of the columns: where campaign.yaml says, where they stand, or at the top.

    Raises
    ------
    BadInput
        There is no line that can be it.
    """
    if not log.header:
        return Head(None, rows)
    wanted = {item.column for item in needed if isinstance(item.column, str)}
    fixed = log.header_row
    index = (
        _first_with(rows[:_HEAD_LINES], wanted)
        if fixed is None
        else _row_of_line(rows, fixed, path)
    )
    if index is None:
        raise BadInput(path, "holds no line; expected a header and rows")
    line, row = rows[index]
    assert row is not None
    above = [one for _, one in rows[:index] if one is not None and one[0][:1] != "#"]
    # Blank lines and comments above the names count as those; anything else makes it a preamble.
    kept = [] if above or fixed is not None else rows[:index]
    below = rows[index + 1 :]
    units = 1 if below and _is_row_of_units(below[0][1]) else 0
    return Head(_bare_names(row), kept + below[units:], line, 1 + units, above=index - len(kept))


def _bare_names(row: Sequence[str]) -> list[str]:
    return [row[0].lstrip("# "), *row[1:]]  # some writers mark the header by a hash


def _row_of_line(rows: Sequence[Row], line: int, path: Path) -> int:
    if line > len(rows) or rows[line - 1][1] is None:
        raise BadInput(path, "holds no names of columns; expected log.header_row", f"line {line}")
    return line - 1


def _first_with(rows: Sequence[Row], wanted: Collection[str]) -> int | None:
    """Find the first line that holds all names; the first one that is no comment if none does."""
    first = None
    for index, (_, row) in enumerate(rows):
        if row is None:
            continue
        if wanted and set(wanted) <= set(_bare_names(row)):
            return index
        if first is None and row[0][:1] != "#":
            first = index
    return first


def _is_row_of_units(row: Sequence[str] | None) -> bool:
    """Say whether the row below the names holds no number at all, missing ones included."""
    return (
        row is not None
        and row[0][:1] != "#"
        and all(
            not NUMBER.match(text) and text.lower() not in NOT_FINITE and ":" not in text
            for text in row
        )
    )


def locate(
    needed: Mapping[str, Column],
    head: Head,
    data: Sequence[Row],
    path: Path,
) -> list[int]:
    """Return the 0-based place of each needed column.

    Raises
    ------
    BadInput
        A name is not there, is there twice, or cannot be trusted.
    """
    places = []
    header = head.names
    for role, item in needed.items():
        where = f"log.columns.{role}"
        if isinstance(item.column, int):
            places.append(item.column - 1)
            continue
        if header is None or item.column not in header:
            names = [name for name in header or [] if name]
            hint = (
                "; the first line holds numbers: header: false?"
                if names and all(NUMBER.fullmatch(name) for name in names)
                else suggestion(item.column, names[:12])
            )
            raise BadInput(path, f"line {head.line} names no column '{item.column}'{hint}", where)
        if header.count(item.column) > 1:
            raise BadInput(
                path, f"line {head.line} names '{item.column}' twice; expected an index", where
            )
        widths = Counter(len(row) - (row[-1] == "") for _, row in data if row is not None)
        width = widths.most_common(1)[0][0] if widths else len(header)
        named = len(header) - (header[-1] == "")
        lengths = Counter(len(row) for _, row in data if row is not None)
        if width != named and [len(header)] != [length for length, _ in lengths.most_common(1)]:
            raise BadInput(
                path,
                f"the header has {named} names but the rows have {width} fields, so "
                f"'{item.column}' could be any; expected a 1-based index",
                where,
            )
        places.append(header.index(item.column))
    return places
