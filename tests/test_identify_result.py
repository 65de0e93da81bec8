from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import campaigns
import plant_cases
from identify_cases import TRUTH, step_command, steps, trial
from spa_fo import step_response
from spa_fo.errors import BadInput
from spa_fo.gap.data.searched import at_rate
from spa_fo.identify import FitResult, fit_campaign, fit_optimum, predict_campaign
from spa_fo.identify.fit_report import strong_correlations
from spa_fo.identify.uncertainty import assess
from spa_fo.plant import Model, TransferFunction
from spa_fo.rig import CampaignData, read_campaign, read_trials

WIDTH = 96


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> CampaignData:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder)
    return read_trials(read_campaign(folder))


@pytest.fixture(scope="module")
def result(data: CampaignData) -> FitResult:
    return fit_campaign(data, bootstrap=50)


def test_the_fit_meets_its_trials(result: FitResult) -> None:
    truth = campaigns.TRUTH["b0"] / campaigns.TRUTH["a0"]
    assert result.gain == pytest.approx(truth, rel=0.01)
    assert result.fitted_on == "up-steps"
    assert result.datasets == 8
    assert result.samples == 400
    for error in result.errors:
        assert error.rms_deg < campaigns.NOISE_DEG
        assert error.each_trial_deg == pytest.approx(campaigns.NOISE_DEG, rel=0.25)
        assert error.percent == pytest.approx(100 * error.rms_deg / error.setpoint_deg)


def test_the_order_of_trials_does_not_matter(data: CampaignData, result: FitResult) -> None:
    turned = fit_campaign(replace(data, trials=data.trials[::-1]), bootstrap=0)
    assert turned.gain == pytest.approx(result.gain, rel=1e-6)
    assert turned.optimum.rmse == pytest.approx(result.optimum.rmse, rel=1e-9)


def test_a_fit_may_leave_out_how_certain_it_is(data: CampaignData, result: FitResult) -> None:
    bare = fit_campaign(data, bootstrap=None)
    assert bare.uncertainty is None
    assert bare.model.transfer_function == result.model.transfer_function
    assert "alpha2" in bare.report()


def test_the_report_fits_on_a_screen_and_says_it_all(result: FitResult) -> None:
    text = result.report()
    lines = text.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= WIDTH + 4
    for word in (
        "alpha2",
        "alpha1",
        "a1",
        "a0",
        "b0",
        "K",
        "χ²/dof",
        "rms",
        "valid yes",
        "synthetic",
    ):
        assert word in text
    assert "these data do not determine" in text
    assert f"{result.gain:.4f}" in text


def test_the_report_lists_correlations_strongest_first() -> None:
    data = steps(3, seed=1)
    found = strong_correlations(assess(data, fit_optimum(data), bootstrap=0))
    sizes = [abs(value) for _, _, value in found]
    assert sizes == sorted(sizes, reverse=True)
    assert all(size > 0.9 for size in sizes)


def test_the_dictionary_is_strict_json(result: FitResult) -> None:
    text = json.dumps(result.to_dict(), allow_nan=False)
    document = json.loads(text)
    assert document["model"]["schema"] == "spa-fo/model/1"
    assert [p["name"] for p in document["uncertainty"]["profiles"]][-1] == "K"
    assert document["uncertainty"]["bootstrap"]["resamples"] == 50


def test_the_same_seed_gives_the_same_document(data: CampaignData, result: FitResult) -> None:
    assert fit_campaign(data, bootstrap=50).to_dict() == result.to_dict()


def test_whole_logs_on_request(data: CampaignData) -> None:
    found = fit_campaign(data, whole_logs=True)
    assert found.fitted_on == "whole logs"
    assert found.uncertainty is None
    assert found.gain == pytest.approx(campaigns.TRUTH["b0"] / campaigns.TRUTH["a0"], rel=0.01)
    assert "whole logs" in found.report()
    json.dumps(found.to_dict(), allow_nan=False)


@pytest.mark.parametrize("whole_logs", [False, True])
def test_an_angle_that_does_not_rise_is_refused(data: CampaignData, whole_logs: bool) -> None:
    turned = tuple(replace(t, angle_deg=-t.angle_deg) for t in data.trials)
    with pytest.raises(BadInput, match="expected an angle that rises with the input") as refused:
        fit_campaign(replace(data, trials=turned), bootstrap=0, whole_logs=whole_logs)
    assert "log.columns.angle.scale: -1" in str(refused.value)


@pytest.mark.parametrize("whole_logs", [False, True])
def test_an_angle_that_never_moves_is_refused(data: CampaignData, whole_logs: bool) -> None:
    still = tuple(replace(t, angle_deg=0.0 * t.angle_deg) for t in data.trials)
    with pytest.raises(BadInput, match="the angle does not move in any trial"):
        fit_campaign(replace(data, trials=still), bootstrap=0, whole_logs=whole_logs)


def test_no_pressure_to_fit(data: CampaignData) -> None:
    bare = replace(data, trials=tuple(replace(t, pressure_kpa=None) for t in data.trials))
    with pytest.raises(BadInput, match="pressure"):
        fit_campaign(bare, signal="pressure")


def test_a_model_of_the_pressure_needs_a_pressure(data: CampaignData) -> None:
    model = Model("a", "b", TransferFunction(**campaigns.TRUTH), 30.0, signal="pressure")
    bare = replace(data, trials=tuple(replace(t, pressure_kpa=None) for t in data.trials))
    with pytest.raises(BadInput, match="pressure column") as refused:
        predict_campaign(model, bare)
    assert refused.value.path == next(data.campaign.trial_files())[2].path


def test_prediction_has_a_row_for_every_sample(data: CampaignData, result: FitResult) -> None:
    table = predict_campaign(result.model, data)
    assert len(table) == sum(trial.t_s.size for trial in data.trials)
    error = table["angle_deg"] - table["predicted_deg"]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(campaigns.NOISE_DEG, rel=0.1)


def test_a_stiff_gap_is_named(tmp_path: Path, data: CampaignData) -> None:
    bent = tuple(
        replace(t, angle_deg=t.angle_deg * (1 + (t.angle_deg / 60.0))) for t in data.trials
    )
    assert any("its form" in text for text in fit_campaign(replace(data, trials=bent)).warnings)


@pytest.mark.parametrize(("rate", "resolved"), [(1.0, False), (20.0, True)])
def test_a_response_that_rises_between_two_points_gets_more(rate: float, resolved: bool) -> None:
    x = at_rate(TRUTH, rate)
    trials = [trial(step_command(50, 1000), 100.0, x, 0.05, number=k, order=k) for k in range(1, 4)]
    found = fit_campaign(plant_cases.campaign_data(trials), bootstrap=None)
    assert found.data is not None
    assert (found.data.points > 50) == resolved
    t = np.linspace(0.0, 10.0, 2001)
    expected, fitted = (step_response(t, *each) for each in (x, found.optimum.x))
    np.testing.assert_allclose(fitted, expected, atol=0.02 * expected[-1])
