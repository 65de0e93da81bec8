"""Campaigns whose command is no pressure: the reference says what drive stands for it.

Where command and measured pressure alone show that nothing changed in the drive, the measured
pressure drives the model: what the nominal drive misses does not blur what the angle says then.
Else its pressure stands where a commanded one stands, and a change of the drive can be named.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from spa_fo.compare.compare import NOTHING_CHANGED, Comparison
from spa_fo.compare.compare import compare as compare_commanded
from spa_fo.compare.pressure_alone import compare_pressure as compare_commanded_pressure
from spa_fo.errors import BadInput
from spa_fo.gap.decide.examine import silent
from spa_fo.gap.decide.nominal import check_driven
from spa_fo.identify.nominal_fit import NominalFit, drive_logs, identify_drive
from spa_fo.plant import Model
from spa_fo.plant.nominal_drive import driven_by
from spa_fo.rig import CampaignData

Progress = Callable[[str], None]

_UNCHANGED = "By command and pressure alone nothing changed in the drive."
_CHANGED = "By command and pressure alone the drive has changed."


def compare(
    reference: CampaignData,
    data: CampaignData,
    plain: Model,
    *,
    excluded: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
) -> Comparison:
    """Say what changed from one campaign of an actuator to another, whatever the command is.

    For the parameters, and what is raised, see `spa_fo.compare.compare.compare`. Where the command
    is no pressure, the campaigns returned hold the nominal one in its place.
    """
    nominal = _nominal(reference, data, progress)
    if nominal is None:
        return compare_commanded(
            reference, data, plain, excluded=excluded, seed=seed, progress=progress
        )
    check_driven(plain, reference)
    before, after = (nominal.drive.applied(each) for each in (reference, data))
    drive = compare_commanded_pressure(
        before, after, excluded=excluded, seed=seed, progress=progress
    )
    same = drive.kind == NOTHING_CHANGED
    found = compare_commanded(
        before,
        after,
        plain if same else replace(plain, signal="command"),
        excluded=excluded,
        seed=seed,
        progress=progress,
    )
    assert found.model is not None
    said = _UNCHANGED if same else _CHANGED
    return replace(
        with_finding(found, f"{_finding(nominal, after)} {said}"),
        model=driven_by(found.model, nominal.drive),
    )


def compare_pressure(
    reference: CampaignData,
    data: CampaignData,
    *,
    excluded: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
) -> Comparison:
    """Say what changed in the drive, by command and measured pressure alone.

    For the parameters, and what is raised, see `spa_fo.compare.pressure_alone.compare_pressure`.
    """
    nominal = _nominal(reference, data, progress)
    before, after = reference, data
    if nominal is not None:
        before, after = (nominal.drive.applied(each) for each in (reference, data))
    found = compare_commanded_pressure(
        before, after, excluded=excluded, seed=seed, progress=progress
    )
    return found if nominal is None else with_finding(found, _finding(nominal, after))


def _nominal(reference: CampaignData, data: CampaignData, progress: Progress) -> NominalFit | None:
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
        raise BadInput(
            (reference, data)[pressures.index(True)].campaign.yaml,
            "expected a command of unit 1 and a measured pressure, as in the other campaign",
            "log.columns.command",
        )
    progress("identifying the drive of the reference from command and pressure")
    return identify_drive(drive_logs(reference))


def with_finding(found: Comparison, sentence: str) -> Comparison:
    """Add a sentence to what a comparison says."""
    change = replace(found.change, findings=(*found.change.findings, sentence))
    return replace(found, change=change)


def _finding(nominal: NominalFit, data: CampaignData) -> str:
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
