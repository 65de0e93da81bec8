"""The curve of a calibration whose known angles err."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from spa_fo.rig.calibration import Calibration, calibrate
from spa_fo.rig.smooth_knots import Series, smoother

ANGLES = np.linspace(0.0, 90.0, 14)
BEYOND = np.array([-15.0, -10.0, -5.0])
WITHIN = np.linspace(0.0, 90.0, 91)


def counts_of(angle_deg: np.ndarray) -> np.ndarray:
    return 3500.0 + 40.0 * angle_deg - 0.12 * angle_deg**2


def series(error_deg: float, seed: int, k: int = 14) -> Series:
    x = np.linspace(0.0, 1.0, k)
    error = np.random.default_rng(seed).normal(0.0, error_deg, k)
    return Series(x, 90.0 * x + 8.0 * x**2 + error, np.full(k, 1e-6), np.ones(k))


def calibrated(error_deg: float, seed: int, both: bool = False) -> Calibration:
    """Dwells of 2 s at angles that differ from what the log says of them."""
    rng = np.random.default_rng(seed)
    said = np.concatenate([ANGLES, ANGLES[-2::-1]]) if both else ANGLES
    true = said + rng.normal(0.0, error_deg, said.size)
    noise = rng.normal(0.0, 2.0, (said.size, 100))
    t = 2.5 * np.arange(said.size)[:, None] + 0.02 * np.arange(100)
    counts = np.round(counts_of(true)[:, None] + noise)
    return calibrate(t.ravel(), np.repeat(said, 100), counts.ravel(), "pre.log")


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


@settings(deadline=None, max_examples=20)
@given(st.floats(-50.0, 50.0), st.floats(-100.0, 100.0), st.floats(-30.0, 30.0), st.integers(4, 19))
def test_a_quadratic_is_no_scatter(a: float, b: float, c: float, k: int) -> None:
    x = np.linspace(0.0, 1.0, k) ** 1.2
    values = a + b * x + c * x**2
    found = smoother(Series(x, values, np.full(k, 1e-8), np.ones(k))) @ values
    np.testing.assert_allclose(found, values, atol=1e-6)


def test_three_angles_say_nothing_of_their_scatter() -> None:
    three = Series(np.array([0.0, 0.4, 1.0]), np.array([0.0, 50.0, 90.0]), np.zeros(3), np.ones(3))
    np.testing.assert_array_equal(smoother(three), np.eye(3))


@pytest.mark.parametrize("both", [False, True])
def test_scatter_of_the_known_angles_is_smoothed_away(both: bool) -> None:
    left, before, beyond, beyond_before = [], [], [], []
    for seed in range(20):
        found = calibrated(0.6, seed, both)
        raw = PchipInterpolator(found.counts, ANGLES)
        at, end = counts_of(WITHIN), counts_of(BEYOND)
        left.append(rms(found.angle_deg(at) - WITHIN))
        before.append(rms(raw(np.clip(at, found.counts[0], found.counts[-1])) - WITHIN))
        beyond.append(rms(found.angle_deg(end) - BEYOND))
        slope = float(raw.derivative()(found.counts[0]))
        beyond_before.append(rms(ANGLES[0] + slope * (end - found.counts[0]) - BEYOND))
    assert np.mean(left) < 0.75 * np.mean(before)
    assert np.mean(beyond) < 0.8 * np.mean(beyond_before)


def test_exact_angles_stay_what_they_are() -> None:
    found = calibrated(0.0, 3)
    np.testing.assert_allclose(found.angles_deg, ANGLES, atol=0.05)


def test_a_sensor_that_bends_sharply_is_followed() -> None:
    """What no quadratic has is no scatter where the angles lie close and do not err."""
    x = np.linspace(0.0, 1.0, 19)
    values = 90.0 * x + 6.0 * np.tanh(6.0 * (x - 0.5))
    found = smoother(Series(x, values, np.full(19, 1e-4), np.ones(19))) @ values
    assert np.abs(found - values).max() < 0.1


def test_the_ways_up_and_down_say_how_much_they_err() -> None:
    """Ways that differ smoothly speak for angles that do not err, whatever the curve does."""
    known = series(0.3, 1)
    own = Series(known.at, 2.0 * np.sin(2.0 * known.at), known.noise, np.full(14, 2.0))
    scattered = Series(
        known.at, np.random.default_rng(5).normal(0.0, 0.45, 14), known.noise, np.full(14, 2.0)
    )
    alone, smooth, wild = (
        float(np.trace(smoother(known, beside))) for beside in (None, own, scattered)
    )
    assert smooth > alone > wild


def test_an_error_of_the_known_angles_moves_readings_as_is_said() -> None:
    """What a calibration misreads for the errors of its angles, within and beyond them."""
    at, left, all_of_it = np.concatenate([BEYOND, WITHIN]), [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)  # as `calibrated` draws them
        error = rng.normal(0.0, 0.6, ANGLES.size)
        found = calibrated(0.6, seed)
        misread = found.angle_deg(counts_of(at)) - at
        left.append(rms(misread + found.misread_deg(at) @ error))
        all_of_it.append(rms(misread))
    assert np.mean(left) < 0.6 * np.mean(all_of_it)
