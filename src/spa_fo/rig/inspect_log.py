"""Inspect a log of unknown make: its format, its columns, its sampling, and how to read it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.rig.csv_log import CsvLog, read_csv_log
from spa_fo.rig.delimited import Table, read_table
from spa_fo.rig.guess_columns import Guess, guess_columns
from spa_fo.rig.inspection import MEASURED, PAUSE, ROLES, Inspection, Repeats, Sampling
from spa_fo.rig.log_format import LogFormat
from spa_fo.rig.parse_report import FileReport
from spa_fo.rig.raw import read_bytes
from spa_fo.rig.spa_rig_log import SpaRigLog, parse_spa_rig_log
from spa_fo.rig.wire import Banner, LineParser, is_banner

_HEAD_LINES = 50  # within which a spa-rig log has its banner
_RIG_ROLES = {"cmd_kpa": "command", "p_adc": "pressure", "angle_deg": "angle"}


def inspect_log(path: Path | str) -> Inspection:
    """Say what a log holds: its format, its columns, its sampling, and how to read it.

    Parameters
    ----------
    path : Path or str
        A spa-rig log, or a delimited file of any make.

    Returns
    -------
    Inspection
        Its `log` was tried: the reader takes the file with it.

    Raises
    ------
    BadInput
        No log: not readable, empty, binary, no rows of numbers, no column that rises as time
        does; or a spa-rig log that cannot be read.
    """
    path = Path(path)
    data = read_bytes(path, "a log")
    if _looks_like_spa_rig(data):
        return _inspect_spa_rig(path, parse_spa_rig_log(data, path))
    table = read_table(path)
    guesses = guess_columns(table)
    if "time" not in guesses:
        raise BadInput(
            path,
            f"holds {len(table.values)} rows of {table.width} columns, but none rises as time "
            "does; expected a column with the time",
        )
    log, read = _try(path, table, guesses)
    columns = log.columns or {}
    return _inspection(
        path,
        "csv",
        log,
        read.t_s,
        {role: read.columns[role] for role in ROLES if role in read.columns},
        read.report,
        guesses={role: guess for role, guess in guesses.items() if role in columns},
        table=table,
    )


def sampling_of(t_s: Floats) -> Sampling:
    """Measure the sampling of rows at rising times `t_s`, shape (n,), n of 2 or more."""
    steps = np.diff(t_s)
    usual = float(np.median(steps))
    even = steps[steps <= PAUSE * usual]
    early, late = np.percentile(even, [5.0, 95.0])
    longest = int(np.argmax(steps))
    return Sampling(
        rows=int(t_s.size),
        duration_s=float(t_s[-1] - t_s[0]),
        step_s=usual,
        early_s=float(early),
        late_s=float(late),
        jitter_s=float(np.std(even)),
        pauses=int(np.count_nonzero(steps > PAUSE * usual)),
        longest_s=float(steps[longest]),
        longest_at_s=float(t_s[longest] - t_s[0]),
    )


def repeats_of(t_s: Floats, *columns: Floats) -> Repeats:
    """Find the rows in which all `columns`, each of shape (n,), repeat the row before."""
    same = np.concatenate(([False], np.all([np.diff(c) == 0.0 for c in columns], axis=0)))
    edges = np.flatnonzero(np.diff(np.concatenate(([False], same, [False])).astype(int)))
    runs = edges.reshape(-1, 2)
    if not runs.size:
        return Repeats(0.0, 0, 0.0)
    begin, end = max(runs.tolist(), key=lambda run: run[1] - run[0])
    return Repeats(float(same.mean()), end - begin, float(t_s[begin] - t_s[0]))


def _looks_like_spa_rig(data: bytes) -> bool:
    lines = [line.removesuffix(b"\r") for line in data[:10_000].split(b"\n")[:_HEAD_LINES]]
    probe = LineParser(("seq", "t_us", "flex_adc"))
    whole = ("fields", "not a number")  # its checksum holds, whatever its columns
    return any(is_banner(line) or probe.reason(line) in whole for line in lines if line)


def _inspect_spa_rig(path: Path, read: SpaRigLog) -> Inspection:
    if read.t_s.size < 2:
        raise BadInput(path, "holds 1 valid sample; expected at least 2")
    signals = {_RIG_ROLES.get(name, name): values for name, values in read.columns.items()}
    return _inspection(
        path, "spa-rig", LogFormat("spa-rig"), read.t_s, signals, read.report, banner=read.banner
    )


def _inspection(
    path: Path,
    kind: Literal["csv", "spa-rig"],
    log: LogFormat,
    t_s: Floats,
    signals: Mapping[str, Floats],
    report: FileReport,
    guesses: Mapping[str, Guess] | None = None,
    table: Table | None = None,
    banner: Banner | None = None,
) -> Inspection:
    moving = {
        role: values
        for role, values in signals.items()
        if role in MEASURED and np.ptp(values) > 0.0
    }
    return Inspection(
        path=path,
        kind=kind,
        log=log,
        t_s=t_s - t_s[0],
        signals=signals,
        report=report,
        sampling=sampling_of(t_s),
        repeats={role: repeats_of(t_s, values) for role, values in moving.items()},
        stale=repeats_of(t_s, *moving.values()) if moving else None,
        guesses=guesses or {},
        table=table,
        banner=banner,
    )


def _try(path: Path, table: Table, guesses: Mapping[str, Guess]) -> tuple[LogFormat, CsvLog]:
    """Return the first section that the reader accepts: all columns by name, by index, fewer."""
    error: BadInput | None = None
    for log in _sections(table, guesses):
        try:
            return log, read_csv_log(path, log)
        except BadInput as refused:
            error = error or refused
    assert error is not None
    raise error


def _sections(table: Table, guesses: Mapping[str, Guess]) -> Iterator[LogFormat]:
    # A column whose numbers are few would cost every row where it has none: it goes first.
    by_numbers = sorted(
        (role for role in guesses if role != "time"),
        key=lambda role: -np.count_nonzero(np.isfinite(table.values[:, guesses[role].place])),
    )
    written = {key: getattr(table, key) for key in ("delimiter", "decimal", "encoding")}
    for kept in range(len(by_numbers), -1, -1):
        roles = [role for role in guesses if role == "time" or role in by_numbers[:kept]]
        by_index = {role: guesses[role].column for role in roles}
        by_name = {
            role: dataclasses.replace(item, column=_name(table, guesses[role].place))
            for role, item in by_index.items()
        }
        if any(isinstance(item.column, str) for item in by_name.values()):
            yield LogFormat("csv", header=True, columns=by_name, **written)
        row = table.header_row if table.header and table.header_row > 1 else None
        yield LogFormat("csv", header=table.header, columns=by_index, header_row=row, **written)


def _name(table: Table, place: int) -> str | int:
    """Return a column's name where it is one that can be written and is its own alone."""
    name = table.names[place] if table.names else ""
    if name and name.isprintable() and table.names.count(name) == 1:
        return name
    return place + 1
