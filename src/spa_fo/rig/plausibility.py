"""What a campaign's numbers can hardly mean: told in one line each, and refused if impossible."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from spa_fo.errors import BadInput
from spa_fo.rig.campaign import Campaign
from spa_fo.rig.trial import Trial

_FULL_TURN_DEG = 360.0
_FACTOR_OFF = 30.0  # of the largest command against reference_kpa, or an angle against its setpoint
_IMPOSSIBLE = 1e6  # of the largest command against reference_kpa
_HALF_TURN_RAD = np.pi  # degrees that never get past this may be radians
_STILL_DEG = 1e-9
_DURATION_S = (1e-6, 1e9)  # of a trial
_SHOWN = 3  # trials named in one line


def implausible(campaign: Campaign, trials: Sequence[Trial]) -> list[str]:
    """Say what is implausible about a campaign's angles and commands.

    Parameters
    ----------
    campaign : Campaign
        What campaign.yaml says.
    trials : sequence of Trial
        Its trials.

    Returns
    -------
    list of str
        One line each; empty where nothing is odd.

    Raises
    ------
    BadInput
        The reference pressure is a million times off the commands, or a trial lasts no time.
    """
    _refuse_durations(campaign, trials)
    if not campaign.has_angle:
        return list(_reference_off(campaign, trials))
    return [
        *_reference_off(campaign, trials),
        *_motionless(trials),
        *(_beyond_a_turn(campaign, trials) or _wrong_unit(campaign, trials)),
    ]


def stands_still(trial: Trial) -> bool:
    """Say whether a trial's angle does not move at all."""
    return not np.ptp(trial.angle_deg) > _STILL_DEG


def _refuse_durations(campaign: Campaign, trials: Sequence[Trial]) -> None:
    shortest, longest = _DURATION_S
    for trial, (_, _, file) in zip(trials, campaign.trial_files(), strict=True):
        if not shortest < trial.t_s[-1] < longest:
            raise BadInput(
                file.path,
                f"lasts {trial.t_s[-1]:.3g} s; expected a trial's time, in the unit of "
                "log.columns.time",
            )


def _reference_off(campaign: Campaign, trials: Sequence[Trial]) -> Iterator[str]:
    signal, named = "command", "commands"
    if not campaign.command_is_pressure:
        signal, named = "pressure", "measured pressures"
    inputs = [t.command_kpa if signal == "command" else t.pressure_kpa for t in trials]
    largest = max((float(np.abs(one).max()) for one in inputs if one is not None), default=0.0)
    if largest == 0.0:
        return
    reference = campaign.reference_kpa
    if not 1.0 / _IMPOSSIBLE < largest / reference < _IMPOSSIBLE:
        raise BadInput(
            campaign.yaml,
            f"is {reference:g}, but the {named} reach {largest:g} kPa; expected about as much",
            "input.reference_kpa",
        )
    if not 1.0 / _FACTOR_OFF < largest / reference < _FACTOR_OFF:
        yield (
            f"input.reference_kpa is {reference:g}, but the {named} reach {largest:.4g} kPa: a "
            f"unit or scale of log.columns.{signal}, or the reference, may be wrong"
        )


def _motionless(trials: Sequence[Trial]) -> Iterator[str]:
    still = [trial for trial in trials if stands_still(trial)]
    if still:
        yield f"the angle does not move at all in {_named(still)}"


def _beyond_a_turn(campaign: Campaign, trials: Sequence[Trial]) -> list[str]:
    far = [trial for trial in trials if _reach(trial) > _FULL_TURN_DEG]
    if not far:
        return []
    column = (campaign.log.columns or {}).get("angle")
    hint = "the calibration, or its log, may be another sensor's"
    if column is not None and campaign.calibration == ():
        hint = "log.columns.angle may have another scale"
        if column.unit == "rad":
            hint = "log.columns.angle says rad, the logs may hold degrees"
    most = max(_reach(trial) for trial in far)
    return [f"the angle reaches {most:.4g} deg, beyond a full turn, in {_named(far)}: {hint}"]


def _wrong_unit(campaign: Campaign, trials: Sequence[Trial]) -> list[str]:
    """Tell degrees by name that are radians by size, and what misses its setpoint by as much."""
    column = (campaign.log.columns or {}).get("angle")
    largest = max((_reach(trial) for trial in trials), default=0.0)
    if column is not None and column.unit == "deg" and _STILL_DEG < largest <= _HALF_TURN_RAD:
        return [
            f"the angle reaches {largest:.3g} deg at most: log.columns.angle says deg, the logs "
            "may hold radians"
        ]
    off = [trial for trial in trials if _misses_by_far(trial)]
    if not off:
        return []
    return [
        f"the angle reaches {_reach(off[0]):.3g} deg for a setpoint_deg of "
        f"{off[0].setpoint_deg:g} in {_named(off)}: one of the two may be in another unit"
    ]


def _misses_by_far(trial: Trial) -> bool:
    if not trial.setpoint_deg or not _reach(trial) > 0.0:
        return False
    ratio = _reach(trial) / abs(trial.setpoint_deg)
    return not 1.0 / _FACTOR_OFF < ratio < _FACTOR_OFF


def _reach(trial: Trial) -> float:
    return float(np.abs(trial.angle_deg).max())


def _named(trials: Sequence[Trial]) -> str:
    names = ", ".join(trial.label for trial in trials[:_SHOWN])
    return names + (f" and {len(trials) - _SHOWN} more" if len(trials) > _SHOWN else "")
