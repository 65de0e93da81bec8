"""Rows -> the bytes a board sends, and what a bad cable makes of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from operator import xor

import numpy as np

from spa_fo.virtual_rig.converter import Converter

TRIAL_COLUMNS = "seq,t_us,cmd_kpa,p_adc,flex_adc"
CALIBRATION_COLUMNS = "seq,t_us,angle_deg,flex_adc"

# A change of one bit that made a line end would make two damages of one.
_LINE_ENDS = b"\r\n"


def banner(
    columns: str, rate_hz: float, board: str = "mega2560", converter: Converter | None = None
) -> bytes:
    """Compose the line a board sends after a reset, without its end."""
    converter = converter or Converter()
    return (
        f"# spa-rig 1 board={board} adc_bits={converter.bits} "
        f"vref_mv={1000.0 * converter.reference_volt:.0f} rate_hz={rate_hz:g} columns={columns}"
    ).encode("ascii")


def data_line(*values: object) -> bytes:
    """Values, joined by commas, with their checksum (XOR of every byte, two hex digits)."""
    body = ",".join(str(value) for value in values).encode("ascii")
    return body + b"*%02X" % reduce(xor, body, 0)


@dataclass(frozen=True)
class Damage:
    """How many data lines of a log go wrong, by kind; no line goes wrong twice.

    Parameters
    ----------
    flipped : int
        One bit of one byte is wrong.
    cut : int
        The line's tail is missing.
    doubled : int
        One byte comes twice.
    glued : int
        The line end is missing: two rows become one line.
    lost : int
        The whole line is missing.
    """

    flipped: int = 0
    cut: int = 0
    doubled: int = 0
    glued: int = 0
    lost: int = 0

    @property
    def damaged_lines(self) -> int:
        """Lines in the log that are no valid row."""
        return self.flipped + self.cut + self.doubled + self.glued

    @property
    def missing_rows(self) -> int:
        """Rows that the log does not hold."""
        return self.damaged_lines + self.glued + self.lost

    def apply(
        self, lines: list[bytes], end: bytes, rng: np.random.Generator, keep: frozenset[int]
    ) -> bytes:
        """Join `lines` into a log, damaged; lines with an index in `keep` are spared.

        Damaged lines stand at least two lines apart, and neither first nor last.
        """
        out = [line + end for line in lines]
        at = iter(_scattered(len(lines), self.missing_rows - self.glued, rng, keep))
        for _ in range(self.flipped):
            i = next(at)
            out[i] = _flip(lines[i], rng) + end
        for _ in range(self.cut):
            i = next(at)
            out[i] = lines[i][: int(rng.integers(1, len(lines[i]) - 1))] + end
        for _ in range(self.doubled):
            i = next(at)
            j = int(rng.integers(len(lines[i])))
            out[i] = lines[i][: j + 1] + lines[i][j:] + end
        for _ in range(self.glued):
            i = next(at)
            out[i] = lines[i]
        for _ in range(self.lost):
            out[next(at)] = b""
        return b"".join(out)


def _scattered(lines: int, count: int, rng: np.random.Generator, keep: frozenset[int]) -> list[int]:
    """Draw indices at least three apart, none of them at or just before a kept line."""
    chosen: list[int] = []
    for i in rng.permutation(np.arange(1, lines - 2)).tolist():
        if len(chosen) == count:
            break
        if {i, i + 1} & keep or any(abs(i - other) < 3 for other in chosen):
            continue
        chosen.append(i)
    if len(chosen) < count:
        raise ValueError(f"{lines} lines have no room for {count} damages")
    return chosen


def _flip(line: bytes, rng: np.random.Generator) -> bytes:
    while True:
        i, bit = int(rng.integers(len(line))), int(rng.integers(8))
        byte = line[i] ^ (1 << bit)
        if byte not in _LINE_ENDS:
            return line[:i] + bytes([byte]) + line[i + 1 :]
