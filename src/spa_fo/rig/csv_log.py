"""Read anyone's delimited log by configuration: which column is what, in which unit."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.rig import timestamps
from spa_fo.rig.csv_header import Row, locate, take_header
from spa_fo.rig.fields import (
    comma_number,
    number,
    read_lines,
    reason,
    split_fields,
)
from spa_fo.rig.log_format import DATETIME, Column, LogFormat
from spa_fo.rig.parse_report import FileReport, Tally
from spa_fo.rig.timestamps import unwrapped

# To seconds, kilopascals (gauge), degrees; "1" is taken as it is.
UNITS = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "Pa": 1e-3,
    "hPa": 0.1,
    "kPa": 1.0,
    "bar": 100.0,
    "psi": 6.894757293168361,
    "deg": 1.0,
    "rad": 180.0 / math.pi,
    "1": 1.0,
    DATETIME: 1.0,
}
_FAR = 2.0  # times the length of the log
_LARGEST = 1e12  # s, kPa, deg, counts: more than anything measured, and its square still a number


@dataclass(frozen=True)
class CsvLog:
    """The valid rows of one csv log.

    `columns` holds the configured columns but time, by role, in kPa, deg or counts; `t_s` the
    time as logged (s), strictly increasing; `line` the 1-based line numbers; all of shape (n,).
    """

    t_s: Floats
    columns: Mapping[str, Floats]
    line: npt.NDArray[np.int64]
    report: FileReport


def read_csv_log(
    path: Path | str,
    log: LogFormat,
    roles: Sequence[str] | None = None,
    name: str | None = None,
) -> CsvLog:
    """Read the configured columns of a delimited log.

    A row is valid when every needed column holds a finite number and its time is later than that
    of the row before; the other columns may hold anything. Each row left out is counted by reason.

    Parameters
    ----------
    path : Path or str
        The log.
    log : LogFormat
        Delimiter, header and columns.
    roles : sequence of str, optional
        The columns needed; all configured ones by default.
    name : str, optional
        What the report calls the file; `path` by default.

    Returns
    -------
    CsvLog
        At least two rows.

    Raises
    ------
    BadInput
        Empty, binary, a column that is not there or cannot be told, numbers with thousands dots,
        or fewer than two valid rows.
    """
    path = Path(path)
    lines, whole = read_lines(path, log.encoding)
    columns = log.columns or {}
    roles = tuple(columns) if roles is None else tuple(dict.fromkeys(("time", *roles)))
    needed = {role: columns[role] for role in roles}
    rows = [
        (number, split_fields(line, log.delimiter)) for number, line in enumerate(lines, start=1)
    ]
    _refuse_one_comma(log, lines, path)
    head = take_header(rows, log, needed.values(), path)
    data = [(line, row) for line, row in head.rows if row is not None and row[0][:1] != "#"]
    places = locate(needed, head, data, path)
    tally = Tally()
    for line, row in head.rows:
        if row is None:
            tally.add("blank", line)
    fields = [
        _Field(place, _reader(item, log), log.decimal)
        for place, item in zip(places, needed.values(), strict=True)
    ]
    values, numbers = _parse_rows(data, fields, tally, cut=0 if whole else len(lines))
    _refuse_thousands(tally, data, places, path)
    raw = np.array(values, dtype=np.float64).reshape(len(numbers), len(needed))
    if columns["time"].unit == DATETIME:
        place = list(needed).index("time")
        raw[:, place] = unwrapped(raw[:, place], columns["time"].format)
    with np.errstate(over="ignore", invalid="ignore"):
        converted = {
            role: (raw[:, i] * column.scale + column.offset) * UNITS[column.unit]
            for i, (role, column) in enumerate(needed.items())
        }
    finite = np.all([np.abs(array) <= _LARGEST for array in converted.values()], axis=0)
    for index in np.flatnonzero(~finite):
        tally.add("too large", numbers[index])
    numbers = [numbers[index] for index in np.flatnonzero(finite)]
    raw = raw[finite]
    converted = {role: array[finite] for role, array in converted.items()}
    keep, duplicates = _in_order(converted["time"], raw, numbers, tally)
    comments = sum(row is not None and row[0][:1] == "#" for _, row in head.rows)
    report = FileReport(
        name or str(path),
        lines=len(lines),
        valid=len(keep),
        damaged=tally.damage(),
        duplicates=duplicates,
        comments=comments + head.above,
        pauses=_pauses(converted["time"][keep]),
        banners=head.lines,
    )
    if len(keep) < 2:
        why = report.why()
        raise BadInput(
            path,
            f"holds {len(keep)} valid rows in {len(lines)} lines; expected at least 2"
            + (f"; left out: {why}" if why else ""),
        )
    return CsvLog(
        converted["time"][keep],
        {role: array[keep] for role, array in converted.items() if role != "time"},
        np.array(numbers, dtype=np.int64)[keep],
        report,
    )


@dataclass(frozen=True)
class _Field:
    """Where a needed field stands, what reads it, and how its numbers are written."""

    place: int
    read: Callable[[str], float]
    decimal: str


def _reader(item: Column, log: LogFormat) -> Callable[[str], float]:
    if item.unit == DATETIME:
        return timestamps.reader(item.format)
    return number if log.decimal == "." else comma_number


def _refuse_one_comma(log: LogFormat, lines: Sequence[str], path: Path) -> None:
    """Refuse one comma for two purposes, unless fields are in quotes."""
    if log.decimal == log.delimiter and not any('"' in line for line in lines):
        raise BadInput(
            path, "is ',' as is log.delimiter; expected another, or fields in quotes", "log.decimal"
        )


def _parse_rows(
    data: Sequence[Row], fields: Sequence[_Field], tally: Tally, cut: int
) -> tuple[list[list[float]], list[int]]:
    """Parse the needed fields of each row; `cut` is the number of the line without an end."""
    values, numbers = [], []
    last = max(field.place for field in fields)
    for line, row in data:
        assert row is not None
        if line == cut and len(row) <= last + 1:
            # Its last field may have lost digits: there is no telling.
            tally.add("cut", line)
        elif len(row) <= last:
            tally.add("fields", line)
        else:
            try:
                values.append([field.read(row[field.place]) for field in fields])
                numbers.append(line)
            except ValueError:
                tally.add(_why_none(row, fields), line)
    return values, numbers


def _why_none(row: Sequence[str], fields: Sequence[_Field]) -> str:
    """Say why the first needed field that cannot be read is none."""
    for field in fields:
        text = row[field.place]
        try:
            field.read(text)
        except ValueError:
            why = reason(text, field.decimal)
            return (
                "no date and time"
                if why in (None, "not a number") and _is_time(field)
                else why or "nan"
            )
    return "nan"


def _is_time(field: _Field) -> bool:
    return field.read not in (number, comma_number)


def _refuse_thousands(
    tally: Tally,
    data: Sequence[Row],
    places: Sequence[int],
    path: Path,
) -> None:
    """Refuse a file that groups thousands by dots: its '534.000' may be 534 or 534000."""
    lines = tally.lines_by_reason.get("thousands dots", [])
    if len(lines) <= 0.01 * len(data):
        return
    row = next(row for number, row in data if number == lines[0])
    assert row is not None
    text = next(row[place] for place in places if reason(row[place]) == "thousands dots")
    raise BadInput(
        path,
        f"'{text}' looks like thousands grouped by dots ({len(lines)} such lines), which makes "
        "every number of its column doubtful; expected plain decimal numbers",
        f"line {lines[0]}",
    )


def _in_order(
    time: Floats, raw: Floats, numbers: Sequence[int], tally: Tally
) -> tuple[npt.NDArray[np.int64], int]:
    """Keep the longest strictly increasing sequence of times; count the rest by reason.

    A first or last row farther from the others than these last is out of order as well.
    """
    keep = np.arange(len(time))
    if not np.all(np.diff(time) > 0):
        keep, duplicates = _increasing(time, raw, numbers, tally)
    else:
        duplicates = 0
    for end, inner in ((-1, slice(0, -1)), (0, slice(1, None))):
        rest = time[keep[inner]]
        if rest.size >= 10 and abs(time[keep[end]] - rest[end]) > _FAR * np.ptp(rest):
            tally.add("implausible time", numbers[keep[end]])
            keep = keep[inner]
    return keep, duplicates


def _pauses(time: Floats) -> int:
    """Count the steps of time that are longer than 5 of the usual ones."""
    steps = np.diff(time)
    return int(np.count_nonzero(steps > 5.0 * np.median(steps))) if steps.size else 0


def _increasing(
    time: Floats, raw: Floats, numbers: Sequence[int], tally: Tally
) -> tuple[npt.NDArray[np.int64], int]:
    keep = np.array(longest_increasing(time.tolist()), dtype=np.int64)
    kept = {float(time[i]): i for i in keep}
    duplicates = 0
    for i in sorted(set(range(len(time))) - set(keep.tolist())):
        twin = kept.get(float(time[i]))
        if twin is None:
            tally.add("backward time", numbers[i])
        elif np.array_equal(raw[i], raw[twin]):
            duplicates += 1
        else:
            tally.add("repeated time", numbers[i])
    return keep, duplicates


def longest_increasing(values: Sequence[float]) -> list[int]:
    """Return indices of a longest strictly increasing subsequence, the earliest of equal values.

    One value far too large or too small costs itself alone, unlike a comparison with the running
    maximum, which it would spoil for all that follow.
    """
    tails: list[float] = []
    at: list[int] = []
    before: list[int] = []
    for index, value in enumerate(values):
        place = bisect_left(tails, value)
        before.append(at[place - 1] if place else -1)
        if place == len(tails):
            tails.append(value)
            at.append(index)
        elif value < tails[place]:
            tails[place] = value
            at[place] = index
    chain = []
    index = at[-1] if at else -1
    while index >= 0:
        chain.append(index)
        index = before[index]
    return chain[::-1]
