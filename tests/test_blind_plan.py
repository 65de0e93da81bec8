"""Which cases a blind benchmark has, what is drawn around them, and how their truth is sealed."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from blind import plan as planning
from blind import writer
from blind.equivalents import confounded
from blind.plan import benchmark_plan, plan_cases
from blind.rigs import RIGS
from blind.surroundings import PRIORS, RICH, describe, draw_model, draw_protocol, draw_surroundings
from blind.writer import label_bytes, seal, write_cases
from spa_fo.errors import BadInput
from spa_fo.gap.settings import SETTINGS

EFFECTS = ("creep", "sensor_creep", "leak", "dead_time", "parameter_shift")


class FakeRig:
    """A rig whose campaigns are one file."""

    NAME = "fake"
    EFFECTS = EFFECTS
    FOREIGN: Mapping[str, tuple[str, ...]] = {"ballooning": ("stiffening",), "swaying": ()}

    def write_case(self, document: Mapping[str, Any], folder: Path) -> dict[str, Any]:
        """Write nothing but the name."""
        (folder / "campaign").mkdir(parents=True)
        (folder / "campaign" / "campaign.yaml").write_text(f"name: {document['name']}\n")
        return {"noise_floor_deg": 0.5}


@pytest.fixture(autouse=True)
def _fake_rigs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "rig_named", lambda _: FakeRig())
    monkeypatch.setattr(writer, "rig_named", lambda _: FakeRig())


PLAN = {
    "seed": 3,
    "no_effect": 8,
    "closed": {"sizes": [1, 2, 4, 8]},
    "other": {"sizes": [2, 8]},
    "withheld": {"sizes": [4, 8]},
    "alien": {"sizes": [4]},
    "pair": 6,
    "several": 4,
}


def test_every_rig_has_the_same_make_up() -> None:
    cases = plan_cases(PLAN)
    kinds = {rig: Counter(case.asked["kind"] for case in cases if case.rig == rig) for rig in RIGS}
    expected = {"no_effect": 8, "closed": 4 * 5 + 2 * 5, "withheld": 5, "alien": 2}
    expected |= {"pair": 6, "several": 4}
    assert kinds == dict.fromkeys(RIGS, expected)


def test_names_and_order_say_nothing_and_seeds_are_their_own() -> None:
    cases = plan_cases(PLAN)
    assert [case.name for case in cases] == [f"case_{i:04d}" for i in range(1, len(cases) + 1)]
    assert len({case.asked["seed"] for case in cases}) == len(cases)
    kinds = [case.asked["kind"] for case in cases]
    assert kinds != sorted(kinds)


def test_the_same_seed_gives_the_same_cases_and_another_seed_others() -> None:
    assert plan_cases(PLAN) == plan_cases(PLAN)
    assert plan_cases(PLAN) != plan_cases(PLAN | {"seed": 4})


def test_a_part_has_every_kind_every_effect_and_every_size() -> None:
    cases = plan_cases(PLAN | {"part": 0.25, "rigs": ["virtual_rig"]})
    rich = [
        case.asked
        for case in cases
        if case.asked["kind"] == "closed" and case.asked["protocol"]["name"] in RICH
    ]
    assert {asked["effects"][0] for asked in rich} == set(EFFECTS)
    assert {asked["sizes"][0] for asked in rich} == {1.0, 2.0, 4.0, 8.0}
    assert {case.asked["kind"] for case in cases} == set(planning.KINDS)


def test_protocols_are_those_that_the_lists_ask_for() -> None:
    for case in plan_cases(PLAN):
        name = case.asked["protocol"]["name"]
        if case.asked["kind"] in ("withheld", "alien", "pair", "several"):
            assert name in RICH
        if name in RICH:
            assert case.asked["protocol"]["repeats"] >= 2


def test_withheld_effects_are_excluded_and_no_others() -> None:
    for case in plan_cases(PLAN):
        withheld = case.asked["kind"] == "withheld"
        assert case.exclude == (tuple(case.asked["effects"]) if withheld else ())


def test_a_shifted_specimen_is_never_identified_on_its_own_campaign() -> None:
    models = {
        case.asked["model"]["kind"]
        for case in plan_cases(PLAN)
        if "parameter_shift" in case.asked["effects"]
    }
    assert models
    assert "own" not in models


@pytest.mark.parametrize(("kind", "counts"), [("pair", {2}), ("several", {3, 4, 5})])
def test_effects_that_act_together_can_be_told_apart(kind: str, counts: set[int]) -> None:
    cases = [case.asked for case in plan_cases(PLAN | {kind: 60}) if case.asked["kind"] == kind]
    assert len(cases) == 120
    assert {len(asked["effects"]) for asked in cases} <= counts
    assert all(len(asked["sizes"]) == len(asked["effects"]) for asked in cases)
    pairs = [pair for asked in cases for pair in combinations(asked["effects"], 2)]
    assert not any(confounded(*pair) or "parameter_shift" in pair for pair in pairs)


@pytest.mark.parametrize(
    ("document", "named"),
    [
        ({"sise": 1}, "sise"),
        ({"no_effect": -1}, "no_effect"),
        ({"part": 0}, "part"),
        ({"closed": {"sizes": [0]}}, "closed"),
        ({"closed": [4]}, "closed"),
        ({"rigs": ["third"]}, "rigs"),
    ],
)
def test_a_wrong_plan_is_named(document: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        benchmark_plan(document)


def test_surroundings_fill_their_priors() -> None:
    """The extremes of 2000 draws come near both ends of every range that has two."""
    rng = np.random.default_rng(5)
    drawn = [draw_surroundings(rng) for _ in range(2000)]
    for key, low, high in [
        ("noise.coloured_deg", 0.02, 0.5),
        ("scatter.gain", 0.002, 0.04),
        ("scatter.rest_deg", 0.05, 1.0),
        ("fixture.error_deg", 0.02, 0.8),
        ("calibration.dwell_s", 2.0, 10.0),
        ("calibration.angles", 3, 19),
    ]:
        group, name = key.split(".")
        values = [document[group][name] for document in drawn]
        assert low <= min(values) < 1.1 * low or min(values) == low
        assert 0.95 * high < max(values) <= high
    kinds = Counter(document["calibration"]["kind"] for document in drawn)
    assert kinds["none"] / 2000 == pytest.approx(0.25, abs=0.04)
    assert all(
        (document["noise"]["correlation_s"] is None)
        == (document["noise"]["colour"] == "one_over_f")
        for document in drawn
    )


def test_protocols_and_models_are_drawn_as_asked() -> None:
    rng = np.random.default_rng(6)
    assert {draw_protocol(rng, ("single",))["name"] for _ in range(5)} == {"single"}
    assert all(2 <= draw_protocol(rng, RICH)["repeats"] <= 5 for _ in range(50))
    assert {draw_model(rng, own=False)["kind"] for _ in range(50)} == {"earlier", "off"}


def test_every_prior_is_described() -> None:
    described = describe()
    assert {name for name, *_ in described} >= {prior.key for prior in PRIORS}
    assert all(words and reason for _, words, _, reason in described)


def test_a_label_holds_all_that_was_drawn_and_fits_its_seal(tmp_path: Path) -> None:
    cases = plan_cases(PLAN | {"part": 0.1, "rigs": ["virtual_rig"]})
    write_cases(cases, tmp_path / "cases", tmp_path / "labels")
    seals = dict(
        reversed(line.split("  "))
        for line in (tmp_path / "cases" / "seals.txt").read_text().splitlines()
    )
    assert set(seals) == {case.name for case in cases}
    for case in cases:
        data = (tmp_path / "labels" / f"{case.name}.json").read_bytes()
        assert seal(data) == seals[case.name]
        label = json.loads(data)
        assert label["asked"] == case.asked
        assert label["truth"] == {"noise_floor_deg": 0.5}
        assert data == label_bytes(label)
        exclude = (tmp_path / "cases" / case.name / "exclude.txt").read_text().split()
        assert tuple(exclude) == case.exclude


def test_fair_answers_stand_in_the_label(tmp_path: Path) -> None:
    cases = [case for case in plan_cases(PLAN) if case.asked["kind"] in ("withheld", "alien")]
    write_cases(cases, tmp_path, tmp_path)
    fair = {}
    for case in cases:
        label = json.loads((tmp_path / f"{case.name}.json").read_text())
        fair[case.asked["effects"][0]] = label["equivalents"]
    assert fair["creep"] == ["sensor_creep"]
    assert fair["leak"] == []
    assert fair["ballooning"] == ["stiffening"]


def test_a_case_is_never_overwritten(tmp_path: Path) -> None:
    case = plan_cases(PLAN)[:1]
    write_cases(case, tmp_path, tmp_path)
    with pytest.raises(BadInput, match="not overwritten"):
        write_cases(case, tmp_path, tmp_path)


def test_how_much_noisier_a_bench_may_be_is_what_drawn_surroundings_say() -> None:
    """A trial or a few without repeats and without any cause, over what an ordinary bench makes."""
    rng, times = np.random.default_rng(0), []
    for _ in range(4000):
        drawn, trials, bent_deg = (
            draw_surroundings(rng),
            rng.integers(1, 6),
            rng.uniform(15.0, 45.0),
        )
        gain, rest = (drawn["scatter"][name] for name in ("gain", "rest_deg"))
        moved = [rest * rng.normal(size=trials), gain * bent_deg * rng.normal(size=trials)]
        # Angles between two dwells err by part of what these do.
        calibrated = drawn["calibration"]["kind"] != "none"
        fixture = 0.6 * drawn["fixture"]["error_deg"] * rng.normal() if calibrated else 0.0
        squares = drawn["noise"]["coloured_deg"] ** 2 + np.mean(np.square(moved).sum(axis=0))
        ordinary = [2.0 * SETTINGS.coloured_deg, SETTINGS.rest_scatter_deg]
        ordinary += [SETTINGS.scatter * bent_deg, SETTINGS.dwell_error_deg * calibrated]
        times.append(np.sqrt(squares + fixture**2) / np.linalg.norm(ordinary))
    assert np.std(np.log(times)) == pytest.approx(SETTINGS.level_alone, abs=0.05)
    most = np.exp(norm.ppf(0.99) * SETTINGS.level_alone)
    assert 0.003 < np.mean(np.array(times) > most) < 0.02
