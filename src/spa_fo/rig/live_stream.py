"""Lines as they come, while a trial runs: what the recorder needs to know of them at once."""

from __future__ import annotations

from dataclasses import dataclass

from spa_fo.rig.wire import COLUMNS, LineParser, is_banner, is_comment

_LONGEST = 4096  # bytes without a line end: no line, whatever follows


@dataclass(frozen=True)
class Row:
    """A valid data line: its columns by name."""

    seq: int
    fields: dict[str, float]


@dataclass(frozen=True)
class Remark:
    """A comment or a banner, without its end."""

    line: bytes

    @property
    def greets(self) -> bool:
        """Whether the board has begun anew."""
        return is_banner(self.line) or self.line.startswith(b"# ready")


class LiveStream:
    """Cuts a stream into lines and keeps the account.

    Parameters
    ----------
    columns : sequence of str
        Of the banner.
    adc_max : int
        Counts beyond are damage.
    """

    def __init__(self, columns: tuple[str, ...], adc_max: int) -> None:
        self._parser = LineParser(columns)
        self._adc_max = adc_max
        self._begun = b""
        self.rows = self.damaged = 0

    def feed(self, data: bytes) -> list[Row | Remark]:
        """Take the next bytes; returns what their whole lines say, damaged ones left out."""
        *lines, self._begun = (self._begun + data).split(b"\n")
        if len(self._begun) > _LONGEST:
            self._begun = b""
            self.damaged += 1
        said: list[Row | Remark] = []
        for line in lines:
            heard = self._line(line.removesuffix(b"\r"))
            if heard is None:
                self.damaged += 1
            else:
                self.rows += isinstance(heard, Row)
                said.append(heard)
        return said

    def _line(self, line: bytes) -> Row | Remark | None:
        texts = self._parser.parse(line)
        if texts is None:
            return Remark(line) if is_comment(line) else None
        named = zip(self._parser.columns, texts, strict=True)
        fields = {name: float(text) for name, text in named if name in COLUMNS}
        if any(fields.get(name, 0.0) > self._adc_max for name in ("p_adc", "flex_adc")):
            return None
        return Row(int(fields.pop("seq")), fields)


class Progress:
    """How far the board is: the last sample whose number its neighbour confirms.

    One damaged line in 256 has a right checksum; a number that nobody confirms must not end a
    trial early.
    """

    def __init__(self) -> None:
        self.seq = -1
        self._last = -1

    def see(self, seq: int) -> bool:
        """Take a row's number; returns whether it counts."""
        confirmed = seq == self._last + 1 and seq > self.seq
        if confirmed:
            self.seq = seq
        self._last = seq
        return confirmed
