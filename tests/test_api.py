"""The objects of a Python session: what they load, print, draw and refuse."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import campaigns
import spa_fo
from spa_fo import BadInput, Campaign, Diagnosis, FitResult, Model
from spa_fo.api.overview import spark_line
from spa_fo.api.show import card, text_table
from spa_fo.plant.effects.library import IDS

KEPT = ("stiffening", "parameter_shift", "sensor_saturation")
WIDTH = 100


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=3)
    return folder


@pytest.fixture(scope="module")
def campaign(folder: Path) -> Campaign:
    return Campaign.load(folder)


@pytest.fixture(scope="module")
def fit(campaign: Campaign) -> FitResult:
    return campaign.fit()


@pytest.fixture(scope="module")
def diagnosis(campaign: Campaign, fit: FitResult) -> Diagnosis:
    """Of a specimen a tenth softer than the model."""
    document = fit.model.document
    g = document.transfer_function
    softer = type(g)(g.alpha2, g.alpha1, g.a1, g.a0, 1.1 * g.b0)
    model = Model(type(document)("another", "test rubber", softer, document.reference_kpa))
    return model.diagnose(campaign, exclude=[name for name in IDS if name not in KEPT])


class Checker(HTMLParser):
    """Counts tags and refuses what is not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows = 0
        self.words = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.rows += tag == "tr"
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data


def checked(thing: object) -> Checker:
    page = Checker(thing._repr_html_())  # type: ignore[attr-defined]
    assert page.open == []
    return page


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = ("numpy", "numba", "pandas", "control", "matplotlib")
    ask = f"import sys, spa_fo; print([m for m in {heavy} if m in sys.modules])"
    run = subprocess.run([sys.executable, "-c", ask], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_the_package_lists_what_it_offers() -> None:
    for name in spa_fo.__all__:
        assert name in dir(spa_fo)
        assert getattr(spa_fo, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'Campain'"):
        _ = spa_fo.Campain


def test_a_campaign_prints_its_experiments(campaign: Campaign) -> None:
    lines = str(campaign).splitlines()
    assert lines[0] == "test rubber: steps, 6 trials"
    assert lines[1].startswith("synthetic data; tests/campaigns.py")
    assert max(map(len, lines)) <= WIDTH
    row = next(line.split() for line in lines if line.startswith("step_60"))
    assert row[:5] == ["step_60", "step_release", "60°", "3", "1200"]
    page = checked(campaign)
    assert page.rows == 3
    assert "synthetic data" in page.words


def test_a_campaign_says_what_was_read(campaign: Campaign) -> None:
    seen = campaign.overview[1]
    assert (seen.experiment.name, seen.trials, seen.samples) == ("step_60", 3, 1200)
    assert seen.rate_hz == pytest.approx(25.0)
    assert seen.command_kpa == pytest.approx((0.0, 55.1), abs=0.1)
    assert seen.pressure_kpa is None
    low, high = seen.angle_deg
    assert -10.0 < low < 0.0 < 60.0 < high < 75.0
    assert seen.rest_deg is not None
    assert max(map(abs, seen.rest_deg)) < 0.3
    line = next(line for line in str(campaign).splitlines() if "°, at rest" in line)
    assert line.startswith("step_30  ▁") or line.startswith("step_30  ▂")
    assert "█" in line


def test_a_small_line_of_blocks() -> None:
    assert spark_line(np.arange(8.0), 8) == "▁▂▃▄▅▆▇█"
    assert spark_line(np.zeros(100), 5) == "▁▁▁▁▁"
    assert len(spark_line(np.arange(3.0), 40)) == 3


def test_figures_are_saved_twice(campaign: Campaign, fit: FitResult, tmp_path: Path) -> None:
    for thing, stem in ((campaign, "trials"), (fit.model.predict(campaign), "predicted")):
        written = thing.save_figure(tmp_path / f"{stem}.png")
        assert written == (tmp_path / f"{stem}.pdf", tmp_path / f"{stem}.png")
        assert written[1].read_bytes().startswith(b"\x89PNG")


def test_a_campaigns_table_holds_every_sample(campaign: Campaign, tmp_path: Path) -> None:
    table = campaign.table()
    assert len(table) == 6 * 400
    assert table["pressure_kpa"].isna().all()
    assert table["angle_deg"].max() > 55.0
    campaign.save_table(tmp_path / "trials.csv")
    assert len((tmp_path / "trials.csv").read_text().splitlines()) == 6 * 400 + 1


def test_a_fit_prints_values_with_their_uncertainty(fit: FitResult) -> None:
    gain = fit.parameters["K"]
    assert gain.value == pytest.approx(campaigns.TRUTH["b0"] / campaigns.TRUTH["a0"], rel=0.01)
    assert gain.low is not None
    assert gain.low < gain.value
    assert gain.text() in checked(fit).words
    assert checked(fit).rows == 7
    assert "95 % profile-likelihood interval" in checked(fit).words
    value, _, error = gain.text().partition(" ± ")
    line = next(line for line in str(fit).splitlines() if line.startswith("K "))
    assert f"{value}  ± {error}" in line


def test_a_models_file_keeps_what_the_fit_knew(fit: FitResult, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    fit.save(path)
    model = Model.load(path)
    assert model.parameters == fit.parameters
    assert model.provenance.startswith("synthetic data; tests/campaigns.py")
    assert fit.parameters["K"].text() in str(model)
    assert checked(model).rows == 7
    assert model.approximate().filter.sample_time_s == 0.04


def test_a_model_without_uncertainty_says_so(fit: FitResult) -> None:
    bare = Model(replace(fit.model.document, extra={}))
    assert "no uncertainty is known" in str(bare)
    assert "data of unknown provenance" in str(bare)
    assert "±" not in str(bare).splitlines()[-1]
    assert bare.parameters["K"].value == fit.parameters["K"].value


def test_a_step_is_in_degrees_and_scales_with_the_pressure(fit: FitResult) -> None:
    t = np.array([0.0, 1.0, 1e4])
    one = fit.model.step(t)
    assert one[0] == 0.0
    assert one[-1] == pytest.approx(np.degrees(fit.model.gain), rel=1e-3)
    assert fit.model.step(t, pressure_kpa=15.0) == pytest.approx(0.5 * one)


def test_a_prediction_knows_its_error(
    campaign: Campaign, fit: FitResult, folder: Path, tmp_path: Path
) -> None:
    prediction = fit.model.predict(campaign)
    assert prediction.rms_deg == pytest.approx(campaigns.NOISE_DEG, rel=0.1)
    assert fit.model.predict(folder).rms_deg == prediction.rms_deg
    assert f"rms error {prediction.rms_deg:.2f}°, fit {prediction.fit_percent:.1f} %" in str(
        prediction
    )
    assert 95.0 < prediction.fit_percent < 100.0
    assert checked(prediction).rows == 4  # both experiments, and all
    prediction.save(tmp_path / "p.csv")
    assert (tmp_path / "p.csv").read_text().startswith("experiment,trial,t_s,angle_deg,")


def test_a_diagnosis_prints_saves_and_loads(
    diagnosis: Diagnosis, campaign: Campaign, tmp_path: Path
) -> None:
    assert diagnosis.kind == "cause"
    assert diagnosis.causes == (("parameter_shift",),)
    *_, page = diagnosis.save(tmp_path / "d")
    assert page.name == "diagnosis.html"
    again = Diagnosis.load(tmp_path / "d")
    assert str(again) == str(diagnosis)
    assert checked(again).rows >= 4
    assert again.model.transfer_function == diagnosis.model.transfer_function
    with pytest.raises(BadInput, match="holds no curves"):
        again.plot()
    plan = again.plan(campaign, max_duration_s=40.0)
    plan.save(tmp_path / "next.csv")
    assert str(plan).startswith("Nothing is left to separate")
    assert "t_s,cmd_kpa" in (tmp_path / "next.csv").read_text()
    assert checked(plan).rows == 0
    assert isinstance(plan.plot(), Figure)


def test_a_diagnosis_of_another_campaign_plans_nothing(
    diagnosis: Diagnosis, tmp_path: Path
) -> None:
    other = tmp_path / "other"
    other.mkdir()
    campaigns.step_campaign(other, trials=2)
    with pytest.raises(BadInput, match="expected a diagnosis of 'other', found 'steps'"):
        diagnosis.plan(other)


def figures(campaign: Campaign, fit: FitResult, diagnosis: Diagnosis) -> dict[str, Figure]:
    return {
        "trials": campaign.plot(),
        "fit": fit.plot(),
        "profiles": fit.plot("profiles"),
        "model": fit.model.plot(),
        "model on a campaign": fit.model.plot(campaign),
        "prediction": fit.model.predict(campaign).plot(),
        "gap": diagnosis.plot("gap"),
        "export": fit.model.approximate().plot(),
    }


def test_every_figure_carries_its_provenance(
    campaign: Campaign, fit: FitResult, diagnosis: Diagnosis
) -> None:
    for name, figure in figures(campaign, fit, diagnosis).items():
        assert isinstance(figure, Figure), name
        assert "synthetic data" in figure.get_supxlabel(), name


def test_figures_that_there_are_not(campaign: Campaign, fit: FitResult) -> None:
    with pytest.raises(BadInput, match="expected one of trials, found 'calibration'"):
        campaign.plot("calibration")
    with pytest.raises(BadInput, match="expected one of fit, profiles, found 'fits'"):
        fit.plot("fits")


def test_a_fit_of_whole_logs_names_the_kind_of_its_errors(campaign: Campaign) -> None:
    found = campaign.fit(whole_logs=True)
    assert "leaving out one log at a time" in checked(found).words
    assert found.parameters["K"].error is not None
    assert isinstance(found.plot(), Figure)
    with pytest.raises(BadInput, match="expected one of fit, found 'profiles'"):
        found.plot("profiles")


def test_what_is_wrong_is_bad_input(folder: Path, fit: FitResult, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="is not there"):
        Campaign.load(tmp_path / "nowhere")
    with pytest.raises(BadInput, match="cannot be read"):
        Model.load(tmp_path / "model.json")
    with pytest.raises(BadInput, match=r"diagnosis\.json: cannot be read"):
        Diagnosis.load(tmp_path)
    (tmp_path / "diagnosis.json").write_text("{}")
    with pytest.raises(BadInput, match="expected a diagnosis"):
        Diagnosis.load(tmp_path)
    with pytest.raises(BadInput, match="a7 is no parameter"):
        Campaign.load(folder).fit(bounds={"a7": (1.0, 2.0)})
    with pytest.raises(BadInput, match="is 'crep'; did you mean 'creep'"):
        fit.model.diagnose(folder, exclude=["crep"])


def test_html_is_escaped_and_empty_columns_are_left_away() -> None:
    page = card("<b>", ["a & b"], ("one", "two"), [["<i>", ""]], ["<u>"], "<s>")
    assert "<b>" not in page
    assert "<i>" not in page
    assert "&lt;u&gt;" in page
    assert "&lt;s&gt;" in page
    assert "two" not in page
    assert "two" not in text_table(("one", "two"), [["1", ""]])


def test_a_cell_holds_the_first_parameters_and_counts_the_others() -> None:
    from spa_fo.api.diagnosis import _parameters_text

    knots = {f"at_{angle}deg": {"value": 1.0, "ci95": [0.5, 1.5]} for angle in (12, 24, 36, 48, 60)}
    assert _parameters_text({"sensor_nonlinearity": knots}).endswith(", and 2 more")
    assert "more" not in _parameters_text({"sensor_nonlinearity": {"at_12deg": knots["at_12deg"]}})
