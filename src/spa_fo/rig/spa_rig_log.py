"""Read a spa-rig log: every line is a sample, a duplicate, a comment, a banner, or damaged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from spa_fo.errors import BadInput
from spa_fo.rig.clock import WRAP, follow, sampling_period
from spa_fo.rig.parse_report import FileReport, Tally
from spa_fo.rig.wire import Banner, LineParser, is_banner, parse_banner

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SpaRigLog:
    """The valid samples of one log.

    `t_s` is the time from the first sample; `columns` holds the banner's columns but seq and
    t_us, by name; `seq`, `line` (1-based) and `after_reset` go with them, all of shape (n,).
    `segment` counts board resets: 0 before the first.
    """

    banner: Banner
    t_s: Floats
    columns: Mapping[str, Floats]
    seq: npt.NDArray[np.int64]
    line: npt.NDArray[np.int64]
    after_reset: npt.NDArray[np.bool_]
    segment: npt.NDArray[np.int64]
    report: FileReport


def read_spa_rig_log(path: Path | str, name: str | None = None) -> SpaRigLog:
    """Read a spa-rig log file (see `parse_spa_rig_log`); `name` is what reports call it."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BadInput(path, f"cannot be read ({error.strerror}); expected a log") from error
    return parse_spa_rig_log(data, path, name)


def parse_spa_rig_log(data: bytes, path: Path | str, name: str | None = None) -> SpaRigLog:
    """Parse the bytes of a spa-rig log.

    Samples after a board reset are placed at the last sample before it plus half a period plus
    their own t_us: micros() restarts at the reset, and the time the bootloader took is not known.
    It is an estimate, marked by `after_reset`.

    Parameters
    ----------
    data : bytes
        ASCII, LF or CRLF; a last line without line end counts if it is whole.
    path : Path or str
        Where they came from, for messages.
    name : str, optional
        What the report calls the file; `path` by default.

    Returns
    -------
    SpaRigLog
        At least one sample.

    Raises
    ------
    BadInput
        Empty, no banner of version 1 before the first whole line, or no valid sample.
    """
    if not data:
        raise BadInput(path, "is empty; expected a spa-rig log")
    lines = data.split(b"\n")
    if lines[-1] == b"":
        lines.pop()
    lines = [line.removesuffix(b"\r") for line in lines]
    first, banner = _first_banner(lines, path)
    parser = LineParser(banner.columns)
    tally = Tally()
    rows: list[tuple[bytes, ...]] = []
    numbers: list[int] = []
    stretches = [0]  # where in rows each banner's stretch begins
    comments = 0
    banners = 1
    for number, line in enumerate(lines, start=1):
        if number == first + 1:
            continue
        fields = parser.parse(line)
        if fields is not None:
            rows.append(fields)
            numbers.append(number)
        elif line.startswith(b"# ") and _printable(line):
            if not is_banner(line):
                comments += 1
            elif _same_banner(line, banner):
                banners += 1
                stretches.append(len(rows))
            else:
                tally.add("banner", number)
        else:
            tally.add(parser.reason(line), number)
    rows, numbers, stretches = _in_range(rows, numbers, stretches, banner, tally)
    report = FileReport(
        name or str(path), len(lines), 0, tally.damage(), comments=comments, banners=banners
    )
    return _assemble(rows, numbers, stretches, banner, tally, report, path)


def _printable(line: bytes) -> bool:
    return line.isascii() and line.decode("ascii").isprintable()


def _first_banner(lines: list[bytes], path: Path | str) -> tuple[int, Banner]:
    """Find the banner: line 1, or behind what a serial port held before the board restarted."""
    for index, line in enumerate(lines):
        if is_banner(line):
            try:
                return index, parse_banner(line)
            except ValueError as error:
                raise BadInput(path, str(error), f"line {index + 1}") from error
        if LineParser(("seq", "t_us", "flex_adc")).reason(line) in ("fields", "not a number"):
            break  # a whole data line (its checksum holds) before any banner
    try:
        parse_banner(lines[0])
    except ValueError as error:
        raise BadInput(path, str(error), "line 1") from error
    raise AssertionError("unreachable")  # pragma: no cover


def _same_banner(line: bytes, banner: Banner) -> bool:
    try:
        return parse_banner(line) == banner
    except ValueError:
        return False


def _in_range(
    rows: list[tuple[bytes, ...]],
    numbers: list[int],
    stretches: list[int],
    banner: Banner,
    tally: Tally,
) -> tuple[list[tuple[bytes, ...]], list[int], list[int]]:
    """Take out rows whose counts the board cannot have sent."""
    counts = [i for i, name in enumerate(banner.columns) if name in ("p_adc", "flex_adc")]
    clock = banner.columns.index("t_us")
    limit = banner.adc_max
    bad = {}
    for index, row in enumerate(rows):
        if any(int(row[i]) > limit for i in counts):
            bad[index] = "adc range"
        elif int(row[clock]) >= WRAP:
            bad[index] = "implausible time"
    if not bad:
        return rows, numbers, stretches
    for index, reason in bad.items():
        tally.add(reason, numbers[index])
    keep = [index for index in range(len(rows)) if index not in bad]
    gone = np.array(sorted(bad))
    moved = [begin - int(np.searchsorted(gone, begin)) for begin in stretches]
    return [rows[i] for i in keep], [numbers[i] for i in keep], moved


def _assemble(
    rows: list[tuple[bytes, ...]],
    numbers: list[int],
    stretches: list[int],
    banner: Banner,
    tally: Tally,
    report: FileReport,
    path: Path | str,
) -> SpaRigLog:
    at_seq, at_clock = banner.columns.index("seq"), banner.columns.index("t_us")
    seq = [int(row[at_seq]) for row in rows]
    t_us = [int(row[at_clock]) for row in rows]
    period = sampling_period(seq, t_us, 1e6 / banner.rate_hz)
    taken: list[int] = []
    times: list[float] = []
    segments: list[int] = []
    segment = -1
    gaps = missing = pauses = wraps = resets = bannerless = duplicates = 0
    notes: list[str] = []
    for begin, end in zip(stretches, [*stretches[1:], len(rows)], strict=True):
        part = slice(begin, end)
        followed = follow(seq[part], t_us[part], rows[part], period)
        duplicates += len(followed.duplicates)
        for index in followed.implausible:
            tally.add("implausible time", numbers[begin + index])
        resets += begin != stretches[0] or bool(taken)
        for place, run in enumerate(followed.runs):
            if place > 0:
                resets += 1
                bannerless += 1
            segment += 1
            start = times[-1] + 0.5 * period if times else 0.0
            members = [begin + row for row in run.rows]
            times.extend(start + tick for tick in run.ticks)
            taken.extend(members)
            segments.extend([segment] * len(members))
            steps = np.diff([seq[i] for i in members]) - 1
            gaps += int(np.count_nonzero(steps))
            missing += int(steps.sum())
            pauses += run.pauses
            wraps += run.ticks[-1] // WRAP
    report = FileReport(
        report.file,
        report.lines,
        len(taken),
        tally.damage(),
        duplicates=duplicates,
        comments=report.comments,
        banners=report.banners,
        gaps=gaps,
        missing_samples=missing,
        pauses=pauses,
        wraps=wraps,
        resets=resets,
        resets_without_banner=bannerless,
        notes=tuple(notes),
    )
    if not taken:
        why = report.why()
        raise BadInput(
            path, f"holds no valid sample in {report.lines} lines" + (f": {why}" if why else "")
        )
    ticks = np.array(times)
    columns = {
        name: np.array([float(rows[i][place]) for i in taken])
        for place, name in enumerate(banner.columns)
        if name not in ("seq", "t_us")
    }
    after = np.array(segments)
    return SpaRigLog(
        banner=banner,
        t_s=(ticks - ticks[0]) / 1e6,
        columns=columns,
        seq=np.array([seq[i] for i in taken], dtype=np.int64),
        line=np.array([numbers[i] for i in taken], dtype=np.int64),
        after_reset=after > 0,
        segment=after,
        report=report,
    )
