"""Cases of the blind benchmark on disk: what the examinee gets, and the sealed labels.

A case's folder ``<case>/`` holds ``campaign/``, ``later/`` (the campaign that continues it, kept
from the diagnosis to judge the shrink by), ``exclude.txt`` (effects to withhold, a line each) and,
unless the model has to be identified on the campaign, ``model.json``. The label goes to
another folder; ``seals.txt`` beside the cases holds its hash, as sha256sum would write it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from blind.first_rig.build import BuiltCase, Case, draw_salt, model_document
from spa_fo.atomic import write_bytes, write_text
from spa_fo.errors import BadInput
from spa_fo.virtual_rig.campaign_writer import write_folder


def label_bytes(label: Mapping[str, Any], salt: str) -> bytes:
    """Write a label in the one way that is sealed: keys sorted, salted so it cannot be guessed."""
    document = {**label, "salt": salt}
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode("ascii") + b"\n"


def seal(data: bytes) -> str:
    """Hash of a label's bytes."""
    return hashlib.sha256(data).hexdigest()


def case_files(built: BuiltCase) -> dict[str, bytes]:
    """Every file of a case's folder, by its relative name."""
    case = built.case
    files = {f"campaign/{name}": data for name, data in built.campaign.items()}
    files |= {f"later/{name}": data for name, data in built.later.items()}
    files["exclude.txt"] = "".join(f"{effect}\n" for effect in case.exclude).encode("ascii")
    if case.model == "nominal":
        files["model.json"] = json.dumps(model_document(case), indent=2).encode("ascii") + b"\n"
    return files


def write_case(case: Case, folder: Path, labels: Path) -> str:
    """Make a case and write its folder and its label, each whole or not at all.

    Returns
    -------
    str
        The label's seal.

    Raises
    ------
    BadInput
        The case's folder exists already, or something cannot be written.
    """
    built = BuiltCase(case)
    write_folder(case_files(built), folder / case.name)
    data = label_bytes(built.label, draw_salt(case))
    write_bytes(labels / f"{case.name}.json", data)
    return seal(data)


def write_cases(cases: Sequence[Case], folder: Path, labels: Path, workers: int = 1) -> None:
    """Write cases and, last, their seals to the end of ``seals.txt``.

    Raises
    ------
    BadInput
        The folder of a case exists already, or something cannot be written.
    """
    seals = folder / "seals.txt"
    write = partial(write_case, folder=folder, labels=labels)
    if workers == 1:
        hashes: Iterable[str] = map(write, cases)
    else:
        # Forked processes could inherit locked threads; spawned ones cannot.
        with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
            hashes = list(pool.map(write, cases))
    lines = [f"{value}  {case.name}\n" for value, case in zip(hashes, cases, strict=True)]
    before = seals.read_text(encoding="ascii") if seals.exists() else ""
    write_text(seals, before + "".join(lines))


def check_seals(seals: Path, labels: Path) -> None:
    """Check every label against its seal.

    Raises
    ------
    BadInput
        A label is missing or is not the one that was sealed.
    """
    for number, line in enumerate(seals.read_text(encoding="ascii").splitlines(), start=1):
        value, name = line.split("  ", 1)
        path = labels / f"{name}.json"
        if not path.is_file():
            raise BadInput(path, f"is missing, but {seals.name} seals it", f"line {number}")
        if seal(path.read_bytes()) != value:
            raise BadInput(path, f"is not the label that {seals.name} seals")
