"""Made-up trials, campaigns and effects for the simulator's tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identify_cases import trial as one_trial
from spa_fo.plant import TABLE_I, Model, TransferFunction
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.rig import Campaign, CampaignData, Experiment, LogFormat, Provenance, Trial, TrialFile

X = TABLE_I["design_1"].as_array()
KPA = 30.0
SIXTY = 55.0  # kPa: settles at 60 degrees

# One visible size of each effect; what is not named here begins where searches do.
SIZES: dict[str, dict[str, float]] = {
    "dead_time": {"delay_s": 0.13, "uneven": 0.0},
    "line_lag": {
        "time_constant_s": 0.4,
        "second_pole": 0.3,
        "tail_share": 0.2,
        "venting_excess": 0.5,
        "orifice_share": 0.6,
    },
    "supply_droop": {
        "fraction": 0.12,
        "recovery_s": 2.0,
        "slow_share": 0.3,
        "exponent": 1.3,
        "throttled_share": 0.4,
        "slower": 6.0,
        "steady_share": 0.4,
        "building_s": 0.2,
    },
    "leak": {
        "rate_per_s": 0.02,
        "makeup_per_s": 0.05,
        "vented_share": 0.6,
        "renewal_per_kpa": 0.02,
        "below_share": 0.4,
        "kept_share": 0.3,
        "opens_per_kpa": 0.0,
    },
    "slew_limit": {"rise_kpa_s": 60.0, "fall_ratio": 0.7, "approach_kpa": 3.0},
    "drive_backlash": {
        "play_kpa": 3.0,
        "centre": 0.4,
        "kept": 1.0,
        "wait_s": 0.0,
        "vented": 0.0,
        "vent_s": 0.0,
        "ready": 0.0,
        "catch_up": 0.0,
    },
    "stiffening": {"fraction_at_60deg": 0.15, "exponent": 2.2, "by_load": 0.3},
    "gravity_load": {"along_rest": 0.1, "across_rest": 0.1, "at_rest": 0.0},
    "contact_stop": {"angle_deg": 40.0, "stiffness": 3.0, "softness_deg": 4.0},
    "mullins_softening": {"fraction": 0.2},
    "creep": {
        "per_decade": 0.06,
        "typical_s": 20.0,
        "decades": 1.2,
        "by_angle": 0.3,
        "growth": 0.4,
    },
    "hysteresis": {
        "moment_deg": 4.0,
        "turn_deg": 20.0,
        "tail": 1.5,
        "outside": 0.3,
        "begins": -0.4,
        "forgets": 0.25,
    },
    "thermal_drift": {"per_hour": 0.5, "fading_per_hour": 0.5, "of_stiffness": 0.4},
    "parameter_shift": {},
    "sensor_nonlinearity": {
        "at_minus_10deg": 1.0,
        "at_24deg": 2.0,
        "at_60deg": -3.0,
        "wider": -0.2,
    },
    "sensor_saturation": {"ceiling_deg": 50.0, "knee_deg": 3.0},
    "sensor_lag": {
        "time_constant_s": 0.3,
        "second_pole": 0.3,
        "tail_share": 0.2,
        "return_excess": 0.5,
    },
    "sensor_creep": {"per_decade": 0.06, "typical_s": 6.0, "decades": 0.8, "growth": 0.5},
    "sensor_hysteresis": {
        "width_deg": 3.0,
        "turn_deg": 4.0,
        "exponent": 0.6,
        "begins": 0.3,
        "lens": 0.4,
        "span_deg": 70.0,
    },
    "sensor_slip": {"walk_deg": 0.4, "zero_deg": -1.0},
    "channel_latency": {"delay_s": 0.13},
    "mains_pickup": {"amplitude_deg": 1.0},
    "drive_overshoot": {"fraction": 0.15, "period_s": 1.2, "damping": 0.3},
    "drive_hunting": {"fall": 0.2, "period_s": 3.0},
    "supply_limit": {"highest_kpa": 20.0},
    "gain_growth": {"growth": 0.15, "exponent": 0.8},
    "opening_fold": {"opening_kpa": 4.0, "sharpness": 3.0},
    "pressure_set": {"set_kpa": 2.0, "building_s": 3.0},
    "body_mode": {"share": 0.3, "frequency_hz": 0.5, "damping": 0.05},
    "pressure_damping": {"lag_s": 0.4},
    "tear": {"lost": 0.3, "since": 0.4},
    "unsigned_reading": {"share": 1.0, "across_deg": 4.0},
    "sensor_detachment": {"lost": 0.6, "level_deg": 3.0, "since": 0.4},
    "sensor_freeze": {"held": 0.7, "since": 0.4},
}


def parameters(name: str, **changes: float) -> dict[str, float]:
    """Give all parameters of an effect: its size here, else where its searches begin."""
    sizes = {q.name: q.starts[0] for q in LIBRARY[name].parameters} | SIZES[name] | changes
    return {q.name: sizes[q.name] for q in LIBRARY[name].parameters}


def vector(name: str, **changes: float) -> np.ndarray:
    """Give the vector of all parameters with one effect in it."""
    e = absent()
    e[LIBRARY[name].slots] = list(parameters(name, **changes).values())
    return e


def entry(name: str, **changes: float) -> dict[str, Any]:
    """Give an effect as a model file lists it."""
    return {
        "id": name,
        "stage": LIBRARY[name].stage,
        "parameters": parameters(name, **changes),
    }


def model(*effects: Mapping[str, Any], **changes: Any) -> Model:
    return Model("arm", "test rubber", TransferFunction(*X), KPA, effects=effects, **changes)


def step_release(kpa: float = SIXTY, rest: float = 0.5, up: float = 4.0, down: float = 2.5):
    parts = [(rest, 0.0), (up, kpa), (down, 0.0)]
    return np.concatenate([np.full(round(seconds * 50.0), level) for seconds, level in parts])


def triangle(kpa: float = SIXTY, ramp: float = 5.0) -> np.ndarray:
    up = np.arange(round(ramp * 50.0)) * kpa / (ramp * 50.0)
    return np.concatenate([up, kpa - up, np.zeros(50)])


def trials(*commands: np.ndarray, first_order: int = 1, first_s: float = 0.0) -> tuple[Trial, ...]:
    """Run commands one after the other, a minute apart, at 50 Hz."""
    return tuple(
        replace(
            one_trial(command, number=i + 1, order=first_order + i, protocol="free"),
            started_s=first_s + 60.0 * i,
        )
        for i, command in enumerate(commands)
    )


def campaign_data(
    own: Sequence[Trial], name: str = "arm", continues: str | None = None
) -> CampaignData:
    """Make a campaign of one experiment."""
    files = tuple(
        TrialFile(f"{t.order}.csv", Path(f"{name}/{t.order}.csv"), t.order, t.started_s, place)
        for place, t in enumerate(own, start=1)
    )
    campaign = Campaign(
        folder=Path(name),
        name=name,
        material="rubber",
        provenance=Provenance("synthetic"),
        log=LogFormat("csv"),
        reference_kpa=KPA,
        experiments=(Experiment("all", None, "free", files),),
        continues=continues,
    )
    return CampaignData(campaign, tuple(own))
