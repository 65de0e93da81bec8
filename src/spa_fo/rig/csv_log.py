"""Read anyone's delimited log by configuration: which column is what, in which unit."""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from spa_fo.errors import BadInput
from spa_fo.rig.campaign import Column, LogFormat
from spa_fo.rig.parse_report import FileReport, Tally
from spa_fo.rig.raw import read_bytes
from spa_fo.validation import suggestion

Floats = npt.NDArray[np.float64]

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
}
_FAR = 2.0  # times the length of the log
_LARGEST = 1e12  # s, kPa, deg, counts: more than anything measured, and its square still a number
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3}){2,}")
DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
NOT_FINITE = {"nan", "inf", "infinity", "-nan", "-inf", "+inf", "na", "n/a", "null", "none"}


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
    lines, whole = read_lines(path)
    columns = log.columns or {}
    roles = tuple(columns) if roles is None else tuple(dict.fromkeys(("time", *roles)))
    needed = {role: columns[role] for role in roles}
    rows = [
        (number, split_fields(line, log.delimiter)) for number, line in enumerate(lines, start=1)
    ]
    header, rows = _take_header(rows, log, needed.values(), path)
    data = [(number, row) for number, row in rows if row is not None and row[0][:1] != "#"]
    places = _locate(needed, header, data, path)
    tally = Tally()
    for number, row in rows:
        if row is None:
            tally.add("blank", number)
    values, numbers = _parse_rows(data, places, tally, cut=0 if whole else len(lines))
    _refuse_thousands(tally, data, places, path)
    raw = np.array(values, dtype=np.float64).reshape(len(numbers), len(needed))
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
    comments = sum(row is not None and row[0][:1] == "#" for _, row in rows)
    report = FileReport(
        name or str(path),
        lines=len(lines),
        valid=len(keep),
        damaged=tally.damage(),
        duplicates=duplicates,
        comments=comments,
        pauses=_pauses(converted["time"][keep]),
        banners=0 if header is None else 1,
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


def read_lines(path: Path) -> tuple[list[str], bool]:
    """Return the lines without their ends, and whether the last one was ended."""
    data = read_bytes(path, "a csv log")
    if not data:
        raise BadInput(path, "is empty; expected a csv log")
    if b"\0" in data or data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise BadInput(path, "is binary or UTF-16; expected a csv log in ASCII or UTF-8")
    text = data.decode("utf-8-sig", errors="replace")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    whole = lines[-1] == ""
    return (lines[:-1] if whole else lines), whole


def split_fields(line: str, delimiter: str) -> list[str] | None:
    """Split a line into bare fields; None if it is blank."""
    if not line.strip():
        return None
    fields = line.split() if delimiter in (" ", "whitespace") else line.split(delimiter)
    return [field.strip().strip('"').strip() for field in fields]


def _take_header(
    rows: list[tuple[int, list[str] | None]],
    log: LogFormat,
    needed: Iterable[Column],
    path: Path,
) -> tuple[list[str] | None, list[tuple[int, list[str] | None]]]:
    if not log.header:
        return None, rows
    wanted = {item.column for item in needed if isinstance(item.column, str)}
    for index, (_, row) in enumerate(rows):
        if row is None:
            continue
        bare = [row[0].lstrip("# "), *row[1:]]
        if row[0][:1] != "#" or (wanted and wanted <= set(bare)):  # some writers mark it by a hash
            return bare, rows[:index] + rows[index + 1 :]
    raise BadInput(path, "holds no line; expected a header and rows")


def _locate(
    needed: Mapping[str, Column],
    header: list[str] | None,
    data: Sequence[tuple[int, list[str] | None]],
    path: Path,
) -> list[int]:
    """Return the 0-based place of each needed column."""
    places = []
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
            raise BadInput(path, f"line 1 names no column '{item.column}'{hint}", where)
        if header.count(item.column) > 1:
            raise BadInput(path, f"line 1 names '{item.column}' twice; expected an index", where)
        widths = Counter(len(row) - (row[-1] == "") for _, row in data if row is not None)
        width = widths.most_common(1)[0][0] if widths else len(header)
        named = len(header) - (header[-1] == "")
        if width != named:
            raise BadInput(
                path,
                f"the header has {named} names but the rows have {width} fields, so "
                f"'{item.column}' could be any; expected a 1-based index",
                where,
            )
        places.append(header.index(item.column))
    return places


def _parse_rows(
    data: Sequence[tuple[int, list[str] | None]],
    places: Sequence[int],
    tally: Tally,
    cut: int,
) -> tuple[list[list[float]], list[int]]:
    """Parse the needed fields of each row; `cut` is the number of the line without an end."""
    values, numbers = [], []
    last = max(places)
    for number, row in data:
        assert row is not None
        if number == cut and len(row) <= last + 1:
            # Its last field may have lost digits: there is no telling.
            tally.add("cut", number)
        elif len(row) <= last:
            tally.add("fields", number)
        else:
            texts = [row[place] for place in places]
            try:
                found = [float(text) for text in texts]
            except ValueError:
                found = []
            if found and all(map(math.isfinite, found)) and all(map(NUMBER.fullmatch, texts)):
                values.append(found)
                numbers.append(number)
            else:
                tally.add(_reason(texts), number)
    return values, numbers


def _reason(texts: Sequence[str]) -> str:
    for text in texts:
        if not text:
            return "empty field"
        if text.lower() in NOT_FINITE:
            return "nan"
        if THOUSANDS.fullmatch(text):
            return "thousands dots"
        if DECIMAL_COMMA.fullmatch(text):
            return "decimal comma"
        if not NUMBER.fullmatch(text):
            return "not a number"
    return "nan"


def _refuse_thousands(
    tally: Tally,
    data: Sequence[tuple[int, list[str] | None]],
    places: Sequence[int],
    path: Path,
) -> None:
    """Refuse a file that groups thousands by dots: its '534.000' may be 534 or 534000."""
    lines = tally.lines_by_reason.get("thousands dots", [])
    if len(lines) <= 0.01 * len(data):
        return
    row = next(row for number, row in data if number == lines[0])
    assert row is not None
    text = next(row[place] for place in places if THOUSANDS.fullmatch(row[place]))
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
