"""Raw files as bytes."""

from __future__ import annotations

from pathlib import Path

from spa_fo.errors import BadInput


def read_bytes(path: Path, expected: str) -> bytes:
    """Return all bytes of `path`, or raise BadInput naming what was `expected` there."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(path, f"cannot be read ({error.strerror}); expected {expected}") from error
