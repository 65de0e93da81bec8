"""What the reference of a campaign lets expect of its angle.

What the model misses on the reference is learned as a law of fading memory, and expected of the
campaign as well, as surely as the law, and the sensor of the pressure that drives it, are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.compare.bounds import hold_to_bounds
from spa_fo.compare.expectation import Expected, of_a_day
from spa_fo.compare.fading_memory import FadingMemoryLaw, Signal
from spa_fo.compare.learning import learn
from spa_fo.compare.misread import Misread, misread, rows_of
from spa_fo.compare.timing import lateness_s, rate, unsure_of_time
from spa_fo.errors import BadInput
from spa_fo.gap.noise.bench_noise import TYPICAL
from spa_fo.gap.noise.coloured import CORRELATION_S, TYPICAL_DEG
from spa_fo.gap.settings import SETTINGS
from spa_fo.identify.whole_log import input_of
from spa_fo.plant import Model
from spa_fo.plant.augmented import predict_augmented
from spa_fo.rig import CampaignData, Trial

_LOWEST = 0.01  # quantile of a log's pressure: at rest, if it ever was


@dataclass(frozen=True)
class AngleKnown:
    """What is known of the angle of a campaign by its reference, by trial where it is a sequence.

    Attributes
    ----------
    law : FadingMemoryLaw
        What the model misses on the reference, deg.
    missed : sequence of Signal
        That, by trial of the reference.
    common : sequence of pairs
        What it lets expect that the model misses, and its deviation, deg.
    late : sequence of arrays
        By how much angles are off, 1 sigma, as their times are off as the reference's were, deg.
    sigma : sequence of arrays
        The same deviation with that of a day, deg; infinite where the reference never was.
    broken : tuple of str
        Sentences on where a reading is out of its bounds.
    misread : tuple
        What is none of an actuator's readings.
    unvisited : sequence of arrays
        Which rows are that, or where the reference never was.
    """

    law: FadingMemoryLaw
    missed: Sequence[Signal]
    common: Sequence[Expected]
    late: Sequence[Floats]
    sigma: Sequence[Floats]
    broken: tuple[str, ...]
    misread: tuple[tuple[Misread, ...], ...]
    unvisited: Sequence[NDArray[np.bool_]]


def know_angle(reference: CampaignData, data: CampaignData, plain: Model) -> AngleKnown:
    """Learn what the model misses on the reference, and say what that lets expect.

    `BadInput` where a log lacks the signal that drives the model.
    """
    missed, there = _missed(reference, plain), _missed(data, plain)
    law = learn(missed, _unrepeated_deg(reference))
    common, unvisited = law.predict(there), law.unvisited(there)
    if plain.signal == "pressure":
        error_kpa = _zero_error_kpa(reference, data, plain)
        foreseen = _foreseen(data, there, common)
        common = _unsure_of_pressure(law, data, plain, foreseen, common, error_kpa)
    readings = [trial.angle_deg for trial in reference.trials]
    held = hold_to_bounds(law, missed, readings, there, data.trials, common, unvisited)
    common, unvisited = held.common, held.unvisited
    foreseen = _foreseen(data, there, common)
    sigma = [
        np.where(nowhere, np.inf, np.hypot(own, of_a_day(angle)))
        for angle, (_, own), nowhere in zip(foreseen, common, unvisited, strict=True)
    ]
    wrong = misread(reference, data, [signal.input for signal in there], foreseen, sigma)
    unvisited = [
        rows | rows_of(found, rows.size) for rows, found in zip(unvisited, wrong, strict=True)
    ]
    late_s = lateness_s(reference.trials, law)
    late = [
        late_s * rate(angle, trial.t_s) for angle, trial in zip(foreseen, data.trials, strict=True)
    ]
    law = unsure_of_time(law, reference.trials, late_s)
    return AngleKnown(law, missed, common, late, sigma, held.sentences, wrong, unvisited)


def _zero_error_kpa(reference: CampaignData, data: CampaignData, plain: Model) -> float:
    """Say how unsure the zero of the pressure is: where all logs rested it was seen."""
    lowest = [
        np.quantile(_driving(trial, plain, each), _LOWEST)
        for each in (reference, data)
        for trial in each.trials
    ]
    return min(SETTINGS.pressure_offset_kpa, float(np.ptp(lowest)))


def _unsure_of_pressure(
    law: FadingMemoryLaw,
    data: CampaignData,
    plain: Model,
    foreseen: Sequence[Floats],
    common: Sequence[Expected],
    error_kpa: float,
) -> list[Expected]:
    """Be less sure of what is expected by what an error of the pressure's zero makes of it.

    One sensor has read both campaigns, so that its gain is the same.
    """
    read = [
        replace(trial, pressure_kpa=_driving(trial, plain, data) + error_kpa)
        for trial in data.trials
    ]
    moved = replace(data, trials=tuple(read))
    there = _missed(moved, plain)
    others = _foreseen(moved, there, law.predict(there))
    return [
        (mean, np.hypot(deviation, other - angle))
        for (mean, deviation), angle, other in zip(common, foreseen, others, strict=True)
    ]


def _foreseen(
    data: CampaignData, there: Sequence[Signal], common: Sequence[Expected]
) -> list[Floats]:
    """Give by trial the angle that is expected, deg."""
    return [
        trial.angle_deg - signal.missed + mean
        for trial, signal, (mean, _) in zip(data.trials, there, common, strict=True)
    ]


def _driving(trial: Trial, plain: Model, data: CampaignData) -> Floats:
    drive = input_of(trial, plain.signal)
    if drive is None:
        raise BadInput(
            data.campaign.folder,
            f"expected a {plain.signal} column: it drives the model",
            trial.label,
        )
    return drive


def _missed(data: CampaignData, plain: Model) -> list[Signal]:
    """Return what the model misses of each trial, what a trial leaves to the next with it."""
    driving = [_driving(trial, plain, data) for trial in data.trials]
    predicted = predict_augmented(replace(plain, extra={}), data)
    return [
        Signal(t.started_s, t.t_s, drive, t.angle_deg - angle)
        for t, drive, angle in zip(data.trials, driving, predicted, strict=True)
    ]


def _unrepeated_deg(reference: CampaignData) -> float:
    """Say what repeats of a trial of some campaign differ by, where none is there to show it."""
    angle = np.concatenate([trial.angle_deg for trial in reference.trials])
    coloured = TYPICAL_DEG * np.sqrt(CORRELATION_S.size)
    return float(np.hypot(coloured, TYPICAL.gain * float(np.sqrt(np.mean(angle**2)))))
