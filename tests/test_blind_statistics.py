"""Rates, intervals and calibration of the blind benchmark, where they are known otherwise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blind.judge.statistics import Estimate, calibration, difference, expected_error, mean, rate


def test_wilson_interval_of_a_textbook_case() -> None:
    # 8 of 10 at 95 %: (0.4902, 0.9433), for example Agresti and Coull (1998).
    estimate = rate([True] * 8 + [False] * 2)
    assert (estimate.value, estimate.n) == (0.8, 10)
    assert estimate.low == pytest.approx(0.4902, abs=1e-4)
    assert estimate.high == pytest.approx(0.9433, abs=1e-4)


@pytest.mark.parametrize("hits", [[True] * 20, [False] * 20])
def test_wilson_interval_holds_its_share_at_the_ends(hits: list[bool]) -> None:
    estimate = rate(hits)
    assert 0.0 <= estimate.low <= estimate.value <= estimate.high <= 1.0
    assert estimate.high - estimate.low == pytest.approx(0.161, abs=1e-3)


def test_nothing_has_no_rate() -> None:
    assert math.isnan(rate([]).value)
    assert mean([]).n == 0


def test_bootstrap_interval_of_a_mean_is_that_of_its_standard_error() -> None:
    values = np.random.default_rng(3).normal(2.0, 1.0, 400)
    estimate = mean(values.tolist())
    assert estimate.value == pytest.approx(values.mean())
    half = 1.96 * values.std() / 20.0
    assert estimate.low == pytest.approx(values.mean() - half, abs=0.2 * half)
    assert estimate.high == pytest.approx(values.mean() + half, abs=0.2 * half)


def test_calibration_error_of_constructed_cases() -> None:
    perfect = calibration([0.75] * 8, [True] * 6 + [False] * 2)
    assert perfect.ece.value == pytest.approx(0.0, abs=1e-12)
    sure = calibration([1.0] * 10, [True] * 4 + [False] * 6)
    assert sure.ece.value == pytest.approx(0.6)
    # Half the cases 0.2 too high, half 0.1 too low: both count, neither cancels the other.
    mixed = calibration(
        [0.9] * 10 + [0.4] * 10, [True] * 7 + [False] * 3 + [True] * 5 + [False] * 5
    )
    assert mixed.ece.value == pytest.approx(0.15)
    assert [entry.right.value for entry in mixed.bins] == [0.5, 0.7]
    assert mixed.ece.low < 0.15 < mixed.ece.high


def test_errors_of_both_signs_within_one_bin_cancel_and_those_of_two_bins_do_not() -> None:
    within = calibration([0.52, 0.58] * 5, [True, False] * 5)
    assert within.ece.value == pytest.approx(0.05)
    across = calibration([0.45, 0.55] * 5, [True, False] * 5)
    assert across.ece.value == pytest.approx(0.55)


def test_calibration_error_by_chance_is_what_perfect_answers_would_show() -> None:
    rng = np.random.default_rng(5)
    claimed = rng.uniform(0.3, 1.0, 300)
    found_errors = [
        calibration(claimed.tolist(), (rng.random(300) < claimed).tolist()) for _ in range(20)
    ]
    mean_error = np.mean([entry.ece.value for entry in found_errors])
    assert found_errors[0].by_chance == pytest.approx(mean_error, rel=0.2)


def test_the_difference_of_two_shares_has_newcombe_s_interval() -> None:
    # 56 of 70 and 48 of 80: 0.2 (0.0524, 0.3339), Newcombe (1998), table II, method 10.
    many, few = rate([True] * 56 + [False] * 14), rate([True] * 48 + [False] * 32)
    for found in (difference(many, few), difference(few, many)):
        assert found.value == pytest.approx(0.2)
        assert found.low == pytest.approx(0.0524, abs=1e-4)
        assert found.high == pytest.approx(0.3339, abs=1e-4)
        assert found.n == 150


def test_the_difference_to_nothing_is_nothing() -> None:
    assert difference(rate([]), Estimate(0.5, 0.4, 0.6, 20)).n == 0


def test_the_error_alone_is_that_of_the_calibration() -> None:
    claimed, right = [0.3, 0.55, 0.9, 0.95], [True, False, True, True]
    assert expected_error(claimed, right) == calibration(claimed, right).ece
    assert expected_error([], []).n == 0
