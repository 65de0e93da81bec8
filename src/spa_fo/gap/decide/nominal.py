"""A command that is no pressure: a nominal drive stands for it, and what that misses is expected.

It is identified on the trials that take part. So what an effect of the drive has in common with it
is in it already; what is left for an effect is a departure from it, beyond what it misses of trials
that it was not fitted to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from spa_fo.errors import BadInput
from spa_fo.gap.noise.coloured import Spectrum, estimate, misfit
from spa_fo.identify.nominal_fit import NominalFit, drive_logs, identify_drive
from spa_fo.plant import Model
from spa_fo.rig import CampaignData, Trial

_WHITE_KPA = 1e-3
_SHARED = (
    "It was identified on this very campaign, so it holds what is always the same of the drive: a "
    "lag, a delay, a leak or a gain of the drive's own cannot be told from it. Only a departure "
    "from it can; to see a change of the drive, compare with an earlier campaign."
)


@dataclass(frozen=True)
class Nominal:
    """What stands for the command.

    Attributes
    ----------
    fit : NominalFit
        The drive, and what it misses.
    spectrum : Spectrum
        Of that, kPa².
    """

    fit: NominalFit
    spectrum: Spectrum

    def sentences(self) -> tuple[str, ...]:
        """Say what it is, and what it hides."""
        return self.fit.sentence(), _SHARED


def nominal_of(data: CampaignData, trials: Sequence[Trial]) -> Nominal:
    """Identify the nominal drive of a campaign on some of its trials.

    Raises
    ------
    BadInput
        The command or the pressure never changes.
    """
    drive_logs(data)
    fit = identify_drive(trials)
    left = [
        misfit(trial.t_s, missed, fit.drive.at_rows(trial))
        for trial, missed in zip(trials, fit.left, strict=True)
    ]
    return Nominal(fit, estimate(left, _WHITE_KPA))


def check_driven(plain: Model, data: CampaignData) -> None:
    """Refuse a model of the command where that is no pressure.

    Raises
    ------
    BadInput
        It is driven by the command.
    """
    if plain.signal == "command" and not data.campaign.command_is_pressure:
        raise BadInput(
            data.campaign.yaml,
            "is 1, so the command is no pressure; expected a model that the pressure drives, as "
            "spa-fo fit makes one of this campaign",
            "log.columns.command.unit",
        )
