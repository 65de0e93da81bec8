"""Write files whole or not at all, one by one or several together."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from spa_fo.errors import BadInput

TEMPORARY = ".part-"
"""How the name of a file begins that is still being written, or was when its writer was killed."""


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Yield a temporary path beside `path` that takes its place when the block succeeds.

    Parameters
    ----------
    path : Path or str
        The file to write. Missing parent folders are made.

    Yields
    ------
    Path
        Where to write; it has the suffix of `path`, so writers that look at it work.

    Raises
    ------
    BadInput
        The file cannot be written (read-only, disk full); an earlier file is left as it was. Or
        something else than a file has its name: a device must not be replaced.
    """
    path = Path(path)
    temporary: Path | None = None
    try:
        if path.exists() and not path.is_file():
            raise BadInput(path, "cannot be written: it is not a file")
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=TEMPORARY, suffix=path.suffix, dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        yield temporary
        _make_durable(temporary)
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    except OSError as error:
        raise BadInput(path, f"cannot be written: {error.strerror or error}") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


@contextmanager
def filling(folder: Path | str) -> Iterator[Path]:
    """Yield an empty folder whose files move into `folder` when the block succeeds.

    Parameters
    ----------
    folder : Path or str
        Where the files belong together; made where missing, other files in it are let be.

    Yields
    ------
    Path
        Where to write them; it lies in `folder` and is gone afterwards.

    Raises
    ------
    BadInput
        A file cannot be written; none of them is then there, or all are as they were.
    """
    folder = Path(folder)
    is_new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=TEMPORARY, dir=folder) as name:
            temporary = Path(name)
            try:
                yield temporary
            except BadInput as error:
                if temporary not in error.path.parents:
                    raise
                place = folder / error.path.relative_to(temporary)
                raise BadInput(place, error.expected, error.where) from error
            files = sorted(temporary.iterdir())
            for target in (folder / file.name for file in files):
                if target.exists() and not target.is_file():
                    raise BadInput(target, "cannot be written: it is not a file")
            for file in files:
                file.replace(folder / file.name)
            is_new = False
    except OSError as error:
        raise BadInput(folder, f"cannot be written: {error.strerror or error}") from error
    finally:
        if is_new and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def write_bytes(path: Path | str, data: bytes) -> None:
    """Write `data` to `path` whole or not at all (see `replacing`)."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def write_text(path: Path | str, text: str) -> None:
    """Write `text` to `path` as UTF-8, whole or not at all (see `replacing`)."""
    write_bytes(path, text.encode("utf-8"))


def _make_durable(path: Path) -> None:
    # A power cut after os.replace must not leave an empty file under the final name.
    with path.open("rb") as stream:
        os.fsync(stream.fileno())


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
