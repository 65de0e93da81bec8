"""Free-form laws found in campaigns whose law is known."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

import blind_documents
import law_cases
import naive_gap
import naive_law
from blind.first_rig import write_case
from spa_fo.cli import main
from spa_fo.gap.data.evidence import collect
from spa_fo.gap.diagnose import diagnose_campaign
from spa_fo.gap.fit.bench import Bench, bench_for
from spa_fo.gap.places.law_basis import Basis, motion_basis, order_basis, relaxation_basis
from spa_fo.gap.places.law_problem import LawFit, LawProblem
from spa_fo.gap.places.laws import bases, drive_law, law_at, place_laws
from spa_fo.gap.places.resemblance import likenesses
from spa_fo.gap.search.fitted import Fitted, fit
from spa_fo.plant import read_model
from spa_fo.plant.effects.library import CONTRACT, LIBRARY
from spa_fo.plant.law import Law, law_of
from spa_fo.rig import CampaignData

NOT_READ = cast(Any, None)
ANGLES = np.linspace(-5.0, 70.0, 16)
CUBIC = Law("moment", ANGLES, -8.0 * (ANGLES / 60.0) ** 3)
CURVE = Law("reading", ANGLES, 8.0 * ANGLES / 60.0 - 8.0 * (ANGLES / 60.0) ** 2)
ORDERS = np.arange(1.0, 10.0)
SOFTER = Law("trial_gain", ORDERS, 0.1 * np.log(ORDERS))
RATES = np.linspace(-60.0, 60.0, 121)
FRICTION = Law("damping", RATES, -3.0 * np.tanh(RATES / 4.0))


def ballooning(kpa: np.ndarray) -> np.ndarray:
    return 30.0 * (kpa / 30.0) ** 1.3


CASES = {
    "input_map": ballooning,
    "moment": CUBIC,
    "reading": CURVE,
    "trial_gain": SOFTER,
    "damping": FRICTION,
}


def prepared(data: CampaignData) -> tuple[Bench, Fitted]:
    """Make a campaign ready as a diagnosis does, with its plain model."""
    bench = bench_for(collect(data), law_cases.X, own=False, pressure_kpa=None)
    plain = fit(bench, (), bench.starts)
    y = plain.predicted_deg
    return bench.with_gap(bench.evidence.grid.angle_deg - y, y), plain


@pytest.fixture(scope="module", params=CASES)
def found(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, list[LawFit]]:
    folder = tmp_path_factory.mktemp("laws") / request.param
    return request.param, place_laws(*prepared(law_cases.write(folder, CASES[request.param])))


@pytest.fixture(scope="module")
def nothing(tmp_path_factory: pytest.TempPathFactory) -> tuple[Bench, Fitted]:
    return prepared(law_cases.write(tmp_path_factory.mktemp("laws") / "none", None))


def test_the_place_is_found(found: tuple[str, list[LawFit]]) -> None:
    place, laws = found
    assert laws[0].basis.place == place
    # Trials that drift are hard to tell from trials that differ.
    sure = place != "trial_gain"
    assert laws[0].probability > (0.8 if sure else 0.3)
    assert laws[0].nats > (20.0 if sure else 3.0)


def without_line(basis: Basis, values: np.ndarray) -> np.ndarray:
    """Take what gain and coefficients do out of a law."""
    return values - basis.taken @ values * basis.line


def test_its_curve_is_the_law(found: tuple[str, list[LawFit]]) -> None:
    place, laws = found
    fitted = laws[0]
    basis = fitted.basis
    if place == "input_map":
        truth = without_line(basis, ballooning(basis.knots))
        # One amplitude for all: the coefficients have taken the rest of the gain.
        truth /= basis.taken @ ballooning(basis.knots)
    else:
        law = CASES[place]
        assert isinstance(law, Law)
        truth = without_line(basis, law.at(basis.knots))
    curve = basis.curve(basis.over)
    missed = curve @ (fitted.e - basis.coefficients(truth))
    size = np.sqrt(np.mean((curve @ basis.coefficients(truth)) ** 2))
    assert np.sqrt(np.mean(missed**2)) < 0.35 * size


FORMS = {
    "input_map": ("power", 1.2, 1.4),
    "moment": ("power", 2.5, 3.6),
    "reading": ("saturation", 80.0, 400.0),
    "trial_gain": ("logarithm", 0.0, 100.0),
    "damping": ("saturation", 0.5, 8.0),
}


def test_its_form_is_named(found: tuple[str, list[LawFit]]) -> None:
    place, laws = found
    form, low, high = FORMS[place]
    found_law = laws[0]
    alike = likenesses(found_law.basis, found_law.e, found_law.covariance)
    named = {like.form: like for like in alike}
    value = next(iter(named[form].parameters.values()))
    assert low <= value <= high
    assert named[form].explains > 0.75


def test_where_there_is_none_none_is_found(nothing: tuple[Bench, Fitted]) -> None:
    assert all(law.nats < 5.0 and law.probability < 0.4 for law in place_laws(*nothing))


def test_a_law_of_no_size_moves_nothing(nothing: tuple[Bench, Fitted]) -> None:
    bench, plain = nothing
    fitted = law_at(bench, plain, "moment")
    assert np.abs(fitted.beside.predicted_deg - plain.predicted_deg).max() < 1.0


def test_trials_that_judge_take_no_part(tmp_path: Path) -> None:
    evidence = collect(law_cases.write(tmp_path / "judged", CUBIC))
    grid = evidence.grid
    part = np.arange(len(grid.trials)) != 4
    angle = np.where(grid.sample_trial == 4, -2.0 * grid.angle_deg, grid.angle_deg)
    bench = bench_for(replace(evidence, takes_part=part), law_cases.X, False, None)
    spoilt = replace(bench.evidence, grid=replace(grid, angle_deg=angle))
    fits = []
    for one in (bench, replace(bench, evidence=spoilt)):
        plain = fit(one, (), one.starts)
        y = plain.predicted_deg
        fits.append(law_at(one.with_gap(one.evidence.grid.angle_deg - y, y), plain, "moment"))
    np.testing.assert_array_equal(fits[0].e, fits[1].e)


# --- numerics, against plain twins ---------------------------------------------------------------


@pytest.fixture
def basis() -> Basis:
    rng = np.random.default_rng(2)
    return motion_basis("moment", rng.uniform(-3.0, 60.0, 400), rng.uniform(0.5, 1.0, 400))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_rounding_visits_is_no_side_of_a_law(side: float) -> None:
    over = side * np.linspace(0.0, 11.0, 215)
    over[:5] = -side * 5e-12
    basis = motion_basis("damping", over, np.ones(over.size))
    assert (side * basis.knots >= 0.0).all()
    assert np.isfinite(basis.shape).all()


def test_a_law_has_no_straight_part(basis: Basis) -> None:
    rng = np.random.default_rng(2)
    over, weight = rng.uniform(-3.0, 60.0, 400), rng.uniform(0.5, 1.0, 400)
    for e in np.eye(basis.size):
        law = basis.law(e)
        assert law.at(np.zeros(1))[0] == pytest.approx(0.0, abs=1e-9)
        assert np.sum(weight * over * law.at(over)) == pytest.approx(0.0, abs=1e-6 * weight.sum())


def test_beforehand_it_is_one_in_size(basis: Basis) -> None:
    e = np.random.default_rng(3).normal(size=(basis.size, 4000))
    drawn = basis.curve(basis.over) @ e
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(1.0, rel=0.03)


def test_what_is_charged_is_its_curvature(basis: Basis) -> None:
    charges = [naive_law.curvature(basis.law(e)) for e in np.eye(basis.size)]
    pairs = [
        naive_law.curvature(basis.law(e)) for e in np.eye(basis.size) + np.eye(basis.size, k=1)
    ]
    np.testing.assert_allclose(charges, charges[0], rtol=1e-3)
    np.testing.assert_allclose(pairs[:-1], 2.0 * charges[0], rtol=1e-3)


def test_a_law_over_the_trials_has_no_mean() -> None:
    made = order_basis("trial_gain", ORDERS)
    assert made is not None
    for e in np.eye(made.size):
        assert made.law(e).at(ORDERS).mean() == pytest.approx(0.0, abs=1e-9)
    assert order_basis("trial_gain", ORDERS[:3]) is None


def test_tangents_are_slopes_of_the_whole_prediction(nothing: tuple[Bench, Fitted]) -> None:
    bench, plain = nothing
    made = next(b for b in bases(bench, plain) if b.place == "moment")
    e = 0.5 * np.ones(made.size)
    problem = LawProblem(bench, plain, made, e, 1.0)
    tangents = problem.tangents(plain.z)
    for k, step in enumerate(0.05 * np.eye(made.size)):
        there, before = (
            LawProblem(bench, plain, made, e + sign * step, 1.0).predict(plain.z)[0]
            for sign in (1.0, -1.0)
        )
        slope = problem.rows.merged((there - before) / 0.1)
        size = np.abs(slope).max()
        np.testing.assert_allclose(tangents[: slope.size, k], slope, atol=0.02 * size)


def test_the_evidence_is_that_of_the_whole_covariance(nothing: tuple[Bench, Fitted]) -> None:
    bench, plain = nothing
    made = next(b for b in bases(bench, plain) if b.place == "input_map")
    problem = LawProblem(bench, plain, made, np.zeros(made.size), 0.5)
    linear = problem.linear(plain.z)
    factor = bench.whitening.factor(1.0, 0.05)
    variances = np.append(plain.variances, 0.25)
    quick, solution, _ = problem.weigh(linear, factor, variances, rounds=0)
    again, _, _ = problem.weigh(linear, factor, np.append(plain.variances, 1e-6), rounds=0)
    whitened = problem.white(factor, np.column_stack([linear.left, linear.columns]))
    left, columns = whitened[:, 0], whitened[:, 1:]
    spread = np.append(np.ones(problem.parameters), problem.spread(variances))
    mean = np.append(np.linalg.solve(problem.root, problem.centre - linear.z), 0.0 * spread[5:])
    less = spread.copy()
    less[-made.size :] = 1e-6

    def slowly(own):
        """With slopes of the prediction beside the nuisances that are most probable."""
        inner = columns.T @ columns + np.diag(1.0 / own[problem.parameters :])
        b = np.linalg.solve(inner, columns.T @ left)
        slopes = problem.white(factor, problem.slopes_beside(linear.z, b) @ problem.root)
        every = np.hstack([slopes, columns])
        return naive_gap.log_evidence(left, np.ones(left.size), every, mean, own)

    slow = [slowly(each) for each in (spread, less)]
    priors = [prior_of(v / s**2) for v, s in zip((0.25, 1e-6), (0.5, 0.5), strict=True)]
    assert quick - again == pytest.approx(slow[0] - slow[1] + priors[0] - priors[1], abs=1e-3)
    assert solution.coefficients.size == spread.size


def prior_of(ratio: float) -> float:
    """Log of a variance's weak prior, of two degrees of freedom."""
    return -2.0 * float(np.log(ratio)) - (1.0 / ratio - 1.0)


def test_a_spectrum_is_never_negative(nothing: tuple[Bench, Fitted]) -> None:
    fitted = law_at(*nothing, "relaxation")
    assert (fitted.law.values >= 0.0).all()


@pytest.mark.parametrize(
    ("values", "form"),
    [
        (np.array([0.0, 1.0, 1.0, 0.0, 0.0, 0.0]), "one time"),
        (np.ones(6), "many times"),
    ],
)
def test_a_spectrum_is_one_time_or_many(values: np.ndarray, form: str) -> None:
    like = likenesses(relaxation_basis(40.0), values, np.eye(6))[0]
    assert like.form == form
    assert 0.3 <= next(iter(like.parameters.values())) <= 40.0


def test_a_drive_that_slews_saturates(tmp_path: Path) -> None:
    asked = blind_documents.document("slew_limit", size=6.0, seed=5)
    truth = write_case(asked, tmp_path)["parameters"]["slew_limit"]
    fitted = drive_law(collect(blind_documents.read(tmp_path / "campaign")), NOT_READ)
    reached = fitted.law.at(np.array([0.7, 0.9]) * fitted.basis.over[-1])
    np.testing.assert_allclose(reached, truth["rate_kpa_s"], rtol=0.1)
    like = likenesses(fitted.basis, fitted.e, fitted.covariance)[0]
    assert like.form == "saturation"


# --- the whole way -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def balloon(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("balloon")
    law_cases.write(folder / "campaign", ballooning)
    law_cases.write_plain(folder / "model.json")
    further = tuple(name for name in LIBRARY if name not in CONTRACT)
    diagnose_campaign(folder / "campaign", folder / "model.json", folder / "out", further)
    return folder, json.loads((folder / "out" / "diagnosis.json").read_text())


def test_an_unknown_cause_has_content(balloon: tuple[Path, dict[str, Any]]) -> None:
    _, document = balloon
    assert document["verdict"]["kind"] == "unknown"
    law = document["laws"][0]
    assert (law["place"], law["stage"]) == ("input_map", "actuator")
    assert law["probability"] > 0.9
    assert law["fraction_closed"] > 0.9
    assert law["resembles"][0]["form"] == "power"
    curve = law["curve"]
    low, value, high = (np.array(curve[name]) for name in ("low", "value", "high"))
    assert ((low <= value) & (value <= high)).all()
    assert max(curve["over"]) == pytest.approx(46.0, abs=0.5)
    sentence = next(text for text in document["findings"] if "free-form law" in text)
    assert "what load a pressure makes" in sentence
    assert "its pressure was not logged" in sentence


def test_the_model_carries_the_law_and_predicts(balloon: tuple[Path, dict[str, Any]]) -> None:
    folder, document = balloon
    assert document["laws"][0]["in_model"]
    model = folder / "out" / "augmented_model.json"
    (effect,) = read_model(model).effects
    assert law_of(effect, "effects[0]", model).place == "input_map"
    out = folder / "predicted.csv"
    assert main(["predict", str(model), str(folder / "campaign"), "--out", str(out)]) == 0
    table = np.genfromtxt(out, delimiter=",", names=True, dtype=None, encoding="utf-8")
    missed = table["angle_deg"] - table["predicted_deg"]
    assert np.sqrt(np.mean(missed**2)) < 0.45


def test_a_law_with_bad_values_takes_one_line(
    balloon: tuple[Path, dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, _ = balloon
    model = json.loads((folder / "out" / "augmented_model.json").read_text())
    model["effects"][0]["parameters"]["values"][2] = "much"
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps(model))
    out = tmp_path / "predicted.csv"
    with pytest.raises(SystemExit) as ended:
        main(["predict", str(bad), str(folder / "campaign"), "--out", str(out)])
    assert ended.value.code == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert "bad.json: effects[0].parameters.values: expected numbers, found 'much'" in text
    assert not out.exists()
