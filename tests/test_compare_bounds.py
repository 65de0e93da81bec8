"""Bounds of an angle by what has been of its input."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from spa_fo.compare.bounds import _tightest, learn_bounds, no_less
from spa_fo.compare.fading_memory import Signal, inputs

LAGS_S = np.array([0.2, 2.0])
MOMENTS = hnp.arrays(np.float64, (12, 3), elements=st.integers(0, 4).map(float))
READINGS = hnp.arrays(np.float64, 12, elements=st.floats(-5.0, 5.0))


def naive(at: np.ndarray, read: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """Bound the reading at one moment, by the words of `Bounds`."""
    low, high = -np.inf, np.inf
    for one in at:
        if (x >= one).all():
            low = max(low, min(r for a, r in zip(at, read, strict=True) if (a >= one).all()))
        if (x <= one).all():
            high = min(high, max(r for a, r in zip(at, read, strict=True) if (a <= one).all()))
    return low, high


@given(at=MOMENTS, read=READINGS, x=MOMENTS)
@settings(max_examples=60, deadline=None)
def test_bounds_are_the_tightest_that_a_reference_keeps(
    at: np.ndarray, read: np.ndarray, x: np.ndarray
) -> None:
    bounds = _tightest(at, read)
    low, high = bounds.of(x)
    for k, one in enumerate(x):
        assert (low[k], high[k]) == naive(at, read, one)
    low, high = bounds.of(at)
    assert ((low <= read) & (read <= high)).all()


def test_what_is_nowhere_less() -> None:
    one = np.array([[1.0, 2.0], [3.0, 0.0]])
    other = np.array([[1.0, 1.0], [0.0, 3.0], [3.0, 0.0]])
    assert no_less(one, other).tolist() == [[True, False, False], [False, False, True]]


def response(kpa: np.ndarray, t: np.ndarray) -> np.ndarray:
    """A creeping actuator that saturates: it preserves order."""
    return 40.0 * np.tanh(inputs([Signal(0.0, t, kpa, kpa)], np.array([0.5]))[0][:, 1] / 60.0)


@pytest.mark.parametrize(("end", "keeps"), [(1.0, True), (0.4, False)])
def test_pressed_harder_than_ever_it_bends_no_less(end: float, keeps: bool) -> None:
    t = np.arange(0.0, 20.0, 0.05)
    reference, campaign = np.clip(8.0 * t, 0.0, 50.0), np.clip(20.0 * t, 0.0, 120.0)
    x, asked = (inputs([Signal(0.0, t, u, u)], LAGS_S)[0] for u in (reference, campaign))
    bounds = learn_bounds(x, response(reference, t), [np.zeros(t.size, dtype=np.int64)])
    read = np.minimum(response(campaign, t), end * response(reference, t).max())
    beyond_range = campaign > 60.0
    moved = bounds.nearest(asked, read)[beyond_range] - read[beyond_range]
    if keeps:
        np.testing.assert_allclose(moved, 0.0, atol=1e-9)
    else:
        assert np.median(moved) > 10.0


def test_bounds_are_wider_by_what_they_are_broken_by_where_they_took_no_part() -> None:
    at = np.arange(8.0)[:, None]
    read = np.array([0.0, 1.0, 2.0, 3.0, 1.0, 5.0, 6.0, 7.0])  # the fifth falls back by 2
    trial = np.array([0, 0, 0, 0, 1, 1, 1, 1])
    bounds = learn_bounds(at, read, [trial])
    assert bounds.slack == pytest.approx(2.0)
    assert learn_bounds(at, read, [np.zeros(8, dtype=np.int64)]).slack == 0.0
    low, high = bounds.of(np.array([[20.0], [-1.0]]))
    np.testing.assert_allclose(low, [7.0 - 2.0, -np.inf])
    np.testing.assert_allclose(high, [np.inf, 0.0 + 2.0])
