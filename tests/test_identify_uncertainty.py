from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from identify_cases import TRUTH, steps
from spa_fo.fractional import step_response
from spa_fo.identify import assess, fit_optimum, free_bounds, widened_bounds
from spa_fo.identify.noise import trial_noise
from spa_fo.identify.uncertainty import Uncertainty
from spa_fo.plant.estimates import QUANTITIES

GAIN = TRUTH[4] / TRUTH[3]


@pytest.fixture(scope="module")
def assessed() -> Uncertainty:
    data = steps(4, seed=20)
    return assess(data, fit_optimum(data, widened_bounds()), bootstrap=100)


def test_white_noise_is_measured_as_white() -> None:
    noise = trial_noise(steps(7, noise_deg=0.5, seed=1), 0.0)
    assert np.degrees(noise.total) == pytest.approx(0.5, rel=0.1)
    assert noise.white == pytest.approx(noise.total, rel=0.1)
    assert noise.design_effect < 2.5


def test_scatter_in_gain_is_measured_as_between_trials() -> None:
    noise = trial_noise(steps(7, noise_deg=0.1, seed=1, gain_scatter=0.05), 0.0)
    assert np.degrees(noise.white) == pytest.approx(0.1, rel=0.2)
    assert noise.between > 5 * noise.white
    assert noise.design_effect > 30.0


def test_single_trials_fall_back_to_the_residuals() -> None:
    noise = trial_noise(steps(1), 0.01)
    assert not noise.repeated
    assert noise.total == 0.01


def test_step_responses_determine_the_gain_and_not_the_rest(assessed: Uncertainty) -> None:
    assert assessed.profile("K").determined
    assert "a1" in assessed.undetermined
    assert "a0" in assessed.undetermined
    assert assessed.covariance.condition_number > 1e5
    # Held anywhere within its interval, the least determined parameter hardly moves the curve.
    widest = assessed.widest
    assert widest.likely_change_deg < 0.2
    assert widest.high_95 - widest.low_95 > 0.4


def test_profiles_touch_zero_at_the_optimum_and_hold_it(assessed: Uncertainty) -> None:
    for profile in assessed.profiles:
        assert np.all(np.diff(profile.values) > 0)
        assert np.all(profile.rise >= 0)
        assert profile.rise[np.argmin(np.abs(profile.values - profile.estimate))] < 1e-3
        assert profile.low_95 <= profile.low_68 <= profile.estimate
        assert profile.estimate <= profile.high_68 <= profile.high_95


def test_closed_intervals_end_where_chi_square_says(assessed: Uncertainty) -> None:
    ends = 0
    for p in assessed.profiles:
        for level, low, high in ((0.68, p.low_68, p.high_68), (0.95, p.low_95, p.high_95)):
            closed = [(low, p.open_low), (high, p.open_high)]
            for end in (end for end, is_open in closed if not is_open):
                if end in (p.values[0], p.values[-1]):
                    continue
                rise = np.interp(end, p.values, np.sqrt(p.rise)) ** 2
                assert rise == pytest.approx(chi2.ppf(level, 1), rel=0.05)
                ends += 1
    assert ends >= 4


def test_an_open_interval_ends_at_the_bounds(assessed: Uncertainty) -> None:
    open_ones = [p for p in assessed.profiles if p.open_low or p.open_high]
    assert open_ones
    for profile in open_ones:
        assert not profile.determined
        if profile.open_low:
            assert profile.low_95 == profile.values[0]
        if profile.open_high:
            assert profile.high_95 == profile.values[-1]


def test_the_gains_interval_covers_the_truth_about_as_often_as_it_says() -> None:
    hits = 0
    for seed in range(20):
        data = steps(3, seed=200 + seed)
        k = assess(data, fit_optimum(data, widened_bounds()), bootstrap=0).profile("K")
        hits += k.low_95 <= GAIN <= k.high_95
    assert hits >= 17


def test_errors_are_the_inverse_of_the_information() -> None:
    """Against finite differences of the plain response, at the truth, away from any bound."""
    data = steps(4, noise_deg=0.1, seed=21)
    x = TRUTH.copy()
    free = free_bounds()
    optimum = replace(fit_optimum(data, free), x=x, at_bounds=(), bounds=free)
    found = assess(data, optimum, bootstrap=0)
    columns = []
    for i in range(5):
        h = 1e-5 * x[i]
        up, down = x.copy(), x.copy()
        up[i] += h
        down[i] -= h
        columns.append((step_response(data.t, *up) - step_response(data.t, *down)) / (2 * h))
    unit = np.array(columns).T
    variance = found.noise.total**2 * found.noise.design_effect * found.scale**2
    information = unit.T @ unit * np.sum(data.u**2) / variance
    scaling = np.outer(x, x)
    expected = np.linalg.inv(information * scaling) * scaling
    np.testing.assert_allclose(
        found.covariance.standard_error[:5], np.sqrt(np.diag(expected)), rtol=1e-3
    )
    slope = np.array([0, 0, 0, -x[4] / x[3] ** 2, 1 / x[3]])
    assert found.covariance.standard_error[5] == pytest.approx(
        np.sqrt(slope @ expected @ slope), rel=1e-3
    )


def test_the_bootstrap_sees_scatter_between_trials() -> None:
    spreads = []
    for scatter in (0.0, 0.05):
        data = steps(5, noise_deg=0.2, seed=3, gain_scatter=scatter)
        found = assess(data, fit_optimum(data, widened_bounds()), bootstrap=100).bootstrap
        assert found is not None
        spreads.append(found.standard_deviation[QUANTITIES.index("K")] / GAIN)
    # The heights 1 and 2 weigh as their squares: about 0.05 sqrt(85) / 25.
    assert 0.009 < spreads[1] < 0.036
    assert spreads[1] > 3 * spreads[0]


@pytest.mark.parametrize("trials", [2, 4])
def test_the_bootstrap_of_few_trials_is_not_too_sure(trials: int) -> None:
    data = steps(trials, noise_deg=0.0, seed=6, gain_scatter=0.05)
    found = assess(data, fit_optimum(data, widened_bounds()), bootstrap=400).bootstrap
    assert found is not None
    # K is a mean of the trials' gains, an experiment's weight the square of its height.
    gain = data.angle_rad[:, -1] / data.u / step_response(data.t[-1:], *TRUTH) * GAIN
    variance = sum(
        weight**2 * np.var(gain[rows], ddof=1) / trials
        for weight, rows in zip((0.2, 0.8), data.groups.values(), strict=True)
    )
    spread = found.standard_deviation[QUANTITIES.index("K")]
    assert spread == pytest.approx(np.sqrt(variance), rel=0.1)


def test_the_same_seed_gives_the_same_bits() -> None:
    data = steps(3, seed=4)
    optimum = fit_optimum(data, free_bounds())
    one, two = (assess(data, optimum, seed=5, bootstrap=20) for _ in range(2))
    assert one.bootstrap is not None
    assert two.bootstrap is not None
    assert one.bootstrap.x.tobytes() == two.bootstrap.x.tobytes()
    assert one.profiles[2].rise.tobytes() == two.profiles[2].rise.tobytes()


def test_a_parameter_on_its_bound_has_no_symmetric_error() -> None:
    data = steps(3, seed=4)
    optimum = fit_optimum(data, widened_bounds())
    assert optimum.at_bounds
    assessed = assess(data, optimum, bootstrap=0)
    touched = {mark.split()[0] for mark in optimum.at_bounds}
    for name, error in zip(QUANTITIES[:5], assessed.covariance.standard_error, strict=False):
        assert np.isnan(error) == (name in touched)
