"""The blind benchmark's judge, on hand-made truths and answers whose scores are known."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blind.judge import (
    Answer,
    Claim,
    Outcome,
    Realised,
    Truth,
    read_answer,
    read_baselines,
    read_realised,
    read_truth,
    score,
)
from blind.judge.questions import (
    MEASURES,
    fair_or_unknown,
    found,
    in_sets,
    one_named,
    right_first,
    right_stage,
    shrink_points,
    wrong_name,
)
from blind.judge.score import confusion, smallest_size
from blind.judge.statistics import calibration, mean, rate
from blind.judge.targets import TARGETS, marks
from blind.unseal import fingerprint, unseal
from spa_fo.errors import BadInput
from spa_fo.plant.effects.library import LIBRARY


def ids(*names: str) -> frozenset[str]:
    return frozenset(names)


def truth(*effects: str, kind: str = "closed", size: float | None = 4.0, **others: Any) -> Truth:
    given: dict[str, Any] = {
        "case": "case_0001",
        "equivalents": ids(),
        "noise_floor_deg": 0.5,
        "protocol": "rich",
        "model": "nominal",
        "form": "a",
    }
    return Truth(kind=kind, effects=ids(*effects), size=size, **given | others)


def answer(*sets: Iterable[str], verdict: str | None = None, **others: Any) -> Answer:
    """Answer with these sets, sure of the first."""
    named = tuple(frozenset(each) for each in sets)
    kind = verdict or ("no_gap", "cause", "ambiguous")[min(len(named), 2)]
    top = named[0] if named else ids("none")
    given: dict[str, Any] = {"top": top, "probability": 0.9, "stage": None}
    return Answer(kind, named, **given | others)


CREEP, LEAK = truth("creep"), truth("leak")
NOTHING = truth(kind="no_effect", size=None)
UNKNOWN = answer(verdict="unknown", top=ids("unknown"))


# --- questions ------------------------------------------------------------------------------------


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


def test_one_of_a_pair_counts_wherever_it_is_named() -> None:
    pair = truth("creep", "leak", kind="pair", size=None)
    assert one_named(pair, answer(["leak"], verdict="unknown"))
    assert one_named(pair, answer(["line_lag"], ["leak", "stiffening"]))
    assert not one_named(pair, answer(["line_lag"]))


# --- statistics -----------------------------------------------------------------------------------


def test_wilson_interval_of_a_textbook_case() -> None:
    # 8 of 10 at 95 %: (0.4902, 0.9433), for example Agresti and Coull (1998).
    estimate = rate([True] * 8 + [False] * 2)
    assert (estimate.value, estimate.n) == (0.8, 10)
    assert estimate.low == pytest.approx(0.4902, abs=1e-4)
    assert estimate.high == pytest.approx(0.9433, abs=1e-4)


@pytest.mark.parametrize("hits", [[True] * 20, [False] * 20])
def test_wilson_interval_holds_its_share_at_the_ends(hits: list[bool]) -> None:
    estimate = rate(hits)
    assert 0.0 <= estimate.low <= estimate.value <= estimate.high <= 1.0
    assert estimate.high - estimate.low == pytest.approx(0.161, abs=1e-3)


def test_nothing_has_no_rate() -> None:
    assert math.isnan(rate([]).value)
    assert mean([]).n == 0


def test_bootstrap_interval_of_a_mean_is_that_of_its_standard_error() -> None:
    values = np.random.default_rng(3).normal(2.0, 1.0, 400)
    estimate = mean(values.tolist())
    assert estimate.value == pytest.approx(values.mean())
    half = 1.96 * values.std() / 20.0
    assert estimate.low == pytest.approx(values.mean() - half, abs=0.2 * half)
    assert estimate.high == pytest.approx(values.mean() + half, abs=0.2 * half)


def test_calibration_error_of_constructed_cases() -> None:
    perfect = calibration([0.75] * 8, [True] * 6 + [False] * 2)
    assert perfect.ece.value == pytest.approx(0.0, abs=1e-12)
    sure = calibration([1.0] * 10, [True] * 4 + [False] * 6)
    assert sure.ece.value == pytest.approx(0.6)
    # Half the cases 0.2 too high, half 0.1 too low: both count, neither cancels the other.
    mixed = calibration(
        [0.9] * 10 + [0.4] * 10, [True] * 7 + [False] * 3 + [True] * 5 + [False] * 5
    )
    assert mixed.ece.value == pytest.approx(0.15)
    assert [entry.right.value for entry in mixed.bins] == [0.5, 0.7]
    assert mixed.ece.low < 0.15 < mixed.ece.high


def test_errors_of_both_signs_within_one_bin_cancel_and_those_of_two_bins_do_not() -> None:
    within = calibration([0.52, 0.58] * 5, [True, False] * 5)
    assert within.ece.value == pytest.approx(0.05)
    across = calibration([0.45, 0.55] * 5, [True, False] * 5)
    assert across.ece.value == pytest.approx(0.55)


def test_calibration_error_by_chance_is_what_perfect_answers_would_show() -> None:
    rng = np.random.default_rng(5)
    claimed = rng.uniform(0.3, 1.0, 300)
    found_errors = [
        calibration(claimed.tolist(), (rng.random(300) < claimed).tolist()) for _ in range(20)
    ]
    mean_error = np.mean([entry.ece.value for entry in found_errors])
    assert found_errors[0].by_chance == pytest.approx(mean_error, rel=0.2)


# --- the shrink -----------------------------------------------------------------------------------


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
    assert score(outcomes).shrink_left_out == 1


def test_claims_are_counted_by_kind_of_answer() -> None:
    close = shrunk(Claim(0.80, 0.70, 0.90), math.sqrt(4.25), math.sqrt(1.25))
    far = shrunk(Claim(0.95, 0.90, 0.99), math.sqrt(4.25), math.sqrt(1.25))
    unclear = shrunk(Claim(0.80, 0.70, 0.90), 1.2, 0.5)
    silent = shrunk(None, math.sqrt(4.25), math.sqrt(1.25))

    def unknown(outcome: Outcome) -> Outcome:
        return replace(outcome, answer=replace(outcome.answer, verdict="unknown"))

    none = Outcome(CREEP, answer())
    outcomes = [close, close, unclear, unknown(close), unknown(far), unknown(silent), none]
    named, stood_in = score(outcomes).claims
    assert (named.verdict, named.answers, named.claims, named.close.n) == ("cause", 3, 3, 2)
    assert named.close.value == named.covered.value == 1.0
    counts = (stood_in.verdict, stood_in.answers, stood_in.claims, stood_in.close.n)
    assert counts == ("unknown", 3, 2, 2)
    assert stood_in.close.value == stood_in.covered.value == 0.5


# --- sizes, arms, effects, marks ------------------------------------------------------------------


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


def named(effect: str, hits: int, misses: int, **others: Any) -> list[Outcome]:
    stage = LIBRARY[effect].stage
    right = Outcome(truth(effect, **others), answer([effect], stage=stage))
    wrong = Outcome(truth(effect, **others), answer(["thermal_drift"], stage=stage))
    return [right] * hits + [wrong] * misses


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
    arms = {(arm.kind, arm.protocol, arm.size): arm for arm in score(outcomes).arms}
    assert arms["closed", "rich", 4.0].scores["in_sets"].value == 0.75
    assert arms["closed", "rich", 2.0].n == 2
    assert arms["closed", "up_steps", 4.0].scores["right_first"].value == 1.0
    assert arms["no_effect", "rich", None].scores["found"].value == 1.0


def test_variants_part_by_form_and_by_model() -> None:
    outcomes = named("creep", 2, 0, form="b") + named("creep", 0, 1, model="own_fit")
    variants = {variant.name: variant for variant in score(outcomes).variants}
    assert variants["form b"].scores["in_sets"].value == 1.0
    assert variants["model own_fit"].scores["in_sets"].value == 0.0
    assert variants["model nominal"].n == 2


def mark(name: str, outcomes: list[Outcome]) -> Any:
    return next(entry for entry in marks(outcomes) if entry.target.name == name)


def test_marks_are_held_against_their_own_cases_only() -> None:
    name = "rich protocol, 4 or more times the floor: truth in the sets"
    outcomes = named("creep", 19, 1) + named("creep", 0, 5, size=2.0)
    outcomes += named("creep", 0, 5, protocol="up_steps")
    reached = mark(name, outcomes)
    assert (reached.estimate.value, reached.estimate.n) == (0.95, 20)
    assert reached.target.reached(reached.estimate) is True
    missed = mark(name, named("creep", 18, 2))
    assert missed.target.reached(missed.estimate) is False
    absent = mark(name, [Outcome(NOTHING, answer())])
    assert absent.target.reached(absent.estimate) is None


def test_upper_marks_are_reached_from_below() -> None:
    alarms = "no effect: false alarms"
    quiet = mark(alarms, [Outcome(NOTHING, answer())] * 100)
    assert quiet.target.reached(quiet.estimate) is True
    loud = mark(alarms, [Outcome(NOTHING, answer())] * 98 + [Outcome(NOTHING, UNKNOWN)] * 2)
    assert (loud.estimate.value, loud.target.reached(loud.estimate)) == (0.02, False)


def test_every_mark_has_a_measure_and_a_name_of_its_own() -> None:
    assert {target.measure for target in TARGETS} <= MEASURES.keys()
    assert len({target.name for target in TARGETS}) == len(TARGETS)


def test_set_counts_are_of_answers_that_name_something() -> None:
    given = [answer(["creep"]), answer(["creep"], ["leak"]), answer(), UNKNOWN]
    estimate = MEASURES["sets"]([Outcome(CREEP, each) for each in given])
    assert (estimate.value, estimate.n) == (1.5, 2)


def test_confusion_counts_first_explanations() -> None:
    outcomes = [*named("creep", 2, 1), Outcome(NOTHING, answer())]
    outcomes.append(Outcome(CREEP, answer(["creep", "leak"])))
    counted = confusion(outcomes)
    assert counted.rows == ("creep", "no effect")
    cells = dict(zip(counted.columns, counted.counts[0], strict=True))
    assert (cells["creep"], cells["thermal_drift"], cells["pair"]) == (2, 1, 1)
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
    up_steps = next(entry for entry in again["marks"] if entry["name"].startswith("up-steps"))
    assert up_steps["estimate"]["value"] is None
    assert up_steps["reached"] is None


# --- documents ------------------------------------------------------------------------------------


def label(**changes: Any) -> dict[str, Any]:
    return {
        "schema": "spa-fo/blind-label/1",
        "case": "case_0007",
        "kind": "closed",
        "effects": ["creep"],
        "equivalents": [],
        "form": "b",
        "sizes": [8.0],
        "sizes_reached": [7.9],
        "noise_floor_deg": 0.4,
        "protocol": "rich",
        "model": "nominal",
    } | changes


def diagnosis(**changes: Any) -> dict[str, Any]:
    return {
        "schema": "spa-fo/diagnosis/1",
        "where": {"stage": {"drive": 0.1, "actuator": 0.8, "sensor": 0.1, "acquisition": 0.0}},
        "causes": [
            {"set": ["creep"], "probability": 0.7},
            {"set": ["sensor_creep"], "probability": 0.2},
            {"set": ["none"], "probability": 0.0},
            {"set": ["unknown"], "probability": 0.1},
        ],
        "verdict": {
            "kind": "ambiguous",
            "sets": [["creep"], ["sensor_creep"]],
            "next_experiment": "calibrate",
        },
        "shrink": {"fraction_closed": 0.9, "ci95": [0.8, 0.95]},
        "baselines": {"smallest_bic": ["sensor_creep"], "commonest": ["line_lag"]},
    } | changes


def test_a_label_and_a_diagnosis_are_read_as_they_stand() -> None:
    case, given = read_truth(label(), "l"), read_answer(diagnosis(), "d")
    assert (case.size, case.short, case.stages) == (8.0, False, ids("actuator"))
    assert given.top == ids("creep")
    assert (given.probability, given.stage) == (0.7, "actuator")
    assert given.claim == Claim(0.9, 0.8, 0.95)
    assert in_sets(case, given)
    baselines = read_baselines(diagnosis(), "d")
    assert baselines["refit_only"].verdict == "no_gap"
    assert wrong_name(case, baselines["smallest_bic"])
    assert not right_stage(case, baselines["commonest"])


def test_baselines_stand_beside_the_marks() -> None:
    case = read_truth(label(), "l")
    outcome = Outcome(case, read_answer(diagnosis(), "d"), read_baselines(diagnosis(), "d"))
    entry = mark("rich protocol, 4 or more times the floor: truth in the sets", [outcome])
    assert entry.estimate.value == 1.0
    assert [entry.baselines[name].value for name in sorted(entry.baselines)] == [0.0, 0.0, 0.0]
    bare = Outcome(case, outcome.answer, read_baselines(diagnosis(baselines={}), "d"))
    entry = mark("rich protocol, 4 or more times the floor: truth in the sets", [bare])
    assert entry.baselines["smallest_bic"].n == 0


def test_an_effect_that_fell_short_is_graded_by_what_it_reached() -> None:
    short = read_truth(label(sizes_reached=[5.0]), "l")
    assert (short.size, short.short) == (4.0, True)
    assert score([Outcome(short, answer(["creep"]))]).short == 1


def test_an_insignificant_gap_has_no_stage() -> None:
    stages = dict.fromkeys(("drive", "actuator", "sensor", "acquisition"), 0.0)
    assert read_answer(diagnosis(where={"stage": stages}), "d").stage is None


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"schema": "spa-fo/diagnosis/2"}, "schema"),
        ({"causes": [{"set": ["creep"], "probability": 1.0}]}, "none and unknown"),
        (
            {
                "causes": [
                    {"set": ["none"], "probability": 0.5},
                    {"set": ["unknown"], "probability": 0.1},
                ]
            },
            "sum to 1",
        ),
        ({"verdict": {"kind": "perhaps", "sets": []}}, "verdict.kind"),
        ({"verdict": {"kind": "cause", "sets": [["creep"], ["leak"]]}}, "verdict.sets"),
        ({"verdict": {"kind": "cause", "sets": ["creep"]}}, "list of identifiers"),
        ({"where": {}}, "stage"),
        ({"shrink": {"fraction_closed": None, "ci95": [0, 1]}}, "finite number"),
    ],
)
def test_a_diagnosis_that_breaks_the_contract_is_refused(
    change: Mapping[str, Any], text: str
) -> None:
    with pytest.raises(BadInput, match=rf"^some\.json.*{re.escape(text)}"):
        read_answer(diagnosis(**change), "some.json")


def test_realised_errors_are_read_or_refused() -> None:
    entry = {"before_deg": 2.0, "after_deg": 0.5, "refit_deg": 1.5}
    assert read_realised(entry, "r") == Realised(2.0, 0.5, 1.5)
    with pytest.raises(BadInput, match="refit_deg"):
        read_realised({"before_deg": 2.0, "after_deg": 0.5}, "r")


# --- seals ----------------------------------------------------------------------------------------


@pytest.fixture
def sealed(tmp_path: Path) -> tuple[Path, list[Path], list[Path]]:
    """Seals, labels and the witness of a diagnosis."""
    labels, lines = [], []
    for number in (1, 2):
        path = tmp_path / f"case_000{number}.json"
        path.write_text(json.dumps({"case": path.stem}))
        labels.append(path)
        lines.append(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.stem}\n")
    seals, witness = tmp_path / "seals.txt", tmp_path / "sealed_by.txt"
    seals.write_text("".join(lines))
    witness.write_text(fingerprint(seals) + "\n")
    return seals, labels, [witness]


def test_labels_open_when_they_are_what_was_sealed(
    sealed: tuple[Path, list[Path], list[Path]],
) -> None:
    assert list(unseal(*sealed)) == ["case_0001", "case_0002"]


def test_a_changed_label_is_refused(sealed: tuple[Path, list[Path], list[Path]]) -> None:
    sealed[1][1].write_text(json.dumps({"case": "case_0002", "effects": ["leak"]}))
    with pytest.raises(BadInput, match=r"case_0002\.json.*not the label that was sealed"):
        unseal(*sealed)


def test_a_label_changed_together_with_its_seal_is_refused(
    sealed: tuple[Path, list[Path], list[Path]],
) -> None:
    seals, labels, witnesses = sealed
    before = hashlib.sha256(labels[0].read_bytes()).hexdigest()
    labels[0].write_text("{}")
    after = hashlib.sha256(labels[0].read_bytes()).hexdigest()
    seals.write_text(seals.read_text().replace(before, after))
    with pytest.raises(BadInput, match="under other seals"):
        unseal(seals, labels, witnesses)


def test_missing_and_unsealed_labels_are_refused(
    sealed: tuple[Path, list[Path], list[Path]], tmp_path: Path
) -> None:
    seals, labels, witnesses = sealed
    with pytest.raises(BadInput, match="case_0002"):
        unseal(seals, labels[:1], witnesses)
    further = tmp_path / "case_0003.json"
    further.write_text("{}")
    with pytest.raises(BadInput, match="never sealed"):
        unseal(seals, [*labels, further], witnesses)
