"""Trials that take no part in choosing or fitting, and how far the gap closes on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.diagnosis import Shrink
from spa_fo.plant.grid import CampaignGrid

_MOST = 0.3  # of the trials
_DRAWS = 2000
_LEAST_HALF_WIDTH = 0.1  # the floor itself is known from few trials
_HARDLY = 0.3  # noise floors
_FARTHER = 0.05  # of the largest input, by more than which a trial goes farther. Assumed.
_PIECES = 8  # of a lone held-out trial


@dataclass(frozen=True)
class HeldOut:
    """Which trials are held out."""

    trials: NDArray[np.bool_]  # (trials,): True for those that take no part
    text: str  # what they are, in words


def hold_out(
    evidence: Evidence, rng: np.random.Generator, missed_deg: Floats | None = None
) -> HeldOut:
    """Draw one trial of each experiment that was repeated; else one of three or more experiments.

    The first trial of an experiment stays: softening is seen in it. Where only some experiments can
    be held out, it is those whose trials the given model misses most, `missed_deg`, (n,), at the
    averaged samples, and so is a lone one: a trial without a gap judges nothing. A lone one that
    goes farther than all others stays, as nothing that is left would say what happens there.
    """
    grid = evidence.grid
    held = np.zeros(len(grid.trials), dtype=bool)
    most = max(1, int(_MOST * held.size))
    names = []
    for name in _by_gap(evidence, missed_deg):
        own = [i for i, trial in enumerate(grid.trials) if trial.experiment == name]
        if len(own) >= 2 and held.sum() < most:
            held[own[int(rng.integers(1, len(own)))]] = True
            names.append(name)
    if names:
        return HeldOut(held, f"one trial of each of {', '.join(names)}: {held.sum()} trials")
    if held.size >= 3:
        lone = np.flatnonzero(~_farthest(grid)).tolist()
        one = lone[int(rng.integers(len(lone)))]
        if missed_deg is not None:
            one = max(
                lone, key=[_gap(evidence, [own], missed_deg) for own in evidence.rows].__getitem__
            )
        held[one] = True
        return HeldOut(held, f"{grid.trials[one].label}, the only one of its experiment")
    return nothing_held_out(evidence)


def _farthest(grid: CampaignGrid) -> NDArray[np.bool_]:
    """Find the trials, (trials,), whose input goes clearly farther up, or down, than all others."""
    cells = grid.pressure_kpa if grid.command_kpa is None else grid.command_kpa
    assert cells is not None
    trials = np.split(cells, grid.cell_starts[1:-1])
    ends = np.array([[own.max(), -own.min()] for own in trials])
    next_to_it = np.partition(ends, -2, axis=0)[-2]
    return np.asarray((ends > next_to_it + _FARTHER * np.abs(cells).max()).any(axis=1))


def _by_gap(evidence: Evidence, missed_deg: Floats | None) -> list[str]:
    """List experiments, those with the largest gap first; as they come where that is not known."""
    trials = evidence.grid.trials
    names = list(dict.fromkeys(trial.experiment for trial in trials))
    if missed_deg is None:
        return names
    rows = {
        name: [r for r, t in zip(evidence.rows, trials, strict=True) if t.experiment == name]
        for name in names
    }
    return sorted(names, key=lambda name: _gap(evidence, rows[name], missed_deg), reverse=True)


def _gap(evidence: Evidence, rows: Sequence[Integers], missed_deg: Floats) -> float:
    """Mean square of what is missed over some trials' rows, deg²."""
    own, counts = np.concatenate(rows), evidence.grid.counts
    return float(counts[own] @ missed_deg[own] ** 2) / max(float(counts[own].sum()), 1e-9)


def nothing_held_out(evidence: Evidence, why: str = "no trial was left to hold out") -> HeldOut:
    """Let all trials take part; `why` in words."""
    none = np.zeros(len(evidence.grid.trials), dtype=bool)
    return HeldOut(none, f"{why}; figures are of the fitted trials")


def judged(evidence: Evidence, held: HeldOut) -> NDArray[np.bool_]:
    """Averaged samples that the shrink is measured on, (n,)."""
    trials = held.trials if held.trials.any() else np.ones_like(held.trials)
    return np.asarray(trials[evidence.grid.sample_trial])


def rmse(evidence: Evidence, predicted_deg: Floats, where: NDArray[np.bool_]) -> float:
    """RMS error over single samples, their white noise included, a line taken off not, deg."""
    squares = _squares(evidence, predicted_deg)
    return float(np.sqrt(np.average(squares[where], weights=evidence.grid.counts[where])))


def _squares(evidence: Evidence, predicted_deg: Floats) -> Floats:
    """Mean squared error of the single samples behind each averaged one."""
    grid = evidence.grid
    white = evidence.noise_deg**2 * (1.0 - 1.0 / grid.counts)
    return np.asarray((grid.angle_deg - predicted_deg) ** 2 + white)


def fraction_closed(before: Floats | float, after: Floats | float, floor_deg: float) -> Floats:
    """Share of the gap that closes: 1 - (after - floor²) / (before - floor²), errors as squares."""
    # Hardly a gap has no part that could be told, and no more than all of it closes.
    gap = np.maximum(before - floor_deg**2, (_HARDLY * floor_deg) ** 2 + 1e-6)
    return np.asarray(1.0 - np.maximum(after - floor_deg**2, 0.0) / gap)


def shrink(
    evidence: Evidence,
    held: HeldOut,
    curves: dict[str, Floats],
    floor_deg: float,
    rng: np.random.Generator,
) -> Shrink:
    """Measure how far the gap closes.

    Parameters
    ----------
    evidence, held : Evidence, HeldOut
        The campaign, and its trials that took no part.
    curves : dict
        Predictions at the averaged samples, deg: ``plain``, ``refit``, ``explained``, ``ceiling``.
    floor_deg : float
        The noise floor.
    rng : numpy.random.Generator
        For the bootstrap over trials, or over the pieces of a lone one.
    """
    where = judged(evidence, held)
    # An interference is in every error, and nothing foretells its phase.
    line_deg = evidence.line_deg
    errors = {n: float(np.hypot(rmse(evidence, c, where), line_deg)) for n, c in curves.items()}
    # What is left bounds what these trials differ by.
    floor_deg = min(floor_deg, errors["explained"])
    trials, unit = np.unique(evidence.grid.sample_trial[where], return_inverse=True)
    if trials.size == 1:
        time = evidence.grid.time_s[where]
        share = (time - time[0]) / max(float(time[-1] - time[0]), 1e-9)
        pieces = np.minimum((_PIECES * share).astype(np.int64), _PIECES - 1)
        unit = np.unique(pieces, return_inverse=True)[1]
    counts = evidence.grid.counts[where]
    sums = [
        np.bincount(unit, weights=counts * (_squares(evidence, curves[name])[where] + line_deg**2))
        for name in ("plain", "explained")
    ]
    weights = np.bincount(unit, weights=counts)
    draws = rng.integers(weights.size, size=(_DRAWS, weights.size))
    total = weights[draws].sum(axis=1)
    before, after = (each[draws].sum(axis=1) / total for each in sums)
    low, high = np.quantile(fraction_closed(before, after, floor_deg), [0.025, 0.975])
    whole = float(fraction_closed(errors["plain"] ** 2, errors["explained"] ** 2, floor_deg))
    # Few trials: Student's t against the normal quantile that the bootstrap stands for.
    wide = 1.0 + 2.0 / max(trials.size - 1, 1)
    low = min(whole - wide * (whole - low), whole - _LEAST_HALF_WIDTH)
    high = max(whole + wide * (high - whole), whole + _LEAST_HALF_WIDTH)
    return Shrink(
        held_out_on=held.text,
        before_rmse_deg=errors["plain"],
        after_rmse_deg=errors["explained"],
        refit_only_rmse_deg=errors["refit"],
        ceiling_rmse_deg=errors["ceiling"],
        noise_floor_deg=floor_deg,
        fraction_closed=whole,
        # No more than all of it closes, give or take what is added to any interval.
        ci95=(float(max(low, min(whole, -1.0))), float(min(high, 1.0 + _LEAST_HALF_WIDTH))),
    )
