"""The plain model of a reference, whatever the rest of its angle is, and its sign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.identify import fit_campaign
from spa_fo.identify.whole_log import input_of
from spa_fo.plant import Model
from spa_fo.rig import CampaignData, Trial

_AT_REST = 0.05  # of the range of the input, from its lowest
_TURNED = (
    "The angle falls as the input rises: it is compared with its sign turned, and "
    "the model is of the turned angle."
)


@dataclass(frozen=True)
class ReferenceModel:
    """A plain model, and both campaigns as it describes them.

    Attributes
    ----------
    plain : Model
    reference, data : CampaignData
        Their angles may be turned.
    finding : str
        Says so; empty where they are as measured.
    """

    plain: Model
    reference: CampaignData
    data: CampaignData
    finding: str = ""


def identify_reference(reference: CampaignData, data: CampaignData, seed: int) -> ReferenceModel:
    """Identify the plain model of a reference as `fit_campaign` does, or else as far as can be.

    That is by the measured pressure where one of both lacks commands, on whole logs where no step
    is of use, and without what the angle rests at: a model that starts at 0 may fail over it,
    and as it is missed in both campaigns alike it is no change. An angle that falls as the input
    rises is turned, in both.

    Raises
    ------
    BadInput
        As `fit_campaign`; `NoGain` where the angle goes neither way.
    """
    signal = _of_both(reference, data)
    turned = [_with_angles(each, lambda trial: -trial.angle_deg) for each in (reference, data)]
    ways = (
        (reference, data, ""),
        (_with_angles(reference, _from_rest), data, ""),
        (_with_angles(turned[0], _from_rest), turned[1], _TURNED),
    )
    refusals = []
    for fitted, other, finding in ways:
        for whole_logs in (False, True):
            try:
                found = fit_campaign(
                    fitted, seed=seed, bootstrap=None, whole_logs=whole_logs, signal=signal
                )
            except BadInput as refusal:
                refusals.append(refusal)
                continue
            return ReferenceModel(found.model, turned[0] if finding else reference, other, finding)
    raise refusals[0]


def _of_both(reference: CampaignData, data: CampaignData) -> str | None:
    """Choose the measured pressure where one of both lacks commands; else leave it to the fit."""
    trials = (*reference.trials, *data.trials)
    if any(trial.command_kpa is None for trial in trials) and all(
        trial.pressure_kpa is not None for trial in trials
    ):
        return "pressure"
    return None


def _with_angles(data: CampaignData, angle_of: Callable[[Trial], Floats]) -> CampaignData:
    return replace(data, trials=tuple(replace(t, angle_deg=angle_of(t)) for t in data.trials))


def _from_rest(trial: Trial) -> Floats:
    """Take off what is read while the input is about its lowest, deg."""
    signals = [input_of(trial, signal) for signal in ("command", "pressure")]
    drive = next((each for each in signals if each is not None), None)
    if drive is None:
        return trial.angle_deg
    low = drive <= drive.min() + _AT_REST * np.ptp(drive)
    return np.asarray(trial.angle_deg - trial.angle_deg[low].mean())
