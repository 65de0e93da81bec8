"""All runs of the blind benchmark that were published: none is chosen, and none is lost."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from spa_fo.errors import BadInput


@dataclass(frozen=True)
class Mark:
    """What one run reached of one mark.

    Attributes
    ----------
    seed : int
        Of the run.
    commit : str
        That made it.
    cases : int
        Of the whole run.
    mark : str
        What was to be reached.
    goal : str
        Its limit in words.
    value : str
        A number; empty where no case tells.
    n : int
        Cases of this mark.
    reached : str
        ``yes``, ``no``, or empty.
    """

    seed: int
    commit: str
    cases: int
    mark: str
    goal: str
    value: str
    n: int
    reached: str


def marks_of(scores: Mapping[str, Any], commit: str, goals: Sequence[str]) -> list[Mark]:
    """List the marks of a run.

    Parameters
    ----------
    scores : Mapping
        As read from scores.json.
    commit : str
        That made them.
    goals : sequence of str
        The limit of each mark in words.
    """
    return [
        Mark(
            seed=scores["benchmark"]["seed"],
            commit=commit,
            cases=scores["cases"],
            mark=mark["name"],
            goal=limit,
            value="" if mark["estimate"]["value"] is None else f"{mark['estimate']['value']:.3f}",
            n=mark["estimate"]["n"],
            reached={True: "yes", False: "no", None: ""}[mark["reached"]],
        )
        for mark, limit in zip(scores["marks"], goals, strict=True)
    ]


def read_history(path: Path) -> list[Mark]:
    """Read all runs; none where there is no file yet.

    Raises
    ------
    BadInput
        The file is not what `written` writes.
    """
    if not path.is_file():
        return []
    names = [field.name for field in fields(Mark)]
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames != names:
            raise BadInput(path, f"expected the columns {', '.join(names)}", where="line 1")
        try:
            return [_mark(row) for row in reader]
        except (TypeError, ValueError) as error:
            expected = "expected whole numbers of seed, cases and n in every row"
            raise BadInput(path, expected, where=f"line {reader.line_num}") from error


def _mark(row: Mapping[str, str]) -> Mark:
    numbers = {key: int(row[key]) for key in ("seed", "cases", "n")}
    return Mark(**{**row, **numbers})  # type: ignore[arg-type]


def with_run(history: Sequence[Mark], run: Sequence[Mark]) -> list[Mark]:
    """Add a run at the end; one of the same seed and commit is the same run."""
    made = {(mark.seed, mark.commit) for mark in run}
    return [mark for mark in history if (mark.seed, mark.commit) not in made] + list(run)


def written(history: Sequence[Mark]) -> str:
    """Write all runs as csv."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(Mark)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(mark) for mark in history)
    return text.getvalue()


def table(history: Sequence[Mark]) -> str:
    """Set the runs side by side, the first one left: what was missed is bold."""
    runs: dict[tuple[int, str], dict[str, Mark]] = {}
    for mark in history:
        runs.setdefault((mark.seed, mark.commit), {})[mark.mark] = mark
    goals = {mark.mark: mark.goal for mark in history}
    judged = {run: [m for m in marks.values() if m.reached] for run, marks in runs.items()}
    lines = [
        f"| mark | goal | {' | '.join(f'seed {seed}' for seed, _ in runs)} |",
        f"|:--|:--|{'--:|' * len(runs)}",
        *(
            f"| {name} | {limit} | {' | '.join(_cell(own.get(name)) for own in runs.values())} |"
            for name, limit in goals.items()
        ),
        "| marks reached | | "
        + " | ".join(
            f"{sum(m.reached == 'yes' for m in own)} of {len(own)}" for own in judged.values()
        )
        + " |",
        f"| commit | | {' | '.join(f'`{commit[:7]}`' for _, commit in runs)} |",
    ]
    return "\n".join(lines)


def _cell(mark: Mark | None) -> str:
    if mark is None or not mark.value:
        return "–"
    return f"**{mark.value}**" if mark.reached == "no" else mark.value
