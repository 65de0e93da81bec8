"""A reading that stands still where the angle moves, or is clearly another than is foreseen.

A channel that hangs, or that reads nothing, repeats one value exactly; no actuator does where its
noise, and that of its sensor, moved it before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.diagnosis import Cause, Diagnosis, Step
from spa_fo.gap.plan.next_steps import in_words
from spa_fo.plant.effects.effect import STAGES
from spa_fo.rig import CampaignData, Trial

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_LEAST_S, _LEAST = 0.5, 10  # of one value
_LONGER = 3.0  # than any in the reference, in samples: there a quiet converter repeats itself, too
_CLEARLY = 3.0  # deviations of what is foreseen
_MOVES = 0.2  # of its range in the trial, by the input
_LOOK = Step(
    "look at the channel's cable, converter and program",
    "a channel that hangs repeats one value, and says nothing of the actuator meanwhile",
)


@dataclass(frozen=True)
class Still:
    """A stretch of one trial in which the reading stands still.

    Attributes
    ----------
    label : str
        Of the trial.
    rows : slice
        Of its samples.
    begins_s, ends_s : float
        In the trial.
    value_deg : float
    square : float
        Sum of the squares by which the angle that is foreseen differs from it, deg².
    """

    label: str
    rows: slice
    begins_s: float
    ends_s: float
    value_deg: float
    square: float

    @property
    def text(self) -> str:
        """Say it."""
        return (
            f"The reading stands at {self.value_deg:.3g}° from {self.begins_s:.3g} to "
            f"{self.ends_s:.3g} s of {self.label}, while the actuator moves or is elsewhere."
        )


def still(
    reference: CampaignData,
    data: CampaignData,
    inputs: Sequence[Floats],
    foreseen: Sequence[Floats],
    deviation: Sequence[Floats],
) -> tuple[tuple[Still, ...], ...]:
    """Find by trial of the second campaign where its reading stands still.

    `inputs`, which bend it, `foreseen` and `deviation`, deg, are by trial, at its samples. What
    stands at the largest reading of all, below what is foreseen, is against a stop or at a ceiling,
    and not among these.
    """
    usual = max(int(np.diff(_edges(trial.angle_deg)).max()) for trial in reference.trials)
    largest = max(float(trial.angle_deg.max()) for trial in data.trials)
    return tuple(
        tuple(_in_trial(*own, usual, largest))
        for own in zip(data.trials, inputs, foreseen, deviation, strict=True)
    )


def _edges(values: Floats) -> NDArray[np.int64]:
    """Return where each run of one value begins, and the end of all."""
    changes = np.flatnonzero(np.diff(values) != 0.0) + 1
    return np.concatenate([[0], changes, [values.size]])


def _in_trial(
    trial: Trial, drive: Floats, foreseen: Floats, deviation: Floats, usual: int, largest: float
) -> list[Still]:
    edges, found = _edges(trial.angle_deg), []
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        lasts_s = float(trial.t_s[end - 1] - trial.t_s[begin])
        if end - begin < max(_LEAST, _LONGER * usual) or lasts_s < _LEAST_S:
            continue
        rows, value = slice(begin, end), float(trial.angle_deg[begin])
        away, moved = foreseen[rows] - value, float(np.ptp(drive[rows]))
        if value == largest and np.all(away > -_CLEARLY * deviation[rows]):
            continue
        elsewhere = bool(np.any(np.abs(away) > _CLEARLY * deviation[rows]))
        if elsewhere or (begin > 0 and moved > _MOVES * float(np.ptp(drive))):
            times = float(trial.t_s[begin]), float(trial.t_s[end - 1])
            found.append(Still(trial.label, rows, *times, value, float(away @ away)))
    return found


def rows_of(found: Sequence[Still], rows: int) -> Bools:
    """Say which rows of a trial stand still."""
    out = np.zeros(rows, dtype=bool)
    for each in found:
        out[each.rows] = True
    return out


def with_still(change: Diagnosis, found: Sequence[Still], rows: int) -> Diagnosis:
    """Add a reading that stands still to what changed, which was found without it.

    `rows` are all samples of the campaign. It is the sensor's, by what it is away from the angle
    that is foreseen; of what else changed the gap says how much. A model does not go on with it.
    """
    if not found:
        return change
    dead = sum(each.square for each in found) / rows
    rest = change.gap.rmse_deg**2 if change.kind != "no_gap" else 0.0
    stage = change.where.stage
    if stage is not None:
        stage = {name: rest * stage[name] for name in STAGES}
        stage["sensor"] += dead
        stage = {name: square / (rest + dead) for name, square in stage.items()}
    elif dead > rest:
        stage = {name: float(name == "sensor") for name in STAGES}
    change = replace(
        change,
        where=replace(
            change.where, stage=stage, not_known=None if stage else change.where.not_known
        ),
        findings=(*(each.text for each in found), *change.findings),
        next_steps=(_LOOK, *change.next_steps),
        next_experiment=in_words((_LOOK, *change.next_steps)),
    )
    if change.kind != "no_gap":
        return change
    return replace(
        change,
        kind="unknown",
        gap=replace(change.gap, significant=True, p_value=0.0),
        causes=_unknown_for_none(change.causes),
    )


def _unknown_for_none(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    none = sum(cause.probability for cause in causes if cause.set == ("none",))
    moved: dict[tuple[str, ...], float] = {("none",): -none, ("unknown",): none}
    changed = [
        replace(cause, probability=cause.probability + moved.get(cause.set, 0.0))
        for cause in causes
    ]
    return tuple(sorted(changed, key=lambda cause: -cause.probability))
