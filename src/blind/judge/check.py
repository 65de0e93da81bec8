"""Say which marks fall short: ``python -m blind.judge.check scores.json``; exit code 1 if any."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from spa_fo.edge import bad_input_exits
from spa_fo.errors import BadInput

CALIBRATION = "probabilities: calibration error"
_FEW = 300  # cases with which right probabilities, too, are off by about the goal: chance adds up


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m blind.judge.check",
        description="Print every mark of the blind benchmark that falls short; exit code 1 if any.",
    )
    parser.add_argument("scores", type=Path, help="scores.json of a benchmark")
    parser.add_argument(
        "--beyond-chance",
        action="store_true",
        help="a mark falls short only where its whole interval does: for few cases",
    )
    given = parser.parse_args(arguments)
    with bad_input_exits():
        marks = read_marks(given.scores)
    judged = [mark for mark in marks if mark["reached"] is not None]
    missed = missed_beyond_chance if given.beyond_chance else missed_at_all
    short = [mark for mark in judged if missed(mark)]
    for mark in short:
        print(line(mark))
    within = ", or missed by what may be chance" if given.beyond_chance else ""
    print(f"{len(judged) - len(short)} of {len(judged)} marks are reached{within}")
    if len(judged) < len(marks):
        print(f"{len(marks) - len(judged)} further ones have no case")
    return 0 if judged and not short else 1


def missed_at_all(mark: Mapping[str, Any]) -> bool:
    """Whether the estimate misses the goal."""
    return not mark["reached"]


def missed_beyond_chance(mark: Mapping[str, Any]) -> bool:
    """Whether all of the estimate's interval misses the goal."""
    estimate, goal = mark["estimate"], mark["goal"]
    if mark["name"] == CALIBRATION and estimate["n"] < _FEW:
        return False
    return bool(estimate["high"] < goal if mark["at_least"] else estimate["low"] > goal)


def read_marks(path: Path) -> Sequence[Mapping[str, Any]]:
    """Read the marks in a scores.json.

    Raises
    ------
    BadInput
        It cannot be read, or holds none.
    """
    try:
        marks: Sequence[Mapping[str, Any]] = json.loads(path.read_text(encoding="utf-8"))["marks"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadInput(path, f"expected the scores of a blind benchmark: {error}") from error
    return marks


def line(mark: Mapping[str, Any]) -> str:
    """Write a mark as one line: rig, mark, goal, value, interval, cases, and which is the worst."""
    estimate = mark["estimate"]
    which = f" [{mark['which']}]" if mark["which"] else ""
    return (
        f"{mark['rig']}: {mark['name']}{which}: expected {goal(mark)}, found "
        f"{estimate['value']:.3f} ({estimate['low']:.3f} to {estimate['high']:.3f}) "
        f"in {estimate['n']} cases"
    )


def goal(mark: Mapping[str, Any]) -> str:
    """Write a mark's goal as ``≥ 0.95``."""
    return f"{'≥' if mark['at_least'] else '≤'} {mark['goal']:g}"


if __name__ == "__main__":
    raise SystemExit(main())
