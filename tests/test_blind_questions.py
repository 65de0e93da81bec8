"""What the blind benchmark asks of an answer, on hand-made truths and answers."""

from __future__ import annotations

import pytest

from blind.judge import Answer, Outcome, Truth
from blind.judge.questions import (
    MEASURES,
    fair_or_unknown,
    false_alarm,
    found,
    in_sets,
    one_named,
    right_first,
    right_stage,
    rightly_named,
    wrong_name,
)
from blind_records import CREEP, ERROR, NOTHING, UNKNOWN, answer, ids, truth


@pytest.mark.parametrize(
    ("case", "given", "expected"),
    [
        (CREEP, answer(["creep"]), True),
        (CREEP, answer(["leak"], ["creep"]), True),
        (CREEP, answer(["leak"]), False),
        (CREEP, answer(["creep", "leak"]), False),  # more than what is at work
        (CREEP, answer(["creep"], verdict="unknown"), False),  # only a part of the explanation
        (CREEP, answer(), False),
        (NOTHING, answer(), True),
        (NOTHING, answer(["creep"]), False),
        (truth("creep", "leak", kind="pair", size=None), answer(["leak", "creep"]), True),
        (truth("creep", "leak", kind="pair", size=None), answer(["leak"]), False),
    ],
)
def test_the_truth_is_in_the_sets_when_named_exactly(
    case: Truth, given: Answer, expected: bool
) -> None:
    assert in_sets(case, given) is expected


WITHHELD = truth("creep", kind="withheld", equivalents=ids("sensor_creep"))
ALIEN = truth("pump_ripple", kind="alien")


@pytest.mark.parametrize(
    ("case", "given", "wrong", "fair"),
    [
        (CREEP, answer(["creep"]), False, True),
        (CREEP, answer(["sensor_creep"]), True, False),
        (CREEP, answer(["creep", "leak"]), True, False),
        (CREEP, answer(["leak"], ["line_lag"]), False, False),  # wrong, but not confident
        (CREEP, UNKNOWN, False, True),
        (WITHHELD, answer(["sensor_creep"]), False, True),
        (WITHHELD, answer(["sensor_creep"], ["leak"]), False, False),
        (WITHHELD, answer(["leak"]), True, False),
        (WITHHELD, answer(), False, False),
        (ALIEN, answer(["mains_pickup"]), True, False),
        (ALIEN, answer(["mains_pickup"], verdict="unknown"), False, True),
        (NOTHING, answer(["creep"]), True, False),
        (truth("creep", "leak", kind="pair", size=None), answer(["leak"]), False, True),
    ],
)
def test_wrong_names_and_fair_answers(case: Truth, given: Answer, wrong: bool, fair: bool) -> None:
    assert wrong_name(case, given) is wrong
    assert fair_or_unknown(case, given) is fair


def test_of_several_some_may_be_named_and_nothing_else() -> None:
    several = truth("creep", "leak", "hysteresis", kind="several", size=None)
    assert rightly_named(several, answer(["creep", "leak"]))
    assert not rightly_named(several, answer(["creep", "sensor_lag"]))
    assert not rightly_named(several, answer(["creep", "leak"], verdict="unknown"))
    assert not rightly_named(several, answer())


def test_the_first_explanation_is_right_by_kind_of_case() -> None:
    assert right_first(CREEP, answer(["creep"]))
    assert not right_first(CREEP, UNKNOWN)
    assert right_first(NOTHING, answer())
    assert not right_first(NOTHING, UNKNOWN)
    assert right_first(WITHHELD, UNKNOWN)
    assert right_first(WITHHELD, answer(["sensor_creep"]))
    assert not right_first(ALIEN, answer(["sensor_creep"]))


def test_the_stage_of_a_pair_is_either_s_and_that_of_a_foreign_effect_is_not_judged() -> None:
    pair = truth("creep", "leak", kind="pair", size=None)
    assert right_stage(pair, answer(["leak"], stage="drive"))
    assert right_stage(pair, answer(["leak"], stage="actuator"))
    assert not right_stage(pair, answer(["leak"], stage="sensor"))
    assert not right_stage(CREEP, answer(["creep"], stage=None))
    stages = MEASURES["right_stage"]
    assert stages([Outcome(ALIEN, answer(["leak"], stage="drive"))]).n == 0
    assert stages([Outcome(CREEP, answer(["creep"], stage=None))]).n == 0


def test_one_of_a_pair_counts_wherever_it_is_named() -> None:
    pair = truth("creep", "leak", kind="pair", size=None)
    assert one_named(pair, answer(["leak"], verdict="unknown"))
    assert one_named(pair, answer(["line_lag"], ["leak", "stiffening"]))
    assert not one_named(pair, answer(["line_lag"]))


# --- errors, and models that are off --------------------------------------------------------------


def test_an_error_is_an_alarm_without_effect_and_names_nothing_with_one() -> None:
    assert false_alarm(NOTHING, ERROR)
    for case in (CREEP, WITHHELD, NOTHING):
        assert not found(case, ERROR)
        assert not in_sets(case, ERROR)
        assert not right_first(case, ERROR)
        assert not fair_or_unknown(case, ERROR)
        assert not wrong_name(case, ERROR)


def test_an_error_claims_no_probability_and_no_sets() -> None:
    outcomes = [Outcome(CREEP, ERROR), Outcome(CREEP, answer(["creep"]))]
    assert MEASURES["ece"](outcomes).n == MEASURES["sets"](outcomes).n == 1
    assert MEASURES["in_sets"](outcomes).value == 0.5


SHIFT = ["parameter_shift"]
OFF_NOTHING = truth(kind="no_effect", size=None, model="off")


@pytest.mark.parametrize(
    ("given", "alarm"),
    [
        (answer(SHIFT), False),
        (answer(SHIFT, SHIFT), False),
        (answer(SHIFT, ["creep"]), True),
        (answer(["creep", *SHIFT]), True),
        (answer(SHIFT, verdict="unknown"), True),
        (UNKNOWN, True),
        (answer(), False),
    ],
)
def test_without_an_effect_a_model_that_is_off_may_be_said_to_be_shifted(
    given: Answer, alarm: bool
) -> None:
    assert false_alarm(OFF_NOTHING, given) is alarm
    assert in_sets(OFF_NOTHING, given) is not alarm
    for model in ("own", "earlier"):
        other = truth(kind="no_effect", size=None, model=model)
        assert false_alarm(other, given) is (given.verdict != "no_gap")


def test_a_shift_beside_the_truth_is_right_where_the_model_is_off_and_there_alone() -> None:
    beside = answer(["creep", *SHIFT])
    off = truth("creep", model="off")
    assert in_sets(off, beside)
    assert right_first(off, beside)
    assert not wrong_name(off, beside)
    assert in_sets(off, answer(["creep"]))
    assert not in_sets(CREEP, beside)
    assert wrong_name(CREEP, beside)


def test_a_shift_instead_of_the_truth_is_a_wrong_name() -> None:
    for case in (truth("creep", model="off"), truth("creep", kind="withheld", model="off")):
        assert wrong_name(case, answer(SHIFT))
        assert not right_first(case, answer(SHIFT))
    assert not wrong_name(OFF_NOTHING, answer(SHIFT))


def test_a_shift_beside_a_fair_answer_is_fair() -> None:
    off = truth("creep", kind="withheld", equivalents=ids("sensor_creep"), model="off")
    assert fair_or_unknown(off, answer(["sensor_creep", *SHIFT]))
    assert not fair_or_unknown(off, answer(["leak", *SHIFT]))
    assert not fair_or_unknown(WITHHELD, answer(["sensor_creep", *SHIFT]))
