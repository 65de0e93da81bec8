"""The sensor in the calibration fixture, in rows."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

import naive_rig
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.plant.fixture import Fixture, fixture_of, wandering
from spa_fo.plant.specimen import Mounting
from spa_fo.plant.stages import felt_angle
from spa_fo.rig import Calibration, Dwell
from spa_fo.rig.calibration import calibrate
from spa_fo.rig.spa_rig_log import parse_spa_rig_log


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    log = parse_spa_rig_log(naive_rig.calibration_log(), "pre.log")
    return calibrate(log.t_s, log.columns["angle_deg"], log.columns["flex_adc"], "pre.log")


def laid_out(*calibrations: Calibration) -> Fixture:
    fixture = fixture_of(calibrations, 1000.0)
    assert fixture is not None
    return fixture


def test_how_the_first_dwell_settles_says_nothing(calibration: Calibration) -> None:
    fixture = laid_out(calibration)
    first = fixture.dwell == 0
    # Its weight beside all others is nothing; those are known to a fraction of a degree.
    weight = fixture.sigma_deg**-2.0
    assert weight[first].sum() < 1e-3 * weight[~first].sum()
    assert fixture.sigma_deg[~first].max() < 1.0


def test_only_the_first_dwell_of_each_calibration(calibration: Calibration) -> None:
    fixture = laid_out(calibration, replace(calibration, started_s=500.0))
    unsure = np.unique(fixture.dwell[fixture.sigma_deg > 1.0])
    assert unsure.tolist() == [0, len(calibration.dwells)]


def test_without_an_effect_nothing_is_to_be_seen(calibration: Calibration) -> None:
    fixture = laid_out(calibration)
    seen, mounting = fixture.simulate(absent())
    assert seen.shape == fixture.deviation_deg.shape
    assert not seen.any()
    assert mounting.logged_deg(np.array([30.0])) == pytest.approx([30.0])


def test_no_calibration_no_fixture() -> None:
    assert fixture_of((), 0.0) is None


def test_what_is_read_errs_by_the_errors_of_known_angles(calibration: Calibration) -> None:
    fixture, known = laid_out(calibration), [dwell.angle_deg for dwell in calibration.dwells]
    error_deg = np.random.default_rng(1).normal(0.0, 1e-3, len(known))
    at = np.unique(known)
    mean = np.array([error_deg[np.array(known) == angle].mean() for angle in at])
    # The same counts, laid to the angles at which the sensor was in truth.
    right = replace(calibration, angles_deg=calibration.of_known @ (at + mean))
    counts = np.linspace(calibration.counts[0] - 60.0, calibration.counts[-1] + 40.0, 300)
    read = calibration.angle_deg(counts)
    expected = read - right.angle_deg(counts)
    np.testing.assert_allclose(
        fixture.misread(read) @ (fixture.of_known @ error_deg), expected, atol=2e-5
    )


def shaken(calibration: Calibration, sigma: float, seed: int) -> Calibration:
    """Add noise to a calibration's counts that hardly changes while a window lasts."""
    rng = np.random.default_rng(seed)

    def wave(dwell: Dwell) -> NDArray[np.float64]:
        parts = np.array_split(np.zeros(dwell.counts.size), 8)
        return np.concatenate([part + sigma * rng.normal() for part in parts])

    dwells = [replace(d, counts=d.counts + wave(d)) for d in calibration.dwells]
    return replace(calibration, dwells=tuple(dwells))


def test_windows_err_by_the_coloured_noise_that_they_show(calibration: Calibration) -> None:
    slope = np.ptp(calibration.angles_deg) / np.ptp(calibration.counts)
    quiet = laid_out(calibration).sigma_deg[8:]
    for counts in (2.0, 6.0):
        found = [laid_out(shaken(calibration, counts, seed)).sigma_deg[8:] for seed in range(20)]
        # Two pieces of noise to a window.
        expected = np.hypot(np.median(quiet), counts * slope / np.sqrt(2.0))
        assert np.median(found) == pytest.approx(expected, rel=0.3)


def test_a_sensor_that_still_moves_is_no_noise(calibration: Calibration) -> None:
    def moving(dwell: Dwell) -> Dwell:
        way = {"up": 1.0, "down": -1.0}.get(dwell.direction, 0.0)
        return replace(dwell, counts=dwell.counts - 40.0 * way * np.exp(-dwell.t_s / 4.0))

    still = laid_out(calibration)
    settling = laid_out(replace(calibration, dwells=tuple(map(moving, calibration.dwells))))
    np.testing.assert_allclose(settling.sigma_deg[8:], still.sigma_deg[8:], rtol=0.02)


def test_nor_is_one_that_moves_in_proportion_to_uneven_steps() -> None:
    rng, dwells = np.random.default_rng(2), 13
    moves = np.array(
        [0.0, 5.0, 5.0, 10.0, 20.0, 20.0, 30.0, -30.0, -20.0, -20.0, -10.0, -5.0, -5.0]
    )
    ways, dwell = np.where(moves < 0.0, "down", "up"), np.repeat(np.arange(dwells), 2)
    moving = 0.1 * np.where(np.arange(2 * dwells) % 2, 0.01, 0.0) * moves[dwell]
    sigma = np.where(dwell == 0, 10.0, 0.06)
    white = 0.06 * rng.normal(size=2 * dwells)
    still, found = (
        wandering(white + size * moving, sigma, dwell, ways, moves) for size in (0.0, 1e3)
    )
    assert found == pytest.approx(still, abs=1e-6)
    assert still < 0.06


def test_a_later_calibration_at_other_angles_errs_by_the_first_curve(
    calibration: Calibration,
) -> None:
    other = tuple(replace(d, angle_deg=d.angle_deg + 3.0) for d in calibration.dwells)
    fixture = laid_out(calibration, replace(calibration, dwells=other, started_s=5000.0))
    known, dwells = np.unique([d.angle_deg for d in calibration.dwells]), len(other)
    misread = fixture.misread(known + 3.0)
    np.testing.assert_allclose(fixture.misread_later, misread)
    np.testing.assert_allclose(fixture.drifted[:, :dwells], misread @ fixture.of_known[:, :dwells])
    # At the same angles the first calibration read it, too.
    same = laid_out(calibration, replace(calibration, started_s=5000.0))
    assert not same.misread_later.any()


def test_a_loop_is_read_as_the_curve_reads_it_that_was_drawn_through_it() -> None:
    # Only one way comes to the first angle and to the last: there the loop bends the curve.
    effects = absent()
    effects[LIBRARY["sensor_hysteresis"].slots] = 4.2, 2.8, 0.1, 0.0, 0.0, 80.0
    known = np.concatenate([np.arange(0.0, 16.0, 3.0), np.arange(12.0, -1.0, -3.0)])
    path = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise([0.0, *known])])
    read = felt_angle(path, np.zeros(path.size, dtype=np.int64), effects, Mounting().film)
    counts = 200.0 + 10.0 * read[49::50]
    t_s = np.arange(60.0 * known.size) / 20.0
    calibrated = calibrate(t_s, np.repeat(known, 60), np.repeat(counts, 60), "pre.log")
    fixture = laid_out(calibrated)
    seen, _ = fixture.simulate(effects)
    sure = fixture.sigma_deg < 1.0
    assert np.abs(fixture.deviation_deg[sure]).max() > 2.0
    np.testing.assert_allclose(seen[sure], fixture.deviation_deg[sure], atol=0.35)


def test_which_way_a_film_is_turned_after_a_calibration_nobody_knows(
    calibration: Calibration,
) -> None:
    effects = absent()
    effects[LIBRARY["sensor_hysteresis"].slots] = 4.2, 2.8, 0.5, 0.4, 0.0, 80.0
    _, mounting = laid_out(calibration).simulate(effects)
    assert mounting.film[0] == 0.0  # where the loop begins
