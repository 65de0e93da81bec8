"""Say which marks fall short: ``python -m blind.judge.check scores.json``; exit code 1 if any."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from scipy.stats import binomtest, poisson

from spa_fo.edge import bad_input_exits
from spa_fo.errors import BadInput

CALIBRATION, SETS = "ece", "sets"
NO_SHARE = (CALIBRATION, SETS, "")
"""Measures that are no share of cases; the empty one is the difference between the rigs."""
_LEVEL = 0.05
_FEWEST = 10  # cases of both rigs, from which on an interval of their difference means something
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
        help="a mark falls short only where that is no chance: for few cases",
    )
    parser.add_argument(
        "--published",
        type=Path,
        help="scores.json of the whole benchmark: where that misses a goal, chance is about it",
    )
    given = parser.parse_args(arguments)
    with bad_input_exits():
        marks = read_marks(given.scores)
        if given.published is not None:
            whole = read_marks(given.published)
            print(f"{sum(m['reached'] is False for m in whole)} goals are missed there anyway")
            marks = as_published(marks, whole)
    judged = [mark for mark in marks if mark["reached"] is not None]
    short = [mark for mark in judged if not mark["reached"]]
    if given.beyond_chance:
        short = [mark for mark in short if missed_beyond_chance(mark, len(judged))]
    for mark in short:
        print(line(mark))
    within = ", or missed by what may be chance" if given.beyond_chance else ""
    print(f"{len(judged) - len(short)} of {len(judged)} marks are reached{within}")
    if len(judged) < len(marks):
        print(f"{len(marks) - len(judged)} further ones have no case")
    return 0 if judged and not short else 1


def as_published(
    marks: Sequence[Mapping[str, Any]], published: Sequence[Mapping[str, Any]]
) -> list[Mapping[str, Any]]:
    """Hold shares against what the whole benchmark has, where it misses their goal.

    A few cases say whether something has become worse, not again what is known to be missed.
    """
    known = {(m["rig"], m["name"]): m["estimate"]["value"] for m in published if not m["reached"]}
    found: list[Mapping[str, Any]] = []
    for mark in marks:
        value = known.get((mark["rig"], mark["name"]))
        if value is None or mark["measure"] in NO_SHARE:
            found.append(mark)
        else:
            found.append({**mark, "goal": value})
    return found


def missed_beyond_chance(mark: Mapping[str, Any], marks: int = 1) -> bool:
    """Whether a goal that is just reached would be missed by so much in less than 5 % of runs.

    A share is held against its goal by the exact binomial test, and a number of sets, beyond the
    one that there is, by that of Poisson, the 5 % divided among all `marks` that are asked
    (Bonferroni); what is neither by its interval, which a few cases do not have.
    """
    estimate, goal = mark["estimate"], mark["goal"]
    if mark["measure"] == SETS:
        beyond = round((estimate["value"] - 1.0) * estimate["n"])
        expected = (goal - 1.0) * estimate["n"]
        return bool(poisson.sf(beyond - 1, expected) < _LEVEL / marks)
    if mark["measure"] in NO_SHARE:
        few = estimate["n"] < (_FEW if mark["measure"] == CALIBRATION else _FEWEST)
        outside = estimate["high"] < goal if mark["at_least"] else estimate["low"] > goal
        return bool(outside and not few)
    hits = round(estimate["value"] * estimate["n"])
    side: Literal["less", "greater"] = "less" if mark["at_least"] else "greater"
    return bool(binomtest(hits, estimate["n"], goal, alternative=side).pvalue < _LEVEL / marks)


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
