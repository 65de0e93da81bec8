"""One line of the spa-rig format: bytes on the wire to values and back.

A data line is its comma-separated columns, ``*``, and two upper-case hexadecimal digits, the XOR
of every byte before the ``*`` (as in NMEA 0183). A line that begins with ``# `` is a banner or a
comment. Everything else is damaged.

An XOR of one byte does not see two bytes swapped, nor the same bit flipped in two bytes. The clock
(see `spa_fo.rig.clock`) catches those that move seq or t_us by more than about a period; the rest
pass. Measured on 8000 lines each of five columns at 50 Hz, the share of damaged lines that is
accepted, and in brackets the share that then holds another command or count: two unequal
neighbouring bytes swapped, 47 % (38 %); the same bit flipped in two bytes, 12 % (11 %); three
characters replaced by random digits, 1.2 % (1.2 %); the head of one line joined to the tail of
another, 0.3 % (0.3 %). One byte changed or lost never passes, but for a lost zero byte.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import xor

from spa_fo.validation import suggestion

VERSION = "1"
BANNER_EXAMPLE = (
    "# spa-rig 1 board=mega2560 adc_bits=10 vref_mv=5000 rate_hz=50 "
    "columns=seq,t_us,cmd_kpa,p_adc,flex_adc"
)

_COUNT = rb"\d{1,9}"
_DECIMAL = rb"[+-]?(?:\d{1,15}(?:\.\d{0,15})?|\.\d{1,15})(?:[eE][+-]?\d{1,2})?"
_PATTERNS = {
    "seq": rb"\d{1,15}",
    "t_us": rb"\d{1,10}",
    "cmd_kpa": _DECIMAL,
    "p_adc": _COUNT,
    "flex_adc": _COUNT,
    "angle_deg": _DECIMAL,
}
COLUMNS = frozenset(_PATTERNS)
"""Columns that are read; whatever a board logs beside them is passed over."""
_PASSED_OVER = rb'[ !"$-)+\-.-~]*'  # whatever is printed but commas, stars and hashes
_NAME = re.compile(r"[A-Za-z_][\w.]*", re.ASCII)
_CHECKSUM = re.compile(rb"[0-9A-F]{2}")
_PRINTABLE = re.compile(rb"[\x20-\x7e]*")


@dataclass(frozen=True)
class Banner:
    """The first line of a log: the board's settings and the meaning of the columns."""

    board: str
    adc_bits: int
    vref_mv: float
    rate_hz: float
    columns: tuple[str, ...]

    @property
    def adc_max(self) -> int:
        """The largest count of the converter."""
        return int(2**self.adc_bits - 1)

    def line(self) -> bytes:
        """Return the banner as it goes over the wire, without the line end."""
        return (
            f"# spa-rig {VERSION} board={self.board} adc_bits={self.adc_bits} "
            f"vref_mv={self.vref_mv:g} rate_hz={self.rate_hz:g} columns={','.join(self.columns)}"
        ).encode("ascii")


def checksum(body: bytes) -> int:
    """Return the XOR of all bytes of `body` (0..255)."""
    return reduce(xor, body, 0)


def format_line(fields: Sequence[str]) -> bytes:
    """Return a data line of the given column texts with its checksum, without the line end."""
    body = ",".join(fields).encode("ascii")
    return body + b"*%02X" % checksum(body)


def is_banner(line: bytes) -> bool:
    """Say whether `line` sets out to be a banner (it may still be a wrong one)."""
    return line.startswith(b"# spa-rig")


def is_comment(line: bytes) -> bool:
    """Say whether `line` is a comment: hash, space, and printable ASCII."""
    return line.startswith(b"# ") and _PRINTABLE.fullmatch(line) is not None


def no_banner(line: bytes) -> str:
    """Say what was expected in place of `line`."""
    return f"expected the banner '{BANNER_EXAMPLE}', found '{_show(line)}'"


def parse_banner(line: bytes) -> Banner:
    """Parse a banner line (without its end).

    Raises
    ------
    ValueError
        It is not a banner of version 1 with the columns needed; the text says what was expected.
    """
    if not is_banner(line):
        raise ValueError(no_banner(line))
    if not _PRINTABLE.fullmatch(line):
        raise ValueError(f"expected an ASCII banner, found '{_show(line)}'")
    words = line.decode("ascii").split()
    if words[:2] != ["#", "spa-rig"] or len(words) < 3 or words[2] != VERSION:
        raise ValueError(f"expected '# spa-rig {VERSION} ...', found '{_show(line)}'")
    settings: dict[str, str] = {}
    for word in words[3:]:
        key, equals, value = word.partition("=")
        if not equals or not value or key in settings:
            raise ValueError(f"expected key=value, each key once, found '{word}'")
        settings[key] = value
    for key in ("adc_bits", "vref_mv", "rate_hz", "columns"):
        if key not in settings:
            raise ValueError(f"the banner lacks {key}=")
    adc_bits = settings["adc_bits"]
    if not re.fullmatch(r"\d{1,2}", adc_bits) or not 1 <= int(adc_bits) <= 24:
        raise ValueError(f"adc_bits={adc_bits}; expected a whole number from 1 to 24")
    return Banner(
        settings.get("board", ""),
        int(adc_bits),
        _positive("vref_mv", settings["vref_mv"]),
        _positive("rate_hz", settings["rate_hz"]),
        _columns(settings["columns"]),
    )


class LineParser:
    """Parses data lines of the columns a banner names."""

    def __init__(self, columns: Sequence[str]) -> None:
        self.columns = tuple(columns)
        fields = b",".join(b"(" + _PATTERNS.get(name, _PASSED_OVER) + b")" for name in self.columns)
        self._line = re.compile(b"(" + fields + rb")\*([0-9A-F]{2})")

    def parse(self, line: bytes) -> tuple[bytes, ...] | None:
        """Return the column texts of a whole data line, or None: then ask `reason`."""
        match = self._line.fullmatch(line)
        if match is None:
            return None
        body, *fields, digits = match.groups()
        return tuple(fields) if reduce(xor, body) == int(digits, 16) else None

    def reason(self, line: bytes) -> str:
        """Say why `line`, which `parse` refused, is damaged."""
        if not line:
            return "blank"
        if not _PRINTABLE.fullmatch(line):
            return "not ascii"
        if b"#" in line:
            return "hash"
        body, star, digits = line.rpartition(b"*")
        if not star or len(digits) < 2:
            return "cut"
        if not _CHECKSUM.fullmatch(digits) or checksum(body) != int(digits, 16):
            return "checksum"
        if body.count(b",") != len(self.columns) - 1:
            return "fields"
        return "not a number"


def _columns(text: str) -> tuple[str, ...]:
    columns = tuple(text.split(","))
    missing = sorted(COLUMNS - set(columns))
    for name in columns:
        meant = [column for column in missing if _is_mistyped(name, column)]
        if name not in COLUMNS and (meant or not _NAME.fullmatch(name)):
            raise ValueError(f"unknown column '{name}'{suggestion(name, meant or COLUMNS)}")
    if len(set(columns)) < len(columns):
        raise ValueError(f"columns={text} names a column twice")
    for name in ("seq", "t_us"):
        if name not in columns:
            raise ValueError(f"columns={text} lacks {name}")
    if not {"flex_adc", "angle_deg"} & set(columns):
        raise ValueError(f"columns={text} lacks flex_adc")
    return columns


def _is_mistyped(name: str, meant: str) -> bool:
    """Say whether a name is that of a column with its letters swapped, or with one wrong.

    A letter of its first word that is another one is another word: t_adc is no p_adc.
    """
    if sorted(name) == sorted(meant):
        return True
    if len(name) == len(meant):
        wrong = [k for k, (one, right) in enumerate(zip(name, meant, strict=True)) if one != right]
        return len(wrong) == 1 and wrong[0] > meant.find("_")
    longer, shorter = sorted((name, meant), key=len, reverse=True)
    return any(longer[:k] + longer[k + 1 :] == shorter for k in range(len(longer)))


def _positive(key: str, text: str) -> float:
    if not re.fullmatch(r"\d{1,9}(\.\d{0,9})?", text) or float(text) == 0.0:
        raise ValueError(f"{key}={text}; expected a positive number")
    return float(text)


def _show(line: bytes) -> str:
    text = line[:60].decode("ascii", errors="backslashreplace")
    printable = "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)
    return printable + ("..." if len(line) > 60 else "")
