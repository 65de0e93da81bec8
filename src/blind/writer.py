"""Cases of the blind benchmark on disk: what the examinee gets, and the sealed labels.

A case's folder ``<case>/`` holds ``campaign/``, ``later/`` (the campaign that continues it, kept
from the diagnosis to judge the shrink by), ``exclude.txt`` (effects to withhold, a line each) and
where the judged model comes from: ``earlier/`` to identify it on, or ``model.json``, or neither
where the campaign itself is all there is. The label goes to another folder; ``seals.txt`` beside
the cases holds its hash, as sha256sum would write it.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from blind.equivalents import equivalents
from blind.plan import Case
from blind.rigs import rig_named
from spa_fo.atomic import write_bytes, write_text
from spa_fo.errors import BadInput

SCHEMA = "spa-fo/blind-label/2"


def label(case: Case, truth: Mapping[str, Any]) -> dict[str, Any]:
    """Write down what is true of a case, for whoever opens the seal."""
    return {
        "schema": SCHEMA,
        "case": case.name,
        "rig": case.rig,
        "asked": dict(case.asked),
        "exclude": list(case.exclude),
        "equivalents": list(_fair_answers(case)),
        "truth": dict(truth),
        "salt": _salt(case),
    }


def _fair_answers(case: Case) -> tuple[str, ...]:
    """List what is a fair answer as well where the true effect is not in the library."""
    kind, effects = case.asked["kind"], case.asked["effects"]
    if kind == "alien":
        return tuple(rig_named(case.rig).FOREIGN[effects[0]])
    pressure = bool(case.asked["surroundings"]["pressure"]["measured"])
    return equivalents(effects[0], pressure) if kind == "withheld" else ()


def _salt(case: Case) -> str:
    """Draw what keeps a sealed label from being guessed: 128 bits in hexadecimal."""
    return np.random.default_rng([int(case.asked["seed"]), *b"salt"]).bytes(16).hex()


def label_bytes(document: Mapping[str, Any]) -> bytes:
    """Write a label in the one way that is sealed: keys sorted, nothing between them."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return text.encode("ascii") + b"\n"


def seal(data: bytes) -> str:
    """Hash of a label's bytes."""
    return hashlib.sha256(data).hexdigest()


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
    target = folder / case.name
    if target.exists():
        raise BadInput(target, "exists already; expected a new folder, cases are not overwritten")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{case.name}.", dir=folder) as scratch:
            whole = Path(scratch) / case.name
            truth = rig_named(case.rig).write_case(case.asked, whole)
            exclude = "".join(f"{effect}\n" for effect in case.exclude)
            write_bytes(whole / "exclude.txt", exclude.encode("ascii"))
            shutil.move(whole, target)
    except OSError as error:
        raise BadInput(target, f"cannot be written: {error.strerror or error}") from error
    data = label_bytes(label(case, truth))
    write_bytes(labels / f"{case.name}.json", data)
    return seal(data)


def write_cases(
    cases: Sequence[Case],
    folder: Path,
    labels: Path,
    progress: Callable[[str], None] = lambda _: None,
) -> None:
    """Write cases and, last, their seals to the end of ``seals.txt``.

    Raises
    ------
    BadInput
        The folder of a case exists already, or something cannot be written.
    """
    lines = []
    for number, case in enumerate(cases, start=1):
        lines.append(f"{write_case(case, folder, labels)}  {case.name}\n")
        progress(f"{case.name}: {number} of {len(cases)} made")
    seals = folder / "seals.txt"
    before = seals.read_text(encoding="ascii") if seals.exists() else ""
    write_text(seals, before + "".join(lines))
