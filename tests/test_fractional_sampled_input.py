"""Response to a sampled input: one-off and folded into a map."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spa_fo
from naive_fractional import naive_simulate
from spa_fo.fractional import (
    grunwald_letnikov_simulate,
    input_map,
    simulate,
    step_response,
)
from spa_fo.fractional.map_kernels import phi1, phi1_derivative

GOLDEN = json.loads((Path(__file__).parent / "golden" / "fractional.json").read_text())
X = (1.406, 1.196, 0.794, 1.638, 0.934)
GAIN = X[4] / X[3]
HOLDS = ["linear", "zero"]
HARD = [
    X,
    (0.9, 0.5, 0.4, 2.0, 1.0),
    (1.99, 0.99, 0.05, 9.0, 1.0),
    (1.999, 1.0, 2.0, 1.0, 1.0),
    (1.30000001, 1.3, 0.5, 2.0, 1.0),
    (1.5, 0.7, 0.0, 1.0, 1.0),
]


def jittered_log(samples: int, rate: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Sample times with jitter, a gap and a close pair; an input with jumps and noise."""
    rng = np.random.default_rng(seed)
    t = np.sort(np.arange(samples) / rate + rng.exponential(2e-3, samples))
    t[samples // 2 :] += 4.2
    t[samples // 3] = t[samples // 3 - 1] + 2e-4
    t.sort()
    u = np.sign(np.sin(t)) + 0.1 * rng.normal(size=samples)
    return t, u


@st.composite
def signals(draw):
    """Sample times, perhaps with duplicates, and two inputs."""
    n = draw(st.integers(2, 12))
    steps = draw(st.lists(st.sampled_from([0.0, 1e-3, 0.02, 0.5, 7.0]), min_size=n, max_size=n))
    values = st.lists(st.floats(-2.0, 2.0), min_size=n, max_size=n)
    return 3.0 + np.cumsum(steps), np.array(draw(values)), np.array(draw(values))


@pytest.mark.parametrize("case", GOLDEN["simulate"], ids=lambda case: f"{case['x']} {case['hold']}")
def test_golden_values(case):
    t, u = np.array(case["samples"]).T
    expected = np.array(case["y"], dtype=float)
    scale = case["x"][4] / case["x"][3]
    found = simulate(t, u, *case["x"], hold=case["hold"])
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-11 * scale)
    folded = input_map(t, u, case["hold"]).response(case["x"])
    np.testing.assert_allclose(folded, expected, rtol=0, atol=2e-12 * scale)


@pytest.mark.parametrize("hold", HOLDS)
def test_a_unit_step_gives_the_step_response(hold):
    t = 5.0 + np.arange(5000) * 0.02
    expected = step_response(t - 5.0, *X)
    found = simulate(t, np.ones(t.size), *X, hold=hold)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * GAIN)
    assert found[0] == 0.0
    assert spa_fo.simulate is simulate


@pytest.mark.parametrize("x", HARD)
@pytest.mark.parametrize("hold", HOLDS)
def test_irregular_samples_against_superposition(x, hold):
    t, u = jittered_log(300, 50.0, 1)
    expected = naive_simulate(t, u, x, hold)
    scale = 2.0 * x[4] / x[3]
    found = simulate(t, u, *x, hold=hold)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-10 * scale)
    folded = input_map(t, u, hold).response(x)
    np.testing.assert_allclose(folded, expected, rtol=0, atol=1e-10 * scale)


@pytest.mark.parametrize("hold", HOLDS)
def test_a_long_log_both_ways(hold):
    t, u = jittered_log(12000, 60.0, 2)
    response_map = input_map(t, u, hold)
    for x in HARD[:3]:
        difference = response_map.response(x) - simulate(t, u, *x, hold=hold)
        assert np.abs(difference).max() < 3e-10 * x[4] / x[3]


@settings(deadline=None, max_examples=50)
@given(signals(), st.sampled_from(HOLDS))
def test_linear_in_the_input(signal, hold):
    t, u, v = signal
    both = simulate(t, 2.0 * u - 3.0 * v, *X, hold=hold)
    apart = 2.0 * simulate(t, u, *X, hold=hold) - 3.0 * simulate(t, v, *X, hold=hold)
    np.testing.assert_allclose(both, apart, rtol=0, atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(signals(), st.sampled_from(HOLDS))
def test_map_and_simulation_agree(signal, hold):
    t, u, _ = signal
    if t[-1] == t[0]:
        assert np.all(simulate(t, u, *X, hold=hold) == 0.0)
        with pytest.raises(ValueError, match="positive time"):
            input_map(t, u, hold)
        return
    folded = input_map(t, u, hold).response(X)
    np.testing.assert_allclose(simulate(t, u, *X, hold=hold), folded, rtol=0, atol=2e-10)


@settings(deadline=None, max_examples=40)
@given(signals())
def test_holds_are_consistent(signal):
    """A held input is the linear one with every sample's value repeated before the next."""
    t, u, _ = signal
    doubled_t = np.repeat(t, 2)[1:]
    doubled_u = np.repeat(u, 2)[:-1]
    linear = simulate(doubled_t, doubled_u, *X, hold="linear")
    held = simulate(t, u, *X, hold="zero")
    np.testing.assert_allclose(linear[::2], held, rtol=0, atol=1e-10)


@pytest.mark.parametrize("hold", HOLDS)
def test_is_causal_and_ignores_the_origin_of_time(hold):
    t, u = jittered_log(200, 50.0, 3)
    y = simulate(t, u, *X, hold=hold)
    changed = u.copy()
    changed[150:] = 7.0
    np.testing.assert_allclose(simulate(t, changed, *X, hold=hold)[:150], y[:150], atol=1e-12)
    np.testing.assert_allclose(simulate(t + 1e3, u, *X, hold=hold), y, rtol=0, atol=1e-9)


def test_grunwald_letnikov_converges_to_it():
    errors = []
    for n in (500, 1000):
        t = np.linspace(0.0, 10.0, n + 1)
        u = np.sin(t)
        errors.append(np.abs(grunwald_letnikov_simulate(t, u, *X) - simulate(t, u, *X)).max())
    assert errors[0] < 1e-2
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("hold", HOLDS)
def test_jacobian_against_differences(hold):
    t, u = jittered_log(300, 50.0, 4)
    response_map = input_map(t, u, hold)
    for x in HARD[:3]:
        jacobian = response_map.jacobian(x)
        assert jacobian.shape == (300, 5)
        for i in range(5):
            h = 2e-4
            offsets = np.array([-2.0, -1.0, 1.0, 2.0]) * h
            moved = [
                response_map.response([v + d * (k == i) for k, v in enumerate(x)]) for d in offsets
            ]
            slope = (moved[0] - 8.0 * moved[1] + 8.0 * moved[2] - moved[3]) / (12.0 * h)
            np.testing.assert_allclose(jacobian[:, i], slope, rtol=0, atol=2e-8)


def test_phi_functions_where_their_series_take_over():
    for z in (1e-9 + 1e-9j, 0.0999 + 0j, 0.1001j, -0.31 + 0.05j, -0.32 + 0.05j, -3.0 + 4.0j):
        mean = sum(z**k / math.factorial(k + 1) for k in range(40))
        slope = sum((k + 1) * z**k / math.factorial(k + 2) for k in range(40))
        assert abs(phi1(z, np.exp(z)) - mean) < 1e-14
        assert abs(phi1_derivative(z, np.exp(z)) - slope) < 1e-14


@pytest.mark.parametrize(
    ("t", "u", "hold"),
    [
        ([0.0, 1.0], [1.0], "linear"),
        ([[0.0, 1.0]], [[1.0, 1.0]], "linear"),
        ([0.0, 2.0, 1.0], [1.0, 1.0, 1.0], "linear"),
        ([0.0, math.nan], [1.0, 1.0], "linear"),
        ([0.0, 1.0], [1.0, math.inf], "zero"),
        ([0.0, 1.0], [1.0, 1.0], "cubic"),
    ],
)
def test_refuses_bad_samples(t, u, hold):
    with pytest.raises(ValueError, match="must"):
        simulate(t, u, *X, hold=hold)
    with pytest.raises(ValueError, match="must"):
        input_map(t, u, hold)


def test_no_or_one_sample():
    assert simulate([], [], *X).shape == (0,)
    assert np.array_equal(simulate([2.0], [5.0], *X), [0.0])
