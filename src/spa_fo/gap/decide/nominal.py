"""A command that is no pressure: a nominal drive stands for it, and what that misses is expected.

It is identified on the trials that take part. So what an effect of the drive has in common with it
is in it already; what is left for an effect is a departure from it, beyond what it misses of trials
that it was not fitted to. Where the pressure shows none, the measured pressure drives the model, so
that what the nominal drive misses is not laid to the actuator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.gap.data.hold_out import HeldOut, judged
from spa_fo.gap.decide.weigh import decide_drive
from spa_fo.gap.noise.coloured import Spectrum, estimate, misfit
from spa_fo.gap.search.drive import Drive, examine_drive
from spa_fo.gap.settings import SETTINGS
from spa_fo.identify.nominal_fit import NominalFit, drive_logs, identify_drive
from spa_fo.plant import Model
from spa_fo.rig import CampaignData

_WHITE_KPA = 1e-3
_SHARED = (
    "It was identified on this very campaign, so it holds what is always the same of the drive: a "
    "lag, a delay, a leak or a gain of the drive's own cannot be told from it. Only a departure "
    "from it can; to see a change of the drive, compare with an earlier campaign."
)
_DEPARTS = "The drive departs from it: the gap is that of the model driven by the nominal drive."
_AS_NOMINAL = (
    "No effect of the drive departs from it by more than it misses itself: the measured pressure "
    "drives the model, and the gap is that of actuator, sensor and log."
)


@dataclass(frozen=True)
class Nominal:
    """What stands for the command."""

    fit: NominalFit  # the drive, and what it misses
    spectrum: Spectrum  # of that, kPa²

    def sentences(self, departs: bool) -> tuple[str, ...]:
        """Say what it is, what it hides, and whether the drive departs from it."""
        return self.fit.sentence(), _SHARED, _DEPARTS if departs else _AS_NOMINAL


def with_nominal(
    data: CampaignData, everything: Evidence, held: HeldOut, excluded: Sequence[str], x: Floats
) -> tuple[Nominal, Drive | None, Evidence]:
    """Let the nominal drive stand for the command, or the measured pressure for both.

    Returns the nominal drive, how the drive departs from it, and the campaign with its pressure as
    the command; where it does not, None, and the campaign without a command. `x`, (5,), are the
    given model's coefficients. `BadInput` where the command or the pressure never changes.
    """
    drive_logs(data)
    trials = [t for t, out in zip(everything.grid.trials, held.trials, strict=True) if not out]
    fit = identify_drive(trials)
    left = [
        misfit(trial.t_s, missed, fit.drive.at_rows(trial))
        for trial, missed in zip(trials, fit.left, strict=True)
    ]
    nominal = Nominal(fit, estimate(left, _WHITE_KPA))
    rise_s = everything.rise_s
    stand_in = replace(collect(fit.drive.applied(data)), rise_s=rise_s)
    fitted = replace(stand_in, takes_part=~held.trials)
    drive = examine_drive(fitted, excluded, x, nominal.spectrum)
    if _departs(drive, stand_in, held, fit.left_out_kpa):
        return nominal, drive, stand_in
    return nominal, None, replace(collect(driven_by_pressure(data)), rise_s=rise_s)


def _departs(drive: Drive, evidence: Evidence, held: HeldOut, expected_kpa: float) -> bool:
    """Say whether some effect is more probable than none, and closes enough on held-out trials."""
    in_kpa = drive.by_itself()
    weighed, fits, unknown = decide_drive(in_kpa, evidence, expected_kpa)
    named = {ids: p for ids, p in weighed.items() if ids}
    best = max(named, key=lambda ids: named[ids], default=())
    if not best or named[best] * (1.0 - unknown) <= max(weighed.get((), 0.0), unknown):
        return False
    where = judged(evidence, held)
    before, after = (
        float(np.mean(fit.residual_kpa[where] ** 2)) for fit in (drive.fits[()], fits[best])
    )
    return before > expected_kpa**2 and after <= (1.0 - SETTINGS.worth) * before


def driven_by_pressure(data: CampaignData) -> CampaignData:
    """Leave the command out: the model takes the measured pressure for what drives it.

    Raises
    ------
    BadInput
        A trial holds none.
    """
    if any(trial.pressure_kpa is None for trial in data.trials):
        signal = "pressure"
        raise BadInput(data.campaign.folder, f"expected a {signal} column: it drives the model")
    return replace(data, trials=tuple(replace(t, command_kpa=None) for t in data.trials))


def check_driven(plain: Model, data: CampaignData) -> None:
    """Refuse, with `BadInput`, a model of the command where that is no pressure."""
    if plain.signal == "command" and not data.campaign.command_is_pressure:
        raise BadInput(
            data.campaign.yaml,
            "is 1, so the command is no pressure; expected a model that the pressure drives, as "
            "spa-fo fit makes one of this campaign",
            "log.columns.command.unit",
        )
