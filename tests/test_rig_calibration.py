"""The flex sensor's curve, its error, hysteresis and drift."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import naive_rig
from spa_fo.errors import BadInput
from spa_fo.rig.calibration import Calibration, calibrate, drift
from spa_fo.rig.dwells import find_dwells
from spa_fo.rig.spa_rig_log import parse_spa_rig_log

ANGLES = [*range(0, 91, 15), *range(75, -1, -15)]


def dwells(
    curve: object,
    *,
    angles: list[int] = ANGLES,
    noise: float = 1.0,
    creep: float = 0.0,
    way: float = 0.0,
    seed: int = 0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whole counts of dwells of 2 s at 50 Hz."""
    rng = np.random.default_rng(seed)
    t, known, counts = [], [], []
    top = int(np.argmax(angles))
    for place, angle in enumerate(angles):
        inner = angles.count(angle) > 1
        side = (way / 2 if place < top else -way / 2) if inner else 0.0
        local = np.arange(100) * 0.02
        value = curve(angle) + side + creep * (1 - np.exp(-local / 0.3)) + rng.normal(0, noise, 100)  # type: ignore[operator]
        t.append(2.0 * place + local)
        known.append(np.full(100, float(angle)))
        counts.append(np.round(value))
    return np.concatenate(t), np.concatenate(known), np.concatenate(counts)


def bent(angle: float) -> float:
    return 350.0 + 4.0 * angle - 0.012 * angle**2


def falling(angle: float) -> float:
    return 800.0 - 3.0 * angle


@pytest.mark.parametrize("curve", [bent, falling])
def test_the_curve_is_found_within_its_own_error(curve: object) -> None:
    result = calibrate(*dwells(curve), "pre.log")
    angles = np.linspace(0, 90, 181)
    counts = np.array([curve(angle) for angle in angles])  # type: ignore[operator]
    error = result.angle_deg(counts) - angles
    assert np.abs(error).max() < 0.25
    assert np.all(np.abs(error) < 4.0 * result.sigma_deg(counts) + 1e-12)
    assert result.sigma_deg(counts).max() < 0.5
    assert result.range_deg == (0.0, 90.0)


def test_the_errors_are_as_large_as_claimed() -> None:
    counts = np.array([bent(angle) for angle in (0, 15, 30, 45, 60, 75, 90)])
    found = [calibrate(*dwells(bent, noise=3.0, seed=seed), "x") for seed in range(40)]
    scatter = np.std([curve.angle_deg(counts) for curve in found], axis=0)
    claimed = np.mean([curve.sigma_deg(counts) for curve in found], axis=0)
    assert np.all(claimed > 0.7 * scatter)
    assert np.all(claimed < 8.0 * scatter)


def test_hysteresis_is_reported_by_angle() -> None:
    result = calibrate(*dwells(bent, way=6.0), "pre.log")
    slope = np.array([4.0 - 0.024 * angle for angle in (15, 45, 75)])
    found = [result.hysteresis_deg[angle] for angle in (15.0, 45.0, 75.0)]
    np.testing.assert_allclose(found, 6.0 / slope, atol=0.25)
    assert 90.0 not in result.hysteresis_deg
    assert result.max_hysteresis_deg == pytest.approx(6.0 / slope[-1], abs=0.3)
    assert result.sigma_deg(bent(45)) >= 0.9 * 3.0 / slope[1]


def test_a_sensor_that_creeps_shows_within_its_dwells() -> None:
    still = calibrate(*dwells(bent, noise=0.5), "a")
    creeping = calibrate(*dwells(bent, noise=0.5, creep=10.0), "b")
    assert max(abs(dwell.settling) for dwell in still.dwells) < 0.5
    assert min(dwell.settling for dwell in creeping.dwells) > 3.0
    # The knots are the settled values: 10 counts above the curve, 2.5 deg.
    assert creeping.angle_deg(bent(45) + 10.0) == pytest.approx(45.0, abs=0.3)


def test_drift_within_a_dwell_has_an_honest_error() -> None:
    scores = []
    for seed in range(20):
        found = calibrate(*dwells(bent, noise=2.0, seed=seed), "x").dwells
        scores += [dwell.drift / dwell.drift_error for dwell in found]
    assert 0.8 < np.std(scores) < 1.2


def test_drift_of_a_later_calibration() -> None:
    first = calibrate(*dwells(bent), "pre.log", -600.0)
    same = drift(first, calibrate(*dwells(bent, seed=5), "again.log", 0.0))
    assert abs(same.mean_deg) < 0.1
    later = calibrate(*dwells(lambda a: bent(1.1 * a) + 8.0, seed=6), "post.log", 5400.0)
    found = drift(first, later)
    assert found.mean_deg == pytest.approx(0.1 * 45 + 8.0 / 3.0, abs=0.6)
    assert found.slope > 0.08
    assert found.max_deg == np.abs(found.drift_deg).max()
    assert json.loads(json.dumps(found.to_dict()))["file"] == "post.log"


def test_outside_its_range_the_curve_is_a_line_and_says_so() -> None:
    result = calibrate(*dwells(bent), "pre.log")
    low, high = result.counts[0], result.counts[-1]
    x = np.array([low - 40, low - 20, low, 0.5 * (low + high), high, high + 20, high + 40])
    assert result.outside(x).tolist() == [True, True, False, False, False, True, True]
    angle = result.angle_deg(x)
    assert angle[1] - angle[0] == pytest.approx(angle[2] - angle[1])
    assert angle[6] - angle[5] == pytest.approx(angle[5] - angle[4])
    assert angle[0] == pytest.approx(-40 / 4.0, abs=1.0)
    sigma = result.sigma_deg(x)
    assert sigma[0] > sigma[1] > sigma[2]
    assert np.isfinite(result.angle_deg([0, 1023])).all()


def test_noise_that_breaks_monotony_is_smoothed_and_said() -> None:
    def flat_in_the_middle(angle: float) -> float:
        return 350.0 + angle - (10.0 if angle == 45 else 0.0) + (10.0 if angle == 30 else 0.0)

    result = calibrate(*dwells(flat_in_the_middle), "pre.log")
    assert "knots not monotone" in result.notes[0]
    x = np.linspace(result.counts[0] - 10, result.counts[-1] + 10, 400)
    assert np.all(np.diff(result.angle_deg(x)) > 0)
    assert result.sigma_deg(387.5) > 5.0


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(1.0, 40), min_size=4, max_size=9), st.integers(0, 99), st.booleans())
def test_the_curve_is_monotone_whatever_the_sensor(
    steps: list[float], seed: int, rising: bool
) -> None:
    levels = np.cumsum([300.0, *steps])
    angles = [10 * i for i in range(len(levels))]

    def curve(angle: int) -> float:
        return float(levels[angle // 10]) if rising else 1000.0 - float(levels[angle // 10])

    result = calibrate(*dwells(curve, angles=angles, seed=seed), "x")
    x = np.linspace(0, 1023, 500)
    change = np.diff(result.angle_deg(x))
    assert np.all(change >= 0) if rising else np.all(change <= 0)
    assert np.all(result.sigma_deg(x) > 0)


def test_isotonic_regression_is_what_it_says() -> None:
    # The twin of the library call that the curve rests on.
    from scipy.optimize import isotonic_regression

    values = [1.0, 3.0, 2.0, 2.0, 5.0, 4.0, 0.0, 6.0]
    np.testing.assert_allclose(isotonic_regression(values).x, naive_rig.naive_monotone(values))


@pytest.mark.parametrize(
    ("angles", "curve", "message"),
    [
        ([0, 90, 0], bent, "dwells at 2 known angles; expected a calibration of at least 3"),
        ([0], bent, "dwells at 1 known angles"),
        (ANGLES, lambda a: 350.0, "its counts hardly change"),
        ([0, 30, 60, 90], lambda a: 400.0 + 50.0 * (a > 40), "counts differ at 2 angles only"),
        ([0, 30, 60, 90], lambda a: 500.0 - 50.0 * (a % 60 > 0), "neither rise nor fall"),
    ],
)
def test_calibrations_that_cannot_be_used(angles: list[int], curve: object, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        calibrate(*dwells(curve, angles=angles, noise=0.0), "pre.log")


def test_short_stretches_are_no_dwells() -> None:
    t, known, counts = dwells(bent)
    known[150:155] = 22.0
    found, notes = find_dwells(t, known, counts)
    assert 22.0 not in {dwell.angle_deg for dwell in found}
    assert notes == ["1 stretches of fewer than 8 samples left out"]


def test_directions() -> None:
    found, _ = find_dwells(*dwells(bent))
    assert [dwell.direction for dwell in found] == ["up"] * 7 + ["down"] * 6
    down, _ = find_dwells(*dwells(bent, angles=[90, 60, 30]))
    assert {dwell.direction for dwell in down} == {"down"}


def held(angles: list[int], move_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Dwells of 2 s at 50 Hz with a silent move before each, and what each reads."""
    t = [place * (2.0 + move_s) + np.arange(100) * 0.02 for place in range(len(angles))]
    counts = [np.full(100, bent(angle) + place) for place, angle in enumerate(angles)]
    return np.concatenate(t), np.repeat(np.array(angles, dtype=float), 100), np.concatenate(counts)


@pytest.mark.parametrize("move_s", [0.4, 0.8, 3.0])
def test_two_dwells_at_the_turn_are_told_by_the_move_between_them(move_s: float) -> None:
    angles = [0, 30, 60, 60, 30, 0]
    found, _ = find_dwells(*held(angles, move_s))
    assert [dwell.angle_deg for dwell in found] == angles
    assert [dwell.noise for dwell in found] == pytest.approx([0.0] * 6, abs=1e-9)


@pytest.mark.parametrize("move_s", [0.0, 0.1, 0.2, 0.8])
@pytest.mark.parametrize("lost_s", [0.1, 0.2, 0.3, 0.6])
def test_lost_lines_do_not_cut_a_dwell(move_s: float, lost_s: float) -> None:
    t, known, counts = held([0, 30, 60, 30, 0], move_s)
    kept = ~((t > t[230]) & (t < t[230] + lost_s))
    found, _ = find_dwells(t[kept], known[kept], counts[kept])
    assert len(found) == 5


def test_a_log_that_comes_in_bursts_is_not_cut_by_them() -> None:
    _, known, counts = held([0, 30, 60, 30, 0], 0.0)
    every = np.arange(known.size)
    found, _ = find_dwells(0.1 * (every // 10) + 0.001 * (every % 10), known, counts)
    assert len(found) == 5


def test_one_way_only_says_that_hysteresis_is_not_known() -> None:
    result = calibrate(*dwells(bent, angles=[0, 30, 60, 90]), "pre.log")
    assert result.max_hysteresis_deg is None
    assert "hysteresis not known" in result.notes[-1]


def test_it_goes_to_json_and_comes_from_a_log() -> None:
    log = parse_spa_rig_log(naive_rig.calibration_log(), "pre.log")
    result: Calibration = calibrate(
        log.t_s, log.columns["angle_deg"], log.columns["flex_adc"], "pre.log"
    )
    stored = json.loads(json.dumps(result.to_dict()))
    assert len(stored["counts"]) == 7
    assert len(stored["dwells"]) == 13
    assert stored["max_hysteresis_deg"] == pytest.approx(0.5, abs=0.15)
