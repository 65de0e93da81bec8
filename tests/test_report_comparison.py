from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from spa_fo.fractional import step_response
from spa_fo.identify.protocol import StepData
from spa_fo.identify.reproduction import Options, Reproduction, reproduce
from spa_fo.plant import paper
from spa_fo.report.comparison import (
    MaterialComparison,
    parameter_table,
    rms_table,
    step_panels,
)
from spa_fo.report.figures import step_figure
from spa_fo.report.style import save_figure

NOISE_RAD = 0.005


@pytest.fixture(scope="module")
def reproduction() -> Reproduction:
    """Two trials each at 30° and 60° of an actuator that is Table I's first row."""
    t = np.arange(1, 51) / 5.0
    x = paper.TABLE_I["design_1"]
    unit = step_response(t, x.alpha2, x.alpha1, x.a1, x.a0, x.b0)
    u = np.radians([30.0, 30.0, 60.0, 60.0]) / x.gain
    noise = np.random.default_rng(3).normal(0.0, NOISE_RAD, (4, t.size))
    data = StepData(
        experiments=("step_30", "step_30", "step_60", "step_60"),
        trials=(1, 2, 1, 2),
        orders=np.array([1, 3, 2, 4]),
        setpoint_deg=np.array([30.0, 30.0, 60.0, 60.0]),
        u=u,
        t=t,
        angle_rad=u[:, np.newaxis] * unit + noise,
    )
    return reproduce(data, Options(seeds=3, design="design_1", ludwick_n=2.365), seed=1)


@pytest.fixture(scope="module")
def material(reproduction: Reproduction) -> MaterialComparison:
    return MaterialComparison("rubber", "design_1", reproduction)


def test_the_truth_errs_by_the_noise_of_a_mean(reproduction: Reproduction) -> None:
    truth = next(m for m in reproduction.models if m.source == "paper")
    expected = np.degrees(NOISE_RAD) / np.sqrt(2)
    for rms in truth.rms_deg.values():
        assert rms == pytest.approx(expected, rel=0.3)


def test_wider_bounds_never_fit_worse(reproduction: Reproduction) -> None:
    optimum = {m.bounds: m.fit_rmse_deg for m in reproduction.models if m.source == "optimum"}
    swarm = {m.bounds: m.fit_rmse_deg for m in reproduction.models if m.source == "swarm"}
    assert None not in optimum.values()
    assert optimum["widened"] <= optimum["printed"] * (1 + 1e-9)
    for bounds, least in optimum.items():
        if bounds in swarm:
            assert swarm[bounds] >= least * (1 - 1e-9)


def test_it_survives_json(reproduction: Reproduction) -> None:
    text = json.dumps(reproduction.to_dict(), allow_nan=False)
    assert Reproduction.from_dict(json.loads(text)) == reproduction


def test_the_papers_errors_stand_beside_the_models_that_are_its_own(
    material: MaterialComparison,
) -> None:
    rows = rms_table([material], "synthetic").rows
    printed = rows.dropna(subset=["paper (°)"])
    found = {(row["setpoint (°)"], row["model"]): row["paper (°)"] for _, row in printed.iterrows()}
    assert found == {
        (30.0, "swarm 200×10, widened bounds"): 1.24,
        (30.0, "Ludwick, n from the literature"): 4.75,
        (30.0, "Ludwick, n from the literature, a force a setpoint"): 4.75,
        (60.0, "swarm 200×10, widened bounds"): 2.52,
        (60.0, "Ludwick, n from the literature"): 3.42,
        (60.0, "Ludwick, n from the literature, a force a setpoint"): 3.42,
    }
    assert (rows["here (%)"] * rows["setpoint (°)"] / 100).to_numpy() == pytest.approx(
        rows["here (°)"].to_numpy()
    )


def test_table_1_is_among_the_parameters(material: MaterialComparison) -> None:
    rows = parameter_table([material], "synthetic").rows.set_index("model")
    printed = rows.loc["Table I as printed"]
    for name in ("alpha2", "alpha1", "a1", "a0", "b0"):
        assert printed[name] == getattr(paper.TABLE_I["design_1"], name)


def test_a_figure_is_the_same_bytes_twice(material: MaterialComparison, tmp_path: Path) -> None:
    first, second = (
        save_figure(step_figure(step_panels(material)), tmp_path / name, "synthetic")
        for name in ("a", "b")
    )
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes()
