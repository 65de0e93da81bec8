"""The page about rigs of other hands: what an answer is worth, and all sets added up."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from blind.judge.records import Answer, Outcome, Truth
from blind.other_rig import _UNSAID
from blind.report.history import Mark, read_history
from blind.report.other_rigs import (
    Given,
    given,
    hits,
    in_short,
    page,
    probabilities,
    read_answers,
    worth,
    written,
)
from spa_fo.errors import BadInput

DOCS = Path(__file__).parents[1] / "docs"


def outcome(kind: str, effects: str, verdict: str, *sets: str, rich: bool = True) -> Outcome:
    """A case with its answer; sets are words."""
    truth = Truth(
        case="case_001",
        rig="a rig",
        kind=kind,
        effects=frozenset(effects.split()),
        equivalents=frozenset(),
        size=4.0,
        noise_floor_deg=math.nan,
        protocol="rich" if rich else "up_steps",
        repeats=2,
        order="interleaved",
        model="earlier",
        surroundings=_UNSAID,
    )
    named = tuple(frozenset(one.split()) for one in sets)
    top = named[0] if named else frozenset({"none"})
    return Outcome(truth, Answer(verdict, named, top, 0.9, None))


@pytest.mark.parametrize(
    ("kind", "effects", "verdict", "sets", "right"),
    [
        ("no_effect", "", "no_gap", (), True),
        ("closed", "creep", "no_gap", (), False),
        ("closed", "creep", "cause", ("creep",), True),
        ("pair", "creep leak", "cause", ("creep",), True),
        ("closed", "creep", "cause", ("creep leak",), False),
        ("closed", "creep", "ambiguous", ("leak", "creep"), True),
        ("closed", "creep", "ambiguous", ("leak", "stiffening"), False),
        ("closed", "creep", "unknown", ("creep",), False),
        ("withheld", "creep", "unknown", ("leak",), True),
        ("alien", "", "unknown", (), True),
        ("alien", "", "cause", ("leak",), False),
        ("closed", "creep", "error", (), False),
    ],
)
def test_what_is_right(
    kind: str, effects: str, verdict: str, sets: tuple[str, ...], right: bool
) -> None:
    assert given(outcome(kind, effects, verdict, *sets), 2, "abc").right is right


def test_answers_are_read_as_they_were_written(tmp_path: Path) -> None:
    answers = [
        given(outcome("closed", "creep", "cause", "creep"), 1, "abc"),
        given(outcome("no_effect", "", "no_gap", rich=False), 2, "def"),
    ]
    path = tmp_path / "answers.csv"
    assert read_answers(path) == []
    path.write_text(written(answers), encoding="utf-8")
    assert read_answers(path) == answers
    assert [one.protocol for one in answers] == ["rich", "lean"]


@pytest.mark.parametrize(
    ("old", "new", "where"),
    [
        ("rig,number", "rig,set", "line 1"),
        ("True", "perhaps", "line 2"),
        ("0.9", "often", "line 2"),
    ],
)
def test_a_damaged_table_is_bad_input(tmp_path: Path, old: str, new: str, where: str) -> None:
    path = tmp_path / "answers.csv"
    text = written([given(outcome("closed", "creep", "cause", "creep"), 1, "abc")])
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(BadInput, match=where):
        read_answers(path)


def test_answers_are_parted_by_kind_probability_and_protocol() -> None:
    def one(verdict: str, probability: float, right: bool, protocol: str = "rich") -> Given:
        return Given(
            "a rig", 1, "abc", "case", "closed", protocol, verdict, probability, right, right
        )

    answers = [
        one("cause", 0.9, True),
        one("cause", 0.81, False, "lean"),
        one("cause", 0.8, True),
        one("cause", 0.6, False),
        one("error", math.nan, False),
    ]
    lines = [[cell.strip() for cell in row.split("|")[1:-1]] for row in worth(answers).split("\n")]
    assert [(row[0], row[1].split(" (")[0], row[3].split(" (")[0]) for row in lines[2:]] == [
        ("one cause, more than 0.8", "1 of 2", "0 of 1"),
        ("one cause, 0.6 to 0.8", "1 of 1", "–"),
        ("one cause, 0.6 or less", "0 of 1", "–"),
        ("an error", "0 of 1", "–"),
    ]


def test_probabilities_are_held_against_how_often_they_are_right() -> None:
    answers = [
        Given("a rig", 1, "abc", "case", "closed", "rich", "cause", 0.8, True, first)
        for first in (True, True, True, False)
    ]
    failed = Given("a rig", 1, "abc", "case", "closed", "rich", "error", math.nan, False, False)
    text = probabilities([*answers, failed])
    assert "Over all 4 answers the calibration error is 0.050" in text
    assert "| 0.80 | 0.75 | 4 |" in text


def test_the_newest_rig_comes_first_with_its_sets_side_by_side() -> None:
    marks = [
        Mark(number, "abcdef0", "1", rig, 84, "found", "≥ 0.9", value, 10, reached)
        for rig in ("sixth_rig", "seventh_rig")
        for number, value, reached in ((1, "0.800", "no"), (2, "1.000", "yes"))
    ]
    text = page(marks, [], "## What each showed")
    assert text.index("**Seventh rig**") < text.index("**Sixth rig**") < text.index("## What each")
    assert "| mark | goal | set 1 | set 2 |" in text
    assert "| found | ≥ 0.9 | **0.800** | 1.000 |" in text
    assert "What an answer is worth" not in text
    assert sum(hits(marks)) == 36


def test_what_is_published_is_made_of_the_tables_beside_it() -> None:
    beside = DOCS / "blind"
    marks, answers = (
        read_history(beside / "other_rigs.csv"),
        read_answers(beside / "other_rigs_answers.csv"),
    )
    told = (beside / "other_rigs_told.md").read_text(encoding="utf-8").strip()
    assert (DOCS / "other_rigs.md").read_text(encoding="utf-8") == page(marks, answers, told)
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    assert in_short(answers) in " ".join(readme.split())
    cases = {(mark.rig, mark.seed): mark.cases for mark in marks}
    for rig, number in {(one.rig, one.number) for one in answers}:
        own = [one for one in answers if (one.rig, one.number) == (rig, number)]
        assert len(own) == cases[rig, number]
