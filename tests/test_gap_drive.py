"""Fits of the measured pressure, and the pressure that the angle's fits are driven by."""

from dataclasses import replace

import numpy as np
import pytest

from plant_cases import KPA, SIXTY, X, campaign_data, step_release, trials
from spa_fo import simulate
from spa_fo.gap.candidates import _with_missed
from spa_fo.gap.drive import fit_drive, fit_drives
from spa_fo.gap.evidence import collect
from spa_fo.plant.memory import FINEST_STEP_S

NOISE_KPA = 0.1


def driven(delays_s, levels_kpa=(SIXTY,), leak_per_s=0.0):
    """Trials of jumps that the drive follows late, each after a delay of its own."""
    rng = np.random.default_rng(3)
    own = []
    commands = [step_release(level) for level in levels_kpa for _ in delays_s]
    for trial, delay_s in zip(trials(*commands), list(delays_s) * len(levels_kpa), strict=True):
        # The command of a row holds until the next one's time.
        at = np.searchsorted(trial.t_s, trial.t_s - delay_s - 1e-9, side="left") - 1
        pressure = np.where(at >= 0, trial.command_kpa[np.maximum(at, 0)], 0.0)
        pressure = pressure * np.exp(-leak_per_s * trial.t_s)
        angle = np.degrees(simulate(trial.t_s, pressure / KPA, *X, hold="zero"))
        noisy = pressure + NOISE_KPA * rng.normal(size=pressure.size)
        own.append(
            replace(
                trial,
                pressure_kpa=noisy,
                angle_deg=angle + 0.1 * rng.normal(size=angle.size),
            )
        )
    return collect(campaign_data(own))


@pytest.mark.parametrize("delay_s", [0.08, 0.34, 0.9])
def test_a_delay_of_any_length_is_found(delay_s):
    found = fit_drive(driven([delay_s] * 4), ("dead_time",))
    assert found.searched[0] == pytest.approx(delay_s, abs=0.03)


def test_a_delay_that_varies_is_still_a_delay():
    evidence = driven([0.20, 0.26, 0.32, 0.38])
    fits = fit_drives(evidence)
    alone = {ids: fit for ids, fit in fits.items() if len(ids) == 1}
    best = max(alone, key=lambda ids: alone[ids].log_evidence)
    assert best == ("dead_time",)
    assert alone[best].searched[0] == pytest.approx(0.29, abs=0.06)


def test_what_is_weak_alone_is_tried_beside_the_best():
    fits = fit_drives(driven([0.3] * 4, leak_per_s=0.01))
    best = max(fits, key=lambda ids: fits[ids].log_evidence)
    assert best == ("dead_time", "leak")


def test_the_angle_is_driven_by_what_each_trial_was():
    delays = [0.20, 0.26, 0.32, 0.38]
    evidence = driven(delays)
    pressure = _with_missed(evidence, fit_drive(evidence, ("dead_time",)))
    grid = evidence.grid
    for trial, delay_s in enumerate(delays):
        first, end = grid.cell_starts[trial : trial + 2]
        rise = np.argmax(pressure[first:end] > 0.5 * SIXTY) * FINEST_STEP_S
        assert rise == pytest.approx(0.5 + delay_s, abs=0.035)


def test_a_lone_sample_beside_a_jump_is_no_pressure():
    evidence = driven([0.0] * 4)
    plain = fit_drive(evidence, ())
    own = plain.residual_kpa.copy()
    at = int(np.argmax(np.abs(np.gradient(plain.predicted_kpa))))
    own[at] += 40.0
    struck = _with_missed(evidence, replace(plain, residual_kpa=own))
    np.testing.assert_allclose(struck, _with_missed(evidence, plain), atol=1e-9)
