"""A profile's set-points as commands to the board, sent ahead and again where they got lost."""

from __future__ import annotations

from collections.abc import Sequence


class Pacer:
    """Which set-points to send when.

    Parameters
    ----------
    changes : sequence of (int, float)
        Sample and command (kPa), samples rising; 0 kPa before.
    lookahead : int
        Samples ahead.
    queue : int
        Set-points the board can keep waiting.
    patience : int
        Rows in a row with another command than that of the profile until it is sent again.
    """

    def __init__(
        self, changes: Sequence[tuple[int, float]], lookahead: int, queue: int, patience: int
    ) -> None:
        self._changes = changes
        self._lookahead, self._queue, self._patience = lookahead, queue, patience
        self._next = 0  # place of the first set-point that is not sent
        self._held = 0  # place of the first one beyond the last sample seen
        self._strays = 0
        self.repairs = 0

    def expected(self, seq: int) -> float:
        """Command of a sample at or behind the last one seen, kPa."""
        while self._held < len(self._changes) and self._changes[self._held][0] <= seq:
            self._held += 1
        return self._changes[self._held - 1][1] if self._held else 0.0

    def commands(self, seq: int) -> list[str]:
        """List the commands to send when sample `seq` was the last one seen."""
        self.expected(seq)
        last = min(len(self._changes), self._held + self._queue)
        out = []
        while self._next < last and self._changes[self._next][0] <= seq + self._lookahead:
            sample, kpa = self._changes[self._next]
            out.append(f"set {decimal(kpa)} {sample}")
            self._next += 1
        return out

    def see(self, seq: int, command_kpa: float) -> list[str]:
        """Take a row; lists what to send because the board does something else for too long."""
        expected = self.expected(seq)
        stray = abs(command_kpa - expected) > 0.006
        self._strays = self._strays + 1 if stray else 0
        if self._strays <= self._patience:
            return []
        self._strays = 0
        self.repairs += 1
        self._next = self._held
        return [f"set {decimal(expected)}"]


def decimal(value: float, places: int = 2) -> str:
    """Write a number as the board reads it."""
    text = f"{value:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
