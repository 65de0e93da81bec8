"""The fractional model beside integer orders: criteria, what counts as independent, whole logs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import campaigns
from spa_fo import Campaign, simulate
from spa_fo.identify import whole_log
from spa_fo.identify.baselines import fit_first_order, fit_on_logs, fit_second_order
from spa_fo.identify.fit_report import order_lines
from spa_fo.identify.goodness import fit_percent, rms_error
from spa_fo.identify.protocol import StepData
from spa_fo.identify.selection import (
    FRACTIONAL,
    Contender,
    OrderComparison,
    compare_on_logs,
    compare_on_steps,
    criteria,
    independent_samples,
)
from spa_fo.identify.whole_log import LogData, held_response
from spa_fo.plant.second_order import second_order_step

T = np.linspace(0.0, 30.0, 1501)
U = np.where(T > 2.0, 0.7, 0.0) + 0.3 * np.sin(T)


def log_of(angle: np.ndarray, u: np.ndarray = U, hold: str = "zero") -> LogData:
    return LogData(None, T, u, angle, np.ones(T.size, dtype=bool), hold)  # type: ignore[arg-type]


def first_order(gain: float, time_s: float) -> object:
    return lambda t: gain * -np.expm1(-t / time_s)


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_the_response_to_a_held_input_is_that_of_the_simulator(hold: str) -> None:
    """One pole is an order of 1 without the middle term."""
    found = held_response(log_of(T, hold=hold), first_order(0.5, 1.3))  # type: ignore[arg-type]
    exact = simulate(T, U, 1.0, 0.5, 0.0, 1.0 / 1.3, 0.5 / 1.3, hold=hold)
    assert found == pytest.approx(exact, abs=1e-9)


def test_whole_logs_of_integer_order_give_their_parameters_back() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-3, T.size)
    second = held_response(log_of(T), lambda t: second_order_step(t, 0.6, 0.4, 2.1))
    one = fit_on_logs([log_of(second + noise), log_of(2.0 * second + noise, 2.0 * U)], 2)
    expected = {"gain": 0.6, "damping_ratio": 0.4, "natural_frequency": 2.1}
    assert one.parameters == pytest.approx(expected, rel=0.01)
    first = held_response(log_of(T), first_order(0.6, 0.8))  # type: ignore[arg-type]
    other = fit_on_logs([log_of(first + noise)], 1)
    assert other.parameters == pytest.approx({"gain": 0.6, "time_constant": 0.8}, rel=0.01)


def steps_of(curve: np.ndarray, t: np.ndarray, noise: float = 1e-3) -> StepData:
    u = np.array([1.0, 1.0, 2.0])
    scatter = np.random.default_rng(2).normal(0.0, noise, (3, t.size))
    return StepData(
        experiments=("a", "a", "b"),
        trials=(1, 2, 1),
        orders=np.array([1, 2, 3]),
        setpoint_deg=np.array([30.0, 30.0, 60.0]),
        u=u,
        t=t,
        angle_rad=np.outer(u, curve) + scatter,
    )


def test_steps_of_first_order_give_their_parameters_back() -> None:
    t = np.arange(1, 51) / 5.0
    data = steps_of(-0.6 * np.expm1(-t / 1.7), t)
    found = fit_first_order(data)
    assert found.parameters == pytest.approx({"gain": 0.6, "time_constant": 1.7}, rel=0.01)
    assert found.kind == "first order"
    # A second order can only be nearer.
    missed = [fit_second_order(data).step(t, 1.0), found.step(t, 1.0)]
    assert rms_error(data.angle_rad[0], missed[0]) <= 1.01 * rms_error(data.angle_rad[0], missed[1])


def test_what_counts_as_independent() -> None:
    white = np.random.default_rng(3).normal(size=(20, 500))
    assert independent_samples(list(white)) == pytest.approx(10_000, rel=0.15)
    slow = np.zeros_like(white)
    for i in range(1, 500):
        slow[:, i] = 0.9 * slow[:, i - 1] + white[:, i]
    # Of a first-order autoregression n (1 - a) / (1 + a).
    assert independent_samples(list(slow)) == pytest.approx(10_000 * 0.1 / 1.9, rel=0.25)
    assert independent_samples([np.ones(50)] * 7) == 7.0
    assert independent_samples([np.zeros(50)] * 7) == 350.0


def test_criteria_by_their_formula() -> None:
    aic, bic = criteria(0.04, 3, 100.0)
    assert aic == pytest.approx(100.0 * math.log(0.04) + 2 * 4)
    assert bic == pytest.approx(100.0 * math.log(0.04) + 4 * math.log(100.0))
    assert criteria(0.04, 3, 6.0) == (None, None)
    assert criteria(0.0, 3, 100.0) == (None, None)


def test_too_few_independent_samples_give_no_criterion() -> None:
    one = Contender("first order", {"gain": 1.0, "time_constant": 2.0}, 0.5, None, None)
    orders = OrderComparison((one,), 500, 3.2)
    assert orders.best("aic") is None
    assert "no AIC, no BIC: only 3 of 500 samples count as independent" in order_lines(orders)[-1]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    folder = tmp_path_factory.mktemp("raw") / "steps"
    folder.mkdir()
    campaigns.step_campaign(folder, trials=2)
    return Campaign.load(folder)


def test_a_fractional_actuator_is_found_to_be_one(campaign: Campaign) -> None:
    from spa_fo.identify import fit_campaign

    found = fit_campaign(campaign.data, bootstrap=None)
    assert found.orders is not None
    assert found.orders.best("aic") == found.orders.best("bic") == FRACTIONAL
    assert [one.model for one in found.orders.contenders] == [
        FRACTIONAL,
        "second order",
        "first order",
    ]
    assert found.orders.samples == found.samples
    stored = found.model.to_dict()["orders"]
    assert stored["independent_samples"] == found.orders.independent
    assert stored["models"][1]["parameters"].keys() == {
        "gain",
        "damping_ratio",
        "natural_frequency",
    }
    assert "smallest AIC and BIC: fractional order" in found.report()
    assert found.data is not None
    assert compare_on_steps(found.data, found.optimum) == found.orders
    logs = whole_log.log_data(campaign.trials, campaigns.REFERENCE_KPA)
    assert compare_on_logs(logs, found.optimum).best("bic") == FRACTIONAL


def test_the_fit_in_per_cent() -> None:
    y = np.array([0.0, 1.0, 2.0, 3.0])
    assert fit_percent(y, y) == 100.0
    assert fit_percent(y, np.full(4, y.mean())) == pytest.approx(0.0)
    assert fit_percent(y, -y) < 0.0
    assert fit_percent(y, y + 0.1) == pytest.approx(100.0 * (1.0 - 0.2 / math.sqrt(5.0)))
    assert math.isnan(fit_percent(np.ones(4), y))


def test_the_report_stays_on_one_screen(campaign: Campaign, tmp_path: Path) -> None:
    fit = campaign.fit(whole_logs=True)
    lines = str(fit).splitlines()
    assert len(lines) <= 40
    assert any(line.startswith("second order") and "ζ" in line for line in lines)
