"""What trials differ by from their expected mean: of just these trials, not of trials at large."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.data.searched import at_rate
from spa_fo.gap.decide.explanation import Explanation, simulate
from spa_fo.gap.fit.bench import GAIN, REST, TIME_SCALE, Bench
from spa_fo.gap.fit.problem import nuisance_scales
from spa_fo.plant.effects.library import at_port

Floats = NDArray[np.float64]

_RATE_STEP = 2e-3


def own_scatter(
    bench: Bench,
    chosen: Explanation,
    everything: Evidence,
    where: NDArray[np.bool_],
    curves: Mapping[str, Floats],
    left_deg: float,
) -> float:
    """Estimate the RMS of noise and scatter in some trials beside an explanation, deg.

    A few trials scatter more or less than trials do on average, and what they happen to differ by
    is neither left of the gap nor closed. Each has its gain, rest angle and time scale, of which is
    known how much trials differ: what they are worth, given the prediction's error and beside what
    it misses, is the scatter; noise is what the bench has. What a slip or an interference makes of
    trials is no scatter.

    Parameters
    ----------
    bench : Bench
        Noise and scatter.
    chosen : Explanation
        What predicts the trials.
    everything : Evidence
        The campaign with all its trials.
    where : (n,) bool array
        Averaged samples of the trials.
    curves : mapping of str to (n,) arrays
        At all averaged samples: ``plain``, of the plain model, and ``explained``, the prediction.
    left_deg : float
        RMS by which the explanation misses the trials that it was fitted to.
    """
    grid = everything.grid
    trials = np.zeros(len(grid.trials), dtype=bool)
    trials[np.unique(grid.sample_trial[where])] = True
    explained_deg, plain_deg = curves["explained"], curves["plain"]
    judging = bench.without(~trials).with_gap(grid.angle_deg - plain_deg, plain_deg)
    there, rows = judging.whitening, judging.whitening.rows
    quick = simulate(chosen, everything, given=at_rate(chosen.x, 1.0 + _RATE_STEP))
    ones = np.ones_like(explained_deg)
    shapes = np.column_stack([explained_deg, ones, (quick - explained_deg) / _RATE_STEP])
    left, shapes = rows.merged(grid.angle_deg - explained_deg), rows.merged(shapes)
    factor = there.factor(1.0, left_deg / max(bench.gap_deg, 1e-9))
    white_left = there.white(factor, left)
    slips = at_port("zeros", chosen.ids) is not None
    own = nuisance_scales(bench, slips)[[GAIN, REST, TIME_SCALE]]
    squares = counts = 0.0
    for group in rows.groups:
        for trial in np.unique(group.trial):
            here = np.arange(group.rows.start, group.rows.stop)[group.trial == trial]
            only = np.zeros_like(shapes)
            only[here] = shapes[here]
            white = there.white(factor, only)
            precision = cho_factor(white.T @ white + np.diag(own**-2.0))
            mean = cho_solve(precision, white.T @ white_left)
            spread = cho_solve(precision, np.eye(own.size))
            scattered = (shapes[here] @ mean) ** 2
            scattered += np.einsum("ij,jk,ik->i", shapes[here], spread, shapes[here])
            weight = group.count[group.trial == trial]
            squares += float(weight @ scattered)
            counts += float(weight.sum())
    return float(np.sqrt(squares / counts + _noise(chosen, everything, bench)))


def _noise(chosen: Explanation, everything: Evidence, bench: Bench) -> float:
    """Variance of a single sample's noise, deg²."""
    spectrum, white = bench.noise.spectrum, everything.noise_deg**2
    if chosen.line is not None:
        # A fast interference is no white noise, and hardly shows in averages over many samples.
        white = min(white, spectrum.white)
    return white + float(spectrum.coloured.sum())
