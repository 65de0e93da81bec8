"""Parts of the diagnosis by themselves: the floor, places, coefficients, intervals."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm, truncnorm

import campaigns
import naive_plant
from spa_fo import step_response
from spa_fo.gap.answer.intervals import _interval, _of_shift, _of_zeros
from spa_fo.gap.answer.locate import shares
from spa_fo.gap.data.evidence import Evidence, collect, noise_floor
from spa_fo.gap.data.searched import at_rate, to_x, to_z
from spa_fo.gap.decide.explanation import steady_walk
from spa_fo.plant.effects.shared import CURVE_KNOTS_DEG
from spa_fo.plant.sensor_curve import curve_columns
from spa_fo.rig import read_campaign, read_trials

TRUTH = np.array(list(campaigns.TRUTH.values()))


@pytest.fixture(scope="module")
def steps(tmp_path_factory: pytest.TempPathFactory) -> Evidence:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    campaigns.step_campaign(folder, trials=3)
    return collect(read_trials(read_campaign(folder)))


# --- the noise floor ------------------------------------------------------------------------------


def repeated(values: np.ndarray, noise_deg: float, groups: list[int] | None = None) -> Any:
    """Evidence of trials (rows of `values`), all of one experiment unless `groups` says else."""
    trials, samples = values.shape
    time_s = np.tile(np.arange(float(samples)), trials)
    return SimpleNamespace(
        course_s=time_s,
        grid=SimpleNamespace(
            angle_deg=values.ravel(),
            trials=[None] * trials,
            time_s=time_s,
            counts=np.ones(values.size),
        ),
        noise_deg=noise_deg,
        rows=np.arange(values.size).reshape(trials, samples),
        alike=np.array(groups or [0] * trials),
    )


def test_where_trials_drift_successive_differences_are_the_floor() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.2, (6, 400))
    drifting = np.arange(6.0)[:, None] + noise
    evidence = repeated(drifting, 0.2)
    assert noise_floor(evidence) ** 2 == pytest.approx(0.5 + 0.2**2, rel=0.05)
    explained = np.repeat(np.arange(6.0), 400)
    assert noise_floor(evidence, explained) == pytest.approx(0.2, rel=0.05)


def test_without_drift_deviations_from_the_mean_are_the_floor() -> None:
    jumping = np.array([0.0, 1.0, 0.0, 1.0])[:, None] + np.zeros((4, 50))
    assert noise_floor(repeated(jumping, 0.0)) ** 2 == pytest.approx(1.0 / 3.0)


def test_without_repeats_the_noise_of_samples_is_the_floor() -> None:
    assert noise_floor(repeated(np.ones((2, 9)), 0.3, [0, 1])) == 0.3
    assert noise_floor(repeated(np.ones((2, 9)), 0.3, [0, 1]), otherwise=0.7) == 0.7


# --- where ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "name", "where"),
    [
        ("phase", "rest", lambda t, _: t < 0.9),
        ("phase", "rise", lambda t, _: (t > 1.1) & (t < 1.9)),
        ("phase", "hold", lambda t, _: (t > 3.0) & (t < 10.0)),
        ("phase", "fall", lambda t, _: (t > 11.1) & (t < 11.9)),
        ("phase", "released", lambda t, _: t > 13.0),
        ("trial", "first third", lambda _, order: order <= 2),
        ("trial", "last third", lambda _, order: order >= 5),
    ],
)
def test_the_gap_is_put_where_it_is(
    kind: str, name: str, where: Callable[[Any, Any], Any], steps: Evidence
) -> None:
    grid = steps.grid
    here = where(grid.time_s, grid.orders[grid.sample_trial])
    found = shares(steps, np.where(here, 5.0, 0.0), grid.angle_deg)
    assert found[kind][name] > 0.95
    for by in found.values():
        assert sum(by.values()) == pytest.approx(1.0)


def test_the_gap_is_put_at_its_amplitude_and_direction(steps: Evidence) -> None:
    grid = steps.grid
    high = grid.angle_deg > 50.0
    found = shares(steps, np.where(high, 5.0, 0.0), grid.angle_deg)["amplitude"]
    assert found["45-60 deg"] + found["above 60 deg"] > 0.95
    rising = grid.slopes(grid.angle_deg) > 5.0
    found = shares(steps, np.where(rising, 5.0, 0.0), grid.angle_deg)["direction"]
    assert found["bending"] > 0.95


# --- coefficients and curves ----------------------------------------------------------------------


@given(
    st.tuples(
        st.floats(1.1, 1.9),
        st.floats(0.5, 1.05),
        st.floats(0.1, 3.0),
        st.floats(0.3, 5.0),
        st.floats(0.2, 2.0),
    ),
    st.floats(0.5, 2.0),
)
def test_a_faster_actuator_answers_sooner(drawn: tuple[float, ...], rate_factor: float) -> None:
    x = np.array(drawn)
    t = np.linspace(0.1, 8.0, 20)
    fast = step_response(t, *at_rate(x, rate_factor))
    assert fast == pytest.approx(step_response(rate_factor * t, *x), rel=1e-6, abs=1e-9)
    assert to_x(to_z(x)) == pytest.approx(x)


def test_the_columns_of_the_curve_are_its_error() -> None:
    rng = np.random.default_rng(4)
    errors = rng.normal(0.0, 2.0, len(CURVE_KNOTS_DEG))
    zero = CURVE_KNOTS_DEG.index(0.0)
    errors[zero] = 0.0
    angle = np.linspace(-30.0, 120.0, 301)
    ours = angle + curve_columns(angle, 1.0) @ np.delete(errors, zero)
    assert ours == pytest.approx(naive_plant.curve(angle, np.array(CURVE_KNOTS_DEG), errors))


# --- intervals ------------------------------------------------------------------------------------


def covariance(size: int) -> np.ndarray:
    root = np.random.default_rng(2).normal(size=(size, size))
    return root @ root.T


def test_intervals_are_of_95_percent() -> None:
    width = norm.ppf(0.975)
    ends = np.array([-0.1, 0.1]) * width
    free = -np.inf, np.inf
    assert _interval(2.0, free, (0.1, False)) == pytest.approx(2.0 + ends, rel=1e-3)
    assert _interval(2.0, free, (0.1, True)) == pytest.approx(2.0 * np.exp(ends), rel=1e-3)
    assert _interval(2.0, free, None) is None


@pytest.mark.parametrize("value", [0.0, 0.05, 0.3, 1.0])
def test_an_interval_ends_where_the_parameter_may_go_and_holds_95_percent_of_what_is_left(
    value,
) -> None:
    bounds = 0.0, 1.0
    low, high = _interval(value, bounds, (0.2, False))
    assert bounds[0] <= low <= value <= high <= bounds[1]
    left = truncnorm(*((np.array(bounds) - value) / 0.2), loc=value, scale=0.2)
    assert left.cdf(high) - left.cdf(low) >= 0.95 - 1e-4
    if value in bounds:
        assert left.cdf(high) - left.cdf(low) == pytest.approx(0.95, abs=1e-3)


def test_the_error_of_b0_is_that_of_gain_and_a0_together() -> None:
    spread = covariance(7)
    errors = _of_shift("parameter_shift", TRUTH, spread)
    draws = np.random.default_rng(3).multivariate_normal(np.zeros(7), spread, 200_000)
    for name, of_logarithm, drawn in (
        ("b0", True, draws[:, 3] + draws[:, 4]),
        ("a0", True, draws[:, 3]),
        ("alpha2", False, draws[:, 0] / TRUTH[0]),
    ):
        expected = pytest.approx(np.std(drawn), rel=0.02), of_logarithm
        assert errors["parameter_shift", name] == expected


def test_the_errors_of_a_slip_are_what_its_steps_scatter_by() -> None:
    orders = np.arange(1, 401)
    jumps = np.random.default_rng(5).normal(0.3, 0.2, 400)
    errors = _of_zeros("sensor_slip", np.cumsum(jumps), orders)
    walk, zero = (errors["sensor_slip", name][0] for name in ("walk_deg", "zero_deg"))
    assert walk == pytest.approx(0.2 / np.sqrt(399.0), rel=0.1)
    assert zero == pytest.approx(0.2, rel=0.1)


def test_a_zero_that_walks_goes_on_and_one_that_jumps_about_stays() -> None:
    orders = np.array([1, 2, 4, 5, 8, 9, 12])
    assert steady_walk(orders, 0.4 * orders - 1.0) == pytest.approx((0.4, 0.0))
    about = np.array([4.4, 19.5, 16.6, 4.7, -0.1, 6.1, 0.3])  # as likely back as on
    walk, sigma = steady_walk(orders, about)
    assert walk == 0.0
    assert sigma > abs((about[-1] - about[0]) / 11.0)
    assert steady_walk(orders[:1], about[:1]) == (0.0, 0.0)
    assert steady_walk(orders[:2], about[:2]) == pytest.approx((0.0, 15.1))
    # Far beyond what its steps scatter by, nearly all of a walk goes on.
    steps = np.random.default_rng(1).normal(2.0, 0.5, 30)
    walk, _ = steady_walk(np.arange(30) + 1, np.cumsum(steps))
    mean = (np.sum(steps) - steps[0]) / 29.0
    assert 0.99 * mean < walk < mean
