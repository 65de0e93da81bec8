"""A static curve beside the linear part: found where it is, not found where it is not."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import campaigns
from identify_cases import TRUTH, trial
from spa_fo.api import Campaign, Model
from spa_fo.cli import main
from spa_fo.errors import BadInput
from spa_fo.fractional import simulate
from spa_fo.identify import fit_whole_logs, log_data, predict_trial
from spa_fo.identify.curve_choice import CurveChoice, choose_curve, parts_of
from spa_fo.identify.curve_report import curve_lines, curve_verdict
from spa_fo.identify.moderate import moderate_optimum
from spa_fo.identify.static_curve import Form, _Problem, fit_form, plain_fit
from spa_fo.plant import Model as Document
from spa_fo.plant import TransferFunction, read_model, write_model
from spa_fo.plant.static_curve import (
    Conditioning,
    MonotoneCurve,
    StaticCurve,
    curve_of,
    integrated_hats,
    level_reached,
)
from spa_fo.rig import Trial

REFERENCE_KPA, RATE_HZ, NOISE_DEG = 30.0, 12.5, 0.3
LEVELS_KPA = (20.0, 8.0, 30.0, 14.0)
"""Highest pressure of each log, not in order."""
BENT = np.array([0.4, 1.0, 1.6])
RISES = MonotoneCurve.normalised(np.array([0.0, 15.0, 30.0]), BENT)
TURNS = MonotoneCurve.normalised(np.array([0.0, 20.0, 40.0]), BENT[::-1])
LEFT = Conditioning(level_kpa=30.0, time_s=10.0, set_deg=6.0, softening=0.3)


def model(curve: StaticCurve | None) -> Document:
    effects = () if curve is None else (curve.to_effect(),)
    g = TransferFunction.from_array(TRUTH)
    return Document("made", "rubber", g, REFERENCE_KPA, effects=effects)


def pulses(top_kpa: float, order: int, curve: StaticCurve | None) -> Trial:
    """Three pulses to a level, of a model with a curve."""
    command = np.tile(np.repeat([0.0, top_kpa, 0.0], [12, 75, 63]), 3)
    one = trial(command, RATE_HZ, TRUTH, experiment=f"pulses_{top_kpa:.0f}", order=order)
    noise = NOISE_DEG * np.random.default_rng(order).standard_normal(command.size)
    return replace(one, angle_deg=predict_trial(model(curve), one) + noise, protocol="free")


def chosen(curve: StaticCurve | None, levels: tuple[float, ...] = LEVELS_KPA) -> CurveChoice:
    trials = [pulses(top, order, curve) for order, top in enumerate(levels, 1)]
    logs = log_data(trials, REFERENCE_KPA)
    return choose_curve(logs, moderate_optimum(lambda box: fit_whole_logs(logs, box)), 30.0)


@pytest.fixture(scope="module")
def before() -> CurveChoice:
    return chosen(StaticCurve("before", RISES))


# What is found.


def test_a_curve_before_is_found(before: CurveChoice) -> None:
    curve = before.curve
    assert curve is not None
    assert curve.position == "before"
    assert before.kept
    assert before.curved_deg == pytest.approx(NOISE_DEG, rel=0.05)
    kpa = np.array([8.0, 14.0, 20.0, 30.0])
    # The curve's average slope is one up to the highest level, which is its last knot here as well.
    np.testing.assert_allclose(curve.curve(kpa), RISES(kpa), atol=0.5)


def test_left_out_levels_say_what_it_gains(before: CurveChoice) -> None:
    assert before.held_out == "level"
    assert [one.logs for one in before.left_out] == [1, 1, 1, 1]
    assert [one.beyond for one in before.left_out] == [False, False, False, True]
    assert before.better == 4
    inside = [one for one in before.left_out if not one.beyond]
    assert all(one.curved_deg < 0.5 * one.plain_deg for one in inside)
    assert before.closed is not None
    assert before.closed > 0.6
    assert before.closed_within is not None
    assert before.closed_within > before.closed
    assert not before.in_order


def test_a_curve_behind_is_found() -> None:
    found = chosen(StaticCurve("behind", TURNS))
    assert found.curve is not None
    assert found.curve.position == "behind"
    assert found.kept
    assert found.curved_deg == pytest.approx(NOISE_DEG, rel=0.05)


def test_none_is_found_where_there_is_none() -> None:
    found = chosen(None)
    assert found.curve is None
    assert not found.kept
    assert found.curved_deg == found.plain_deg
    assert curve_verdict(found).startswith("No static curve: of 12 forms the plain model")


def test_conditioning_is_found_with_the_curve() -> None:
    found = chosen(StaticCurve("before", RISES, LEFT))
    assert found.curve is not None
    effect = found.curve.conditioning
    assert effect is not None
    assert effect.time_s == LEFT.time_s
    # At its level they are as they were made, and both are known to some 10 %.
    assert effect.set_deg == pytest.approx(LEFT.set_deg, rel=0.15)
    assert effect.softening == pytest.approx(LEFT.softening, abs=0.06)


def test_levels_in_order_are_told() -> None:
    found = chosen(StaticCurve("before", RISES), (10.0, 20.0, 30.0))
    assert found.in_order
    assert "these data cannot tell apart" in curve_verdict(found)


def test_one_level_is_left_out_log_by_log() -> None:
    found = chosen(StaticCurve("before", RISES), (30.0, 30.0))
    assert found.held_out == "log"
    assert len(found.left_out) == 2


def test_a_single_log_leaves_nothing_to_judge_by() -> None:
    found = chosen(StaticCurve("before", RISES), (30.0,))
    assert found.held_out == ""
    assert found.left_out == ()
    assert found.closed is None
    assert curve_lines(found)[0].startswith("static curve: ")


def test_a_curve_that_left_out_levels_deny_is_not_taken(before: CurveChoice) -> None:
    worse = replace(
        before,
        left_out=tuple(
            replace(one, plain_deg=one.curved_deg, curved_deg=one.plain_deg)
            for one in before.left_out
        ),
    )
    plain = model(None)
    assert not worse.kept
    assert worse.augment(plain) is plain
    assert "does not hold elsewhere" in curve_verdict(worse)


def test_neighbouring_levels_are_left_out_together() -> None:
    levels = (10.0, 10.5, 20.0, 30.0, 40.0, 55.0, 75.0, 82.0, 100.0)
    logs = log_data([pulses(top, i, None) for i, top in enumerate(levels, 1)], REFERENCE_KPA)
    what, parts = parts_of(logs, REFERENCE_KPA)
    assert what == "level"
    assert len(parts) == 6
    assert parts[0] == ("up to 10.5 kPa", frozenset({0, 1}))
    assert frozenset().union(*(part for _, part in parts)) == frozenset(range(9))


# The curve itself.

slopes = st.lists(st.floats(1e-3, 1e3), min_size=2, max_size=8)
points = st.lists(st.floats(-50.0, 200.0), min_size=2, max_size=40, unique=True)


@settings(deadline=None)
@given(slopes, points)
def test_a_curve_rises_everywhere(steepness: list[float], at: list[float]) -> None:
    knots = np.linspace(0.0, 100.0, len(steepness))
    curve = MonotoneCurve.normalised(knots, np.array(steepness))
    x = np.sort(np.array(at))
    assert np.all(np.diff(curve(x)) >= 0.0)
    assert np.all(curve.slope(x) > 0.0)
    ends = curve(np.array([0.0, 100.0]))
    np.testing.assert_allclose(ends, [0.0, 100.0], atol=1e-9)


def test_hats_are_integrated() -> None:
    knots = np.array([0.0, 1.0, 4.0])
    fine = np.linspace(-2.0, 7.0, 90_001)
    for k, column in enumerate(integrated_hats(knots, fine).T):
        hat = np.interp(fine, knots, np.eye(3)[k])
        step = np.diff(fine) * 0.5 * (hat[1:] + hat[:-1])
        integral = np.concatenate([[0.0], np.cumsum(step)])
        integral -= np.interp(0.0, fine, integral)
        np.testing.assert_allclose(column, integral, atol=1e-6)


def test_a_level_follows_up_and_never_down() -> None:
    t = np.arange(0.0, 40.0, 0.01)
    level = np.where(t < 20.0, 2.0, 1.0)
    reached = level_reached(t, level, 5.0)
    early = t < 20.0
    np.testing.assert_allclose(reached[early], 2.0 * -np.expm1(-t[early] / 5.0), atol=1e-9)
    np.testing.assert_allclose(reached[~early], reached[~early][0])


@pytest.mark.parametrize("position", ["before", "behind", None])
def test_the_jacobian_is_that_of_the_residuals(position: str | None) -> None:
    logs = log_data([pulses(20.0, 1, StaticCurve("before", RISES))], REFERENCE_KPA)
    plain = fit_whole_logs(logs)
    form = Form(position, 3 if position else 0, 5.0)
    problem = _Problem(logs, form, plain.bounds)
    q = problem.start(plain_fit(logs, plain))
    q[0] = 0.4
    q[5:] = np.linspace(0.3, 0.1, q.size - 5)
    exact = problem.jacobian(q)
    for i in range(q.size):
        step = np.zeros(q.size)
        step[i] = 1e-6
        slope = (problem.residual(q + step) - problem.residual(q - step)) / 2e-6
        np.testing.assert_allclose(exact[:, i], slope, atol=2e-5 * np.abs(slope).max() + 1e-7)


def test_a_form_without_curve_and_conditioning_is_the_plain_fit() -> None:
    logs = log_data([pulses(20.0, 1, None)], REFERENCE_KPA)
    plain = fit_whole_logs(logs)
    fit = fit_form(logs, Form(), plain.bounds, plain_fit(logs, plain))
    assert fit.squares == pytest.approx(plain.sum_squares, rel=1e-6)


# Its file, and what it predicts.

CURVES = (
    StaticCurve("before", RISES),
    StaticCurve("behind", TURNS),
    StaticCurve("before", RISES, LEFT),
)


@pytest.mark.parametrize("curve", CURVES, ids=["before", "behind", "conditioned"])
def test_a_curve_comes_back_from_its_file(curve: StaticCurve, tmp_path: Path) -> None:
    write_model(tmp_path / "model.json", model(curve))
    back = curve_of(read_model(tmp_path / "model.json"))
    assert back is not None
    assert back.to_effect() == curve.to_effect()
    one = trial(np.repeat([0.0, 25.0, 0.0], 50), RATE_HZ)
    np.testing.assert_array_equal(
        predict_trial(read_model(tmp_path / "model.json"), one), predict_trial(model(curve), one)
    )


def test_a_curve_is_where_it_says() -> None:
    command = np.repeat([0.0, 25.0, 10.0], 50)
    one = trial(command, RATE_HZ)
    bent = simulate(one.t_s, RISES(command) / REFERENCE_KPA, *TRUTH, hold="zero")
    found = predict_trial(model(StaticCurve("before", RISES)), one)
    np.testing.assert_allclose(found, np.degrees(bent))
    straight = predict_trial(model(None), one)
    behind = predict_trial(model(StaticCurve("behind", TURNS)), one)
    np.testing.assert_allclose(behind, TURNS(straight))


def test_what_was_fitted_is_what_is_predicted(before: CurveChoice) -> None:
    augmented = before.augment(model(None))
    missed = []
    for order, top in enumerate(LEVELS_KPA, 1):
        one = pulses(top, order, StaticCurve("before", RISES))
        missed.append(one.angle_deg - predict_trial(augmented, one))
    rms = float(np.sqrt(np.mean(np.square(missed))))
    assert rms == pytest.approx(before.curved_deg, rel=1e-3)


GOOD = StaticCurve("before", RISES, LEFT).to_effect()["parameters"]


@pytest.mark.parametrize(
    ("change", "where"),
    [
        ({"position": "beside"}, "position: expected one of before, behind, found 'beside'"),
        ({"slope": 1.0}, "slope: is no parameter of static_curve; did you mean 'slopes'?"),
        ({"slopes": [1.0, 1.0]}, "slopes: expected 3 positive numbers, one a knot"),
        ({"slopes": [1.0, -1.0, 1.0]}, "slopes: expected 3 positive numbers, one a knot"),
        ({"slopes": [1.0, True, 1.0]}, "slopes: expected finite numbers, found True"),
        ({"slopes": 1.0}, "slopes: expected a list of numbers"),
        ({"knots_kpa": [0.0, 9.0, 9.0]}, "knots_kpa: expected two knots or more that rise from 0"),
        ({"conditioning": {"time_s": 3.0}}, "conditioning: expected an object with level_kpa"),
        (
            {"conditioning": {**GOOD["conditioning"], "time_s": 0.0}},
            "time_s: expected a positive number, found 0",
        ),
    ],
)
def test_a_bad_curve_names_the_key(change: Mapping[str, Any], where: str) -> None:
    effect = {"id": "static_curve", "stage": "actuator", "parameters": {**GOOD, **change}}
    with pytest.raises(BadInput, match=r"model\.json") as refusal:
        curve_of(replace(model(None), effects=(effect,)), "model.json")
    assert where in str(refusal.value)


def test_a_curve_stands_alone_and_in_its_stage() -> None:
    effect = StaticCurve("before", RISES).to_effect()
    creep = {"id": "creep", "stage": "actuator", "parameters": {}}
    with pytest.raises(BadInput, match="stand alone"):
        curve_of(replace(model(None), effects=(effect, creep)))
    with pytest.raises(BadInput, match="belongs to the actuator"):
        curve_of(replace(model(None), effects=({**effect, "stage": "sensor"},)))


# The commands.


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign of csv logs with a curve before the linear part."""
    place = tmp_path_factory.mktemp("curve") / "arm"
    place.mkdir()
    experiments = []
    for order, top in enumerate(LEVELS_KPA, 1):
        one = pulses(top, order, StaticCurve("before", RISES))
        assert one.command_kpa is not None
        columns = zip(one.t_s, one.command_kpa, one.angle_deg, strict=True)
        rows = [f"{t:.4f},{u:.3f},{y:.4f}" for t, u, y in columns]
        file = f"pulses_{top:.0f}.csv"
        (place / file).write_text("t,command,angle\n" + "\n".join(rows) + "\n")
        trials = [{"file": file, "order": order, "started_s": 100.0 * order}]
        experiments.append({"name": file[:-4], "protocol": "free", "trials": trials})
    campaigns.write_yaml(place, campaigns.document("arm", experiments))
    campaigns.write_sums(place)
    return place


@pytest.fixture(scope="module")
def curved(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the model that the Python interface saves, and its report."""
    out = tmp_path_factory.mktemp("model") / "curved.json"
    result = Campaign.load(folder).fit(static_curve=True)
    result.save(out)
    return out, str(result)


def test_the_report_says_what_the_curve_gains(curved: tuple[Path, str]) -> None:
    _, report = curved
    assert "static curve: curve before" in report
    assert "fitted logs: rms" in report
    assert "up to 30 kPa (beyond the others)" in report
    assert "The model file holds the curve: on left-out levels it closes" in report


def test_the_file_holds_curve_and_evidence(curved: tuple[Path, str]) -> None:
    document = json.loads(curved[0].read_text())
    (effect,) = document["effects"]
    assert effect["id"] == "static_curve"
    assert document["static_curve"]["kept"]
    assert len(document["static_curve"]["left_out"]) == 4
    assert document["static_curve"]["squared_error_closed"] > 0.6


def test_the_command_predicts_with_the_curve(
    curved: tuple[Path, str], folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "prediction.csv"
    assert main(["predict", str(curved[0]), str(folder), "--out", str(out)]) == 0
    assert "with static_curve" in capsys.readouterr().out
    assert Model.load(curved[0]).predict(folder).rms_deg == pytest.approx(NOISE_DEG, rel=0.05)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("export {model} --to csv", "holds static_curve, which no linear model can hold"),
        ("diagnose {arm} --model {model} --out {new}", "expected a plain model"),
        ("predict {bad} {arm} --out {new}", "slopes: expected"),
    ],
)
def test_a_command_that_cannot_use_it_says_so_in_one_line(
    command: str,
    words: str,
    curved: tuple[Path, str],
    folder: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    document = json.loads(curved[0].read_text())
    document["effects"][0]["parameters"]["slopes"] = [1.0]
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps(document))
    places = {"model": curved[0], "arm": folder, "new": tmp_path / "new", "bad": bad}
    with pytest.raises(SystemExit) as leaving:
        main(command.format(**places).split())
    assert leaving.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert not places["new"].exists()


def test_a_pump_has_a_curve_of_its_own(tmp_path: Path) -> None:
    """A pump whose pressure rises with the square of its PWM, in half a second."""
    arm = tmp_path / "pump"
    arm.mkdir()
    experiments = []
    for order, top in enumerate((60.0, 100.0, 40.0, 80.0), 1):
        pwm = np.tile(np.repeat([0.0, top, 0.0], [12, 60, 48]), 2)
        t = np.arange(pwm.size) / RATE_HZ
        noise = np.random.default_rng(order).normal(0.0, 0.1, (2, t.size))
        kpa = simulate(t, 40.0 * (pwm / 100.0) ** 2, 1.02, 1.0, 1e-3, 2.0, 2.0, hold="zero")
        angle = np.degrees(simulate(t, kpa / REFERENCE_KPA, *TRUTH))
        columns = zip(t, pwm, kpa + noise[0], angle + noise[1], strict=True)
        rows = [",".join(f"{value:.4f}" for value in row) for row in columns]
        file = f"pwm_{top:.0f}.csv"
        (arm / file).write_text("t,command,pressure,angle\n" + "\n".join(rows) + "\n")
        trials = [{"file": file, "order": order, "started_s": 100.0 * order}]
        experiments.append({"name": file[:-4], "protocol": "free", "trials": trials})
    document = campaigns.document("pump", experiments)
    document["log"]["columns"]["command"]["unit"] = "1"
    document["log"]["columns"]["pressure"] = {"column": "pressure", "unit": "kPa"}
    campaigns.write_yaml(arm, document)
    campaigns.write_sums(arm)
    result = Campaign.load(arm).fit(static_curve=True, input="pressure")
    drive = result.result.drive
    assert drive is not None
    assert drive.curve is not None
    assert drive.curve.position == "before"
    assert drive.rise_s == pytest.approx(0.5, abs=0.06)
    pwm = np.array([40.0, 60.0, 80.0])
    np.testing.assert_allclose(drive.curve.curve(pwm), pwm**2 / 100.0, atol=2.0)
    entry = result.model.document.extra["drive"]
    assert entry["output"] == {"unit": "kPa"}
    gain = entry["transfer_function"]["b0"] / entry["transfer_function"]["a0"]
    assert gain == pytest.approx(40.0, rel=0.03)
    assert "drive: the command is no pressure; curve before" in str(result)
    # The angle is linear in the pressure: no curve of the actuator's own.
    assert result.result.curve is not None
    assert not result.result.curve.kept


def test_vacuum_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arm = tmp_path / "arm"
    arm.mkdir()
    campaigns.free_campaign(arm, trials=2, sign=-1.0)
    out = tmp_path / "new.json"
    with pytest.raises(SystemExit) as leaving:
        main(["fit", str(arm), "--static-curve", "--out", str(out)])
    assert leaving.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "a static curve: expected an input and an angle that rise above 0" in line
    assert not out.exists()
