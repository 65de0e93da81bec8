from __future__ import annotations

import numpy as np
import pytest

from spa_fo.identify.baselines import (
    fit_ludwick,
    fit_ludwick_literature,
    fit_ludwick_per_step,
    fit_second_order,
)
from spa_fo.identify.protocol import StepData
from spa_fo.plant.ludwick import Ludwick, ludwick_step
from spa_fo.plant.second_order import second_order_step

T = np.arange(1, 51) / 5.0
U = np.array([1.0, 1.0, 2.0])
NOISE = np.random.default_rng(1).normal(0.0, 1e-3, (3, 50))


def data_of(curves: list[np.ndarray]) -> StepData:
    return StepData(
        experiments=("a", "a", "b"),
        trials=(1, 2, 1),
        orders=np.array([1, 2, 3]),
        setpoint_deg=np.array([30.0, 30.0, 60.0]),
        u=U,
        t=T,
        angle_rad=np.array(curves) + NOISE,
    )


def rms(step: object, data: StepData) -> float:
    curves = np.array([step(data.t, float(u)) for u in data.u])  # type: ignore[operator]
    return float(np.sqrt(np.mean((curves - data.angle_rad) ** 2)))


def test_the_refitted_ludwick_model_finds_its_own_curves() -> None:
    truth = Ludwick(2.0, 0.6, 1.5, 0.8)
    data = data_of([ludwick_step(T, u, truth) for u in U])
    found = fit_ludwick(data)
    assert rms(found.step, data) < 1.1e-3
    assert found.parameters["exponent"] == pytest.approx(2.0, rel=0.05)
    assert found.parameters["natural_frequency"] == pytest.approx(1.5, rel=0.05)


def test_the_literatures_ludwick_model_fits_the_force_only() -> None:
    truth = Ludwick(2.365, 0.7, 1.812, 0.9)
    data = data_of([ludwick_step(T, u, truth) for u in U])
    found = fit_ludwick_literature(data, 2.365)
    assert found.fitted == ("force",)
    assert found.parameters["force"] == pytest.approx(0.9, rel=0.01)


def test_no_other_force_is_better() -> None:
    truth = Ludwick(1.3, 0.3, 2.5, 1.4)
    data = data_of([ludwick_step(T, u, truth) for u in U])
    found = fit_ludwick_literature(data, 2.365)
    for factor in (0.99, 1.01):
        other = Ludwick(2.365, 0.7, 1.812, factor * found.parameters["force"])
        worse = rms(lambda t, u, model=other: ludwick_step(t, u, model), data)
        assert worse > rms(found.step, data)


def test_the_second_order_model_finds_its_own_curves() -> None:
    data = data_of([u * second_order_step(T, 0.5, 0.4, 1.3) for u in U])
    found = fit_second_order(data)
    expected = {"gain": 0.5, "damping_ratio": 0.4, "natural_frequency": 1.3}
    assert found.parameters == pytest.approx(expected, rel=0.01)


def test_a_force_for_each_step_never_fits_worse() -> None:
    truth = Ludwick(1.3, 0.3, 2.5, 1.4)
    data = data_of([ludwick_step(T, u, truth) for u in U])
    common, each = fit_ludwick_literature(data, 2.365), fit_ludwick_per_step(data, 2.365)
    assert rms(each.step, data) < rms(common.step, data)
    assert set(each.fitted) == {"force at u = 1.000", "force at u = 2.000"}
