"""Blind cases: sizes as ordered, labels sealed, nothing of them in what is handed out."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from blind.cases import (
    build,
    build_continuation,
    check_seals,
    label_bytes,
    main,
    model_document,
    plan_cases,
    seal,
    write_cases,
)
from blind.equivalents import CONFOUNDED, REASONS, confounded, equivalents
from blind.first_rig.build import BuiltCase, Case, plan_campaign, plan_continuation
from blind.first_rig.doses import FORMS
from blind.first_rig.foreign_effects import ALIENS
from blind.first_rig.sizing import Scale, exact_reading, noise_floor_deg, rms, solve
from spa_fo.errors import BadInput
from spa_fo.plant.model_file import read_model
from spa_fo.rig.campaign import read_campaign
from spa_fo.rig.trials import read_trials
from spa_fo.virtual_rig.campaign_writer import campaign_files, write_folder

CASE = Case("case_0001", 11, "closed", ("creep",), "a", (4.0,))


@cache
def built(case: Case) -> BuiltCase:
    return BuiltCase(case)


def closed(effect, form="a", size=4.0, protocol="rich", seed=11):
    return Case("case_0001", seed, "closed", (effect,), form, (size,), protocol)


# --- sizes --------------------------------------------------------------------------------------


def test_the_solver_finds_the_size_or_the_end():
    assert solve(lambda x: (x**2, True), 9.0, 0.1, 100.0).amplitude == pytest.approx(3.0, rel=0.02)
    saturating = solve(lambda x: (x / (1.0 + x), True), 5.0, 0.1, 100.0)
    assert (saturating.amplitude, saturating.size) == (100.0, 100.0 / 101.0)
    barred = solve(lambda x: (x, x <= 2.0), 5.0, 0.1, 100.0)
    assert 1.95 < barred.amplitude <= 2.0


@pytest.mark.parametrize(("protocol", "every"), [("rich", 2), ("up_steps", 5)])
def test_sizes_come_out_as_ordered(protocol, every):
    for i, effect in list(enumerate(FORMS["a"]))[::every]:
        form, size = "ab"[i // every % 2], (1.0, 4.0, 8.0)[i % 3]
        (reached,) = built(closed(effect, form, size, protocol, seed=i)).label["sizes_reached"]
        assert reached == pytest.approx(size, rel=0.1), (effect, form)


@pytest.mark.parametrize(
    ("effect", "form"), [("dead_time", "b"), ("sensor_slip", "a"), ("mullins_softening", "b")]
)
def test_a_size_is_that_of_the_fine_simulation_as_well(effect, form):
    it = built(closed(effect, form))
    bare = replace(it.plan, specimen=it.plan.specimen.with_effect(effect, None))
    with_it, without = (exact_reading(plan, 11, 1000.0).angle_deg for plan in (it.plan, bare))
    floor = it.label["noise_floor_deg"]
    assert rms(with_it - without) / floor == pytest.approx(4.0, rel=0.1)


def test_the_noise_floor_is_what_repeated_trials_differ_by(tmp_path):
    plan = built(Case("case_0001", 3, protocol="up_steps")).plan
    step_60 = plan.experiments[1]
    plan = replace(plan, experiments=(step_60,), order=("step_60",) * 60, rest_s=20.0)
    write_folder(campaign_files(plan, 3), tmp_path / "case")
    grid = np.arange(0.1, 11.3, 0.02)
    trials = read_trials(read_campaign(tmp_path / "case")).trials
    angles = np.array([np.interp(grid, trial.t_s, trial.angle_deg) for trial in trials])
    apart = np.sqrt(angles.var(axis=0, ddof=1).mean())
    assert apart == pytest.approx(noise_floor_deg(plan, 3), rel=0.12)


def test_amplitudes_stop_where_the_fixture_ends():
    it = built(closed("parameter_shift", size=60.0))
    assert it.label["sizes_reached"][0] < 60.0
    assert exact_reading(it.plan, 11).angle_deg.max() <= 86.0


# --- what is handed out -------------------------------------------------------------------------


def test_nothing_handed_out_tells_of_the_label():
    told = {"closed", "withheld", "alien", "pair", "no_effect", "effect", "form", "size", "seed"}
    words = [rf"\b{word}\b".encode() for word in {*FORMS["a"], *ALIENS, *told}]
    case = closed("sensor_slip")
    for files in (built(case).campaign, built(case).later):
        for name, data in files.items():
            assert name.split("/")[0].split("_")[0] not in ("sensor", "slip")
            assert not [word for word in words if re.search(word, data)], name
    text = json.dumps(model_document(case))
    assert json.loads(text)["effects"] == []
    assert "sensor" not in text


def test_the_cause_changes_what_it_acts_on_and_nothing_else():
    plain = built(Case("case_0001", 11)).campaign
    slipped = built(closed("sensor_slip")).campaign
    assert slipped.keys() == plain.keys()
    assert slipped["campaign.yaml"] == plain["campaign.yaml"]
    name = "step_60/trial_03.log"
    columns = [
        np.array([line.split(b"*")[0].split(b",") for line in files[name].splitlines()[20:60]])
        for files in (plain, slipped)
    ]
    np.testing.assert_array_equal(columns[0][:, :4], columns[1][:, :4])
    assert np.any(columns[0][:, 4] != columns[1][:, 4])


def test_the_protocols_are_as_described():
    rich = built(CASE).campaign
    assert {"calibration/pre.log", "calibration/post.log"} <= rich.keys()
    seconds = sum(data.count(b"\n") for name, data in rich.items() if "trial" in name) / 50.0
    assert 400 < seconds < 500
    steps = build(Case("case_0002", 3, protocol="up_steps"))[0]
    assert "calibration/post.log" not in steps
    assert sorted(name.split("/")[0] for name in steps if "trial" in name) == (
        ["step_30"] * 7 + ["step_60"] * 7
    )
    cases = [Case("case_0001", seed, protocol="up_steps") for seed in range(40)]
    orders = [plan_campaign(case).order for case in cases]
    assert 10 < sum(order == tuple(sorted(order)) for order in orders) < 30


def test_the_model_is_the_bare_core(tmp_path):
    path = tmp_path / "model.json"
    path.write_text(json.dumps(model_document(CASE)))
    model = read_model(path)
    assert (model.campaign, model.effects, model.reference_kpa) == ("nominal", (), 30.0)
    assert vars(built(CASE).core) == {
        name: getattr(model.transfer_function, name)
        for name in ("alpha2", "alpha1", "a1", "a0", "b0")
    }
    shifted = closed("parameter_shift")
    assert model_document(shifted) == model_document(CASE)
    assert built(shifted).plan.specimen.actuator.core == built(CASE).core


def test_cases_that_cannot_be_are_refused():
    for wrong in (
        {"kind": "pair"},
        {"effects": ("ghost",)},
        {"kind": "no_effect"},
        {"sizes": (1.0, 2.0)},
        {"kind": "alien"},
        {"kind": "strange"},
        {"form": "c"},
        {"protocol": "steps"},
        {"model": "own"},
    ):
        with pytest.raises(ValueError, match=r"case(?: of kind|'s \w+ is one of)"):
            replace(CASE, **wrong)


# --- the continuation ---------------------------------------------------------------------------


def test_the_continuation_goes_on_counting(tmp_path):
    for name, files in (("now", built(CASE).campaign), ("later", built(CASE).later)):
        write_folder(files, tmp_path / name)
    now, later = read_campaign(tmp_path / "now"), read_campaign(tmp_path / "later")
    assert later.continues == now.name
    assert later.calibration[0].started_s == now.calibration[0].started_s
    assert len(later.calibration) == 1
    assert built(CASE).later["calibration/pre.log"] == built(CASE).campaign["calibration/pre.log"]
    before = [trial for _, _, trial in now.trial_files()]
    after = [trial for _, _, trial in later.trial_files()]
    assert min(trial.order for trial in after) == max(trial.order for trial in before) + 1
    assert min(t.started_s for t in after) > now.calibration[-1].started_s + 60.0
    assert len(read_trials(later).trials) == 6


def test_the_continuation_carries_the_state_on():
    it = built(closed("mullins_softening", size=8.0))
    alone = campaign_files(plan_continuation(it.case, it.plan), 11)
    name = "step_45/trial_01.log"

    def top(files):
        rows = [line.split(b"*")[0].split(b",") for line in files[name].splitlines()[300:500]]
        return np.mean([float(row[4]) for row in rows if len(row) == 5])

    # A specimen that starts anew is stiffer.
    assert top(it.later) > top(alone) + 5.0


def test_the_continuation_is_made_by_the_case_alone():
    assert build_continuation(CASE) == built(CASE).later


# --- labels, seals, files -----------------------------------------------------------------------


def test_labels_say_what_is_known():
    label = built(CASE).label
    assert label["effects"] == ["creep"]
    assert set(label["parameters"]) == {"creep"}
    assert label["parameters"]["creep"]["fraction"] > 0
    withheld = BuiltCase(replace(CASE, kind="withheld", exclude=("creep",)))
    assert withheld.label["equivalents"] == ["sensor_creep"]
    assert withheld.campaign == built(CASE).campaign
    strange = Case("case_0001", 5, "alien", ("valve_cracking",), "a", (4.0,), "up_steps")
    assert BuiltCase(strange).label["equivalents"] == ["drive_backlash"]


def test_equivalents_are_effects_of_the_library_and_have_reasons():
    named = set().union(*CONFOUNDED)
    assert named == set(REASONS)
    assert named <= set(FORMS["a"])
    for one in FORMS["a"]:
        for other in equivalents(one):
            assert one != other
            assert confounded(one, other)
            assert one in equivalents(other)
    assert {name for it in ALIENS.values() for name in it.equivalents} <= set(FORMS["a"])


def test_a_pair_has_both_effects_each_in_its_size():
    case = Case("case_0001", 4, "pair", ("leak", "sensor_lag"), "b", (3.0, 6.0))
    it = BuiltCase(case)
    present = {name for name, effect in it.plan.specimen.effects().items() if effect is not None}
    assert present == {"leak", "sensor_lag"}
    assert it.label["sizes_reached"] == pytest.approx([3.0, 6.0], rel=0.1)
    assert 3.0 < it.label["joint_size"] < 9.5


def test_same_case_same_bytes_and_another_seed_others():
    again = BuiltCase(CASE)
    assert again.campaign == built(CASE).campaign
    assert again.label == built(CASE).label
    other = BuiltCase(replace(CASE, seed=12))
    assert all(
        other.campaign[name] != again.campaign[name] for name in again.campaign if "/" in name
    )


def test_seals_hold_one_label_and_no_other(tmp_path):
    folder, labels = tmp_path / "cases", tmp_path / "labels"
    cases = [replace(CASE, protocol="up_steps"), Case("case_0002", 2, protocol="up_steps")]
    write_cases(cases[:1], folder, labels)
    write_cases(cases[1:], folder, labels)
    lines = (folder / "seals.txt").read_text().splitlines()
    assert [line.split("  ")[1] for line in lines] == ["case_0001", "case_0002"]
    check_seals(folder / "seals.txt", labels)
    files = sorted(path.name for path in (folder / "case_0001").iterdir())
    assert files == ["campaign", "exclude.txt", "later", "model.json"]
    with pytest.raises(BadInput, match="exists already"):
        write_cases(cases[:1], folder, labels)

    path = labels / "case_0002.json"
    label = json.loads(path.read_text())
    salt = label.pop("salt")
    assert len(salt) == 32
    assert lines[1].startswith(seal(label_bytes(label, salt)))
    path.write_bytes(label_bytes({**label, "effects": ["creep"]}, salt))
    with pytest.raises(BadInput, match="not the label"):
        check_seals(folder / "seals.txt", labels)
    path.unlink()
    with pytest.raises(BadInput, match="is missing"):
        check_seals(folder / "seals.txt", labels)


# --- the plan and the command -------------------------------------------------------------------

PLAN = {
    "seed": 5,
    "closed": {"rich": 1, "up_steps": 2, "sizes": [2, 4]},
    "withheld": {"rich": 1, "sizes": [4]},
    "alien": {"rich": 1, "up_steps": 1, "sizes": [8]},
    "no_effect": {"rich": 7, "up_steps": 3},
    "pair": {"rich": 40},
    "own_fit": 0.5,
}


def test_the_plan_has_the_cases_that_are_asked():
    cases = plan_cases(PLAN)
    counts = {kind: sum(case.kind == kind for case in cases) for kind in {c.kind for c in cases}}
    assert counts == {
        "closed": 22 * 2 * 2 * 3,
        "withheld": 22 * 2,
        "alien": 8 + 7,
        "no_effect": 10,
        "pair": 40,
    }
    assert [case.name for case in cases[:2]] == ["case_0001", "case_0002"]
    assert len({case.seed for case in cases}) == len(cases)
    assert plan_cases(PLAN) == cases
    assert plan_cases({**PLAN, "seed": 6}) != cases
    assert all(case.exclude == case.effects for case in cases if case.kind == "withheld")
    own = [case for case in cases if case.model == "own_fit"]
    assert 0.4 < len(own) / len(cases) < 0.55
    assert not [case for case in own if "parameter_shift" in case.effects]
    kinds = [case.kind for case in cases]
    assert kinds != sorted(kinds)
    for case in cases:
        if case.kind == "pair":
            assert not confounded(*case.effects)
            assert all(2.0 <= size <= 8.0 for size in case.sizes)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"clsed": {}}, "clsed"),
        ({"closed": {"rihc": 1}}, "closed.rihc"),
        ({"closed": {"rich": -1}}, "closed.rich"),
        ({"closed": {"sizes": [0]}}, "closed.sizes"),
        ({"closed": 3}, "closed"),
        ({"forms": ["c"]}, "forms"),
        ({"own_fit": 2}, "own_fit"),
        ({"seed": "one"}, "seed"),
    ],
)
def test_a_wrong_plan_is_refused_by_name(change, named):
    with pytest.raises(ValueError, match=rf"^{named}: expected"):
        plan_cases({**PLAN, **change})


def test_the_command_writes_a_plan_with_any_number_of_workers(tmp_path, capsys):
    plan = tmp_path / "plan.yaml"
    plan.write_text("seed: 3\nno_effect: {up_steps: 2}\n")
    one, two = tmp_path / "one", tmp_path / "two"
    assert main(["--out", str(one), "--plan", str(plan)]) == 0
    assert main(["--out", str(two), "--plan", str(plan), "--workers", "2"]) == 0
    written = [
        {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}
        for out in (one, two)
    ]
    assert written[0] == written[1]
    assert len(written[0]) > 2 * 20
    plan.write_text("sede: 3\n")
    assert main(["--out", str(tmp_path / "three"), "--plan", str(plan)]) == 2
    assert "plan.yaml: sede: expected one of" in capsys.readouterr().err
    assert not (tmp_path / "three").exists()


def test_the_command_writes_a_single_case(tmp_path):
    order = ["--effect", "leak", "--kind", "withheld", "--size", "2", "--protocol", "up_steps"]
    assert main(["--out", str(tmp_path), "--model", "own_fit", *order]) == 0
    assert (tmp_path / "case_0001" / "exclude.txt").read_text() == "leak\n"
    assert not (tmp_path / "case_0001" / "model.json").exists()
    label = json.loads((tmp_path / "labels" / "case_0001.json").read_text())
    assert (label["kind"], label["effects"], label["sizes"]) == ("withheld", ["leak"], [2.0])
    with pytest.raises(SystemExit):
        main(["--out", str(tmp_path), "--effect", "ghost"])


def test_a_heavier_effect_weighs_more():
    bare = built(Case("case_0001", 11)).plan
    scale = Scale(bare, 11)
    assert scale.weigh(bare.specimen) == (0.0, True)
    assert scale.floor_deg == pytest.approx(built(CASE).label["noise_floor_deg"])
