"""All runs of the blind benchmark that were published: none is chosen, and none is lost."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blind.judge.check import goal
from blind.judge.targets import BOTH_RIGS
from blind.report.csv_rows import names_of, read_rows, written_rows
from blind.report.words import REACHED, percent

_ONE_RIG = {"share": "1", "rig": "virtual_rig"}  # what runs were that do not say


@dataclass(frozen=True)
class Mark:
    """What one run reached of one mark.

    Attributes
    ----------
    seed : int
        Of the run.
    commit : str
        That made it.
    share : str
        Of the planned cases that was made.
    rig : str
        That the cases are from, or `BOTH_RIGS`.
    cases : int
        Of the rig in this run.
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
    share: str
    rig: str
    cases: int
    mark: str
    goal: str
    value: str
    n: int
    reached: str

    @property
    def run(self) -> tuple[int, str, str]:
        """What tells one run from another."""
        return self.seed, self.commit, self.share


def marks_of(scores: Mapping[str, Any], commit: str) -> list[Mark]:
    """List the marks of a run.

    Parameters
    ----------
    scores : Mapping
        As read from scores.json.
    commit : str
        That made them.
    """
    cases = {rig: own["cases"] for rig, own in scores["rigs"].items()}
    return [
        Mark(
            seed=scores["benchmark"]["seed"],
            commit=commit,
            share=f"{scores['benchmark'].get('part', 1):g}",
            rig=mark["rig"],
            cases=cases.get(mark["rig"], scores["cases"]),
            mark=mark["name"],
            goal=goal(mark),
            value="" if mark["estimate"]["value"] is None else f"{mark['estimate']['value']:.3f}",
            n=mark["estimate"]["n"],
            reached=REACHED[mark["reached"]] or "",
        )
        for mark in scores["marks"]
    ]


def read_history(path: Path) -> list[Mark]:
    """Read all runs; none where there is no file yet. One without rigs is that of one rig.

    Raises
    ------
    BadInput
        The file is not what `written` writes.
    """
    names = names_of(Mark)
    of_one_rig = [name for name in names if name not in _ONE_RIG]
    expected = "expected whole numbers of seed, cases and n in every row"
    return read_rows(path, (names, of_one_rig), lambda row: _mark({**_ONE_RIG, **row}), expected)


def _mark(row: Mapping[str, str]) -> Mark:
    numbers = {key: int(row[key]) for key in ("seed", "cases", "n")}
    return Mark(**{**row, **numbers})  # type: ignore[arg-type]


def with_run(history: Sequence[Mark], run: Sequence[Mark]) -> list[Mark]:
    """Add a run at the end; one of the same seed, commit and share is the same run."""
    made = {mark.run for mark in run}
    return [mark for mark in history if mark.run not in made] + list(run)


def written(history: Sequence[Mark]) -> str:
    """Write all runs as csv."""
    return written_rows(Mark, history)


def rigs_of(history: Iterable[Mark]) -> list[str]:
    """Name the rigs of a history, in the order in which they come."""
    return list(dict.fromkeys(mark.rig for mark in history if mark.rig != BOTH_RIGS))


def table(history: Sequence[Mark], rig: str, each: str = "seed") -> str:
    """Set the runs on one rig side by side, the first one left: what was missed is bold.

    What is asked of the rigs together stands with each of them. `each` says what tells runs apart.
    """
    runs: dict[tuple[int, str, str], dict[str, Mark]] = {}
    for mark in history:
        if mark.rig in (rig, BOTH_RIGS):
            runs.setdefault(mark.run, {})[mark.mark] = mark
    goals = {name: mark.goal for own in runs.values() for name, mark in own.items()}
    judged = [[mark for mark in own.values() if mark.reached] for own in runs.values()]
    counts = [f"{sum(m.reached == 'yes' for m in own)} of {len(own)}" for own in judged]
    lines = [
        f"| mark | goal | {' | '.join(_title(run, each) for run in runs)} |",
        f"|:--|:--|{'--:|' * len(runs)}",
        *(
            f"| {name} | {limit} | {' | '.join(_cell(own.get(name)) for own in runs.values())} |"
            for name, limit in goals.items()
        ),
        f"| marks reached | | {' | '.join(counts)} |",
        f"| commit | | {' | '.join(f'`{commit[:7]}`' for _, commit, _ in runs)} |",
    ]
    return "\n".join(lines)


def _title(run: tuple[int, str, str], each: str) -> str:
    seed, _, share = run
    return f"{each} {seed}" if share == "1" else f"{each} {seed}, {percent(float(share))}"


def _cell(mark: Mark | None) -> str:
    if mark is None or not mark.value:
        return "–"
    return f"**{mark.value}**" if mark.reached == "no" else mark.value
