"""Labels and diagnoses of the blind benchmark as they stand in files; errors are answers too."""

from __future__ import annotations

import copy
import json
import logging
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from blind.judge import (
    Claim,
    Outcome,
    Realised,
    answer_in,
    outcomes,
    read_answer,
    read_realised,
    read_truth,
)
from blind.judge.attempt import attempt
from blind.judge.questions import in_sets
from blind.judge.realised import realise
from blind_records import ids
from spa_fo.errors import BadInput

ASKED: dict[str, Any] = {
    "schema": "spa-fo/blind-case/1",
    "name": "case_0007",
    "seed": 1,
    "kind": "closed",
    "effects": ["creep"],
    "sizes": [8.0],
    "protocol": {"name": "rich", "repeats": 3, "order": "blocked"},
    "model": {"kind": "off", "off": 0.004},
    "surroundings": {
        "noise": {
            "colour": "exponential",
            "coloured_deg": 0.25,
            "correlation_s": 0.8,
            "white_deg": 0.05,
        },
        "converter": {"bits": 12},
        "scatter": {"gain": 0.01, "time_scale": 0.02, "rest_deg": 0.3},
        "fixture": {"error_deg": 0.4},
        "calibration": {"kind": "before", "dwell_s": 5.0, "angles": 7, "directions": 2},
        "sampling": {"rate_hz": 50.0, "jitter": 0.05, "missing": 0.002, "damaged": 0.001},
        "pressure": {"measured": True, "resolution_kpa": 0.2, "lag_s": 0.002},
    },
}


def label(reached: float = 7.9, **asked: Any) -> dict[str, Any]:
    return {
        "schema": "spa-fo/blind-label/2",
        "case": "case_0007",
        "rig": "second_rig",
        "asked": copy.deepcopy(ASKED) | asked,
        "exclude": [],
        "equivalents": [],
        "truth": {
            "noise_floor_deg": 0.4,
            "sizes_reached": [reached] * len(asked.get("sizes", [8.0])),
            "joint_size": None,
            "model_error_deg": 0.7,
            "form": "power law",
            "parameters": {},
            "core": {},
            "protocol": "",
        },
        "salt": "00",
    }


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
    } | changes


def test_a_label_and_a_diagnosis_are_read_as_they_stand() -> None:
    case, given = read_truth(label(), "l"), read_answer(diagnosis(), "d")
    assert (case.size, case.short, case.stages) == (8.0, False, ids("actuator"))
    assert given.top == ids("creep")
    assert (given.probability, given.stage) == (0.7, "actuator")
    assert given.claim == Claim(0.9, 0.8, 0.95)
    assert in_sets(case, given)
    assert (case.rig, case.protocol, case.repeats, case.order) == (
        "second_rig",
        "rich",
        3,
        "blocked",
    )
    assert (case.model, case.model_error_deg, case.is_shifted) == ("off", 0.7, True)
    bench = case.surroundings
    assert (bench.correlation_s, bench.coloured_deg, bench.noise_colour) == (
        0.8,
        0.25,
        "exponential",
    )
    assert (bench.gain, bench.time_scale, bench.rest_deg) == (0.01, 0.02, 0.3)
    assert (bench.fixture_deg, bench.calibration) == (0.4, "before")
    assert (bench.rate_hz, bench.bits, bench.pressure) == (50.0, 12, True)


@pytest.mark.parametrize(
    ("kind", "effect", "read"),
    [
        ("closed", "creep", "closed"),
        ("closed", "gain_growth", "further"),
        ("withheld", "gain_growth", "withheld"),
        ("alien", "ballooning", "alien"),
    ],
)
def test_effects_beyond_the_contract_are_a_kind_of_their_own(
    kind: str, effect: str, read: str
) -> None:
    assert read_truth(label(kind=kind, effects=[effect]), "l").kind == read


def test_what_is_rich() -> None:
    def rich(name: str, repeats: int) -> bool:
        protocol = {"name": name, "repeats": repeats, "order": "blocked"}
        return read_truth(label(protocol=protocol), "l").is_rich

    assert rich("rich", 2)
    assert rich("everything", 5)
    assert not rich("rich", 1)
    assert not rich("releases", 8)
    single = {"name": "single", "repeats": 8, "order": "blocked"}
    assert read_truth(label(protocol=single), "l").repeats == 1


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"kind": "open"}, "asked.kind"),
        ({"model": {"kind": "nominal"}}, "asked.model.kind"),
        ({"protocol": {"name": "rich"}}, "repeats"),
        ({"surroundings": {}}, "noise"),
    ],
)
def test_a_label_that_is_none_is_refused(change: Mapping[str, Any], text: str) -> None:
    with pytest.raises(BadInput, match=re.escape(text)):
        read_truth(label(**change), "l")


def test_an_effect_that_fell_short_is_graded_by_what_it_reached() -> None:
    short = read_truth(label(reached=5.0), "l")
    assert (short.size, short.short) == (4.0, True)


def test_an_insignificant_gap_has_no_stage() -> None:
    stages = dict.fromkeys(("drive", "actuator", "sensor", "acquisition"), 0.0)
    assert read_answer(diagnosis(where={"stage": stages}), "d").stage is None


def test_a_stage_that_the_data_cannot_tell_is_none() -> None:
    where = {"stage": None, "not_known": "no pressure was measured"}
    assert read_answer(diagnosis(where=where, laws=[]), "d").stage is None


def test_causes_beyond_the_library_are_read_as_they_stand() -> None:
    causes = [
        {"set": ["own_idea"], "probability": 0.9},
        {"set": ["none"], "probability": 0.05},
        {"set": ["unknown"], "probability": 0.05},
    ]
    verdict = {"kind": "cause", "sets": [["own_idea"]], "next_experiment": None}
    assert read_answer(diagnosis(causes=causes, verdict=verdict), "d").top == ids("own_idea")


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


# --- a benchmark's files --------------------------------------------------------------------------


def folder_with(tmp_path: Path, name: str, text: str) -> Path:
    folder = tmp_path / "batch_00" / "case_0007"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(text)
    return folder


def test_an_error_is_an_answer(tmp_path: Path) -> None:
    given = answer_in(folder_with(tmp_path, "error.txt", "log.csv: line 3: expected a number\n"))
    assert (given.verdict, given.message) == ("error", "log.csv: line 3: expected a number")


@pytest.mark.parametrize("text", ["{", '{"schema": "spa-fo/diagnosis/9"}'])
def test_a_broken_answer_is_an_error(tmp_path: Path, text: str) -> None:
    assert answer_in(folder_with(tmp_path, "diagnosis.json", text)).verdict == "error"


def test_no_answer_at_all_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="found neither"):
        answer_in(folder_with(tmp_path, "model.json", "{}"))


def together(batch: Path, entry: Mapping[str, Any] | None, *cases: str) -> list[Outcome]:
    labels = {name: label() for name in ("case_0007", *cases)}
    return outcomes(labels, [(batch, {"case_0007": entry})], batch / "labels.json")


def test_truth_answer_and_unseen_trials_come_together(tmp_path: Path) -> None:
    batch = folder_with(tmp_path, "diagnosis.json", json.dumps(diagnosis())).parent
    entry = {"before_deg": 2.0, "after_deg": 0.5, "refit_deg": 1.5}
    (outcome,) = together(batch, entry)
    assert (outcome.truth.case, outcome.answer.verdict) == ("case_0007", "ambiguous")
    assert (outcome.realised, outcome.refused) == (Realised(2.0, 0.5, 1.5), "")
    (refused,) = together(batch, {"error": "later: cannot be read"})
    assert (refused.realised, refused.refused) == (None, "later: cannot be read")
    (silent,) = together(batch, None)
    assert (silent.realised, silent.refused) == (None, "")


def test_a_case_without_a_diagnosis_is_refused(tmp_path: Path) -> None:
    batch = folder_with(tmp_path, "error.txt", "no").parent
    with pytest.raises(BadInput, match="diagnosis of case_0008, found none"):
        together(batch, {"error": "no"}, "case_0008")


def test_what_claims_nothing_is_not_tried_on_unseen_trials(tmp_path: Path) -> None:
    out = folder_with(tmp_path, "diagnosis.json", json.dumps(diagnosis(shrink=None)))
    assert realise(tmp_path / "no_case", out, seed=1) is None


def fails(error: Exception) -> None:
    raise error


def test_what_goes_wrong_in_one_case_is_its_result(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    case = tmp_path / "case_0007"
    assert attempt(case, len, [1, 2]) == (2, "")
    bad = BadInput(case / "campaign" / "log.csv", "expected a number", "line 3")
    assert attempt(case, fails, bad) == (None, "campaign/log.csv: line 3: expected a number")
    with caplog.at_level(logging.ERROR):
        assert attempt(case, fails, IndexError("index 3\nof 2"))[1] == "IndexError: index 3 of 2"
    assert "Traceback" in caplog.text
    assert "case_0007" in caplog.text
