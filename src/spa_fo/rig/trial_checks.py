"""What a trial's log has to agree with: the campaign's numbers, its experiment, its neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from spa_fo.errors import BadInput
from spa_fo.rig.campaign import (
    Campaign,
)
from spa_fo.rig.protocol_check import odd_level
from spa_fo.rig.spa_rig_log import SpaRigLog
from spa_fo.rig.trial import Trial
from spa_fo.rig.wire import Banner

_ONE_LEVEL = ("step", "step_release", "hold")


def check_banner(
    campaign: Campaign, path: Path, log: SpaRigLog, calibration: Banner | None = None
) -> None:
    """Refuse a log whose banner and campaign.yaml disagree about the converter.

    Without a pressure sensor it is that of the earliest calibration that says which one it was.
    """
    sensor = campaign.pressure_sensor
    if sensor is None:
        if calibration is not None:
            _same_converter(path, log.banner, calibration)
        return
    for key, said, found in (
        ("vref_mv", sensor.vref_mv, log.banner.vref_mv),
        ("adc_max", sensor.adc_max, log.banner.adc_max),
    ):
        if said != found:
            raise BadInput(
                path,
                f"its banner means {key} {found:g}, but {campaign.yaml.name} says "
                f"pressure_sensor.{key} {said:g}",
                "line 1",
            )


def _same_converter(path: Path, own: Banner, calibration: Banner) -> None:
    for key in ("vref_mv", "adc_max"):
        found, said = getattr(own, key), getattr(calibration, key)
        if found != said:
            raise BadInput(
                path,
                f"its banner means {key} {found:g}, but that of the calibration {said:g}",
                "line 1",
            )


def check_levels(campaign: Campaign, trials: Sequence[Trial]) -> None:
    """Refuse a trial whose command is not that of its experiment: another one's log."""
    for experiment in campaign.experiments:
        if experiment.setpoint_deg is None or experiment.protocol not in _ONE_LEVEL:
            continue
        found = [
            (file, float(trial.command_kpa.max()))
            for trial, (_, _, file) in zip(trials, campaign.trial_files(), strict=True)
            if trial.experiment == experiment.name
            and trial.command_kpa is not None
            and trial.command_kpa.max() > 0.0
        ]
        levels = np.array([level for _, level in found])
        unit = " kPa" if campaign.command_is_pressure else ""
        if levels.size < 2:
            continue
        odd = odd_level(levels)
        if odd is not None:
            own, middle = f"{levels[odd]:g}{unit}", f"{np.median(levels):g}{unit}"
            raise BadInput(
                found[odd][0].path,
                f"commands {own}, but the trials of experiment '{experiment.name}' "
                f"command {middle} in the middle; expected one setpoint's trials",
            )


def overlaps(trials: Sequence[Trial]) -> list[str]:
    """Say which trials last beyond the start of the next one."""
    warnings = []
    ordered = sorted(trials, key=lambda trial: trial.order)
    for trial, later in pairwise(ordered):
        end = trial.started_s + trial.t_s[-1]
        if end > later.started_s:
            warnings.append(
                f"{trial.label} ends at {end:.1f} s of campaign time, after {later.label} "
                f"starts at {later.started_s:.1f} s"
            )
    return warnings
