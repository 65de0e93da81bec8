"""Logs as bytes: the spa-rig format and delimited tables, with what goes wrong on the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import xor

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Rng = np.random.Generator

_WRAP = 2**32  # micros()
_KPA = {"kPa": 1.0, "hPa": 0.1, "bar": 100.0, "psi": 6.894757293168361}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}


@dataclass(frozen=True)
class Board:
    """What a spa-rig log says of itself."""

    name: str
    bits: int
    rate_hz: float
    vref_mv: int
    line_end: bytes

    def banner(self, columns: Sequence[str]) -> bytes:
        """Return the first line."""
        text = (
            f"# spa-rig 1 board={self.name} adc_bits={self.bits} vref_mv={self.vref_mv} "
            f"rate_hz={self.rate_hz:g} columns={','.join(columns)}"
        )
        return text.encode("ascii")


def draw_board(bits: int, rate_hz: float, rng: Rng) -> Board:
    """Draw a board that has a converter of so many bits."""
    name = str(rng.choice(["mega2560", "uno", "due", "teensy41"]))
    line_end = b"\r\n" if rng.random() < 0.5 else b"\n"
    return Board(name, bits, rate_hz, int(rng.choice([5000, 3300])), line_end)


def spa_rig(
    board: Board,
    columns: Sequence[str],
    seq: npt.NDArray[np.int64],
    times: Floats,
    fields: Sequence[Sequence[str]],
    damaged: Flags,
    rng: Rng,
) -> bytes:
    """Write a spa-rig log.

    Parameters
    ----------
    board : Board
        Banner and line ends.
    columns : sequence of str
        After seq and t_us.
    seq : ndarray, shape (n,)
        Sample numbers; those that never were logged are not among them.
    times : ndarray, shape (n,)
        True times (s).
    fields : sequence of sequences of str
        Texts of the columns, each of length n.
    damaged : ndarray of bool, shape (n,)
        Lines that suffer on the wire.
    rng : Generator
        Draws micros() at the start, comments, and how lines are damaged.
    """
    start = int(rng.integers(_WRAP))
    if rng.random() < 0.15:  # the counter wraps within this log
        start = _WRAP - int(rng.uniform(0.1, 0.9) * 1e6 * times[-1])
    ticks = (start + np.rint(times * 1e6).astype(np.int64)) % _WRAP
    lines = [board.banner(("seq", "t_us", *columns))]
    if rng.random() < 0.3:
        lines.append(b"# ready")
    for row, texts in enumerate(zip(*fields, strict=True)):
        body = ",".join((str(seq[row]), str(ticks[row]), *texts)).encode("ascii")
        line = body + b"*%02X" % reduce(xor, body)
        lines.append(_hurt(line, rng) if damaged[row] else line)
    return board.line_end.join(lines) + board.line_end


def _hurt(line: bytes, rng: Rng) -> bytes:
    """Damage a line as a serial link does; a single byte is always seen by the checksum."""
    place = int(rng.integers(1, len(line) - 1))
    kind = int(rng.integers(4))
    if kind == 0:
        return line[:place]
    if kind == 1:
        return line[:place] + bytes([line[place] ^ (1 << int(rng.integers(6)))]) + line[place + 1 :]
    if kind == 2:
        return line[:place] + b"\xff\xfe" + line[place:]
    return line[:place] + b"#" + line[place:]


@dataclass(frozen=True)
class Table:
    """How someone else's csv log looks.

    Attributes
    ----------
    delimiter : str
        Between fields.
    header : bool
        Whether the first line names the columns.
    order : tuple of str
        Roles as columns stand, with fillers that nobody needs.
    names : tuple of str
        Header's names, one a column.
    units : dict
        Unit of time, command, pressure, angle.
    ambient_kpa : float
        Pressures are absolute where this is not zero.
    line_end : bytes
        LF or CRLF.
    """

    delimiter: str
    header: bool
    order: tuple[str, ...]
    names: tuple[str, ...]
    units: dict[str, str]
    ambient_kpa: float
    line_end: bytes

    def configuration(self) -> dict[str, object]:
        """Return the `log` section of campaign.yaml."""
        columns: dict[str, object] = {}
        for place, role in enumerate(self.order, start=1):
            if role.startswith("filler"):
                continue
            item: dict[str, object] = {"column": self.names[place - 1] if self.header else place}
            if role == "flex_adc":
                columns[role] = item
                continue
            item["unit"] = self.units[role]
            if role == "pressure" and self.ambient_kpa:
                item["offset"] = -self.ambient_kpa / _KPA[self.units[role]]
            if role == "angle":
                item["rest"] = "keep"
            columns[role] = item
        delimiter = "whitespace" if self.delimiter == " " else self.delimiter
        return {"format": "csv", "delimiter": delimiter, "header": self.header, "columns": columns}

    def text(self, role: str, values: Floats) -> list[str]:
        """Return a column's fields in its unit."""
        if role == "flex_adc":
            return [f"{value:d}" for value in values.astype(np.int64)]
        unit = self.units[role]
        if role == "time":
            return [
                f"{value:.{ {'s': 6, 'ms': 3, 'us': 0}[unit] }f}"
                for value in values / _SECONDS[unit]
            ]
        if role == "angle":
            return [f"{x:.6f}" for x in (np.deg2rad(values) if unit == "rad" else values)]
        if role == "pressure":
            values = values + self.ambient_kpa
        return [
            f"{value:.6g}" if role == "command" else f"{value:.7g}" for value in values / _KPA[unit]
        ]


def draw_table(angle: bool, pressure: bool, rng: Rng) -> Table:
    """Draw a csv format that holds angles or flex counts, with measured pressure or without."""
    roles = ["time", "command", "angle" if angle else "flex_adc"]
    if pressure:
        roles.append("pressure")
    names = {
        "time": str(rng.choice(["t", "time", "Zeit", "stamp"])),
        "command": str(rng.choice(["p_set", "command", "ref_pressure"])),
        "pressure": str(rng.choice(["p", "p_meas", "pressure_1"])),
        "angle": str(rng.choice(["angle", "theta", "bend"])),
        "flex_adc": str(rng.choice(["flex", "adc0", "A0"])),
        "filler_1": "temperature",
        "filler_2": "battery",
    }
    fillers = [f"filler_{k}" for k in range(1, 1 + int(rng.integers(0, 3)))]
    order = tuple(str(role) for role in rng.permutation([*roles, *fillers]))
    unit = str(rng.choice(["kPa", "hPa", "bar", "psi"]))
    absolute = unit in ("hPa", "bar") and rng.random() < 0.5
    return Table(
        delimiter=str(rng.choice([",", ";", "\t", "|", " "])),
        header=bool(rng.random() < 0.6),
        order=order,
        names=tuple(names[role] for role in order),
        units={
            "time": str(rng.choice(["s", "ms", "us"])),
            "command": str(rng.choice(["kPa", unit])),
            "pressure": unit,
            "angle": "rad" if rng.random() < 0.35 else "deg",
        },
        ambient_kpa=round(rng.uniform(99.0, 102.5), 2) if absolute else 0.0,
        line_end=b"\r\n" if rng.random() < 0.3 else b"\n",
    )


def delimited(table: Table, columns: dict[str, Floats], damaged: Flags, rng: Rng) -> bytes:
    """Write a csv log.

    Parameters
    ----------
    table : Table
        Its looks.
    columns : dict of ndarray, each of shape (n,)
        By role: time (s), command and pressure (kPa), angle (deg), flex_adc (counts).
    damaged : ndarray of bool, shape (n,)
        Rows that nobody can read.
    rng : Generator
        Draws fillers and damage.
    """
    count = damaged.size
    texts = [
        [f"{value:.2f}" for value in 20.0 + 0.05 * rng.normal(size=count)]
        if role.startswith("filler")
        else table.text(role, columns[role])
        for role in table.order
    ]
    needed = [k for k, role in enumerate(table.order) if not role.startswith("filler")]
    lines = [table.delimiter.join(table.names)] if table.header else []
    for row, fields in enumerate(zip(*texts, strict=True)):
        line = list(fields)
        if damaged[row]:
            line = _spoil(line, needed, table.delimiter != " ", rng)
        lines.append(table.delimiter.join(line))
    end = table.line_end.decode("ascii")
    return (end.join(lines) + end).encode("ascii")


def _spoil(line: list[str], needed: Sequence[int], empty: bool, rng: Rng) -> list[str]:
    """Spoil a row: a field that is no number, one that is empty, or the row's end cut off."""
    kinds = ["nan", "err", "-", "cut"] + [""] * empty
    kind = str(rng.choice(kinds))
    if kind == "cut":
        return line[: max(needed)]
    line[needed[int(rng.integers(len(needed)))]] = kind
    return line
