from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import campaigns
from identify_cases import steps
from spa_fo.identify import AblationOptions, ablate, ablation_verdict
from spa_fo.identify.ablation import _subsets
from spa_fo.rig import CampaignData, read_campaign, read_trials

OPTIONS = AblationOptions(points=(20, 50), outliers=(0.0, 0.05), datasets=5, subsets=12)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> CampaignData:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=5)
    return read_trials(read_campaign(folder))


@pytest.fixture(scope="module")
def table(data: CampaignData) -> pd.DataFrame:
    return ablate(data, OPTIONS)


def test_every_combination_has_one_row(table: pd.DataFrame) -> None:
    keys = ["group", "loss", "outliers", "points", "datasets"]
    assert not table.duplicated(keys).any()
    assert set(table["group"]) == {"step_30", "step_60", "all"}
    plain = table[(table["loss"] == "linear") & (table["outliers"] == 0)]
    assert len(plain) == 3 * 2 * 5
    spoilt = table[(table["loss"] == "huber") | (table["outliers"] > 0)]
    assert set(spoilt["points"]) == {50}
    assert len(spoilt) == 3 * 5 * 3


def test_the_curves_error_is_what_theory_says(table: pd.DataFrame) -> None:
    # Noise alone: a fit of at most five free parameters stays below the theory of five.
    rows = table[(table["loss"] == "linear") & (table["outliers"] == 0) & (table["datasets"] == 3)]
    ratio = rows["curve_spread_deg"] / rows["theory_deg"]
    assert ratio.between(0.3, 1.5).all()
    fewer = table[(table["points"] == 50) & (table["group"] == "all") & (table["outliers"] == 0)]
    spread = fewer[fewer["loss"] == "linear"].set_index("datasets")["curve_spread_deg"]
    assert spread[1] > spread[2] > spread[4]


def test_spikes_hurt_least_squares_and_spare_the_robust_loss(table: pd.DataFrame) -> None:
    rows = table[(table["group"] == "all") & (table["points"] == 50) & (table["datasets"] == 4)]
    error = rows.set_index(["loss", "outliers"])["from_all_deg"]
    assert error["linear", 0.05] > 2 * error["linear", 0.0]
    assert error["huber", 0.05] < 0.5 * error["linear", 0.05]


def test_what_is_left_out_is_met_to_noise(table: pd.DataFrame) -> None:
    rows = table[(table["group"] == "all") & (table["datasets"] == 4) & (table["outliers"] == 0)]
    assert rows["left_out_trials_deg"].to_numpy() == pytest.approx(campaigns.NOISE_DEG, rel=0.3)
    whole = table[(table["group"] == "step_30") & (table["datasets"] == 5)]
    assert whole["left_out_mean_deg"].isna().all()


def test_the_same_seed_gives_the_same_table(data: CampaignData, table: pd.DataFrame) -> None:
    pd.testing.assert_frame_equal(ablate(data, OPTIONS), table, check_exact=True)


def test_all_subsets_of_one_experiment() -> None:
    one = steps(5).select(range(5))
    found = [tuple(s) for s in _subsets(one, 2, 64, np.random.default_rng(1))]
    assert found == list(combinations(range(5), 2))


@pytest.mark.parametrize("n", range(1, 9))
def test_subsets_are_distinct_and_even(n: int) -> None:
    data = steps(4)
    found = [tuple(s) for s in _subsets(data, n, 30, np.random.default_rng(1))]
    assert 0 < len(found) == len(set(found)) <= 30
    for subset in found:
        low = sum(i < 4 for i in subset)
        assert len(set(subset)) == n
        assert abs(low - (n - low)) <= 1


def test_the_verdict_is_in_words_that_the_numbers_carry(table: pd.DataFrame) -> None:
    verdict = ablation_verdict(table)
    assert verdict.outliers.startswith("Confirmed")
    assert verdict.numbers["outlier_harm"] > 2
    assert f"{verdict.numbers['step_30.exponent']:.2f}" in verdict.datasets
    assert all(np.isfinite(value) for value in verdict.numbers.values())
    harmless = table.assign(from_all_deg=0.1)
    assert ablation_verdict(harmless).outliers.startswith("Not confirmed")


def test_without_a_repeated_trial_it_says_so(tmp_path: Path) -> None:
    folder = tmp_path / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=1)
    single = read_trials(read_campaign(folder))
    options = AblationOptions(points=(50,), outliers=(0.0,), losses=("linear",))
    verdict = ablation_verdict(ablate(single, options))
    assert "too few trials" in verdict.datasets
    assert verdict.outliers == "Outliers were not tried."


def test_a_campaign_of_four_trials_gets_words_without_gaps(tmp_path: Path) -> None:
    folder = tmp_path / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=2)
    few = read_trials(read_campaign(folder))
    options = AblationOptions(points=(20,), outliers=(0.1,), subsets=8)
    verdict = ablation_verdict(ablate(few, options))
    assert "nan" not in verdict.datasets + verdict.outliers
    assert all(np.isfinite(value) for value in verdict.numbers.values())
    # All four together are the fit to all: spikes are held against its error, not against zero.
    assert 1.5 < verdict.numbers["outlier_harm"] < 100


@pytest.mark.parametrize(("ratio", "words"), [(2.0, "average the noise"), (1.05, "differ among")])
def test_what_points_buy_follows_the_numbers(table: pd.DataFrame, ratio: float, words: str) -> None:
    spread = np.where(table["points"] == 20, ratio, 1.0)
    verdict = ablation_verdict(table.assign(curve_spread_deg=spread))
    assert words in verdict.datasets
