"""What noise and the scatter of single trials make of an error on some of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.data.searched import at_rate
from spa_fo.gap.decide.explanation import Explanation, simulate
from spa_fo.gap.fit.bench import DELAY, Bench
from spa_fo.gap.fit.nuisances import OF_TRIALS, nuisance_scales
from spa_fo.plant.effects.library import at_port

_RATE_STEP = 2e-3


class Judging:
    """Some trials, their noise, and what each one's gain, rest angle, time scale and delay make.

    `where`, (n,), tells their samples; `plain_deg` and `explained_deg`, (n,), are what the plain
    model and an explanation predict.
    """

    def __init__(
        self,
        bench: Bench,
        chosen: Explanation,
        everything: Evidence,
        where: NDArray[np.bool_],
        plain_deg: Floats,
        explained_deg: Floats,
    ) -> None:
        self.bench, self.chosen, self.everything = bench, chosen, everything
        self.level = chosen.angle.level  # of the noise, beside what is chosen
        self.explained_deg, grid = explained_deg, everything.grid
        trials = np.isin(np.arange(len(grid.trials)), grid.sample_trial[where])
        own = bench.without(~trials).with_gap(grid.angle_deg - plain_deg, plain_deg)
        self.whitening, rows = own.whitening, own.whitening.rows
        quick = simulate(chosen, everything, given=at_rate(chosen.x, 1.0 + _RATE_STEP))
        moved = [explained_deg, np.ones_like(explained_deg), (quick - explained_deg) / _RATE_STEP]
        moved.append(-chosen.angle.delay_s * grid.slopes(explained_deg))
        self.shapes = rows.merged(np.column_stack(moved))  # (rows, 4), of each trial's own
        slips = at_port("zeros", chosen.ids) is not None
        delays = max(float(chosen.angle.variances[DELAY]), 1e-12)
        self.own = np.append(nuisance_scales(bench, slips)[OF_TRIALS], np.sqrt(delays))  # 1 sigma
        self.count = np.concatenate([group.count for group in rows.groups])
        self.trial = np.concatenate([group.trial for group in rows.groups])

    def trials(self) -> Iterator[NDArray[np.bool_]]:
        """Yield the rows of each trial, (rows,) bool."""
        for one in np.unique(self.trial):
            yield self.trial == one

    def scatter(self, left_deg: float) -> float:
        """Estimate the RMS of noise and scatter beside the explanation, deg.

        A few trials scatter more or less than trials do on average, and what they happen to differ
        by is neither left of the gap nor closed. Each has its gain, rest angle and time scale, of
        which is known how much trials differ: what they are worth, given the prediction's error and
        beside what it misses of the trials that it was fitted to, `left_deg`, RMS, is the scatter;
        noise is what the bench has. What a slip or an interference makes of trials is no scatter.
        """
        bench, there, everything = self.bench, self.whitening, self.everything
        factor = there.factor(self.level, left_deg / max(bench.gap_deg, 1e-9))
        left = there.rows.merged(everything.grid.angle_deg - self.explained_deg)
        white_left, squares = there.white(factor, left), np.empty(there.rows.size)
        for here in self.trials():
            white = there.white(factor, np.where(here[:, None], self.shapes, 0.0))
            spread = np.linalg.inv(white.T @ white + np.diag(self.own**-2.0))
            mean, z = spread @ (white.T @ white_left), self.shapes[here]
            squares[here] = (z @ mean) ** 2 + np.einsum("ij,jk,ik->i", z, spread, z)
        spectrum, noise = bench.noise.spectrum, everything.noise_deg**2
        if self.chosen.line is not None:
            # A fast interference is no white noise, and hardly shows in averages of many samples.
            noise = min(noise, spectrum.white)
        scatter = np.average(squares, weights=self.count)
        return float(np.sqrt(scatter + noise + self.level**2 * spectrum.coloured.sum()))

    def unsure(self, without: Floats) -> float:
        """Say how unsure it is what the explanation takes of the mean squared error, 1 sigma, deg².

        If it is right, r being noise and scatter and d what it predicts beyond the curve `without`
        it, (n,), that is d² + 2 d r.
        """
        change = self.whitening.rows.merged(self.explained_deg - without)
        weights = 2.0 * self.count / self.count.sum() * change
        variance = self.whitening.variance_of(weights, self.level)
        for here in self.trials():
            variance += float(np.sum((weights[here] @ self.shapes[here] * self.own) ** 2))
        return float(np.sqrt(variance))
