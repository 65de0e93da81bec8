"""Measured logs between which something is known to differ, compared as people compare them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from reduced_workflow import configure, snakemake
from spa_fo.api import Campaign, Comparison
from spa_fo.cli import main
from spa_fo.plant.effects.library import LIBRARY

BIAS = "bias 0 to 1 psi"  # the opposite chambers push against the bending: a stiffer actuator
SAME_DRIVE = "slow pulses, pressure, early to late"
BELIEVED = 0.5


def pair(measured: Any, name: str, data: Path, folder: Path) -> tuple[Path, Path]:
    """The earlier and the later log of a pair, each laid out as a campaign."""
    (one,) = (each for each in measured.PAIRS if each.name == name)
    before, after = measured.laid_out(one, data, folder)
    return before, after


def without_words(document: Mapping[str, Any]) -> dict[str, Any]:
    """What a comparison found, as its file has it, but for the page's sentences."""
    found: dict[str, Any] = json.loads(json.dumps(document))
    return {key: value for key, value in found.items() if key != "answer"}


def wrongly_believed(document: Mapping[str, Any], stage: str) -> list[list[str]]:
    """Causes that are not all of this stage, and more likely than not."""
    named = [each for each in document["causes"] if each["set"] not in (["none"], ["unknown"])]
    return [
        each["set"]
        for each in named
        if each["probability"] > BELIEVED
        and {LIBRARY[name].stage for name in each["set"]} != {stage}
    ]


def test_a_bias_against_the_bending_is_a_change_of_the_actuator(
    measured: Any, shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = pair(measured, BIAS, shared_data, tmp_path)
    out = tmp_path / "changed"
    assert main(["compare", str(before), str(after), "--out", str(out)]) == 0
    assert "Nothing changed" not in capsys.readouterr().out
    document = json.loads((out / "comparison.json").read_text())
    assert document["verdict"]["kind"] != "nothing_changed"
    shares = document["where"]["stage"]
    assert max(shares, key=lambda stage: shares[stage]) == "actuator"
    assert wrongly_believed(document, "actuator") == []
    asked = Campaign.load(after).compare(before)
    assert without_words(asked.document) == without_words(document)


def test_the_workflow_says_of_a_measured_drive_what_python_says(
    measured: Any, shared_data: Path, tmp_path: Path
) -> None:
    before, after = pair(measured, SAME_DRIVE, shared_data, tmp_path / "pairs")
    (tmp_path / "raw").symlink_to(before.parent)
    configure(tmp_path, materials={"before": None, "after": {"reference": "before"}})
    run = snakemake(tmp_path, "results/after/changed")
    assert run.returncode == 0, run.stdout + run.stderr
    changed = tmp_path / "results" / "after" / "changed"
    document = json.loads((changed / "comparison.json").read_text())
    assert (document["compared"], document["verdict"]["kind"]) == ("pressure", "nothing_changed")
    assert "measured data" in (changed / "comparison.md").read_text()
    asked = Comparison.of_pressure(before, after)
    assert without_words(asked.document) == without_words(document)
