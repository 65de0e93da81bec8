"""Step responses on a fixed grid, and the same bits for any number of threads."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naive_fractional import naive_map_response
from spa_fo.fractional import step_map, step_response, step_response_jacobian
from test_fractional_step import parameters

GOLDEN = json.loads((Path(__file__).parent / "golden" / "fractional.json").read_text())
X = (1.406, 1.196, 0.794, 1.638, 0.934)
GRID = np.arange(1, 51) * 0.2
MAP = step_map(GRID)


@pytest.mark.parametrize("case", GOLDEN["step"], ids=lambda case: str(case["x"]))
def test_against_multiple_precision(case):
    expected = np.array(case["y"], dtype=float)
    found = step_map(case["t"]).response(case["x"])
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-12 * case["x"][4] / case["x"][3])


@settings(deadline=None, max_examples=150)
@given(parameters())
def test_any_parameters_against_the_response_per_point(x):
    found = MAP.response(x)
    np.testing.assert_allclose(found, step_response(GRID, *x), rtol=0, atol=5e-11 * x[4] / x[3])


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 23),
    st.floats(-9.0, -0.7),
    st.floats(0.0, 2.0 * math.pi),
    st.floats(1.05, 1.999),
    st.floats(0.05, 0.999),
)
def test_a_pole_near_or_on_a_node(node, distance, direction, alpha2, share):
    p = MAP.nodes[node] * (1.0 + 10.0**distance * np.exp(1j * direction))
    alpha1 = alpha2 * share
    a1 = -(p**alpha2).imag / (p**alpha1).imag
    a0 = -(p**alpha2 + a1 * p**alpha1).real
    if p.imag <= 0.0 or not (a1 > 0.0 and 1e-3 < a0 < 1e5):
        return
    x = (alpha2, alpha1, a1, a0, a0)
    np.testing.assert_allclose(MAP.response(x), step_response(GRID, *x), rtol=0, atol=5e-11)
    jacobian = step_response_jacobian(GRID, *x)
    scale = np.abs(jacobian).max()
    np.testing.assert_allclose(MAP.jacobian(x), jacobian, rtol=0, atol=1e-9 * scale)


@pytest.mark.parametrize(
    "x",
    [
        # critical damping of integer order, approached from every side
        (1.9999999, 1.0000001, 2.0, 1.0, 1.0),
        (1.9999999, 0.9999999, 2.0000001, 1.0, 1.0),
        (1.999, 1.001, 1.999, 1.0, 1.0),
        (1.99999999, 1.99999998, 0.5, 2.0, 2.0),
        (1.00000001, 0.99999999, 1.0, 1.0, 1.0),
        (1.5, 0.2, 1e-12, 1.0, 1.0),
        (1.5, 0.2, 0.0, 1.0, 1.0),
        (1.5, 1.2, 1e4, 1e-4, 1e-4),
    ],
)
def test_edges_of_the_domain(x):
    np.testing.assert_allclose(MAP.response(x), step_response(GRID, *x), rtol=0, atol=5e-11)
    assert np.all(np.isfinite(MAP.jacobian(x)))


@settings(deadline=None, max_examples=60)
@given(parameters())
def test_jacobian_against_the_one_per_point(x):
    expected = step_response_jacobian(GRID, *x)
    found = MAP.jacobian(x)
    assert found.shape == (50, 5)
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-10 * max(scale, 1.0))


@pytest.mark.parametrize("alpha2", [0.3, 0.8, 1.0])
def test_kernel_against_plain_matrix_product(alpha2):
    x = (alpha2, 0.6 * alpha2, 0.7, 1.3, 0.9)
    np.testing.assert_allclose(MAP.response(x), naive_map_response(MAP, x), rtol=0, atol=1e-13)


def test_zero_numerator():
    x = (*X[:4], 0.0)
    assert np.all(MAP.response(x) == 0.0)
    np.testing.assert_allclose(
        MAP.jacobian(x)[:, 4], MAP.response((*X[:4], 1.0)), rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("span", [1.0, 1e2, 1e4, 1e6, 1e9])
def test_one_map_for_any_range_of_times(span):
    t = np.concatenate(([0.0], np.geomspace(0.01, 0.01 * span, 40)))
    for x in (X, (0.9, 0.4, 0.5, 0.3, 0.6)):
        found = step_map(t).response(x)
        assert found[0] == 0.0
        np.testing.assert_allclose(found, step_response(t, *x), rtol=0, atol=2e-11 * x[4] / x[3])


@pytest.mark.parametrize("t", [[], [0.0], [-1.0, 1.0], [2.0, 1.0], [[1.0]], [1.0, math.nan]])
def test_refuses_bad_times(t):
    with pytest.raises(ValueError, match="must"):
        step_map(t)


@pytest.mark.parametrize("x", [(1.0,) * 4, (1.2, 1.3, 1.0, 1.0, 1.0), (1.4, 1.2, 1.0, 0.0, 1.0)])
def test_refuses_bad_parameters(x):
    with pytest.raises(ValueError, match="must"):
        MAP.response(x)
    with pytest.raises(ValueError, match="must"):
        MAP.jacobian(x)


THREADS = """
import hashlib, sys
import numba, numpy as np
from numba import get_thread_id, prange
from spa_fo.fractional import jacobian_on_map, response_on_map, step_map

@numba.njit(parallel=True)
def evaluate(xs, arrays, work, out, slopes):
    for i in prange(xs.shape[0]):
        response_on_map(xs[i], arrays, work[get_thread_id()], out[i])
        jacobian_on_map(xs[i], arrays, work[get_thread_id()], slopes[i])

grid = step_map(np.arange(1, 51) * 0.2)
rng = np.random.default_rng(5)
xs = np.array([1.406, 1.196, 0.794, 1.638, 0.934]) * rng.uniform(0.8, 1.2, (400, 5))
xs[:, 1] = np.minimum(xs[:, 1], xs[:, 0] - 1e-6)
out, slopes = np.empty((400, 50)), np.empty((400, 5, 50))
for threads in (1, numba.config.NUMBA_NUM_THREADS):
    numba.set_num_threads(threads)
    work = np.stack([grid.work() for _ in range(threads)])
    evaluate(xs, grid.arrays, work, out, slopes)
    print(threads, hashlib.sha256(out.tobytes() + slopes.tobytes()).hexdigest())
"""


def test_the_same_bits_for_one_and_two_threads():
    run = subprocess.run(
        [sys.executable, "-c", THREADS],
        env={**os.environ, "NUMBA_NUM_THREADS": "2"},
        capture_output=True,
        text=True,
        check=True,
    )
    (one, first), (two, second) = (line.split() for line in run.stdout.splitlines())
    assert (one, two) == ("1", "2")
    assert first == second
