"""The diagnosis end to end, on small sealed cases of the virtual rig."""

import dataclasses
import importlib
import json

import numba
import numpy as np
import pytest

import blind_documents
from blind.first_rig import write_case
from spa_fo.gap import diagnose_campaign
from spa_fo.gap.claim import claimed as claim
from spa_fo.plant.effects.library import IDS, LIBRARY
from spa_fo.plant.law import PLACES

SEVEN_EACH = {"name": "up_steps", "repeats": 7, "order": "interleaved"}


def written(folder, *effects, seed, size=4.0):
    """Write a case of fourteen up-steps; returns the truth about it."""
    asked = blind_documents.document(*effects, seed=seed, size=size, protocol=SEVEN_EACH)
    return write_case(asked, folder)


def run(folder, out, **options):
    diagnose_campaign(folder / "campaign", folder / "model.json", out, **options)
    return json.loads((out / "diagnosis.json").read_text())


@pytest.fixture(scope="module")
def hysteresis(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hysteresis")
    assert written(folder, "hysteresis", seed=24)["form"] == "b"
    return folder, run(folder, folder / "out")


def check_contract(document):
    assert document["schema"] == "spa-fo/diagnosis/1"
    assert sum(cause["probability"] for cause in document["causes"]) == pytest.approx(1.0)
    sets = [tuple(cause["set"]) for cause in document["causes"]]
    assert {("none",), ("unknown",)} <= set(sets)
    assert len(sets) == len(set(sets))
    assert all(set(ids) <= {*IDS, "none", "unknown"} for ids in sets)
    stages = document["where"]["stage"]
    significant = document["gap"]["significant"]
    if stages is None:
        assert document["where"]["not_known"]
    else:
        assert sum(stages.values()) == pytest.approx(1.0 if significant else 0.0)
    laws = document["laws"]
    assert not laws or document["verdict"]["kind"] == "unknown"
    assert sum(law["probability"] for law in laws) <= 1.0 + 1e-9
    for law in laws:
        assert law["stage"] == PLACES[law["place"]].stage
        assert np.isfinite(law["fraction_closed"])


def test_hysteresis_is_among_the_sets_and_closes_the_gap(hysteresis):
    _, document = hysteresis
    check_contract(document)
    assert ["hysteresis"] in document["verdict"]["sets"]
    assert document["where"]["stage"]["actuator"] > 0.8
    shrink = document["shrink"]
    assert shrink["after_rmse_deg"] < shrink["before_rmse_deg"]
    none = next(cause for cause in document["causes"] if cause["set"] == ["none"])
    assert none["held_out_rmse_deg"] > shrink["after_rmse_deg"]
    low, high = shrink["ci95"]
    assert low <= shrink["fraction_closed"] <= high


def test_trials_that_judge_took_no_part_in_the_fits(tmp_path, monkeypatch):
    written(tmp_path, "hysteresis", seed=24)
    module = importlib.import_module("spa_fo.gap.decide.examine")
    explained, shrunk = module.explain, claim.shrink
    seen = {}

    def watched(bench, *rest):
        seen["fitted"] = bench.evidence.takes_part
        return explained(bench, *rest)

    def measured(everything, held, *rest):
        seen["judged"] = held.trials
        return shrunk(everything, held, *rest)

    monkeypatch.setattr(module, "explain", watched)
    monkeypatch.setattr(claim, "shrink", measured)
    run(tmp_path, tmp_path / "out")
    assert seen["judged"].sum() == 2
    assert not (seen["fitted"] & seen["judged"]).any()
    assert (seen["fitted"] | seen["judged"]).all()


def test_every_parameter_has_an_interval_about_it(hysteresis):
    checked = set()
    for cause in hysteresis[1]["causes"]:
        for name, own in (cause.get("parameters") or {}).items():
            for key, entry in own.items():
                if key == "frequency_hz":
                    continue
                low, high = entry["ci95"]
                assert low <= entry["value"] <= high
                bounds = [(p.low, p.high) for p in LIBRARY[name].parameters if p.name == key]
                assert all(least <= low < high <= most for least, most in bounds)
                checked.add(name)
    assert "hysteresis" in checked


@pytest.mark.parametrize(
    ("effect", "key"), [("parameter_shift", "a0"), ("sensor_slip", "walk_deg")]
)
def test_intervals_hold_what_was_put_in(tmp_path, effect, key):
    truth = written(tmp_path, effect, seed=33, size=6.0)
    assert truth["form"] == "a"
    document = run(tmp_path, tmp_path / "out")
    put_in = truth["parameters"][effect][key]
    found = {tuple(c["set"]): c.get("parameters") for c in document["causes"]}[(effect,)]
    low, high = found[effect][key]["ci95"]
    assert low <= put_in <= high


def test_same_seed_same_answer(hysteresis):
    folder, document = hysteresis
    assert run(folder, folder / "again") == document


def test_any_number_of_processes_gives_the_same_answer(hysteresis):
    folder, document = hysteresis
    usual = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        assert run(folder, folder / "alone") == document
    finally:
        numba.set_num_threads(usual)


def test_without_hysteresis_in_the_library_it_is_never_named(hysteresis):
    folder, _ = hysteresis
    document = run(folder, folder / "without", exclude=["hysteresis"])
    check_contract(document)
    assert not any("hysteresis" in cause["set"] for cause in document["causes"])
    assert document["verdict"]["kind"] == "unknown"
    assert document["laws"][0]["stage"] == "actuator"


def test_a_set_that_closes_nothing_on_held_out_trials_is_no_cause(tmp_path, monkeypatch):
    written(tmp_path, "leak", seed=25)
    module = importlib.import_module("spa_fo.gap.diagnose")
    claimed = module.claim

    def useless(*given):
        found = claimed(*given)
        return dataclasses.replace(found, closed=dict.fromkeys(found.closed, 0.0), unsure={})

    monkeypatch.setattr(module, "claim", useless)
    document = run(tmp_path, tmp_path / "out")
    assert document["verdict"]["kind"] == "unknown"
    assert document["verdict"]["sets"] == []
    assert document["shrink"] is None
    model = json.loads((tmp_path / "out" / "augmented_model.json").read_text())
    assert document["laws"][0]["stage"] == "drive"
    assert [effect["id"] for effect in model["effects"]] == ["law"]


def test_the_augmented_model_holds_the_first_set_and_nothing_else(hysteresis):
    folder, document = hysteresis
    model = json.loads((folder / "out" / "augmented_model.json").read_text())
    assert [effect["id"] for effect in model["effects"]] == document["verdict"]["sets"][0]


def test_no_effect_is_no_gap(tmp_path):
    written(tmp_path, seed=22)
    document = run(tmp_path, tmp_path / "out")
    check_contract(document)
    assert document["verdict"] == {"kind": "no_gap", "sets": [], "next_experiment": None}
    assert document["shrink"] is None
    model = json.loads((tmp_path / "out" / "augmented_model.json").read_text())
    assert model["effects"] == []


def test_leak_is_told_by_the_pressure(tmp_path):
    written(tmp_path, "leak", seed=23)
    document = run(tmp_path, tmp_path / "out")
    assert document["verdict"]["sets"][0] == ["leak"]
    assert document["where"]["stage"]["drive"] > 0.8
