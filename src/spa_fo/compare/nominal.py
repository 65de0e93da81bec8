"""A command that is no pressure, in both campaigns: the reference says what drive stands for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from spa_fo.errors import BadInput
from spa_fo.identify.nominal_fit import NominalFit, drive_logs, identify_drive
from spa_fo.rig import CampaignData

Progress = Callable[[str], None]


def nominal_of_reference(
    reference: CampaignData, data: CampaignData, progress: Progress
) -> NominalFit | None:
    """Identify the nominal drive on the reference; None where the commands are pressures.

    Raises
    ------
    BadInput
        The command is a pressure in one campaign alone, or the reference shows no drive.
    """
    pressures = [each.campaign.command_is_pressure for each in (reference, data)]
    if all(pressures):
        return None
    if any(pressures):
        other = (reference, data)[pressures.index(True)]
        raise BadInput(
            other.campaign.yaml,
            "expected a command of unit 1 and a measured pressure, as in the other campaign",
            "log.columns.command",
        )
    progress("identifying the drive of the reference from command and pressure")
    return identify_drive(drive_logs(reference))


def nominal_finding(nominal: NominalFit, data: CampaignData) -> str:
    """Say what drive the reference showed, and how well it describes the campaign.

    `data` holds the nominal pressure where its command stood.
    """
    left = [
        trial.pressure_kpa - trial.command_kpa
        for trial in data.trials
        if trial.pressure_kpa is not None and trial.command_kpa is not None
    ]
    missed = float(np.sqrt(np.mean(np.concatenate(left) ** 2)))
    own = f"It is the reference's; of this campaign it misses {missed:.2g} kPa."
    return f"{nominal.sentence()} {own}"
