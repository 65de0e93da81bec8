"""Which effects show beside a fitted explanation, by a score test and no fit.

It holds the change that an effect makes, whitened and cleared of what nuisances and parameters may
take, against what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.searched import Slot
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.fit.lapack import forward
from spa_fo.gap.fit.least_squares import starts
from spa_fo.gap.fit.problem import AngleProblem
from spa_fo.gap.search.fitted import Fitted, problem_of, variants
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.effect import Effect
from spa_fo.plant.effects.library import LIBRARY, log_odds, ordered
from spa_fo.plant.grid import CampaignGrid
from spa_fo.plant.memory import FINEST_STEP_S

Floats = NDArray[np.float64]

_BEST_STARTS = 2
_FARTHEST = 4.0  # times the size that an effect is screened with
# Of looks about a moment: about how many, the first step, a share of what was logged, how much
# finer the next is, how many there are each way, and how fine the last is at least. Assumed.
_LOOKS = 3
_FIRST = 0.01  # of what was logged: what begins before that is there from the start. Assumed.
_NEARER, _FINER, _STEPS, _FINEST_S = 0.002, 10.0, 9, 0.1


@dataclass(frozen=True)
class Shown:
    """What a score test shows of an effect from one start: nats, and the point it begins at."""

    name: str
    gain: float
    z: Floats


def screen(bench: Bench, base: Fitted, names: Sequence[str]) -> list[Shown]:
    """Weigh effects beside a fitted explanation by a score test, most probable first.

    Parameters
    ----------
    bench : Bench
        The campaign.
    base : Fitted
        The explanation.
    names : sequence of str
        Effects; those of the explanation are left out.
    """
    test = _ScoreTest(bench, base)
    shown = [one for name in names if name not in base.ids for one in test.of(name)]
    return sorted(shown, key=lambda s: -s.gain - beforehand((s.name,)))


def beforehand(ids: Sequence[str]) -> float:
    """Say by how many nats of evidence effects that are rare have to show more than others."""
    return log_odds(ids) / SETTINGS.temper


def points_of(shown: Sequence[Shown], name: str) -> list[Floats]:
    """Give the best points at which a fit of an effect may begin."""
    points = {s.z.tobytes(): s.z for s in shown if s.name == name}  # one of each, the best first
    return list(points.values())[:_BEST_STARTS]


def first_of(shown: Sequence[Shown], count: int) -> list[str]:
    """Name the effects that show first."""
    return list(dict.fromkeys(s.name for s in shown))[:count]


class _ScoreTest:
    """What a fitted explanation leaves, and what its nuisances and parameters may take."""

    def __init__(self, bench: Bench, base: Fitted) -> None:
        self.bench, self.base = bench, base
        self.problem = problem = problem_of(bench, base)
        self.factor = factor = bench.whitening.factor(1.0, SETTINGS.search_share)
        linear = problem.linear(base.z)
        self.own = problem.white(factor, np.hstack([linear.columns, linear.slopes @ problem.root]))
        self.left = problem.white(factor, linear.left)
        precision = np.append(1.0 / problem.spread(base.variances), np.ones(problem.parameters))
        matrix = self.own.T @ self.own
        matrix[np.diag_indices_from(matrix)] += precision
        self.root = np.linalg.cholesky(matrix)
        away = forward(problem.root, problem.centre - base.z)
        pull = np.append(np.zeros(precision.size - away.size), away)
        self.taken = forward(self.root, self.own.T @ self.left + pull)
        self.angle, self.fixed = problem.predict(base.z)
        self.drifted = problem.drifted(base.z)

    def of(self, name: str) -> list[Shown]:
        """Weigh an effect from each of its starts."""
        bench, base, moment = self.bench, self.base, LIBRARY[name].moment
        wide = ordered((*base.ids, name))
        problems = [
            AngleProblem(bench, wide, each) for each in variants(bench, (name,), base.calibrated)
        ]
        slots = LIBRARY[name].slots
        mine = np.array([slots.start <= slot.place < slots.stop for slot in problems[0].slots])

        def shown(points: Sequence[Floats]) -> list[Shown]:
            return [self._shown(name, one, mine, own) for own, one in product(points, problems)]

        points = [z[5:] for z in starts(AngleProblem(bench, (name,)), base.z[:5])]
        if moment is None:
            return shown(points)
        logged = _Logged(bench.evidence.grid, Slot(LIBRARY[name].parameters[moment], moment))
        found = shown([logged.begun(one) for one in points])
        found.sort(key=lambda one: -one.gain)
        # No slope leads from one moment to another in the midst of a motion.
        for best in [one for one in found[:_LOOKS] if one.gain > -beforehand((name,))]:
            step = _NEARER
            while True:
                near = shown(logged.about(best.z[5:][mine], step))
                best = max([best, *near], key=lambda one: one.gain)
                found += near
                if step * logged.seconds <= _FINEST_S:
                    break
                step /= _FINER
        return found

    def _shown(self, name: str, one: AngleProblem, mine: NDArray[np.bool_], own: Floats) -> Shown:
        """Weigh an effect whose own parameters are `own`, by as much as it shows of them."""
        z, (none, ways, least) = np.empty(one.parameters), _ways(LIBRARY[name], own)
        z[:5], z[5:][~mine] = self.base.z[:5], self.base.z[5:]
        columns = np.column_stack([self._change(one, z, mine, way) for way in ways])
        shadows = forward(self.root, self.own.T @ columns)
        seen = columns.T @ columns - shadows.T @ shadows + np.eye(len(ways))
        score = columns.T @ self.left - shadows.T @ self.taken
        size = np.clip(np.linalg.solve(seen, score), least, _FARTHEST)
        z[5:][mine] = own if len(ways) == 1 else none + size @ (ways - none)
        return Shown(name, float(size @ score - 0.5 * size @ seen @ size), z)

    def _change(self, one: AngleProblem, z: Floats, mine: NDArray[np.bool_], own: Floats) -> Floats:
        """Give what an effect with parameters `own` changes, whitened."""
        z[5:][mine] = own
        angle, fixed = one.predict(z)
        rows, drift = self.problem.rows.merged(angle - self.angle), one.drifted(z) - self.drifted
        return self.problem.white(
            self.factor, self.problem.stacked(rows, fixed - self.fixed, drift)
        )


def _ways(effect: Effect, own: Floats) -> tuple[Floats, Floats, Floats]:
    """Say in which ways an effect with parameters `own` shows: by how they are, or by each size.

    Of what begins at a moment the sizes are as good as free: what it moves goes with them.

    Returns
    -------
    none : (parameters,) array
        Of no effect.
    ways : (ways, parameters) array
        Of it.
    least : (ways,) array
        Smallest multiple of each.
    """
    sizes = [k for k, each in enumerate(effect.parameters) if each.name in effect.neutral]
    none, lows = own.copy(), np.array([each.low for each in effect.parameters])
    if effect.moment is None or len(sizes) < 2:
        return none, own[None], np.where(lows[:1] < 0.0, -_FARTHEST, 0.0)
    none[sizes] = [effect.neutral[effect.parameters[k].name] for k in sizes]
    ways = np.tile(none, (len(sizes), 1))
    for way, k in zip(ways, sizes, strict=True):
        size = effect.parameters[k]
        way[k] = size.starts[0] if size.starts[0] != none[k] else none[k] + size.spread
    return none, ways, np.where(lows[sizes] < 0.0, -_FARTHEST, 0.0)


class _Logged:
    """Moments of a campaign by how much was logged before: in a rest between trials is none."""

    def __init__(self, grid: CampaignGrid, slot: Slot) -> None:
        self.slot, self.seconds = slot, float(grid.cell_starts[-1]) * FINEST_STEP_S
        self.since = grid.middle_s[grid.sample_step] / grid.middle_s[-1]
        self.share = np.cumsum(grid.counts) / grid.counts.sum()

    def begun(self, own: Floats) -> Floats:
        """Take the moment of an effect's parameters for a share of what was logged."""
        return self._at(own, [self.slot.value(own[self.slot.place])])[0]

    def about(self, own: Floats, step: float) -> list[Floats]:
        """Give parameters at moments near theirs, in steps of what was logged."""
        share = np.interp(self.slot.value(own[self.slot.place]), self.since, self.share)
        near = share + step * np.arange(-_STEPS, _STEPS + 1)
        return self._at(own, near[(near >= _FIRST) & (near <= 1.0 - _FIRST)])

    def _at(self, own: Floats, shares: Sequence[float] | Floats) -> list[Floats]:
        since = np.interp(shares, self.share, self.since)
        parameter = self.slot.parameter
        points = np.tile(own, (since.size, 1))
        points[:, self.slot.place] = [
            self.slot.searched(one) for one in np.clip(since, parameter.low, parameter.high)
        ]
        return list(points)
