"""Campaigns of a pump that is driven by PWM, from the virtual rig's physics.

PWM 0 to 4096 leads to a pressure by a curve, which fills and vents a chamber at two rates; the
virtual rig's own effects of the drive come behind it, and its actuator bends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import campaigns
from spa_fo.virtual_rig.actuator import FractionalCore, SoftActuator
from spa_fo.virtual_rig.first_forms import ContactStop
from spa_fo.virtual_rig.syringe_pump import SyringePump

REFERENCE_KPA = 40.0
STEPS = 500  # a second
RATE_HZ = 50
FULL = 4096.0
FILLING_S, VENTING_S = 0.25, 0.5
HEAD = "t,command,pressure,angle"
CORE = FractionalCore(**campaigns.TRUTH)


@dataclass(frozen=True)
class Pump:
    """What a PWM makes of the pressure."""

    curve: float = 1.5
    top_kpa: float = 60.0
    laminar_kpa: float = 15.0  # a larger difference goes with its root, as through an orifice

    def levels(self, pwm: np.ndarray) -> np.ndarray:
        return np.asarray(self.top_kpa * (pwm / FULL) ** self.curve)

    def pressure(self, pwm: np.ndarray) -> np.ndarray:
        kpa, out = 0.0, []
        for level in self.levels(pwm).tolist():
            seconds = FILLING_S if level > kpa else VENTING_S
            seconds *= (1.0 + abs(level - kpa) / self.laminar_kpa) ** 0.5
            kpa += (level - kpa) / (STEPS * seconds)
            out.append(kpa)
        return np.array(out)


def held(*levels: tuple[float, float]) -> np.ndarray:
    """Hold shares of the full PWM for some seconds each."""
    return np.concatenate([np.full(round(s * RATE_HZ), round(FULL * share)) for s, share in levels])


PROTOCOLS = {
    "half": held((1.0, 0.0), (8.0, 0.5), (5.0, 0.0)),
    "full": held((1.0, 0.0), (8.0, 0.9), (5.0, 0.0)),
    "stairs": held((1, 0.0), (3, 0.3), (3, 0.6), (3, 0.9), (3, 0.6), (3, 0.3), (4, 0.0)),
}


def logged(
    pwm: np.ndarray, effects: SyringePump, actuator: SoftActuator, rng: np.random.Generator
) -> np.ndarray:
    """Run one trial of a virgin specimen: time, PWM, pressure and angle at its rows."""
    every = STEPS // RATE_HZ
    kpa = effects.begin(1.0 / STEPS)(Pump().pressure(np.repeat(pwm, every)))
    specimen = actuator.begin(1.0 / STEPS)
    specimen.retune(1.0 + 0.005 * rng.standard_normal(), 1.0)
    signals = [np.append(0.0, each)[:-1:every] for each in (kpa, specimen(kpa))]
    noise = rng.standard_normal((2, pwm.size))
    time = np.arange(pwm.size) / RATE_HZ
    return np.column_stack([time, pwm, signals[0] + 0.15 * noise[0], signals[1] + 0.2 * noise[1]])


def pump_campaign(
    folder: Path,
    seed: int = 1,
    repeats: int = 3,
    unit: str = "1",
    columns: Sequence[str] = ("command", "pressure", "angle"),
    contact: ContactStop | None = None,
    **effects: Any,
) -> Path:
    """Write a campaign; `effects` are those of the virtual rig's drive."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    actuator = SoftActuator(CORE, REFERENCE_KPA, contact_stop=contact)
    experiments: list[dict[str, Any]] = [
        {"name": name, "protocol": "free", "trials": []} for name in PROTOCOLS
    ]
    order = 0
    for number in range(1, repeats + 1):
        for experiment in experiments:
            order += 1
            name = experiment["name"]
            rows = logged(PROTOCOLS[name], SyringePump(**effects), actuator, rng)
            file = f"{name}_{number}.csv"
            np.savetxt(folder / file, rows, "%.4f", ",", header=HEAD, comments="")
            trial = {"file": file, "order": order, "started_s": 120.0 * order}
            experiment["trials"].append(trial)
    document = campaigns.document(folder.name, experiments)
    document["input"]["reference_kpa"] = REFERENCE_KPA
    units = {"command": unit, "pressure": "kPa", "angle": "deg"}
    document["log"]["columns"] = {
        "time": {"column": "t", "unit": "s"},
        **{name: {"column": name, "unit": units[name]} for name in columns},
    }
    campaigns.write_yaml(folder, document)
    campaigns.write_sums(folder)
    return folder
