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
from spa_fo.plant.effects.effect import Parameter
from spa_fo.plant.effects.library import LIBRARY, log_odds, ordered

Floats = NDArray[np.float64]

_BEST_STARTS = 2
_FARTHEST = 4.0  # times the size that an effect is screened with
# Of looks about a moment: the first step, a share of the campaign, how much finer the next is, how
# many there are each way, and how fine the last is at least. Assumed.
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

        found = shown([z[5:] for z in starts(AngleProblem(bench, (name,)), base.z[:5])])
        if moment is not None and max(one.gain for one in found) > -beforehand((name,)):
            # No slope leads from one moment to another in the midst of a motion.
            parameter, step = LIBRARY[name].parameters[moment], _NEARER
            whole_s = float(bench.evidence.grid.middle_s[-1])
            while True:
                best = max(found, key=lambda one: one.gain).z[5:][mine]
                found += shown(_about(best, moment, parameter, step))
                if step * whole_s <= _FINEST_S:
                    break
                step /= _FINER
        return found

    def _shown(self, name: str, one: AngleProblem, mine: NDArray[np.bool_], own: Floats) -> Shown:
        """Weigh an effect whose own parameters are `own`."""
        problem, z = self.problem, np.empty(one.parameters)
        z[:5], z[5:][~mine], z[5:][mine] = self.base.z[:5], self.base.z[5:], own
        angle, fixed = one.predict(z)
        rows, drift = problem.rows.merged(angle - self.angle), one.drifted(z) - self.drifted
        column = problem.white(self.factor, problem.stacked(rows, fixed - self.fixed, drift))
        shadow = forward(self.root, self.own.T @ column)
        seen = float(column @ column - shadow @ shadow) + 1.0
        score = float(column @ self.left - shadow @ self.taken)
        signed = LIBRARY[name].parameters[0].low < 0.0
        size = float(np.clip(score / seen, -_FARTHEST if signed else 0.0, _FARTHEST))
        return Shown(name, size * score - 0.5 * size**2 * seen, z)


def _about(own: Floats, moment: int, parameter: Parameter, step: float) -> list[Floats]:
    """Give points at moments near that of one."""
    slot = Slot(parameter, moment)
    near = slot.value(own[moment]) + step * np.arange(-_STEPS, _STEPS + 1)
    near = near[(near > parameter.low) & (near < parameter.high)]
    points = np.tile(own, (near.size, 1))
    points[:, moment] = [slot.searched(since) for since in near.tolist()]
    return list(points)
