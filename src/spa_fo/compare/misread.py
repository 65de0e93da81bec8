"""Readings that no actuator has: still while it moves, out of its reach, or elsewhere at once.

A channel that hangs, or that reads nothing, repeats one value exactly; no actuator does where its
noise, and that of its sensor, moved it before. None bends far back beyond where it began. (Far
beyond all that it reached one may go: what held it in the reference may be gone.) And none is
elsewhere from one sample to the next, for good, while its input stays: its sensor has moved, and
what that reads from then on is of another place.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from spa_fo.arrays import Bools, Floats, Integers
from spa_fo.gap.data.evidence import A_GAP
from spa_fo.gap.diagnosis import Cause, Diagnosis, Step
from spa_fo.gap.plan.next_steps import in_words
from spa_fo.plant.effects.effect import STAGES
from spa_fo.rig import CampaignData, Trial

LEAST_S, LEAST = 0.5, 10  # of one value
_LONGER = 3.0  # than any in the reference, in samples: there a quiet converter repeats itself, too
_FASTER = 3.0  # than ever in the reference, whatever its input did
_ABOUT = 5  # samples before and after a jump: what comes back within them is a dropout
_STAYS = 0.05  # of its range, the input at a jump and over `LEAST_S` before it
CLEARLY = 3.0  # deviations of what is foreseen
_MOVES = 0.2  # of its range, by the input, or by the reading
_BEYOND = 0.5  # of the range that the reference read, below the lowest of it
_LOOK = Step(
    "look at the sensor, and at its channel's cable, converter and program",
    "what reads so says nothing of the actuator meanwhile",
)


@dataclass(frozen=True)
class Misread:
    """Samples of one trial that are none of an actuator's.

    Attributes
    ----------
    rows : (n,) array
        Which of the trial's samples.
    words, text : str
        What it is, in short, and where, as a sentence.
    square : float
        Sum of the squares by which the angle that is foreseen differs from them, deg².
    """

    rows: Integers
    words: str
    text: str
    square: float


@dataclass(frozen=True)
class _Reference:
    """What readings the reference had.

    Attributes
    ----------
    longest : int
        Samples of one value.
    low_deg, high_deg : float
        Its readings.
    jump_deg : float
        Largest jump.
    every_s : float
        From one sample to the next.
    """

    longest: int
    low_deg: float
    high_deg: float
    jump_deg: float
    every_s: float

    @property
    def range_deg(self) -> float:
        return self.high_deg - self.low_deg


def misread(
    reference: CampaignData,
    data: CampaignData,
    inputs: Sequence[Floats],
    foreseen: Sequence[Floats],
    deviation: Sequence[Floats],
) -> tuple[tuple[Misread, ...], ...]:
    """Find by trial of the second campaign what is none of an actuator's readings.

    `inputs`, which bend it, `foreseen` and `deviation`, deg, are by trial, at its samples. What
    stands at the largest reading of a trial, below what is foreseen, is against a stop or at a
    ceiling, and not among these.
    """
    angle = np.concatenate([trial.angle_deg for trial in reference.trials])
    seen = _Reference(
        longest=max(int(np.diff(_edges(trial.angle_deg)).max()) for trial in reference.trials),
        low_deg=float(angle.min()),
        high_deg=float(angle.max()),
        jump_deg=max(float(np.max(_jumps(trial))) for trial in reference.trials),
        every_s=float(np.median(np.concatenate([np.diff(t.t_s) for t in reference.trials]))),
    )
    found = [
        (*_still(*own, seen), *_far(own[0], own[2], seen))
        for own in zip(data.trials, inputs, foreseen, deviation, strict=True)
    ]
    moved = _moved(data.trials, inputs, foreseen, deviation, found, seen)
    return tuple(
        own if after is None else (*(e for e in own if e.rows[-1] < after.rows[0]), after)
        for own, after in zip(found, moved, strict=True)
    )


def _edges(values: Floats) -> Integers:
    """Return where each run of one value begins, and the end of all."""
    changes = np.flatnonzero(np.diff(values) != 0.0) + 1
    return np.concatenate([[0], changes, [values.size]])


def _still(
    trial: Trial, drive: Floats, foreseen: Floats, deviation: Floats, seen: _Reference
) -> Iterator[Misread]:
    """Find where the reading stands still, though the actuator moves or is elsewhere."""
    angle, edges = trial.angle_deg, _edges(trial.angle_deg)
    largest, moved = float(angle.max()), float(np.ptp(angle)) > _MOVES * seen.range_deg
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        lasts_s = float(trial.t_s[end - 1] - trial.t_s[begin])
        if end - begin < max(LEAST, _LONGER * seen.longest) or lasts_s < LEAST_S:
            continue
        rows, value = np.arange(begin, end), float(angle[begin])
        away = foreseen[rows] - value
        if moved and value == largest and np.all(away > -CLEARLY * deviation[rows]):
            continue
        elsewhere = bool(np.any(np.abs(away) > CLEARLY * deviation[rows]))
        driven = float(np.ptp(drive[rows])) > _MOVES * float(np.ptp(drive))
        # From the start on it may not have begun to move yet.
        if elsewhere or (driven and (begin > 0 or end == angle.size)):
            text = (
                f"The reading stands at {value:.3g}° from {trial.t_s[begin]:.3g} to "
                f"{trial.t_s[end - 1]:.3g} s of {trial.label}, while the actuator moves or is "
                "elsewhere."
            )
            words = "the reading stands still while the actuator moves or is elsewhere"
            yield Misread(rows, words, text, float(away @ away))


def _far(trial: Trial, foreseen: Floats, seen: _Reference) -> Iterator[Misread]:
    """Find where the reading is out of the actuator's reach."""
    angle = trial.angle_deg
    rows = np.flatnonzero(angle < seen.low_deg - _BEYOND * seen.range_deg)
    if rows.size < LEAST:
        return
    away = foreseen[rows] - angle[rows]
    text = (
        f"The reading of {trial.label} goes from {angle[rows].min():.3g} to "
        f"{angle[rows].max():.3g}° in {rows.size} samples; the reference went from "
        f"{seen.low_deg:.3g} to {seen.high_deg:.3g}°."
    )
    words = "the reading goes back beyond where the actuator begins"
    yield Misread(rows, words, text, float(away @ away))


def _moved(
    trials: Sequence[Trial],
    inputs: Sequence[Floats],
    foreseen: Sequence[Floats],
    deviation: Sequence[Floats],
    found: Sequence[Sequence[Misread]],
    seen: _Reference,
) -> Iterator[Misread | None]:
    """Give by trial what a sensor reads after it has moved: from its first jump on, to the end."""
    jumps = [
        _jump(*own, seen) for own in zip(trials, inputs, foreseen, deviation, found, strict=True)
    ]
    since_s = min(
        (t.started_s + t.t_s[row] for t, row in zip(trials, jumps, strict=True) if row is not None),
        default=np.inf,
    )
    for trial, angle in zip(trials, foreseen, strict=True):
        rows = np.flatnonzero(trial.started_s + trial.t_s >= since_s)
        if not rows.size:
            yield None
            continue
        away = angle[rows] - trial.angle_deg[rows]
        text = f"What is read in {trial.label} is after a jump of the reading."
        if trial.started_s + trial.t_s[0] < since_s:
            text = (
                f"The reading jumps by {_jumps(trial)[rows[0]]:.2g}° at "
                f"{trial.t_s[rows[0]]:.3g} s of {trial.label}, while the input stays; the "
                f"reference never did by more than {seen.jump_deg:.2g}°. What is read from then on "
                "is not compared."
            )
        words = "the reading jumps as no actuator does"
        yield Misread(rows, words, text, float(away @ away))


def _jump(
    trial: Trial,
    drive: Floats,
    foreseen: Floats,
    deviation: Floats,
    found: Sequence[Misread],
    seen: _Reference,
) -> int | None:
    """Return the first sample at which a reading goes off while its input stays, if any.

    Where a reading that stands still begins or ends it jumps, too.
    """
    if trial.t_s.size <= 2 * _ABOUT:
        return None
    longer = max(1.0, float(np.median(np.diff(trial.t_s))) / seen.every_s)
    wrong = np.convolve(rows_of(found, trial.t_s.size), np.ones(2 * _ABOUT + 1), mode="same") > 0.0
    least = np.maximum(_FASTER * longer * seen.jump_deg, CLEARLY * deviation)
    large = (_jumps(trial) > least) & ~wrong
    # Where nobody knows what is to be expected, nothing is away from it.
    away = np.where(np.isinf(deviation), 0.0, np.abs(trial.angle_deg - foreseen))
    for row in np.flatnonzero(large).tolist():
        # From what was held by then, as rows may have been lost since.
        first = int(np.searchsorted(trial.t_s, trial.t_s[row] - LEAST_S, side="right")) - 1
        before = slice(max(first, 0), row + 2)
        if np.ptp(drive[before]) <= _STAYS * np.ptp(drive) and away[row + 1] > away[row - 1]:
            return row
    return None


def _jumps(trial: Trial) -> Floats:
    """Return by how much the reading goes elsewhere at each sample, at once and for good, deg.

    The smaller of its steps over two samples and between the medians of what is before and after:
    of the two a dropout lacks the latter, and what an actuator does the former. Where rows are lost
    nobody saw it go at once.
    """
    angle_deg, out = trial.angle_deg, np.zeros(trial.angle_deg.size)
    first, last = _ABOUT - 1, angle_deg.size - _ABOUT - 2
    if first > last:
        return out
    middle = np.median(sliding_window_view(angle_deg, _ABOUT), axis=1)
    at = np.arange(first, last + 1)
    step, lasting = angle_deg[at + 2] - angle_deg[at], middle[at + 2] - middle[at - first]
    intervals = np.diff(trial.t_s)
    longer = np.maximum(intervals[at], intervals[at + 1]) > A_GAP * np.median(intervals)
    both = (step * lasting > 0.0) & ~longer
    out[at + 1] = np.where(both, np.minimum(np.abs(step), np.abs(lasting)), 0.0)
    return out


def rows_of(found: Sequence[Misread], rows: int) -> Bools:
    """Say which rows of a trial are misread."""
    out = np.zeros(rows, dtype=bool)
    for each in found:
        out[each.rows] = True
    return out


def with_misread(change: Diagnosis, found: Sequence[Misread], rows: int) -> Diagnosis:
    """Add what is misread to what changed, which was found without it.

    `rows` are all samples of the campaign. It is the sensor's, by what it is away from the angle
    that is foreseen; of what else changed the gap says how much. A model does not go on with it.
    """
    if not found:
        return change
    wrong = sum(each.square for each in found) / rows
    sound = 1.0 - sum(each.rows.size for each in found) / rows
    rest = sound * change.gap.rmse_deg**2 if change.kind != "no_gap" else 0.0
    stage = change.where.stage
    if stage is not None:
        stage = {name: rest * stage[name] for name in STAGES}
        stage["sensor"] += wrong
        stage = {name: square / (rest + wrong) for name, square in stage.items()}
    elif wrong > rest:
        stage = {name: float(name == "sensor") for name in STAGES}
    why = None if stage else change.where.not_known
    steps = (_LOOK, *change.next_steps)
    change = replace(
        change,
        where=replace(change.where, stage=stage, not_known=why),
        findings=(*(each.text for each in found), *change.findings),
        next_steps=steps,
        next_experiment=in_words(steps),
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
