"""The noise floor: what repeated trials differ by among themselves."""

from __future__ import annotations

import numpy as np

from spa_fo.gap.evidence import Evidence


def noise_floor(evidence: Evidence) -> float:
    """RMS by which trials of one experiment deviate from their expected mean, deg.

    Scatter in gain, rest angle and pace and the noise of single samples included; pooled over the
    experiments, so one with a single trial borrows it. Where trials drift with their order, the
    differences of successive ones count (von Neumann 1941, doi:10.1214/aoms/1177731677), or the
    drift would hide itself in the floor.
    """
    grid = evidence.grid
    groups: dict[int, list[int]] = {}
    for trial, index in enumerate(evidence.support_index):
        groups.setdefault(int(index[0]), []).append(trial)
    squares = {"mean": 0.0, "successive": 0.0}
    weights = {"mean": 0.0, "successive": 0.0}
    for trials in groups.values():
        if len(trials) < 2:
            continue
        rows = evidence.rows[trials[0]]
        time, weight = grid.time_s[rows], grid.counts[rows]
        angle = np.array(
            [
                np.interp(time, grid.time_s[evidence.rows[i]], grid.angle_deg[evidence.rows[i]])
                for i in trials
            ]
        )
        # Averaging over a step took white noise away; it is given back below.
        white = evidence.noise_deg**2 / weight
        for name, freedom, square in (
            ("mean", len(trials) - 1, np.sum((angle - angle.mean(axis=0)) ** 2, axis=0)),
            ("successive", len(trials) - 1, np.sum(np.diff(angle, axis=0) ** 2, axis=0) / 2.0),
        ):
            squares[name] += float(weight @ (square - freedom * white))
            weights[name] += float(freedom * weight.sum())
    if not weights["mean"]:
        return evidence.noise_deg
    between = min(squares[name] / weights[name] for name in squares)
    return float(np.sqrt(max(between, 0.0) + evidence.noise_deg**2))
