"""A static curve on campaigns that others measured, where they are at hand."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).resolve().parent.parent / "benchmarks"


@pytest.fixture(scope="module")
def script() -> Iterator[Any]:
    sys.path.insert(0, str(BENCHMARKS))
    try:
        import static_curve

        yield static_curve
    finally:
        sys.path.remove(str(BENCHMARKS))
        for name in ("static_curve", "real_data"):
            sys.modules.pop(name, None)


def test_a_bellow_that_stiffens(script: Any, shared_data: Path, tmp_path: Path) -> None:
    """Its gain falls with the pressure: the curve holds at the levels that it has not seen."""
    name = "bellow, chamber 1"
    choice = script.run(script.CAMPAIGNS[name], name, shared_data, tmp_path)
    assert choice.kept
    assert choice.held_out == "level"
    assert choice.better == len(choice.left_out) == 3
    assert choice.closed > 0.6
    slopes = choice.curve.curve.slopes
    assert slopes[0] > slopes[-1]
    rows = script.table({name: choice}).splitlines()
    assert rows[2].startswith(f"| {name} | 3 levels | ")
    assert len({row.count("|") for row in rows[:3]}) == 1
    assert sum(row.startswith(f"| {name}: up to ") for row in rows) == 3
