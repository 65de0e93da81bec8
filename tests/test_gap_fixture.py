"""The sensor in the calibration fixture, in rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import naive_rig
from spa_fo.gap.data.fixture import Fixture, fixture_of
from spa_fo.plant.effects.library import absent
from spa_fo.rig import Calibration
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
