"""Whether a log that was just recorded can be part of its campaign: a bad one would spoil all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from spa_fo.errors import BadInput
from spa_fo.rig.calibration import Calibration
from spa_fo.rig.campaign import PressureSensor, build_campaign
from spa_fo.rig.spa_rig_log import read_spa_rig_log
from spa_fo.rig.trials import earliest_calibration, read_trials


def why_not(document: Mapping[str, Any], folder: Path, file: str) -> str | None:
    """Say why a log cannot be part of a campaign, or return None.

    Parameters
    ----------
    document : mapping
        campaign.yaml with the log in it.
    folder : Path
        The campaign's.
    file : str
        The log.
    """
    campaign = build_campaign(document, folder)
    own = tuple(
        experiment
        for experiment in campaign.experiments
        if any(trial.file == file for trial in experiment.trials)
    )
    try:
        if own and not campaign.calibration:
            # The sensor may be calibrated afterwards: until then there are no angles.
            read_spa_rig_log(folder / file, file)
        else:
            read_trials(replace(campaign, experiments=own))
    except BadInput as error:
        return str(error)
    return None


def reading(
    document: Mapping[str, Any], folder: Path
) -> tuple[PressureSensor | None, Calibration | None]:
    """Give what turns counts into kPa and degrees; None where there is none yet."""
    campaign = build_campaign(document, folder)
    return campaign.pressure_sensor, earliest_calibration(campaign)
