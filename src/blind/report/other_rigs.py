"""The page about rigs of other hands: ``python -m blind.report.other_rigs --help``.

Every number of its tables comes from the marks and the answers beside it.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from blind.judge.questions import right_first
from blind.judge.records import Outcome
from blind.judge.statistics import calibration, rate
from blind.report.csv_rows import names_of, read_rows, written_rows
from blind.report.history import Mark, read_history, rigs_of, table
from blind.report.words import rig_name, rows
from spa_fo.atomic import write_text
from spa_fo.edge import bad_input_exits

_NO_SHARES = ("sets on average", "calibration error")  # marks that are no share of cases
_SURE = 0.8  # more than this is sure, in the table of what an answer is worth
_EVERY, _RICH, _LEAN = "every protocol", "repeats and releases", "less"

_INTRODUCTION = """\
A rig that learned nothing from the diagnosis, and taught it nothing, judges best. Each of these
was written from the contract alone by somebody who had read neither the engine nor the
project's own two rigs: plant, solver, the forms of all effects, noise, fixtures, boards and
protocols are theirs. All data are synthetic. Each set of cases was judged once, by the engine
of the commit below it, before anybody had looked at it (exceptions are said below); what an
opened set taught, the next judges. To judge on a rig of your own: `python -m blind.other_rig
--help`."""

_WORTH = """\
Of the answers to {cases} campaigns of the {rigs}, by the engines of their sets (commits below):
how often such an answer was right. *One cause* is right where nothing is named that is not at
work, or that nobody could tell from it; *several* where one of them is; *unknown* where the
library lacks the cause; *no gap* where there is no effect. Effects have twice the noise floor
or more; {missing} of the campaigns have one that the library lacks, and {none} have none;
nobody knows how many of yours do. All answers:
[other_rigs_answers.csv](blind/other_rigs_answers.csv)."""

_POOLED = """\
All sets of all hands, whichever engine judged them, and beside them the sets that were judged
before anything of their hand had been opened."""


@dataclass(frozen=True)
class Given:
    """The answer to one case of another rig, and whether it was right.

    Attributes
    ----------
    rig : str
        That the case is from.
    number : int
        Of the set.
    commit : str
        The engine that answered.
    case : str
        Its name.
    kind : str
        Of the case, as in `blind.judge.records.KINDS`.
    protocol : str
        ``rich`` or ``lean``.
    verdict : str
        The answer's kind.
    probability : float
        Of the most probable explanation; not a number after an error.
    right : bool
        As the page says.
    first : bool
        Whether the most probable explanation is the truth.
    """

    rig: str
    number: int
    commit: str
    case: str
    kind: str
    protocol: str
    verdict: str
    probability: float
    right: bool
    first: bool


def given(outcome: Outcome, number: int, commit: str) -> Given:
    """Say what was answered to a case, and whether that is right."""
    truth, answer = outcome.truth, outcome.answer
    right = {
        "no_gap": truth.kind == "no_effect",
        "unknown": truth.is_missing,
        "cause": any(map(truth.fair, answer.sets)),
        "ambiguous": any(map(truth.fair, answer.sets)),
    }
    return Given(
        rig=truth.rig,
        number=number,
        commit=commit,
        case=truth.case,
        kind=truth.kind,
        protocol="rich" if truth.is_rich else "lean",
        verdict=answer.verdict,
        probability=float("nan") if answer.probability is None else answer.probability,
        right=right.get(answer.verdict, False),
        first=right_first(truth, answer),
    )


def read_answers(path: Path) -> list[Given]:
    """Read answers; none where there is no file yet.

    Raises
    ------
    BadInput
        The file is not what `written` writes.
    """
    expected = "expected a whole number, a probability, and True or False in every row"
    return read_rows(path, (names_of(Given),), _answer, expected)


def _answer(row: Mapping[str, str]) -> Given:
    numbers = {"number": int(row["number"]), "probability": float(row["probability"])}
    told = {key: {"True": True, "False": False}[row[key]] for key in ("right", "first")}
    return Given(**{**row, **numbers, **told})  # type: ignore[arg-type]


def written(answers: Iterable[Given]) -> str:
    """Write answers as csv; probabilities to a thousandth."""
    return written_rows(
        Given, (replace(one, probability=round(one.probability, 3)) for one in answers)
    )


def worth(answers: Sequence[Given]) -> str:
    """Tell how often each kind of answer was right, by protocol."""
    kinds: tuple[tuple[str, Callable[[Given], bool]], ...] = (
        (f"one cause, more than {_SURE:g}", _is("cause", _SURE, 1.0)),
        (f"one cause, 0.6 to {_SURE:g}", _is("cause", 0.6, _SURE)),
        ("one cause, 0.6 or less", _is("cause", -1.0, 0.6)),
        ("several that these data cannot tell apart", _is("ambiguous")),
        ("unknown", _is("unknown")),
        ("no gap", _is("no_gap")),
        ("an error", _is("error")),
    )
    protocols: dict[str, Callable[[Given], bool]] = {
        _EVERY: lambda _: True,
        _RICH: lambda one: one.protocol == "rich",
        _LEAN: lambda one: one.protocol == "lean",
    }
    cells = []
    for name, belongs in kinds:
        own = [one for one in answers if belongs(one)]
        if own:
            parts = ([one.right for one in own if chosen(one)] for chosen in protocols.values())
            cells.append([name, *map(_share, parts)])
    return rows(("answer, with its probability", *protocols), "lrrr", cells)


def in_short(answers: Sequence[Given]) -> str:
    """Say in one sentence what answers are worth."""

    def of(verdict: str, above: float = -1.0) -> str:
        right = [one.right for one in answers if _is(verdict, above)(one)]
        return f"{sum(right)} of {len(right)}"

    return (
        f"Of its answers to {len(answers)} synthetic campaigns of rigs that others wrote, a single "
        f"cause of more than {100 * _SURE:.0f} % was right in {of('cause', _SURE)}, `unknown` in "
        f"{of('unknown')}, and `no_gap` in {of('no_gap')}"
    )


def probabilities(answers: Sequence[Given]) -> str:
    """Tell whether the most probable explanation is right as often as is said."""
    told = [one for one in answers if not math.isnan(one.probability)]
    found = calibration([one.probability for one in told], [one.first for one in told])
    cells = [
        [f"{each.claimed:.2f}", f"{each.right.value:.2f}", str(each.right.n)] for each in found.bins
    ]
    table = rows(("probability of the first explanation", "right", "answers"), "rrr", cells)
    return (
        f"Over all {len(told)} answers the calibration error is {found.ece.value:.3f}; were every "
        f"probability right, so many answers would still give {found.by_chance:.3f}:\n\n{table}"
    )


def _is(verdict: str, above: float = -1.0, to: float = 1.0) -> Callable[[Given], bool]:
    def belongs(one: Given) -> bool:
        unsaid = math.isnan(one.probability)
        return one.verdict == verdict and (unsaid or above < one.probability <= to)

    return belongs


def _share(right: Sequence[bool]) -> str:
    """Write how many of some were right, with the interval in points."""
    if not right:
        return "–"
    found = rate(right)
    percents = f"{100 * found.value:.0f} %, {100 * found.low:.0f} to {100 * found.high:.0f}"
    return f"{sum(right)} of {len(right)} ({percents})"


def pooled(marks: Sequence[Mark]) -> str:
    """Add up the marks that are shares of cases: of all sets, and of those judged first."""
    cells = []
    for name in dict.fromkeys(mark.mark for mark in marks):
        own = [mark for mark in marks if mark.mark == name]
        if not name.endswith(_NO_SHARES):
            first = [mark for mark in own if mark.seed == 1]
            cells.append([name, own[0].goal, _share(hits(own)), _share(hits(first))])
    return rows(("mark", "goal", "all sets", "first sets"), "llrr", cells)


def hits(marks: Iterable[Mark]) -> list[bool]:
    """Say of each case that some marks are of whether it counts; the marks are shares."""
    found = [(round(float(mark.value) * mark.n), mark.n) for mark in marks if mark.value]
    right, cases = (sum(column) for column in zip(*found, strict=True)) if found else (0, 0)
    return [True] * right + [False] * (cases - right)


def page(marks: Sequence[Mark], answers: Sequence[Given], told: str) -> str:
    """Write the page.

    Parameters
    ----------
    marks : sequence of Mark
        Of all sets; their seed is the set's number.
    answers : sequence of Given
        Of the sets whose answers were kept.
    told : str
        What each hand's rig showed; Markdown.
    """
    parts = ["# Rigs of other hands", _INTRODUCTION]
    if answers:
        *others, last = dict.fromkeys(rig_name(one.rig) for one in answers)
        names = " and the ".join([*filter(None, [", the ".join(others)]), last])
        kinds = Counter(one.kind for one in answers)
        said = _WORTH.format(
            cases=len(answers),
            rigs=names,
            missing=kinds["withheld"] + kinds["alien"],
            none=kinds["no_effect"],
        )
        parts += ["## What an answer is worth", said, worth(answers), probabilities(answers)]
    parts += ["## All marks", _POOLED, pooled(marks), "## Set by set", _sets(marks), told]
    return "\n\n".join(part for part in parts if part) + "\n"


def _sets(marks: Sequence[Mark]) -> str:
    lines = [
        "Each column is a set. Cases are few: one of ten is ten points. What was missed is bold. "
        "All as a table: [other_rigs.csv](blind/other_rigs.csv)."
    ]
    for rig in reversed(rigs_of(marks)):
        lines += [f"**{rig_name(rig).capitalize()}**", table(marks, rig, "set")]
    return "\n\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m blind.report.other_rigs",
        description="Write other_rigs.md from what is beside it: blind/other_rigs.csv, "
        "blind/other_rigs_answers.csv and blind/other_rigs_told.md.",
        epilog="example: python -m blind.report.other_rigs docs",
    )
    parser.add_argument("documents", type=Path, help="folder that gets other_rigs.md")
    folder: Path = parser.parse_args(arguments).documents
    with bad_input_exits():
        marks = read_history(folder / "blind" / "other_rigs.csv")
        answers = read_answers(folder / "blind" / "other_rigs_answers.csv")
        told = (folder / "blind" / "other_rigs_told.md").read_text(encoding="utf-8")
        write_text(folder / "other_rigs.md", page(marks, answers, told.strip()))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
