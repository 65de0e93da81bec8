"""The one exception for bad input: one clear line, exit code 2."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path


class BadInput(Exception):
    """Input that cannot be used.

    Its text is one line that names the file, the line or key, and what was expected.
    Commands print it on stderr and leave with exit code 2.

    Parameters
    ----------
    path : Path or str
        The file or folder at fault.
    expected : str
        What is wrong and what was expected.
    where : str, optional
        The line or key within the file, for example ``"line 12"`` or ``"log.columns.time"``.
    """

    def __init__(self, path: Path | str, expected: str, where: str = "") -> None:
        self._given = path, expected, where
        self.path = Path(path)
        self.where = where
        self.expected = expected
        place = f"{path}: {where}" if where else f"{path}"
        super().__init__(" ".join(f"{place}: {expected}".split()))

    def __reduce__(self) -> tuple[type[BadInput], tuple[Path | str, str, str]]:
        """Say how another process makes the same."""
        return type(self), self._given


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the known word nearest to `word`, or list them all."""
    known = sorted(known)
    near = difflib.get_close_matches(word, known, n=1)
    if near:
        return f"; did you mean '{near[0]}'?"
    return f"; expected one of: {', '.join(known)}" if known else ""
