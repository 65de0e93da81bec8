"""Seals of the blind benchmark: a label opens only if it is what was sealed beforehand."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from blind.unseal import fingerprint, unseal
from spa_fo.errors import BadInput


@pytest.fixture
def sealed(tmp_path: Path) -> tuple[Path, list[Path], list[Path]]:
    """Seals, labels and the witness of a diagnosis."""
    labels, lines = [], []
    for number in (1, 2):
        path = tmp_path / f"case_000{number}.json"
        path.write_text(json.dumps({"case": path.stem}))
        labels.append(path)
        lines.append(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.stem}\n")
    seals, witness = tmp_path / "seals.txt", tmp_path / "sealed_by.txt"
    seals.write_text("".join(lines))
    witness.write_text(fingerprint(seals) + "\n")
    return seals, labels, [witness]


def test_labels_open_when_they_are_what_was_sealed(
    sealed: tuple[Path, list[Path], list[Path]],
) -> None:
    assert list(unseal(*sealed)) == ["case_0001", "case_0002"]


def test_a_changed_label_is_refused(sealed: tuple[Path, list[Path], list[Path]]) -> None:
    sealed[1][1].write_text(json.dumps({"case": "case_0002", "effects": ["leak"]}))
    with pytest.raises(BadInput, match=r"case_0002\.json.*not the label that was sealed"):
        unseal(*sealed)


def test_a_label_changed_together_with_its_seal_is_refused(
    sealed: tuple[Path, list[Path], list[Path]],
) -> None:
    seals, labels, witnesses = sealed
    before = hashlib.sha256(labels[0].read_bytes()).hexdigest()
    labels[0].write_text("{}")
    after = hashlib.sha256(labels[0].read_bytes()).hexdigest()
    seals.write_text(seals.read_text().replace(before, after))
    with pytest.raises(BadInput, match="under other seals"):
        unseal(seals, labels, witnesses)


def test_missing_and_unsealed_labels_are_refused(
    sealed: tuple[Path, list[Path], list[Path]], tmp_path: Path
) -> None:
    seals, labels, witnesses = sealed
    with pytest.raises(BadInput, match="case_0002"):
        unseal(seals, labels[:1], witnesses)
    further = tmp_path / "case_0003.json"
    further.write_text("{}")
    with pytest.raises(BadInput, match="never sealed"):
        unseal(seals, [*labels, further], witnesses)
