"""From readings to a campaign's folder: noise, converter, losses, logs, campaign.yaml."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from blind.second_rig.bench import Bench, Plan
from blind.second_rig.channel import end
from blind.second_rig.effect import Effect
from blind.second_rig.flex import CalibrationLog
from blind.second_rig.noise import coloured, white
from blind.second_rig.sensor import When
from blind.second_rig.timeline import Reading, Trial
from blind.second_rig.wire import delimited, spa_rig

Floats = npt.NDArray[np.float64]
Rng = np.random.Generator


def trial_bytes(
    bench: Bench,
    trial: Trial,
    reading: Reading,
    rng: Rng,
    effects: Sequence[Effect] = (),
    order: int = 1,
) -> bytes:
    """Log one trial: noise on the angle, converters, samples lost and lines damaged.

    Parameters
    ----------
    bench : Bench
        Instruments and surroundings.
    trial : Trial
        Times and commands.
    reading : Reading
        Noise-free.
    rng : Generator
        Draws what is lost.
    effects : sequence of Effect
        Those of the channel's end act on the noise as well.
    order : int
        The trial's, in the specimen's life.
    """
    noise = bench.surroundings["noise"]
    angle = reading.angle + coloured(noise, trial.times, rng)
    angle = angle + white(noise, trial.times.size, rng)
    angle = end(effects, angle, trial.times, When(trial.started_s, order))
    pressure = bench.sensed_kpa(reading.pressure)
    kept, damaged = _losses(bench.surroundings["sampling"], trial.times.size, rng)
    measured = bool(bench.surroundings["pressure"]["measured"])
    if bench.table is not None:
        columns: dict[str, Floats] = {"time": trial.times, "command": trial.command}
        if measured:
            columns["pressure"] = pressure
        if bench.calibrated:
            columns["flex_adc"] = bench.curve.counts(angle).astype(np.float64)
        else:
            step = bench.resolution_deg(angle)
            columns["angle"] = step * np.rint(angle / step)
        chosen = {role: values[kept] for role, values in columns.items()}
        return delimited(bench.table, chosen, damaged[kept], rng)
    names = ["cmd_kpa", "flex_adc"]
    fields = [
        [f"{value:.2f}" for value in trial.command[kept]],
        [str(value) for value in bench.curve.counts(angle)[kept]],
    ]
    if measured:
        names.insert(1, "p_adc")
        fields.insert(1, [str(value) for value in bench.pressure_counts(pressure)[kept]])
    return spa_rig(
        bench.board, names, np.flatnonzero(kept), trial.times[kept], fields, damaged[kept], rng
    )


def calibration_bytes(bench: Bench, log: CalibrationLog, rng: Rng) -> bytes:
    """Log a calibration in the spa-rig format, whatever the trials are logged in."""
    kept, damaged = _losses(bench.surroundings["sampling"], log.times.size, rng)
    fields = [
        [f"{value:.1f}" for value in log.known[kept]],
        [str(value) for value in log.counts[kept]],
    ]
    return spa_rig(
        bench.board,
        ("angle_deg", "flex_adc"),
        np.flatnonzero(kept),
        log.times[kept],
        fields,
        damaged[kept],
        rng,
    )


def _losses(
    sampling: dict[str, Any], count: int, rng: Rng
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Draw which samples are logged, and which of the rows are damaged."""
    kept = rng.random(count) >= float(sampling["missing"])
    damaged = rng.random(count) < float(sampling["damaged"])
    kept[:3] = kept[-3:] = True
    damaged[:3] = damaged[-3:] = False
    return kept, damaged


def write_campaign(
    folder: Path,
    name: str,
    bench: Bench,
    plan: Plan,
    logs: Sequence[bytes],
    calibrations: Sequence[tuple[str, float, bytes]],
    continues: str | None = None,
    first_order: int = 1,
) -> None:
    """Write a campaign's folder.

    Parameters
    ----------
    folder : Path
        Made.
    name : str
        In campaign.yaml.
    bench : Bench
        Instruments.
    plan : Plan
        Experiments and trials.
    logs : sequence of bytes
        One for each trial of the plan, in its order.
    calibrations : sequence of (str, float, bytes)
        File, campaign time of its start (s), log.
    continues : str, optional
        Name of the campaign this one goes on from.
    first_order : int
        Of the first trial.
    """
    ending = "log" if bench.table is None else "csv"
    files: dict[str, bytes] = {file: data for file, _, data in calibrations}
    listed: list[list[dict[str, Any]]] = [[] for _ in plan.experiments]
    for order, (trial, data) in enumerate(zip(plan.trials, logs, strict=True), start=first_order):
        experiment = plan.experiments[trial.experiment]
        file = f"{experiment.name}/trial_{trial.number + 1:02d}.{ending}"
        files[file] = data
        started = round(trial.started_s, 1)
        listed[trial.experiment].append({"file": file, "order": order, "started_s": started})
    document = _description(name, bench, plan, listed, calibrations, continues)
    for file, data in files.items():
        path = folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=100)
    (folder / "campaign.yaml").write_text(text, encoding="utf-8")
    sums = [f"{hashlib.sha256(data).hexdigest()}  {file}\n" for file, data in sorted(files.items())]
    (folder / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")


def _description(
    name: str,
    bench: Bench,
    plan: Plan,
    listed: Sequence[Sequence[dict[str, Any]]],
    calibrations: Sequence[tuple[str, float, bytes]],
    continues: str | None,
) -> dict[str, Any]:
    """Say in the contract's words what the folder holds."""
    document: dict[str, Any] = {
        "schema": "spa-fo/campaign/1",
        "name": name,
        "material": bench.material,
        "provenance": {"kind": "synthetic", "source": "blind benchmark"},
    }
    if continues is not None:
        document["continues"] = continues
    if bench.table is None:
        vref = bench.board.vref_mv
        document["log"] = {"format": "spa-rig"}
        document["pressure_sensor"] = {
            "volts": [0.1 * vref / 1000.0, 0.9 * vref / 1000.0],
            "kpa": [0.0, bench.range_kpa],
            "vref_mv": vref,
            "adc_max": bench.curve.full,
        }
    else:
        document["log"] = bench.table.configuration()
    document["input"] = {"reference_kpa": bench.reference_kpa}
    if calibrations:
        document["calibration"] = [
            {"file": file, "started_s": round(at_s, 1)} for file, at_s, _ in calibrations
        ]
    document["experiments"] = [
        {
            "name": experiment.name,
            "setpoint_deg": None
            if experiment.level is None
            else round(float(np.rad2deg(experiment.level * bench.top_input * bench.core.gain)), 1),
            "protocol": experiment.protocol,
            "trials": list(trials),
        }
        for experiment, trials in zip(plan.experiments, listed, strict=True)
    ]
    return document
