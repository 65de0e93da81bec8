"""What the drive of the reference does to a command, learned and taken off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.compare.expectation import WHITE, expected_rms, noise_of
from spa_fo.compare.fading_memory import FadingMemoryLaw, Signal
from spa_fo.compare.learning import learn
from spa_fo.gap.noise.bench_noise import TYPICAL
from spa_fo.gap.noise.coloured import Spectrum
from spa_fo.plant.grid import acting_command
from spa_fo.rig import CampaignData, Trial

_JUMP = 0.02  # of the commands' range, from one sample to the next
_ABOUT = 5  # samples about it
_MOST = 0.5  # of a trial


@dataclass(frozen=True)
class DriveKnown:
    """What is known of the drive of a campaign by its reference.

    Attributes
    ----------
    law : FadingMemoryLaw
        What the pressure differs from the command by, kPa.
    common : tuple of arrays
        That, by trial of the campaign.
    trials : tuple of Trial
        The campaign's, without it.
    unvisited : float
        Share of their rows where the reference never was.
    expected_kpa : float
        RMS of what may differ without any change.
    spectrum : Spectrum
        The noise that it is, kPa².
    """

    law: FadingMemoryLaw
    common: tuple[Floats, ...]
    trials: tuple[Trial, ...]
    unvisited: float
    expected_kpa: float
    spectrum: Spectrum


def know_drive(reference: CampaignData, data: CampaignData) -> DriveKnown:
    """Learn what the reference's drive does, and take it off the campaign's pressure."""
    lost, there = ([lost_in_drive(trial) for trial in each.trials] for each in (reference, data))
    law = learn(lost, _unrepeated_kpa(lost))
    usual = law.predict(there)
    expected_kpa = expected_rms(law, usual)
    spectrum, _ = noise_of(law, lost, [signal.input for signal in lost], expected_kpa)
    common = tuple(mean for mean, _ in usual)
    return DriveKnown(
        law=law,
        common=common,
        trials=tuple(
            replace(trial, pressure_kpa=_of(trial.pressure_kpa) - mean)
            for trial, mean in zip(data.trials, common, strict=True)
        ),
        unvisited=float(np.mean(np.concatenate(law.unvisited(there)))),
        expected_kpa=expected_kpa,
        spectrum=spectrum,
    )


def shows_drive(trial: Trial) -> bool:
    """Say whether command and pressure of a trial were logged."""
    return trial.command_kpa is not None and trial.pressure_kpa is not None


def lost_in_drive(trial: Trial) -> Signal:
    """Return what the pressure of a trial differs from its command by.

    About a jump it says when, not how much, and is doubtful. Where that would be most of a trial
    the command does not jump, it moves: what a row shows then differs from what acted on it.
    """
    command, pressure = _of(trial.command_kpa), _of(trial.pressure_kpa)
    step = np.abs(np.diff(command, prepend=command[0]))
    jumps = step > _JUMP * np.ptp(command)
    about = np.convolve(jumps, np.ones(_ABOUT), mode="same") > 0.0
    if about.mean() < _MOST:
        return Signal(trial.started_s, trial.t_s, command, pressure - command, about)
    acting = acting_command(trial)
    return Signal(trial.started_s, trial.t_s, acting, pressure - acting)


def _unrepeated_kpa(lost: Sequence[Signal]) -> float:
    """Say the same of the pressure that a drive makes of a command."""
    command = np.concatenate([signal.input for signal in lost])
    return max(TYPICAL.gain * float(np.sqrt(np.mean(command**2))), WHITE)


def _of(signal: Floats | None) -> Floats:
    assert signal is not None
    return signal
