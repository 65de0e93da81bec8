"""The blind benchmark's scores, on hand-made truths and answers whose scores are known."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from blind.judge import Claim, Outcome, Realised, score
from blind.judge.effects import confusion, smallest_size
from blind.judge.questions import MEASURES, found, shrink_points
from blind_records import CREEP, ERROR, NOTHING, UNKNOWN, answer, named, truth


def shrunk(claim: Claim | None, before: float, after: float, refit: float = 1.0) -> Outcome:
    realised = Realised(before_deg=before, after_deg=after, refit_deg=refit)
    return Outcome(CREEP, answer(["creep"], claim=claim), realised=realised)


def test_the_realised_shrink_is_the_contract_s_formula() -> None:
    # floor 0.5: before² - floor² = 4, after² - floor² = 1.
    outcome = shrunk(Claim(0.8, 0.7, 0.9), math.sqrt(4.25), math.sqrt(1.25), math.sqrt(2.25))
    (point,) = shrink_points([outcome])
    assert point.realised == pytest.approx(0.75)
    assert point.refit == pytest.approx(0.5)
    assert point.close
    assert point.covered


def test_claims_are_close_within_ten_points_and_cover_by_their_own_interval() -> None:
    outcomes = [
        shrunk(Claim(0.80, 0.70, 0.90), math.sqrt(4.25), math.sqrt(1.25)),  # close, covers
        shrunk(Claim(0.90, 0.70, 0.99), math.sqrt(4.25), math.sqrt(1.25)),  # covers only
        shrunk(Claim(0.80, 0.79, 0.81), math.sqrt(4.25), math.sqrt(1.25)),  # close only
        shrunk(None, math.sqrt(4.25), math.sqrt(1.25)),  # claims nothing
        shrunk(Claim(0.80, 0.70, 0.90), 1.2, 0.5),  # no clear gap to judge by
    ]
    assert MEASURES["shrink_close"](outcomes).n == 3
    assert MEASURES["shrink_close"](outcomes).value == pytest.approx(2 / 3)
    assert MEASURES["shrink_covered"](outcomes).value == pytest.approx(2 / 3)
    assert score(outcomes).rigs["virtual_rig"].shrink_left_out == 1


def test_claims_are_counted_by_kind_of_answer() -> None:
    close = shrunk(Claim(0.80, 0.70, 0.90), math.sqrt(4.25), math.sqrt(1.25))
    far = shrunk(Claim(0.95, 0.90, 0.99), math.sqrt(4.25), math.sqrt(1.25))
    unclear = shrunk(Claim(0.80, 0.70, 0.90), 1.2, 0.5)
    silent = shrunk(None, math.sqrt(4.25), math.sqrt(1.25))

    def unknown(outcome: Outcome) -> Outcome:
        return replace(outcome, answer=replace(outcome.answer, verdict="unknown"))

    none = Outcome(CREEP, answer())
    outcomes = [close, close, unclear, unknown(close), unknown(far), unknown(silent), none]
    named, stood_in = score(outcomes).rigs["virtual_rig"].claims
    assert (named.verdict, named.answers, named.claims, named.close.n) == ("cause", 3, 3, 2)
    assert named.close.value == named.covered.value == 1.0
    counts = (stood_in.verdict, stood_in.answers, stood_in.claims, stood_in.close.n)
    assert counts == ("unknown", 3, 2, 2)
    assert stood_in.close.value == stood_in.covered.value == 0.5


def at_sizes(**found_at: list[bool]) -> list[Outcome]:
    """Cases of creep; ``x4=[True, False]``: two at size 4, the first of which is found."""
    return [
        Outcome(truth("creep", size=float(key[1:])), answer(["creep"]) if hit else answer())
        for key, hits in found_at.items()
        for hit in hits
    ]


def test_the_smallest_size_is_the_one_from_which_on_all_is_found() -> None:
    outcomes = at_sizes(x1=[True], x2=[False], x4=[True, True], x8=[True])
    assert smallest_size(outcomes, found) == 4.0
    assert smallest_size(at_sizes(x4=[True], x8=[False]), found) is None
    assert smallest_size(at_sizes(x2=[True] * 19 + [False]), found) == 2.0
    assert smallest_size(at_sizes(x2=[True] * 19 + [False]), found, 1.0) is None


def test_the_worst_effect_comes_first_and_says_what_it_is_taken_for() -> None:
    scores = score(named("creep", 9, 1) + named("leak", 1, 3) + named("slew_limit", 5, 0))
    assert [entry.effect for entry in scores.effects][:2] == ["leak", "creep"]
    worst = scores.effects[0]
    assert worst.rates["rich, 4 and more: in sets"].value == 0.25
    assert worst.rates["any size: no wrong name"].value == 0.25
    assert worst.mistaken_for == "thermal_drift"
    assert scores.effects[0].worst_rate <= scores.effects[1].worst_rate


def test_the_stage_is_judged_with_the_worst_rate_too() -> None:
    outcomes = [Outcome(CREEP, answer(["creep"], stage="sensor"))] * 3
    (entry,) = score(outcomes).effects
    assert (entry.worst, entry.worst_rate) == ("rich, 4 and more: stage", 0.0)


def test_arms_part_by_kind_protocol_and_size() -> None:
    outcomes = named("creep", 3, 1) + named("creep", 1, 1, size=2.0)
    outcomes += [*named("leak", 1, 0, protocol="up_steps"), Outcome(NOTHING, answer(["leak"]))]
    outcomes += named("leak", 1, 1, rig="second_rig")
    rigs = score(outcomes).rigs
    assert [(rig, own.cases) for rig, own in rigs.items()] == [
        ("virtual_rig", 8),
        ("second_rig", 2),
    ]
    arms = {(arm.kind, arm.protocols, arm.size): arm for arm in rigs["virtual_rig"].arms}
    assert arms["closed", "rich", 4.0].scores["in_sets"].value == 0.75
    assert arms["closed", "rich", 2.0].n == 2
    assert arms["closed", "other", 4.0].scores["right_first"].value == 1.0
    assert arms["no_effect", "rich", None].scores["false_alarm"].value == 1.0


def test_set_counts_are_of_answers_that_name_something() -> None:
    given = [answer(["creep"]), answer(["creep"], ["leak"]), answer(), UNKNOWN]
    estimate = MEASURES["sets"]([Outcome(CREEP, each) for each in given])
    assert (estimate.value, estimate.n) == (1.5, 2)


def test_confusion_counts_first_explanations() -> None:
    outcomes = [*named("creep", 2, 1), Outcome(NOTHING, answer())]
    outcomes.append(Outcome(CREEP, answer(["creep", "leak"])))
    outcomes += [Outcome(CREEP, answer(["own_idea"])), Outcome(CREEP, ERROR)]
    counted = confusion(outcomes)
    assert counted.rows == ("creep", "no effect")
    cells = dict(zip(counted.columns, counted.counts[0], strict=True))
    assert (cells["creep"], cells["thermal_drift"], cells["pair"]) == (2, 1, 1)
    assert (cells["other"], cells["error"]) == (1, 1)
    assert sum(counted.counts[1]) == counted.counts[1][counted.columns.index("none")] == 1


def test_the_order_of_the_cases_does_not_matter() -> None:
    outcomes = [
        replace(outcome, truth=replace(outcome.truth, case=f"case_{i:04d}"))
        for i, outcome in enumerate(named("creep", 9, 4) + named("leak", 3, 2, size=2.0))
    ]
    assert score(outcomes).to_dict() == score(outcomes[::-1]).to_dict()


def test_scores_are_plain_json() -> None:
    document = score(named("creep", 3, 1)).to_dict()
    again = json.loads(json.dumps(document, allow_nan=False))
    assert again == document
    pair = next(entry for entry in again["marks"] if entry["name"].startswith("pair"))
    assert pair["estimate"]["value"] is None
    assert pair["reached"] is None


def test_errors_are_counted_with_their_messages() -> None:
    outcomes = [
        Outcome(truth("creep", case="case_0001"), ERROR, refused="there is no diagnosis"),
        Outcome(truth("creep", case="case_0002"), answer(["creep"]), refused="cannot be read"),
        Outcome(truth("creep", case="case_0003"), answer(["creep"])),
    ]
    first, second = score(outcomes).rigs["virtual_rig"].failures
    assert (first.case, first.step, first.message) == ("case_0001", "diagnosis", ERROR.message)
    assert (second.case, second.step) == ("case_0002", "unseen trials")
    assert score(outcomes).effects[0].mistaken_for == "error"


def test_what_was_made_of_models_that_are_off_is_counted() -> None:
    shift = ["parameter_shift"]
    nothing, creep = truth(kind="no_effect", size=None, model="off"), truth("creep", model="off")
    answers = [
        (nothing, answer(shift)),
        (nothing, answer()),
        (creep, answer(["creep", *shift])),
        (creep, answer(["leak", *shift])),
        (creep, answer(shift)),
        (truth("parameter_shift", model="off"), answer(shift)),
        (CREEP, answer(["creep", *shift])),
    ]
    found_shifts = score([Outcome(*each) for each in answers]).rigs["virtual_rig"].shifts
    counts = found_shifts.cases, found_shifts.alone, found_shifts.beside, found_shifts.instead
    assert counts == (5, 1, 1, 1)
