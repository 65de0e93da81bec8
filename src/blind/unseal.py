"""Open the labels of the blind benchmark, if they are the ones that were sealed beforehand."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from spa_fo.errors import BadInput


def fingerprint(seals: Path) -> str:
    """Hash of the file of seals: whoever writes it down shows that the seals were there before.

    Raises
    ------
    BadInput
        The file cannot be read.
    """
    return hashlib.sha256(_read(seals)).hexdigest()


def unseal(
    seals: Path, labels: Iterable[Path], witnesses: Iterable[Path]
) -> dict[str, Mapping[str, Any]]:
    """Open all labels.

    Parameters
    ----------
    seals : Path
        Lines ``<sha256>  <case>``.
    labels : iterable of Path
        The labels' files, ``<case>.json``.
    witnesses : iterable of Path
        Files into which the diagnoses wrote, before they began, the fingerprint of `seals`.

    Returns
    -------
    dict of str to Mapping
        The labels by case.

    Raises
    ------
    BadInput
        A label is missing, was never sealed, or is not what was sealed; a diagnosis was made under
        other seals.
    """
    sealed = _sealed(seals)
    files = {path.stem: path for path in labels}
    for name in sealed.keys() - files.keys():
        raise BadInput(seals, f"expected a label for the sealed case {name}, found none")
    for witness in witnesses:
        if _read(witness).decode("ascii", "replace").strip() != fingerprint(seals):
            raise BadInput(witness, f"its diagnoses were made under other seals than {seals.name}")
    return {name: _opened(files[name], sealed) for name in sorted(files)}


def _sealed(seals: Path) -> dict[str, str]:
    sealed = {}
    for number, line in enumerate(_read(seals).decode("ascii", "replace").splitlines(), start=1):
        value, _, name = line.partition("  ")
        if len(value) != 64 or not name or name in sealed:
            raise BadInput(seals, "expected a sha256, two spaces and a new case", f"line {number}")
        sealed[name] = value
    return sealed


def _opened(path: Path, sealed: Mapping[str, str]) -> Mapping[str, Any]:
    data = _read(path)
    if path.stem not in sealed:
        raise BadInput(path, "was never sealed")
    if hashlib.sha256(data).hexdigest() != sealed[path.stem]:
        raise BadInput(path, "is not the label that was sealed")
    label: Mapping[str, Any] = json.loads(data)
    return label


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadInput(path, f"cannot be read: {error.strerror or error}") from error
