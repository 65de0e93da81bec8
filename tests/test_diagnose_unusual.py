"""Diagnoses of campaigns at the edge of what is legal: an answer each, and never a traceback."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import campaigns
from spa_fo.cli import main
from spa_fo.gap.data.evidence import Evidence, _drifts, collect
from spa_fo.gap.noise.interference import _fast, fast_line
from spa_fo.gap.plan.profiles import limits_of
from spa_fo.plant.effects.library import IDS
from spa_fo.plant.grid import CampaignGrid
from spa_fo.plant.sensor_curve import curve_sigma
from spa_fo.rig import read_campaign, read_trials
from test_cli_diagnose import FEW, write_model


@pytest.fixture(scope="module")
def softer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    changed = campaigns.TRUTH | {"b0": 1.1 * campaigns.TRUTH["b0"]}
    return write_model(tmp_path_factory.mktemp("model") / "m.json", transfer_function=changed)


def answer(folder: Path, model: Path, out: Path, *more: str) -> dict[str, Any]:
    assert main(["diagnose", str(folder), "--model", str(model), "--out", str(out), *more]) == 0
    found: dict[str, Any] = json.loads((out / "diagnosis.json").read_text())
    return found


def evidence_of(folder: Path) -> Evidence:
    return collect(read_trials(read_campaign(folder)))


@pytest.mark.parametrize("rate_hz", [1.0, 5.0, 10.0])
def test_slow_logs(rate_hz: float, softer: Path, tmp_path: Path) -> None:
    folder = tmp_path / "slow"
    campaigns.step_campaign(folder, trials=3, rate_hz=rate_hz)
    assert fast_line(evidence_of(folder)).gain == 0.0
    found = answer(folder, softer, tmp_path / "out", *FEW)
    # At one sample a second the response itself looks like noise.
    assert found["gap"]["significant"] or rate_hz == 1.0


def test_a_fast_line_is_looked_for_in_the_trials_that_take_part(tmp_path: Path) -> None:
    folder = tmp_path / "steps"
    campaigns.step_campaign(folder, trials=2)
    evidence = evidence_of(folder)
    _, all_of_them = _fast(evidence)
    _, others = _fast(replace(evidence, takes_part=np.array([True, False, True, True])))
    assert (len(all_of_them), len(others)) == (4, 3)


def test_a_library_without_anything(softer: Path, tmp_path: Path) -> None:
    folder = tmp_path / "steps"
    campaigns.step_campaign(folder, trials=3)
    without = [word for name in IDS for word in ("--exclude-effect", name)]
    found = answer(folder, softer, tmp_path / "out", *without)
    assert found["verdict"]["kind"] == "unknown"
    assert found["verdict"]["sets"] == []
    assert found["shrink"] is None


def test_a_single_trial_knows_that_it_cannot_tell_noise_from_structure(
    softer: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "stairs"
    campaigns.free_campaign(folder)
    found = answer(folder, softer, tmp_path / "out", *FEW)
    assert found["gap"]["repeats"] is False
    assert found["gap"]["noise_floor_deg"] > 0.1
    assert any("No experiment was repeated" in text for text in found["findings"])
    assert found["evidence"]["held_out_on"].startswith("no trial was left to hold out")


def test_a_vacuum_has_an_answer_though_no_profile(
    softer: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "vacuum"
    campaigns.free_campaign(folder, trials=3, sign=-1.0)
    module = importlib.import_module("spa_fo.gap.decide.examine")
    decided = module.decide
    monkeypatch.setattr(module, "decide", lambda *given: replace(decided(*given), kind="unknown"))
    found = answer(folder, softer, tmp_path / "out", *FEW)
    assert 1 <= len(found["next_steps"]) <= 3
    assert found["verdict"]["next_experiment"]


def test_logs_of_a_constant_command_set_no_limit_to_its_rate(tmp_path: Path) -> None:
    folder = tmp_path / "held"
    campaign = campaigns.free_campaign(folder)
    campaigns.write_log(folder / "stairs/trial_01.csv", np.full(250, 30.0), 25.0, seed=1)
    campaigns.write_yaml(folder, campaign)
    campaigns.write_sums(folder)
    limits = limits_of(evidence_of(folder).grid)
    assert limits.rate_kpa_s == np.inf
    assert limits.pressure_kpa == pytest.approx(30.0)


def sampled(trial: list[int], time_s: list[float]) -> CampaignGrid:
    """Give a grid that has nothing but averaged samples."""
    grid = object.__new__(CampaignGrid)
    vars(grid).update(sample_trial=np.array(trial), time_s=np.array(time_s))
    return grid


def test_a_trial_of_one_averaged_sample_has_no_slope() -> None:
    grid = sampled([0, 0, 0, 1, 2, 2], [0.0, 1.0, 2.0, 0.1, 0.0, 0.5])
    slopes = grid.slopes(np.array([0.0, 2.0, 4.0, 7.0, 1.0, 0.0]))
    assert slopes == pytest.approx([2.0, 2.0, 2.0, 0.0, -2.0, -2.0])
    assert sampled([0], [0.1]).slopes(np.array([3.0])) == pytest.approx([0.0])


def test_slopes_are_those_of_each_trial_by_itself() -> None:
    rng = np.random.default_rng(4)
    trial, time_s, values = (
        np.repeat(np.arange(5), 9),
        rng.uniform(0.01, 0.4, 45),
        rng.normal(size=45),
    )
    for first in range(0, 45, 9):
        time_s[first : first + 9] = np.cumsum(time_s[first : first + 9])
    slow = [
        np.gradient(values[first : first + 9], time_s[first : first + 9])
        for first in range(0, 45, 9)
    ]
    found = sampled(trial.tolist(), time_s.tolist()).slopes(values)
    np.testing.assert_allclose(found, np.concatenate(slow), rtol=1e-10)


def falling_curve() -> SimpleNamespace:
    """Counts that fall with the angle: the knots, sorted by counts, run downwards."""
    return SimpleNamespace(
        angles_deg=np.array([90.0, 60.0, 30.0, 0.0]),
        sigma_knots_deg=np.array([0.9, 0.6, 0.3, 0.1]),
        range_deg=(0.0, 90.0),
        hysteresis_deg={},
        dwells=(),
    )


def test_errors_of_a_curve_whose_counts_fall_with_the_angle() -> None:
    sigma = curve_sigma(falling_curve(), 1.0)  # type: ignore[arg-type]
    rising = falling_curve()
    rising.angles_deg, rising.sigma_knots_deg = (
        rising.angles_deg[::-1],
        rising.sigma_knots_deg[::-1],
    )
    assert sigma == pytest.approx(curve_sigma(rising, 1.0))  # type: ignore[arg-type]


def test_a_calibration_between_trials_shows_the_slip_so_far() -> None:
    drifts = [
        SimpleNamespace(drift_deg=np.full(2, value), angles_deg=np.array([60.0, 0.0]), started_s=at)
        for value, at in ((0.1, -50.0), (0.2, 90.0), (0.3, 900.0))
    ]
    curve = falling_curve()
    data = SimpleNamespace(drifts=drifts, calibration=curve, calibrations=[curve] * 4)
    trials = [SimpleNamespace(started_s=at) for at in (0.0, 60.0, 120.0)]
    _, sigma, _, after = _drifts(data, SimpleNamespace(trials=trials))  # type: ignore[arg-type]
    assert sigma == pytest.approx(np.tile(np.hypot([0.6, 0.1], 0.1), 3))
    assert after.tolist() == [0, 0, 2, 2, 3, 3]
