"""Where a command reads and writes: looked at before its work begins, or is even imported."""

from __future__ import annotations

import difflib
import json
import os
import tempfile
from pathlib import Path
from typing import Any

from spa_fo.atomic import TEMPORARY
from spa_fo.errors import BadInput

DESCRIPTION = "campaign.yaml"
DIAGNOSIS = "diagnosis.json"
COMPARISON = "comparison.json"
_HEAD = 2000  # characters in which a file says what it is


def campaign_folder(folder: Path) -> Path:
    """Return the path of a campaign's description.

    Raises
    ------
    BadInput
        There is no such folder, or no campaign.yaml in it.
    """
    if not folder.is_dir():
        if folder.exists():
            raise BadInput(folder, "is a file; expected a campaign folder with campaign.yaml")
        near = _neighbour(folder)
        raise BadInput(folder, f"is not there; expected a campaign folder with campaign.yaml{near}")
    path = folder / DESCRIPTION
    if not path.is_file():
        raise BadInput(path, "is missing; expected the description of the campaign")
    return path


def log_folder(folder: Path) -> None:
    """Refuse a folder of logs that is not there.

    Raises
    ------
    BadInput
        It is missing, or a file.
    """
    if not folder.is_dir():
        near = "" if folder.exists() else _neighbour(folder)
        raise BadInput(folder, f"is not there; expected a folder of logs{near}")


def input_file(path: Path, expected: str) -> None:
    """Refuse a file that is not there; `expected` says what it would have been.

    Raises
    ------
    BadInput
        It is missing, or a folder.
    """
    if path.is_dir():
        raise BadInput(path, f"is a folder; expected {expected}")
    if not path.exists():
        raise BadInput(path, f"is not there; expected {expected}{_neighbour(path)}")


def output_file(path: Path) -> None:
    """Refuse a place where no file can be written; missing parent folders are made later.

    Raises
    ------
    BadInput
        It names a folder, one of its parents is a file, or nothing can be written there.
    """
    try:
        if path.is_dir():
            raise BadInput(path, "cannot be written: it is a folder; expected a file")
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        pass  # it is made, or refused below
    except OSError as error:
        raise _unwritable(path, error) from error
    _try_to_write(path, path.parent)


def output_folder(path: Path) -> None:
    """Refuse a place where no folder can be filled; it is made later where it is missing.

    Raises
    ------
    BadInput
        It or one of its parents is a file, or nothing can be written there.
    """
    try:
        if path.exists() and not path.is_dir():
            raise BadInput(path, "cannot be written: it is a file; expected a folder")
    except OSError as error:
        raise _unwritable(path, error) from error
    _try_to_write(path, path)


def replaced_model(path: Path, campaign: str, overwrite: bool) -> str:
    """Name the model that a new one of this campaign replaces; empty where there is none.

    Raises
    ------
    BadInput
        The file holds anything else than a plain model of this campaign, and may not be
        overwritten.
    """
    if _is_free(path):
        return ""
    document = _json(path)
    if not str(document.get("schema")).startswith("spa-fo/model/"):
        return _replaced(path, "something else than a model", False, overwrite)
    source = document.get("campaign")
    if document.get("effects"):
        return _replaced(path, f"a model of '{source}' with effects", False, overwrite)
    return _replaced(path, f"the model of '{source}'", source == campaign, overwrite)


def replaced_diagnosis(folder: Path, campaign: str, overwrite: bool) -> str:
    """Name the diagnosis that a new one of this campaign replaces; empty where there is none.

    Raises
    ------
    BadInput
        The folder holds the diagnosis of another campaign, and may not be overwritten.
    """
    return _replaced_answer(folder, DIAGNOSIS, "the diagnosis of", campaign, overwrite)


def replaced_comparison(folder: Path, campaign: str, overwrite: bool) -> str:
    """Name the comparison that a new one of this campaign replaces; empty where there is none.

    Raises
    ------
    BadInput
        The folder holds the comparison of another campaign, and may not be overwritten.
    """
    return _replaced_answer(folder, COMPARISON, "what changed in", campaign, overwrite)


def _replaced_answer(folder: Path, file: str, what: str, campaign: str, overwrite: bool) -> str:
    path = folder / file
    if _is_free(path):
        return ""
    document = _json(path)
    source, seed = document.get("campaign"), document.get("seed")
    return _replaced(folder, f"{what} '{source}' (seed {seed})", source == campaign, overwrite)


def replaced_file(path: Path, words: str, what: str, overwrite: bool) -> str:
    """Name what a new file of some kind replaces; empty where there is none.

    Parameters
    ----------
    path : Path
        Where it is to be written.
    words : str
        How a file of this kind begins, or what stands near its beginning.
    what : str
        What such a file is.
    overwrite : bool
        Whether anything may be replaced.

    Raises
    ------
    BadInput
        The file is of another kind, and may not be overwritten.
    """
    if _is_free(path):
        return ""
    own = words in _head(path)
    return _replaced(path, what if own else f"something else than {what}", own, overwrite)


def _replaced(path: Path, found: str, own: bool, overwrite: bool) -> str:
    if not (own or overwrite):
        raise BadInput(path, f"holds {found}; expected another place, or --overwrite")
    return found


def _is_free(path: Path) -> bool:
    """Whether nothing is lost by a new file: there is none, or one without a byte."""
    return not path.is_file() or path.stat().st_size == 0


def _json(path: Path) -> dict[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


def _head(path: Path) -> str:
    with path.open(encoding="utf-8", errors="replace") as stream:
        return stream.read(_HEAD)


def _neighbour(path: Path) -> str:
    """Return what was probably meant: an entry of the same folder with nearly the same name."""
    try:
        names = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return ""
    near = difflib.get_close_matches(path.name, names, n=1, cutoff=0.8)
    return f"; did you mean '{path.with_name(near[0])}'?" if near else ""


def _try_to_write(path: Path, folder: Path) -> None:
    """Write an empty file into a folder, or its nearest parent that is there, and remove it."""
    try:
        while not folder.exists():
            folder = folder.parent
        if not folder.is_dir():
            raise BadInput(path, f"cannot be written: {folder} is a file; expected a folder")
        handle, name = tempfile.mkstemp(prefix=TEMPORARY, dir=folder)
        os.close(handle)
        Path(name).unlink()
    except OSError as error:
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: OSError) -> BadInput:
    return BadInput(path, f"cannot be written: {error.strerror or error}")
