"""Tables of dataclasses as csv: a column a field, and nothing else."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

from spa_fo.errors import BadInput

Row = TypeVar("Row")


def names_of(kind: type[Any]) -> list[str]:
    """Name the columns of a dataclass."""
    return [field.name for field in fields(kind)]


def read_rows(
    path: Path,
    columns: Sequence[Sequence[str]],
    make: Callable[[Mapping[str, str]], Row],
    expected: str,
) -> list[Row]:
    """Read a table; no rows where there is no file yet.

    `columns` are the headings that it may have, `make` turns a row into what it holds and
    `expected` says what that needs, for the message.

    Raises
    ------
    BadInput
        The heading is none of these, or `make` finds a row that it cannot read.
    """
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames not in [list(each) for each in columns]:
            raise BadInput(path, f"expected the columns {', '.join(columns[0])}", where="line 1")
        try:
            return [make(row) for row in reader]
        except (KeyError, TypeError, ValueError) as error:
            raise BadInput(path, expected, where=f"line {reader.line_num}") from error


def written_rows(kind: type[Any], rows: Iterable[Any]) -> str:
    """Write dataclasses of one kind as csv."""
    text = io.StringIO()
    writer = csv.DictWriter(text, names_of(kind), lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return text.getvalue()
