"""Small campaigns for tests: csv logs of a linear actuator with known coefficients."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from spa_fo import simulate

TRUTH = {"alpha2": 1.406, "alpha1": 1.196, "a1": 0.794, "a0": 1.638, "b0": 0.934}
REFERENCE_KPA = 30.0
NOISE_DEG = 0.3
RIG_BANNER = (
    "# spa-rig 1 board=mega2560 adc_bits=10 vref_mv=5000 rate_hz=50 "
    "columns=seq,t_us,cmd_kpa,p_adc,flex_adc\n"
)


def write_sums(folder: Path) -> None:
    """List the bytes of every log in SHA256SUMS."""
    files = sorted(path for path in folder.rglob("*") if path.suffix in (".csv", ".log"))
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(folder).as_posix()}\n"
        for path in files
    ]
    (folder / "SHA256SUMS").write_text("".join(lines))


def write_log(path: Path, command_kpa: np.ndarray, rate_hz: float, seed: int) -> None:
    """Write one csv log of the linear actuator under a command."""
    t = np.arange(command_kpa.size) / rate_hz
    theta = np.degrees(simulate(t, command_kpa / REFERENCE_KPA, **TRUTH, hold="zero"))
    theta += np.random.default_rng(seed).normal(0.0, NOISE_DEG, t.size)
    rows = [f"{a:.4f},{u:.2f},{y:.4f}" for a, u, y in zip(t, command_kpa, theta, strict=True)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("t,command,angle\n" + "\n".join(rows) + "\n")


def step_command(kpa: float, rate_hz: float = 25.0, release: bool = True) -> np.ndarray:
    """One second of rest, ten of pressure, five of release."""
    seconds = [(1.0, 0.0), (10.0, kpa), *([(5.0, 0.0)] if release else [])]
    return np.concatenate([np.full(round(s * rate_hz), level) for s, level in seconds])


def document(name: str, experiments: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a campaign.yaml for csv logs with the columns t, command, angle."""
    return {
        "schema": "spa-fo/campaign/1",
        "name": name,
        "material": "test rubber",
        "provenance": {"kind": "synthetic", "source": "tests/campaigns.py", "note": ""},
        "log": {
            "format": "csv",
            "columns": {
                "time": {"column": "t", "unit": "s"},
                "command": {"column": "command", "unit": "kPa"},
                "angle": {"column": "angle", "unit": "deg"},
            },
        },
        "input": {"reference_kpa": REFERENCE_KPA},
        "experiments": experiments,
    }


def write_yaml(folder: Path, campaign: dict[str, Any]) -> None:
    (folder / "campaign.yaml").write_text(yaml.safe_dump(campaign, sort_keys=False))


def step_campaign(folder: Path, trials: int = 4, rate_hz: float = 25.0) -> dict[str, Any]:
    """Write a campaign of steps to 30° and 60°; return its campaign.yaml as a document."""
    gain_deg = math.degrees(TRUTH["b0"] / TRUTH["a0"])
    experiments = []
    for place, setpoint in enumerate((30.0, 60.0)):
        entries = []
        for trial in range(trials):
            file = f"step_{setpoint:.0f}/trial_{trial + 1:02d}.csv"
            command = step_command(REFERENCE_KPA * setpoint / gain_deg, rate_hz)
            write_log(folder / file, command, rate_hz, seed=10 * place + trial)
            order = 2 * trial + place + 1
            entries.append({"file": file, "order": order, "started_s": 60.0 * (order - 1)})
        experiments.append(
            {
                "name": f"step_{setpoint:.0f}",
                "setpoint_deg": setpoint,
                "protocol": "step_release",
                "trials": entries,
            }
        )
    campaign = document(folder.name, experiments)
    write_yaml(folder, campaign)
    write_sums(folder)
    return campaign


def free_campaign(folder: Path, trials: int = 1, sign: float = 1.0) -> dict[str, Any]:
    """Write a campaign of staircases, which have no up-steps to fit; `sign` -1: of vacuum."""
    levels = sign * np.repeat([0.0, 10.0, 20.0, 30.0, 20.0, 0.0], 125)
    entries = []
    for order in range(1, trials + 1):
        file = f"stairs/trial_{order:02d}.csv"
        write_log(folder / file, levels, 25.0, seed=4 + order)
        entries.append({"file": file, "order": order, "started_s": 90.0 * (order - 1)})
    campaign = document(
        folder.name,
        [{"name": "stairs", "setpoint_deg": None, "protocol": "free", "trials": entries}],
    )
    write_yaml(folder, campaign)
    write_sums(folder)
    return campaign


def rig_line(text: str) -> str:
    check = 0
    for byte in text.encode():
        check ^= byte
    return f"{text}*{check:02X}\n"


def rig_trial(steps: int = 600, top: int = 306) -> str:
    rows = [
        rig_line(f"{i},{1000000 + 20000 * i},{27.5 if i >= 50 else 0.0:.2f},93,{top - i % 7}")
        for i in range(steps)
    ]
    return RIG_BANNER + "".join(rows)


def rig_calibration(top_deg: float) -> str:
    rows, seq = [], 0
    for angle in np.linspace(0.0, top_deg, 7):
        for _ in range(100):
            count = round(300 + 2 * angle)
            rows.append(rig_line(f"{seq},{1000000 + 20000 * seq},{angle:.1f},{count}"))
            seq += 1
    banner = RIG_BANNER.replace("seq,t_us,cmd_kpa,p_adc,flex_adc", "seq,t_us,angle_deg,flex_adc")
    return banner + "".join(rows)


def rig_campaign(folder: Path, trial: bytes, calibration: str) -> None:
    (folder / "step_30").mkdir(parents=True)
    (folder / "calibration").mkdir()
    (folder / "step_30" / "trial_01.log").write_bytes(trial)
    (folder / "calibration" / "pre.log").write_text(calibration)
    entry = {"file": "step_30/trial_01.log", "order": 1, "started_s": 0.0}
    described = document(
        folder.name,
        [{"name": "step_30", "setpoint_deg": 30, "protocol": "step", "trials": [entry]}],
    )
    described["log"] = {"format": "spa-rig"}
    described["pressure_sensor"] = {
        "volts": [0.5, 4.5],
        "kpa": [0.0, 551.6],
        "vref_mv": 5000,
        "adc_max": 1023,
    }
    described["calibration"] = [{"file": "calibration/pre.log", "started_s": -600}]
    write_yaml(folder, described)
    write_sums(folder)
