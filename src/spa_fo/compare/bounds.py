"""Bounds of an angle where its input goes beyond all that a reference showed.

An actuator that is pressed at least as hard at all times bends at least as far: viscoelastic bodies
preserve order so, and hysteresis of Preisach's kind does (Brokate and Sprekels 1996,
doi:10.1007/978-1-4612-4048-8). So where the input, its lags and its largest value are all beyond
those of some moment of the reference, the angle is no less than what the reference read then, and
likewise no more. A reference breaks that itself, as it scatters or swings: the bounds are the
tightest that it keeps, and are wider by the most that it breaks them where it took no part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Bools, Floats, Integers
from spa_fo.compare.expectation import Expected, of_a_day
from spa_fo.compare.fading_memory import ROOM, FadingMemoryLaw, Signal, inputs, telling
from spa_fo.compare.learning import ways
from spa_fo.compare.misread import CLEARLY, LEAST, LEAST_S
from spa_fo.rig import Trial

_MOST = 2000  # moments of a reference: memory
_AT_ONCE = 500  # of those that are asked for: memory


@dataclass(frozen=True)
class Bounds:
    """What a reading is bounded by, by what has been of the input.

    Attributes
    ----------
    at : (n, k) array
        What has been of it at some moments of the reference.
    least, most : (n,) arrays
        What was read, at the least, wherever all of that was as large; and at the most, wherever
        it was as small.
    slack : float
        By how much the bounds are wider.
    """

    at: Floats
    least: Floats
    most: Floats
    slack: float = 0.0

    def of(self, x: Floats) -> tuple[Floats, Floats]:
        """Bound the reading at other moments, (m, k): from below and above, infinite where not."""
        low, high = np.full(len(x), -np.inf), np.full(len(x), np.inf)
        for first in range(0, len(x), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            low[some] = np.where(no_less(x[some], self.at), self.least, -np.inf).max(axis=1)
            high[some] = np.where(no_less(self.at, x[some]).T, self.most, np.inf).min(axis=1)
        return low - self.slack, high + self.slack

    def nearest(self, x: Floats, readings: Floats) -> Floats:
        """Move readings at other moments, (m,), no farther than within their bounds."""
        return np.clip(readings, *self.of(x))


def no_less(one: Floats, other: Floats) -> Bools:
    """Say which of some moments, (n, k), are nowhere less than which others, (m, k): (n, m)."""
    found = np.ones((len(one), len(other)), dtype=bool)
    for mine, theirs in zip(one.T, other.T, strict=True):
        found &= mine[:, None] >= theirs
    return found


def learn_bounds(x: Floats, readings: Floats, groups: Sequence[Integers]) -> Bounds:
    """Learn the bounds from a reference.

    Parameters
    ----------
    x : (n, k) array
        What has been of the input at each of its rows; see `fading_memory.inputs`.
    readings : (n,) array
        What was read there.
    groups : sequence of (n,) arrays
        The ways in which rows are left out together: numbers of what each belongs to.
    """
    scale = np.maximum(x.std(axis=0), 1e-9)
    chosen = telling(x / scale, _MOST)
    at, read = x[chosen], readings[chosen]
    slack = 0.0
    for group in groups:
        for one in np.unique(group[chosen]):
            left_out = group[chosen] == one
            if left_out.all():
                continue
            others = _tightest(at[~left_out], read[~left_out])
            kept = others.nearest(at[left_out], read[left_out])
            slack = max(slack, float(np.abs(kept - read[left_out]).max()))
    return replace(_tightest(at, read), slack=slack)


def _tightest(at: Floats, read: Floats) -> Bounds:
    """Give the tightest bounds that some readings keep."""
    larger = no_less(at, at)
    least = np.where(larger.T, read, np.inf).min(axis=1)
    return Bounds(at, least, np.where(larger, read, -np.inf).max(axis=1))


@dataclass(frozen=True)
class Held:
    """What is expected of a campaign, as far as bounds let it be, by trial where it is a sequence.

    Attributes
    ----------
    common : sequence of pairs
        What its model is expected to miss, and the deviation of that, deg.
    unvisited : sequence of arrays
        Which rows are not compared.
    sentences : tuple of str
        Where a reading is out of its bounds.
    """

    common: list[Expected]
    unvisited: list[Bools]
    sentences: tuple[str, ...] = ()


def hold_to_bounds(
    law: FadingMemoryLaw,
    missed: Sequence[Signal],
    readings: Sequence[Floats],
    there: Sequence[Signal],
    trials: Sequence[Trial],
    common: Sequence[Expected],
    unvisited: Sequence[Bools],
) -> Held:
    """Compare what is read surely out of its bounds for a while, where nothing else is known.

    That is where the input is beyond all that the reference showed.

    Parameters
    ----------
    law, missed, readings : FadingMemoryLaw, sequences by trial of the reference
        What was learned of it, of what, and what was read.
    there, trials, common, unvisited : sequences by trial of the campaign
        The same, what is expected of it without bounds, and where that is nothing.
    """
    farther = _farther(missed, there, unvisited)
    if not any(rows.size for rows in farther):
        return Held(list(common), list(unvisited))
    x = np.concatenate(inputs(missed, law.lags_s))
    known = learn_bounds(x, np.concatenate(readings), ways(missed))
    own = float(np.sqrt(law.chosen.expected(np.zeros(1))[0]))
    expected, nowhere, sentences = list(common), list(unvisited), []
    for i, (trial, x) in enumerate(zip(trials, inputs(there, law.lags_s), strict=True)):
        rows = farther[i]
        low, high = known.of(x[rows])
        bound = np.clip(trial.angle_deg[rows], low, high)
        broken = np.abs(trial.angle_deg[rows] - bound) > CLEARLY * np.hypot(own, of_a_day(bound))
        rows, (bound, low, high) = rows[broken], (each[broken] for each in (bound, low, high))
        if rows.size < LEAST or trial.t_s[rows[-1]] - trial.t_s[rows[0]] < LEAST_S:
            continue
        mean, deviation = (each.copy() for each in common[i])
        predicted = (trial.angle_deg - there[i].missed)[rows]
        # What the law foresees, as far as the bounds let it: they are as far as it may be off.
        foreseen = np.clip(predicted + mean[rows], low, high)
        mean[rows] = foreseen - predicted
        deviation[rows] = np.hypot(own, (foreseen - bound) / CLEARLY)
        expected[i], nowhere[i] = (mean, deviation), unvisited[i].copy()
        nowhere[i][rows] = False
        sentences.append(broken_text(trial, rows, trial.angle_deg[rows] - bound))
    return Held(expected, nowhere, tuple(sentences))


def _farther(
    missed: Sequence[Signal], there: Sequence[Signal], unvisited: Sequence[Bools]
) -> list[Integers]:
    """Give by trial the rows whose input is beyond all that the reference showed."""
    shown = np.concatenate([signal.input for signal in missed])
    low, high, room = shown.min(), shown.max(), ROOM * np.ptp(shown)
    return [
        np.flatnonzero(nowhere & ((signal.input < low - room) | (signal.input > high + room)))
        for signal, nowhere in zip(there, unvisited, strict=True)
    ]


def broken_text(trial: Trial, rows: Integers, by_deg: Floats) -> str:
    """Say in a sentence where a trial breaks its bounds, and by how much; negative is less."""
    time_s, most = trial.t_s[rows], float(by_deg[np.argmax(np.abs(by_deg))])
    how = ("harder", "less") if most < 0.0 else ("less", "farther")
    return (
        f"From {time_s[0]:.3g} to {time_s[-1]:.3g} s of {trial.label} ({rows.size} samples) the "
        f"actuator was pressed {how[0]} than ever in the reference, and bends {how[1]} than that "
        f"lets expect in any case, by up to {abs(most):.2g}°."
    )
