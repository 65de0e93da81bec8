"""Made-up trials and step data for the identification's tests."""

from __future__ import annotations

import numpy as np

from spa_fo.fractional import simulate, step_response
from spa_fo.identify import StepData
from spa_fo.plant import TABLE_I
from spa_fo.rig import Trial

TRUTH = TABLE_I["design_1"].as_array()


def steps(
    trials: int = 4,
    noise_deg: float = 0.5,
    seed: int = 0,
    x: np.ndarray = TRUTH,
    gain_scatter: float = 0.0,
) -> StepData:
    """Trials at u = 1 and as many at u = 2: noise, and a gain of its own for each trial."""
    generator = np.random.default_rng(seed)
    t = np.arange(1, 51) / 5.0
    u = np.repeat([1.0, 2.0], trials)
    gain = 1.0 + gain_scatter * generator.standard_normal(u.size)
    clean = (u * gain)[:, np.newaxis] * step_response(t, *x)
    return StepData(
        experiments=("low",) * trials + ("high",) * trials,
        trials=(*range(1, trials + 1),) * 2,
        orders=np.arange(1, 2 * trials + 1),
        setpoint_deg=np.repeat([30.0, 60.0], trials),
        u=u,
        t=t,
        angle_rad=clean + np.radians(noise_deg) * generator.standard_normal(clean.shape),
    )


def trial(
    command: np.ndarray,
    rate_hz: float = 50.0,
    x: np.ndarray = TRUTH,
    noise_deg: float = 0.0,
    experiment: str = "step_30",
    number: int = 1,
    protocol: str = "step",
    order: int = 1,
    setpoint_deg: float | None = 30.0,
) -> Trial:
    """One trial of the model itself under a command in kPa, u = command / 30 kPa."""
    t = np.arange(command.size) / rate_hz
    angle = np.degrees(simulate(t, command / 30.0, *x, hold="zero"))
    angle += noise_deg * np.random.default_rng(order).standard_normal(t.size)
    none = np.zeros(t.size, dtype=bool)
    return Trial(
        experiment=experiment,
        trial=number,
        protocol=protocol,
        setpoint_deg=setpoint_deg,
        order=order,
        started_s=0.0,
        t_s=t,
        command_kpa=command,
        pressure_kpa=None,
        flex_adc=None,
        angle_deg=angle,
        after_reset=none,
        outside_calibration=none.copy(),
    )


def step_command(before: int = 50, on: int = 400, after: int = 0, kpa: float = 27.5) -> np.ndarray:
    return np.concatenate([np.zeros(before), np.full(on, kpa), np.zeros(after)])
