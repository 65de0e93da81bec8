"""How far the gap closes on held-out trials: the fraction and its interval."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spa_fo.gap.data.hold_out import (
    HeldOut,
    fraction_closed,
    shrink,
)
from spa_fo.gap.diagnosis import Shrink

SAMPLES = 80
FLOOR = 0.5


def measured(errors: dict[str, np.ndarray], trials: int, line_deg: float = 0.0) -> Shrink:
    """Shrink of `trials` held-out trials whose models miss a measured zero by `errors`."""
    trial = np.repeat(np.arange(trials), SAMPLES)
    grid = SimpleNamespace(
        sample_trial=trial,
        counts=np.ones(trial.size),
        angle_deg=np.zeros(trial.size),
        time_s=np.tile(np.linspace(0.0, 8.0, SAMPLES), trials),
    )
    rows = [np.flatnonzero(trial == i) for i in range(trials)]
    evidence: Any = SimpleNamespace(grid=grid, noise_deg=0.0, rows=rows, line_deg=line_deg)
    curves = {"refit": errors["plain"], "ceiling": errors["explained"]} | errors
    held = HeldOut(np.ones(trials, dtype=bool), "all")
    return shrink(evidence, held, curves, FLOOR, np.random.default_rng(1))


def missing(*by_trial: float) -> np.ndarray:
    return np.repeat(by_trial, SAMPLES)


def test_the_fraction_is_that_of_the_squares_above_the_floor() -> None:
    found = measured({"plain": missing(2, 2, 2), "explained": missing(1, 1, 1)}, 3)
    assert found.fraction_closed == pytest.approx(1 - (1 - FLOOR**2) / (4 - FLOOR**2))
    assert (found.before_rmse_deg, found.after_rmse_deg) == (2.0, 1.0)


def test_an_interference_is_in_every_error_and_does_not_close() -> None:
    found = measured({"plain": missing(2, 2, 2), "explained": missing(1, 1, 1)}, 3, line_deg=3.0)
    assert (found.before_rmse_deg, found.after_rmse_deg) == pytest.approx((13**0.5, 10**0.5))
    assert found.fraction_closed == pytest.approx(1 - (10 - FLOOR**2) / (13 - FLOOR**2))


def test_no_interval_goes_beyond_all_of_the_gap() -> None:
    found = measured({"plain": missing(0.2, 3.0), "explained": missing(1.5, 0.2)}, 2)
    assert found.ci95[0] < found.fraction_closed < found.ci95[1]
    assert found.ci95[1] <= 1.1


def test_errors_are_of_single_samples_their_white_noise_included() -> None:
    """An averaged sample stands for as many as were averaged, each with its own noise."""
    counts, noise = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), 0.3
    errors = {"plain": 2.0, "refit": 1.5, "explained": 1.0, "ceiling": 0.8}
    curves = {name: size * np.array([1.0, -1.0, 2.0, 0.5, 1.0]) for name, size in errors.items()}
    evidence: Any = SimpleNamespace(
        grid=SimpleNamespace(
            sample_trial=np.array([0, 0, 1, 1, 1]),
            counts=counts,
            angle_deg=np.zeros(5),
            time_s=np.arange(5.0),
        ),
        noise_deg=noise,
        line_deg=0.0,
        rows=[np.array([0, 1]), np.array([2, 3, 4])],
    )
    held = HeldOut(np.ones(2, dtype=bool), "all")
    found = shrink(evidence, held, curves, FLOOR, np.random.default_rng(1))

    def of_single_samples(curve: np.ndarray) -> float:
        total = 0.0
        for missed, count in zip(curve, counts, strict=True):
            total += count * missed**2 + (count - 1.0) * noise**2
        return float(np.sqrt(total / counts.sum()))

    assert found.before_rmse_deg == pytest.approx(of_single_samples(curves["plain"]))
    assert found.refit_only_rmse_deg == pytest.approx(of_single_samples(curves["refit"]))
    assert found.after_rmse_deg == pytest.approx(of_single_samples(curves["explained"]))
    assert found.ceiling_rmse_deg == pytest.approx(of_single_samples(curves["ceiling"]))


def test_no_more_than_the_whole_gap_closes_and_the_formula_holds_of_what_is_written() -> None:
    found = measured({"plain": missing(2, 2, 2), "explained": missing(0.3, 0.3, 0.3)}, 3)
    before, after, floor = found.before_rmse_deg, found.after_rmse_deg, found.noise_floor_deg
    assert floor == after
    assert found.fraction_closed == 1.0
    assert found.fraction_closed == 1 - (after**2 - floor**2) / (before**2 - floor**2)
    assert found.ci95[0] < 1.0 < found.ci95[1]


def test_where_there_is_hardly_a_gap_the_share_stays_bounded() -> None:
    assert fraction_closed(FLOOR**2, 4 * FLOOR**2, FLOOR) > -40
    assert fraction_closed(0.9 * FLOOR**2, 0.9 * FLOOR**2, FLOOR) == 1.0


def test_trials_that_disagree_widen_the_interval() -> None:
    alike = measured({"plain": missing(2, 2, 2), "explained": missing(1, 1, 1)}, 3)
    apart = measured({"plain": missing(2, 2, 2), "explained": missing(0.6, 0.6, 1.6)}, 3)
    width = [high - low for low, high in (alike.ci95, apart.ci95)]
    assert width[1] > 2 * width[0]


def test_a_lone_trial_that_is_explained_in_parts_has_a_wide_interval() -> None:
    in_parts = np.where(np.arange(SAMPLES) < SAMPLES // 2, 0.5, 1.5)
    lone = measured({"plain": missing(2), "explained": in_parts}, 1)
    low, high = lone.ci95
    assert low < lone.fraction_closed - 0.2
    assert high > lone.fraction_closed + 0.2


def test_the_interval_of_a_wrong_model_holds_its_fraction() -> None:
    found = measured({"plain": missing(1), "explained": missing(20)}, 1)
    low, high = found.ci95
    assert found.fraction_closed < -100
    assert low <= found.fraction_closed <= high
