"""Read a spa-rig log: every line is a sample, a duplicate, a comment, a banner, or damaged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.rig.clock import WRAP, follow, sample_clock
from spa_fo.rig.parse_report import FileReport, Tally
from spa_fo.rig.raw import read_bytes
from spa_fo.rig.wire import (
    COLUMNS,
    Banner,
    LineParser,
    is_banner,
    is_comment,
    no_banner,
    parse_banner,
)


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
    return parse_spa_rig_log(read_bytes(path, "a spa-rig log"), path, name)


def parse_spa_rig_log(data: bytes, path: Path | str, name: str | None = None) -> SpaRigLog:
    """Parse the bytes of a spa-rig log.

    Samples after a board reset are placed at the last sample before it plus half a period plus
    their own t_us: micros() restarts at the reset, and the time the bootloader took is not known.
    It is an estimate, marked by `after_reset`; but what rested before may have rested longer.

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
    lines = [line.removesuffix(b"\r") for line in data.removesuffix(b"\n").split(b"\n")]
    at, banner = _first_banner(lines, path)
    tally = Tally()
    sorted_lines = _sort_lines(lines, at, banner, tally)
    timeline = _Timeline(sorted_lines, banner)
    for index in timeline.implausible:
        tally.add("implausible time", sorted_lines.numbers[index])
    report = FileReport(
        name or str(path),
        lines=len(lines),
        valid=len(timeline.rows),
        damaged=tally.damage(),
        duplicates=timeline.duplicates,
        comments=sorted_lines.comments,
        banners=sorted_lines.banners,
        gaps=timeline.gaps,
        missing_samples=timeline.missing,
        pauses=timeline.pauses,
        wraps=timeline.wraps,
        resets=timeline.resets,
        resets_without_banner=timeline.resets_without_banner,
        notes=(*timeline.notes, *_passed_over(banner)),
    )
    if not timeline.rows:
        raise BadInput(path, f"holds no valid sample in {len(lines)} lines: {report.why()}")
    rows = [sorted_lines.rows[i] for i in timeline.rows]
    segment = np.array(timeline.segments, dtype=np.int64)
    ticks = np.array(timeline.ticks_us)
    columns = {
        column: np.array([float(row[place]) for row in rows])
        for place, column in enumerate(banner.columns)
        if column in COLUMNS - {"seq", "t_us"}
    }
    return SpaRigLog(
        banner=banner,
        t_s=(ticks - ticks[0]) / 1e6,
        columns=columns,
        seq=np.array([timeline.seq[i] for i in timeline.rows], dtype=np.int64),
        line=np.array([sorted_lines.numbers[i] for i in timeline.rows], dtype=np.int64),
        after_reset=segment > _begun(segment, columns.get("cmd_kpa")),
        segment=segment,
        report=report,
    )


def _begun(segment: npt.NDArray[np.int64], command_kpa: Floats | None) -> int:
    """Say in which segment something is commanded first: before it nothing has begun."""
    if command_kpa is None or not command_kpa.any():
        return 0
    return int(segment[np.argmax(command_kpa != 0.0)])


def _passed_over(banner: Banner) -> tuple[str, ...]:
    """Say which columns are not read."""
    others = [name for name in banner.columns if name not in COLUMNS]
    return (f"columns passed over: {', '.join(others)}",) if others else ()


def _first_banner(lines: list[bytes], path: Path | str) -> tuple[int, Banner]:
    """Find the banner: line 1, or behind what a serial port held before the board restarted."""
    probe = LineParser(("seq", "t_us", "flex_adc"))
    for index, line in enumerate(lines):
        if is_banner(line):
            try:
                return index, parse_banner(line)
            except ValueError as error:
                raise BadInput(path, str(error), f"line {index + 1}") from error
        # A data line whose checksum holds, before any banner. The tail of one may hold by chance.
        if index > 0 and probe.reason(line) in ("fields", "not a number"):
            break
    raise BadInput(path, no_banner(lines[0]), "line 1")


@dataclass
class _Lines:
    """Lines sorted by what they are: `stretches` says where in `rows` each banner's rows begin."""

    rows: list[tuple[bytes, ...]]
    numbers: list[int]
    stretches: list[int]
    comments: int = 0
    banners: int = 0


def _sort_lines(lines: list[bytes], at: int, banner: Banner, tally: Tally) -> _Lines:
    parser = LineParser(banner.columns)
    counts = [i for i, name in enumerate(banner.columns) if name in ("p_adc", "flex_adc")]
    clock = banner.columns.index("t_us")
    found = _Lines([], [], [])
    for number, line in enumerate(lines, start=1):
        fields = parser.parse(line)
        if fields is not None:
            if any(int(fields[i]) > banner.adc_max for i in counts):
                tally.add("adc range", number)
            elif int(fields[clock]) >= WRAP:
                tally.add("implausible time", number)
            else:
                found.rows.append(fields)
                found.numbers.append(number)
        elif is_banner(line):
            if number == at + 1 or _same_banner(line, banner):
                found.banners += 1
                found.stretches.append(len(found.rows))
            else:
                tally.add("banner", number)
        elif is_comment(line):
            found.comments += 1
        else:
            tally.add(parser.reason(line), number)
    return found


def _same_banner(line: bytes, banner: Banner) -> bool:
    try:
        return parse_banner(line) == banner
    except ValueError:
        return False


class _Timeline:
    """Rows in the order of time: which are valid, when they were taken, and what was odd."""

    def __init__(self, lines: _Lines, banner: Banner) -> None:
        at_seq, at_clock = banner.columns.index("seq"), banner.columns.index("t_us")
        self.seq = [int(row[at_seq]) for row in lines.rows]
        self.t_us = [int(row[at_clock]) for row in lines.rows]
        self.rows: list[int] = []
        self.ticks_us: list[float] = []
        self.segments: list[int] = []
        self.implausible: list[int] = []
        self.notes: list[str] = []
        self.duplicates = self.gaps = self.missing = self.pauses = self.wraps = 0
        self.resets = self.resets_without_banner = 0
        self._clock = sample_clock(self.seq, self.t_us, 1e6 / banner.rate_hz)
        begin = 0
        for following in [*lines.stretches[1:], None]:
            if following is not None and self._runs_on(following):
                number = lines.numbers[following]
                self.notes.append(f"a banner before line {number}, but the clock ran on: no reset")
                continue
            self._add_stretch(begin, following, lines.rows)
            if following is not None:
                begin = following
                self.resets += 1

    def _runs_on(self, begin: int) -> bool:
        """Say whether the row behind a banner goes on where the row before it stood."""
        if not 0 < begin < len(self.seq):
            return False
        return self._clock.follows(
            self.seq[begin - 1], self.t_us[begin - 1], self.seq[begin], self.t_us[begin]
        )

    def _add_stretch(self, begin: int, end: int | None, rows: list[tuple[bytes, ...]]) -> None:
        part = slice(begin, end)
        followed = follow(self.seq[part], self.t_us[part], rows[part], self._clock)
        self.duplicates += len(followed.duplicates)
        self.implausible.extend(begin + index for index in followed.implausible)
        for place, run in enumerate(followed.runs):
            if place > 0:
                self.resets += 1
                self.resets_without_banner += 1
            start = self.ticks_us[-1] + 0.5 * self._clock.period_us if self.ticks_us else 0.0
            segment = self.segments[-1] + 1 if self.segments else 0
            members = [begin + index for index in run.rows]
            self.rows.extend(members)
            self.ticks_us.extend(start + tick for tick in run.ticks)
            self.segments.extend([segment] * len(members))
            steps = [self.seq[j] - self.seq[i] - 1 for i, j in pairwise(members)]
            self.gaps += sum(step > 0 for step in steps)
            self.missing += sum(steps)
            self.pauses += run.pauses
            self.wraps += run.ticks[-1] // WRAP
