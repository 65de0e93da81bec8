"""The blind benchmark's marks: by rig, by class of surroundings, and the command for them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from blind.judge import Outcome, Truth, score
from blind.judge.check import CALIBRATION, NO_SHARE, SETS, missed_beyond_chance
from blind.judge.check import main as check
from blind.judge.classes import DIMENSIONS
from blind.judge.questions import MEASURES
from blind.judge.targets import BETWEEN_RIGS, FALSE_ALARMS, TARGETS, WORST_CLASS
from blind_records import NOTHING, QUIET, UNKNOWN, answer, named, truth


def mark(name: str, outcomes: list[Outcome]) -> Any:
    return next(entry for entry in score(outcomes).marks if entry.target.name == name)


def test_marks_are_held_against_their_own_cases_only() -> None:
    name = "rich protocol, 4 or more times the floor: truth in the sets"
    outcomes = named("creep", 19, 1) + named("creep", 0, 5, size=2.0)
    outcomes += named("creep", 0, 5, protocol="up_steps") + named("creep", 0, 5, repeats=1)
    outcomes += named("creep", 0, 5, rig="second_rig")
    reached = mark(name, outcomes)
    assert (reached.estimate.value, reached.estimate.n) == (0.95, 20)
    assert reached.target.reached(reached.estimate) is True
    missed = mark(name, named("creep", 18, 2, protocol="everything"))
    assert missed.target.reached(missed.estimate) is False
    absent = mark(name, [Outcome(NOTHING, answer())])
    assert absent.target.reached(absent.estimate) is None


def test_upper_marks_are_reached_from_below() -> None:
    alarms = "no effect: false alarms"
    quiet = mark(alarms, [Outcome(NOTHING, answer())] * 100)
    assert quiet.target.reached(quiet.estimate) is True
    loud = mark(alarms, [Outcome(NOTHING, answer())] * 97 + [Outcome(NOTHING, UNKNOWN)] * 3)
    assert (loud.estimate.value, loud.target.reached(loud.estimate)) == (0.03, False)
    just = mark(alarms, [Outcome(NOTHING, answer())] * 98 + [Outcome(NOTHING, UNKNOWN)] * 2)
    assert (just.estimate.value, just.target.reached(just.estimate)) == (0.02, True)


def test_every_mark_has_a_measure_and_a_name_of_its_own() -> None:
    assert {target.measure for target in TARGETS} <= MEASURES.keys()
    assert len({target.name for target in TARGETS}) == len(TARGETS)


def test_the_marks_are_those_that_were_set() -> None:
    goals = [(target.goal, target.at_least) for target in TARGETS]
    assert goals == [
        (0.02, False),
        (0.92, True),
        (0.90, True),
        (1.3, False),
        (0.08, False),
        (0.90, True),
        (0.80, True),
        (0.03, False),
        (0.92, True),
        (0.03, False),
        (0.08, False),
        (0.75, True),
        (0.70, True),
        (0.70, True),
        (0.08, False),
        (0.90, True),
        (0.90, True),
        (0.05, False),
    ]
    assert (WORST_CLASS.goal, BETWEEN_RIGS.goal) == (0.05, 0.05)


# --- classes of surroundings ----------------------------------------------------------------------


def surrounded(**changes: Any) -> Truth:
    return truth(kind="no_effect", size=None, surroundings=replace(QUIET, **changes))


def class_in(dimension: str, case: Truth) -> str:
    return next(entry.of(case) for entry in DIMENSIONS if entry.name == dimension)


@pytest.mark.parametrize(
    ("dimension", "changes", "expected"),
    [
        ("noise colour", {"coloured_deg": 0.049, "correlation_s": 5.0}, "nearly white"),
        ("noise colour", {"coloured_deg": 0.05, "correlation_s": 0.29}, "below 0.3 s"),
        ("noise colour", {"coloured_deg": 0.2, "correlation_s": 0.3}, "0.3 to 2 s"),
        ("noise colour", {"coloured_deg": 0.2, "correlation_s": 2.01}, "above 2 s"),
        (
            "noise colour",
            {"coloured_deg": 0.2, "noise_colour": "one_over_f", "correlation_s": None},
            "1/f",
        ),
        ("coloured noise", {"coloured_deg": 0.25}, "0.1 to 0.25°"),
        ("coloured noise", {"coloured_deg": 0.251}, "above 0.25°"),
        ("scatter of gain", {"gain": 0.0049}, "below 0.5 %"),
        ("scatter of gain", {"gain": 0.016}, "above 1.5 %"),
        ("scatter of time scale", {"time_scale": 0.01}, "0.5 to 1.5 %"),
        ("scatter of rest angle", {"rest_deg": 0.6}, "above 0.5°"),
        ("fixture error", {"calibration": "none", "fixture_deg": 0.5}, "no calibration"),
        ("fixture error", {"fixture_deg": 0.05}, "below 0.1°"),
        ("fixture error", {"fixture_deg": 0.5}, "above 0.3°"),
        ("calibration", {"calibration": "before_and_after"}, "before and after"),
        ("sampling rate", {"rate_hz": 20.0}, "below 25 Hz"),
        ("sampling rate", {"rate_hz": 200.0}, "above 75 Hz"),
        ("converter", {"bits": 8}, "8 or 9 bits"),
        ("converter", {"bits": 10}, "10 to 12 bits"),
        ("converter", {"bits": 14}, "above 12 bits"),
        ("pressure", {"pressure": False}, "not measured"),
    ],
)
def test_classes_of_surroundings(dimension: str, changes: dict[str, Any], expected: str) -> None:
    assert class_in(dimension, surrounded(**changes)) == expected


def test_classes_of_protocol_and_model() -> None:
    case = truth("creep", protocol="single", repeats=1, order="blocked", model="earlier")
    of = {entry.name: entry.of(case) for entry in DIMENSIONS}
    assert (of["protocol"], of["repeats"], of["order"]) == ("single", "1", "blocked")
    assert of["given model"] == "identified earlier"
    assert class_in("repeats", truth(repeats=3)) == "2 or 3"
    assert class_in("repeats", truth(repeats=4)) == "4 and more"


def test_every_case_is_in_one_class_of_each_dimension() -> None:
    for entry in DIMENSIONS:
        assert entry.of(NOTHING) in entry.classes
        assert len(set(entry.classes)) == len(entry.classes)


def quiet_and_alarms(quiet: int, alarms: int, rig: str = "virtual_rig", **at: Any) -> list[Outcome]:
    case = replace(surrounded(**at), rig=rig)
    return [Outcome(case, answer())] * quiet + [Outcome(case, UNKNOWN)] * alarms


def test_the_worst_class_is_named_and_has_enough_cases() -> None:
    outcomes = quiet_and_alarms(100, 0)
    outcomes += quiet_and_alarms(9, 1, rate_hz=10.0)
    outcomes += quiet_and_alarms(3, 3, bits=8)  # too few to be judged by themselves
    worst = mark(WORST_CLASS.name, outcomes)
    assert worst.which == "sampling rate: below 25 Hz"
    assert (worst.estimate.value, worst.estimate.n) == (0.1, 10)
    assert worst.target.reached(worst.estimate) is False
    few = mark(WORST_CLASS.name, quiet_and_alarms(5, 0))
    assert few.target.reached(few.estimate) is None


def test_every_mark_is_measured_in_every_class_the_worst_first() -> None:
    outcomes = quiet_and_alarms(10, 0) + quiet_and_alarms(5, 5, rate_hz=10.0)
    classes = score(outcomes).classes
    first = classes[0]
    assert (first.target, first.dimension, first.name) == (
        FALSE_ALARMS,
        "sampling rate",
        "below 25 Hz",
    )
    missed = [entry.target.surely_missed_by(entry.estimate) for entry in classes]
    assert missed == sorted(missed, reverse=True)


def test_rigs_differ_by_what_their_intervals_do_not_explain() -> None:
    alike = quiet_and_alarms(99, 1) + quiet_and_alarms(96, 4, rig="second_rig")
    apart = mark(BETWEEN_RIGS.name, alike)
    assert apart.rig == "both"
    assert apart.target.reached(apart.estimate) is True
    other = quiet_and_alarms(100, 0) + quiet_and_alarms(70, 30, rig="second_rig")
    worst = mark(BETWEEN_RIGS.name, other)
    assert worst.which == "no effect: false alarms, 0.300 apart"
    assert 0.19 < worst.estimate.value < 0.25
    assert worst.target.reached(worst.estimate) is False
    alone = mark(BETWEEN_RIGS.name, quiet_and_alarms(100, 0))
    assert alone.target.reached(alone.estimate) is None


# --- the command ----------------------------------------------------------------------------------


def checked(outcomes: list[Outcome], folder: Path) -> int:
    path = folder / "scores.json"
    path.write_text(json.dumps(score(outcomes).to_dict()))
    return check([str(path)])


def test_marks_that_are_reached_give_exit_code_0(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    quiet = [Outcome(NOTHING, answer(probability=1.0))] * 20
    assert checked(quiet, tmp_path) == 0
    said = capsys.readouterr().out.splitlines()
    assert said == ["3 of 3 marks are reached", "17 further ones have no case"]


def test_marks_that_fall_short_are_said_with_exit_code_1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes = quiet_and_alarms(18, 2, rate_hz=10.0) + named("creep", 20, 0)
    assert checked(outcomes, tmp_path) == 1
    said = capsys.readouterr().out.splitlines()
    alarm = "virtual_rig: no effect: false alarms: expected ≤ 0.02, found 0.100 (0.028 to 0.301)"
    assert f"{alarm} in 20 cases" in said
    worst = "virtual_rig: no effect: false alarms, worst class"
    assert any(line.startswith(worst) for line in said)
    assert not any("truth in the sets" in line for line in said)


def test_what_may_be_chance_is_forgiven_where_that_is_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    checked(quiet_and_alarms(19, 1), tmp_path)
    capsys.readouterr()
    path = str(tmp_path / "scores.json")
    assert check([path]) == 1
    assert check(["--beyond-chance", path]) == 0
    checked(quiet_and_alarms(10, 10), tmp_path)
    assert check(["--beyond-chance", path]) == 1
    assert "expected ≤ 0.02, found 0.500" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("measure", "value", "n", "missed"),
    [
        (SETS, 2.0, 1, False),  # one answer of two sets: its bootstrap interval has no width
        (SETS, 1.5, 12, False),
        (SETS, 2.0, 20, True),
        ("", 0.9, 2, False),  # a difference between two cases
        ("", 0.9, 40, True),
    ],
)
def test_a_few_cases_miss_no_mark_by_an_interval_without_width(
    measure: str, value: float, n: int, missed: bool
) -> None:
    estimate = {"value": value, "low": value, "high": value, "n": n}
    document = {"measure": measure, "goal": 1.3 if measure else 0.05, "at_least": False}
    assert missed_beyond_chance({**document, "estimate": estimate}, 30) is missed


def test_the_mark_that_chance_adds_to_is_the_one_of_that_name() -> None:
    measures = {target.measure for target in TARGETS}
    assert CALIBRATION in measures
    assert {*NO_SHARE} - {""} <= measures


def test_scores_without_any_case_reach_nothing(tmp_path: Path) -> None:
    assert checked([], tmp_path) == 1


def test_what_is_no_score_has_exit_code_2(tmp_path: Path) -> None:
    (tmp_path / "scores.json").write_text("[]")
    with pytest.raises(SystemExit) as left:
        check([str(tmp_path / "scores.json")])
    assert left.value.code == 2
