"""What was found in a log of unknown make, as text and as the ``log:`` section that reads it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import yaml

from spa_fo.arrays import Floats
from spa_fo.rig.delimited import Table
from spa_fo.rig.guess_columns import Guess
from spa_fo.rig.log_format import Column, LogFormat
from spa_fo.rig.parse_report import FileReport
from spa_fo.rig.trials import dropouts
from spa_fo.rig.wire import Banner

PAUSE = 5.0  # usual steps: longer ones are pauses, as in the readers' reports
ROLES = ("command", "pressure", "angle", "flex_adc")
MEASURED = ("pressure", "angle", "flex_adc")
_BARS = "▁▂▃▄▅▆▇█"
_SPARK_WIDTH = 48
_MOST_COLUMNS = 40  # listed one by one


@dataclass(frozen=True)
class Sampling:
    """How evenly the rows follow one another.

    `step_s` is the median step, `early_s` and `late_s` its 5th and 95th percentile, `jitter_s`
    the standard deviation, pauses aside; `pauses` are the steps longer than 5 usual ones,
    `longest_s` the longest step, which begins `longest_at_s` after the first row.
    """

    rows: int
    duration_s: float
    step_s: float
    early_s: float
    late_s: float
    jitter_s: float
    pauses: int
    longest_s: float
    longest_at_s: float

    @property
    def rate_hz(self) -> float:
        """Rows a second at the usual step."""
        return 1.0 / self.step_s


@dataclass(frozen=True)
class Repeats:
    """Rows that repeat the row before in one column, or in all measured ones (stale rows).

    `share` of all rows, the `longest` run of them (rows), which begins `at_s` after the first row.
    """

    share: float
    longest: int
    at_s: float


@dataclass(frozen=True)
class Inspection:
    """What one file holds.

    Attributes
    ----------
    path : Path
        The file.
    kind : {"csv", "spa-rig"}
        Its format.
    log : LogFormat
        What `section` prints and the reader was tried with.
    t_s : ndarray, shape (n,)
        Time of the valid rows, from the first one (s).
    signals : dict of str to ndarray, shape (n,)
        By role, in kPa, deg or counts (the pressure of a spa-rig log: counts).
    report : FileReport
        The reader's account of what was left out.
    sampling : Sampling
        Of the valid rows.
    repeats : dict of str to Repeats
        By measured role.
    stale : Repeats or None
        Rows in which everything measured repeats; None where nothing measured moves.
    guesses : dict of str to Guess
        Why each column was chosen; empty for a spa-rig log.
    table : Table or None
        All columns, of a csv log.
    banner : Banner or None
        Of a spa-rig log.
    """

    path: Path
    kind: Literal["csv", "spa-rig"]
    log: LogFormat
    t_s: Floats
    signals: Mapping[str, Floats]
    report: FileReport
    sampling: Sampling
    repeats: Mapping[str, Repeats]
    stale: Repeats | None
    guesses: Mapping[str, Guess]
    table: Table | None = None
    banner: Banner | None = None

    @property
    def complete(self) -> bool:
        """Whether a campaign can be read with it: it holds an angle or a flex count."""
        return "angle" in self.signals or "flex_adc" in self.signals

    def section(self) -> str:
        """Return the ``log:`` section for campaign.yaml."""
        if self.kind == "spa-rig":
            return "log: {format: spa-rig}\n"
        header = str(self.log.header).lower()
        head = ["log:", "  format: csv", f"  delimiter: {json.dumps(self.log.delimiter)}"]
        if self.log.decimal != ".":
            head.append(f"  decimal: {json.dumps(self.log.decimal)}")
        if self.log.encoding != "utf-8":
            head.append(f"  encoding: {self.log.encoding}")
        if self.log.header_row is not None:
            head.append(f"  header_row: {self.log.header_row}")
        columns = [self._column_line(role, item) for role, item in (self.log.columns or {}).items()]
        missing = [] if self.complete else ["    # angle: not found; a campaign needs it, or"]
        missing += [] if self.complete else ["    # flex_adc and a calibration"]
        return "\n".join([*head, f"  header: {header}", "  columns:", *columns, *missing]) + "\n"

    def _column_line(self, role: str, item: Column) -> str:
        keys = [f"column: {_scalar(item.column)}", f"unit: {_scalar(item.unit)}"]
        keys += [f"format: {_scalar(item.format)}"] if item.format else []
        keys += [f"scale: {item.scale!r}"] if item.scale != 1.0 else []
        keys += [f"offset: {item.offset!r}"] if item.offset else []
        keys += [f"rest: {item.rest}"] if item.rest != "keep" else []
        return f"    {role}: {{{', '.join(keys)}}}  # {self._reason(role)}"

    def _reason(self, role: str) -> str:
        guess = self.guesses[role]
        if not guess.rivals:
            return guess.why
        rivals = ", ".join(str(place + 1) for place in guess.rivals[:6])
        return f"{guess.why}; or column {rivals}"

    def text(self) -> str:
        """Describe the file for a terminal, ending with the section to paste."""
        parts = [self._title(), *self._columns(), "", *self._sampling_lines(), *self._notes()]
        sparks = [
            f"{role:9} {spark(values)} {values.min():.6g} to {values.max():.6g} "
            f"{_unit_of(self, role)}"
            for role, values in self.signals.items()
        ]
        return "\n".join([*parts, "", *sparks, "", self.section()])

    def _title(self) -> str:
        if self.banner is not None:
            kind = "calibration" if "angle_deg" in self.banner.columns else "trial"
            return (
                f"{self.path}: a spa-rig log ({kind}), board {self.banner.board or 'unknown'}, "
                f"{self.banner.rate_hz:g} Hz, {self.banner.adc_bits} bit at "
                f"{self.banner.vref_mv:g} mV, columns {','.join(self.banner.columns)}"
            )
        assert self.table is not None
        words = {"\t": "tabs", "whitespace": "blanks"}
        between = words.get(self.table.delimiter, f"'{self.table.delimiter}'")
        header = "a header" if self.table.header or self.table.names else "no header"
        header += f" in line {self.table.header_row}" if self.table.header_row > 1 else ""
        header += ", decimal commas" if self.table.decimal == "," else ""
        header += f", {self.table.encoding}" if self.table.encoding != "utf-8" else ""
        return (
            f"{self.path}: csv, {between} between {self.table.width} columns, {header}, "
            f"{len(self.table.values)} rows"
        )

    def _columns(self) -> Iterator[str]:
        if self.table is None:
            return
        roles = {guess.place: role for role, guess in self.guesses.items()}
        constant: list[str] = []
        lines = []
        for place in range(self.table.width):
            column = self.table.values[:, place]
            values = column[np.isfinite(column)]
            label = self.table.label(place)
            if place not in roles and (not values.size or not np.ptp(values)):
                constant.append(str(place + 1))
                continue
            lines.append(_column_text(label, column, roles.get(place, "")))
        yield f"  {'column':20} {'from':>12} {'to':>12} {'first':>12} {'no number':>9}"
        yield from lines[:_MOST_COLUMNS]
        if len(lines) > _MOST_COLUMNS:
            yield f"  and {len(lines) - _MOST_COLUMNS} more"
        if constant:
            yield f"  constant or without numbers: {_spans(constant)}"

    def _sampling_lines(self) -> Iterator[str]:
        rows = self.sampling
        yield (
            f"time: {rows.rows} rows in {rows.duration_s:.4g} s, {rows.rate_hz:.4g} Hz; a step is "
            f"{_ms(rows.step_s)}, 5 to 95 % {_ms(rows.early_s)} to {_ms(rows.late_s)}, "
            f"jitter {_ms(rows.jitter_s)}"
        )
        yield (
            f"pauses: {rows.pauses} longer than {PAUSE:g} steps; the longest step is "
            f"{_ms(rows.longest_s)} at {rows.longest_at_s:.4g} s"
        )
        report = self.report
        yield (
            f"left out: {report.why() or 'nothing'}"
            + (f"; {report.duplicates} exact duplicates" if report.duplicates else "")
            + (f"; {report.gaps} gaps in seq ({report.missing_samples})" if report.gaps else "")
            + (f"; {report.resets} resets of the board" if report.resets else "")
        )
        for role, repeats in self.repeats.items():
            yield f"{role}: {_repeats_text(repeats, self.sampling)}"
        if self.stale is not None and len(self.repeats) > 1:
            yield f"stale rows (all of these): {_repeats_text(self.stale, self.sampling)}"

    def _notes(self) -> Iterator[str]:
        yield from (f"note: {note}" for note in self.report.notes)
        if self.table is not None:
            yield from (f"note: {note}" for note in self.table.notes)
        broken = np.flatnonzero(dropouts(self.signals.get("flex_adc", np.zeros(0))))
        if broken.size:
            yield (
                f"note: flex_adc falls to 0 in {broken.size} rows, first at "
                f"{self.t_s[broken[0]]:.4g} s, between readings far from it: a loose contact"
            )
        if self.kind == "spa-rig":
            return
        for role in ROLES:
            if role not in self.signals and not (role in MEASURED[1:] and self.complete):
                yield f"note: no column looks like {_article(role)}"


def spark(values: Floats, width: int = _SPARK_WIDTH) -> str:
    """Draw `values`, shape (n,), as a row of at most `width` bars."""
    means = [float(part.mean()) for part in np.array_split(values, min(width, values.size))]
    low, high = min(means), max(means)
    reach = high - low
    if not reach > 0.0:
        return _BARS[0] * len(means)
    return "".join(_BARS[round((mean - low) / reach * (len(_BARS) - 1))] for mean in means)


def _scalar(value: str | int) -> str:
    """Write a name, a unit or an index so that YAML reads back the same."""
    if isinstance(value, int):
        return str(value)
    plain = re.fullmatch(r"[A-Za-z_]\w*", value, re.ASCII) is not None
    return (
        value if plain and yaml.safe_load(value) == value else json.dumps(value, ensure_ascii=False)
    )


def _column_text(label: str, column: Floats, role: str) -> str:
    values = column[np.isfinite(column)]
    low, high, first = values.min(), values.max(), values[0]
    missing = column.size - values.size
    shown = label if len(label) <= 20 else label[:17] + "..."
    return f"  {shown:20} {low:12.6g} {high:12.6g} {first:12.6g} {missing or '-':>9}" + (
        f"  {role}" if role else ""
    )


def _repeats_text(repeats: Repeats, sampling: Sampling) -> str:
    if not repeats.longest:
        return "no row repeats the one before"
    text = (
        f"{100 * repeats.share:.2g} % of the rows repeat the one before, "
        f"{repeats.longest} on end at {repeats.at_s:.4g} s"
    )
    if repeats.share > 0.5:
        text += f" (it changes {(1.0 - repeats.share) * sampling.rate_hz:.3g} times a second)"
    return text


def _unit_of(inspection: Inspection, role: str) -> str:
    if role == "angle":
        return "deg"
    if role == "flex_adc" or (role == "pressure" and inspection.kind == "spa-rig"):
        return "counts"
    column = (inspection.log.columns or {}).get(role)
    return "(unit unknown)" if column is not None and column.unit == "1" else "kPa"


def _article(role: str) -> str:
    words = {"angle": "an angle", "flex_adc": "a flex sensor's counts"}
    return words.get(role, f"a {role}")


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.4g} ms" if seconds < 1.0 else f"{seconds:.4g} s"


def _spans(numbers: Sequence[str]) -> str:
    """Write 3, 4, 5, 9 as ``3-5, 9``."""
    spans: list[list[int]] = []
    for number in map(int, numbers):
        if spans and number == spans[-1][1] + 1:
            spans[-1][1] = number
        else:
            spans.append([number, number])
    return ", ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in spans)
