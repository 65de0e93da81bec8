"""The noise floor: what repeated trials differ by among themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.evidence import Evidence

Floats = NDArray[np.float64]

_NEAR_S = 0.4


def noise_floor(
    evidence: Evidence,
    explained_deg: Floats | None = None,
    which: NDArray[np.bool_] | None = None,
    otherwise: float | None = None,
) -> float:
    """RMS by which trials of one experiment deviate from their expected mean, deg.

    Scatter in gain, rest angle and rate and the noise of single samples included; pooled over the
    experiments, so one with a single trial borrows it. Where trials drift with their order, the
    differences of successive ones count (von Neumann 1941, doi:10.1214/aoms/1177731677), or the
    drift would hide itself in the floor.

    Parameters
    ----------
    evidence : Evidence
        The campaign.
    explained_deg : (n,) array, optional
        What an explanation predicts: by how much it lets trials differ is no scatter.
    which : (trials,) bool array, optional
        Trials to compare; all of them where it is not given.
    otherwise : float, optional
        What is returned where nothing was repeated; the noise of single samples where it is not
        given, which leaves out all scatter.
    """
    values = evidence.grid.angle_deg
    if explained_deg is not None:
        values = values - explained_deg
    squares = {"mean": 0.0, "successive": 0.0}
    weights = {"mean": 0.0, "successive": 0.0}
    if which is None:
        which = np.ones(len(evidence.grid.trials), dtype=bool)
    for repeated in repeats(evidence, values, which):
        angle, weight = repeated.values, repeated.weight
        seen = np.isfinite(angle)
        # Averaging over a step took white noise away; it is given back below.
        white = evidence.noise_deg**2 / weight
        count = seen.sum(axis=0)
        both = seen[1:] & seen[:-1]
        centred = np.where(seen, angle - np.nanmean(np.where(count > 0, angle, 0.0), axis=0), 0.0)
        steps = np.where(both, np.diff(np.where(seen, angle, 0.0), axis=0), 0.0)
        for name, freedom, square in (
            ("mean", np.maximum(count - 1, 0), np.sum(centred**2, axis=0)),
            ("successive", both.sum(axis=0), np.sum(steps**2, axis=0) / 2.0),
        ):
            squares[name] += float(weight @ (square - freedom * white))
            weights[name] += float(weight @ freedom)
    if not weights["mean"]:
        return evidence.noise_deg if otherwise is None else otherwise
    between = min(squares[name] / max(weights[name], 1e-9) for name in squares)
    return float(np.sqrt(max(between, 0.0) + evidence.noise_deg**2))


@dataclass(frozen=True)
class Repeats:
    """Trials that were run alike, on the averaged samples of the first of them.

    Attributes
    ----------
    rows : (n,) array
        Averaged samples of the first trial.
    weight : (n,) array
        Samples averaged in each.
    values : (trials, n) array
        Of all of them at its times; NaN where a trial has no sample near.
    trials : (trials,) array
        Which they are, as an index into the grid's.
    """

    rows: NDArray[np.int64]
    weight: Floats
    values: Floats
    trials: NDArray[np.int64]


def repeats(evidence: Evidence, values: Floats, which: NDArray[np.bool_]) -> list[Repeats]:
    """Align a signal at the averaged samples over the trials that were run alike.

    Parameters
    ----------
    evidence : Evidence
        The campaign.
    values : (n,) array
        At its averaged samples.
    which : (trials,) bool array
        Trials to take.
    """
    grid = evidence.grid
    groups: dict[int, list[int]] = {}
    for trial in np.flatnonzero(which).tolist():
        groups.setdefault(int(evidence.alike[trial]), []).append(trial)
    found = []
    for trials in groups.values():
        # The longest trial says when: a board's reset may have cut others.
        first = max(trials, key=lambda trial: evidence.rows[trial].size)
        rows = evidence.rows[first]
        time = grid.time_s[rows]
        aligned = np.full((len(trials), rows.size), np.nan)
        for k, trial in enumerate(trials):
            own = grid.time_s[evidence.rows[trial]]
            after = np.minimum(np.searchsorted(own, time), own.size - 1)
            before = np.maximum(after - 1, 0)
            near = np.minimum(np.abs(own[after] - time), np.abs(own[before] - time)) < _NEAR_S
            aligned[k, near] = np.interp(time, own, values[evidence.rows[trial]])[near]
        found.append(Repeats(rows, grid.counts[rows], aligned, np.array(trials)))
    return found
