"""Which effects show beside a fitted explanation, by a score test and no fit.

It holds the change that an effect makes, whitened and cleared of what nuisances and parameters may
take, against what is left.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from spa_fo.arrays import Floats
from spa_fo.gap.data.searched import Slot
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.fit.least_squares import starts
from spa_fo.gap.fit.problem import AngleProblem
from spa_fo.gap.search.fitted import Fitted, problem_of, variants
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.lapack import forward
from spa_fo.plant.effects.effect import Effect
from spa_fo.plant.effects.library import LIBRARY, log_odds, ordered
from spa_fo.plant.grid import CampaignGrid
from spa_fo.plant.memory import FINEST_STEP_S

_BEST_STARTS = 2
_FARTHEST = 4.0  # times the size that an effect is screened with
# Of looks for a moment, by shares of what was logged, all assumed: about how many starts, the first
# step about one and how much finer the next is, how many steps each way, how fine the last is at
# least, s, and how much of a campaign an effect has to leave before it and after.
_LOOKS, _STEP, _FINER, _STEPS, _FINEST_S, _ENDS = 3, 0.002, 10.0, 9, 0.1, 0.01
_SAME = 6  # digits of a point at which a fit begins


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
    return by_promise(shown)


def by_promise(shown: Iterable[Shown]) -> list[Shown]:
    """Sort what is shown, the most probable effect first."""
    return sorted(shown, key=lambda s: -s.gain - beforehand((s.name,)))


def beforehand(ids: Sequence[str]) -> float:
    """Say by how many nats of evidence effects that are rare have to show more than others."""
    return log_odds(ids) / SETTINGS.temper


def points_of(shown: Sequence[Shown], name: str) -> list[Floats]:
    """Give the best points at which a fit of an effect may begin."""
    points: dict[bytes, Floats] = {}  # one of each, the best first
    for one in shown:
        if one.name == name:
            points.setdefault(np.round(one.z, _SAME).tobytes(), one.z)
    return list(points.values())[:_BEST_STARTS]


def first_of(shown: Sequence[Shown], count: int) -> list[str]:
    """Name the effects that show first."""
    return list(dict.fromkeys(s.name for s in shown))[:count]


class _ScoreTest:
    """What a fitted explanation leaves, and what its nuisances and parameters may take."""

    def __init__(self, bench: Bench, base: Fitted) -> None:
        self.bench, self.base = bench, base
        self.problem = problem = problem_of(bench, base)
        self.factor = factor = bench.whitening.factor(bench.level, SETTINGS.search_share)
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
            return self._shown(name, list(product(points, problems)), mine)

        points = [z[5:] for z in starts(AngleProblem(bench, (name,)), base.z[:5])]
        if moment is None:
            return shown(points)
        logged = _Logged(bench.evidence.grid, problems[0].slots[int(np.flatnonzero(mine)[moment])])
        found = shown(logged.begun(points, moment))
        looks: list[Shown] = []
        for one in sorted(found, key=lambda one: -one.gain):
            apart = [abs(logged.share(one.z[5:][mine], o.z[5:][mine], moment)) for o in looks]
            if one.gain > -beforehand((name,)) and min(apart, default=1.0) > 2 * _STEPS * _STEP:
                looks.append(one)
        # No slope leads from one moment to another in the midst of a motion.
        for best in looks[:_LOOKS]:
            step = _STEP
            while True:
                near = shown(logged.about(best.z[5:][mine], moment, step))
                best = max([best, *near], key=lambda one: one.gain)
                found += near
                if step * logged.seconds <= _FINEST_S:
                    break
                step /= _FINER
        return found

    def _shown(
        self, name: str, begun: Sequence[tuple[Floats, AngleProblem]], mine: NDArray[np.bool_]
    ) -> list[Shown]:
        """Weigh an effect with any of some own parameters, by as much as it shows of them."""
        if not begun:
            return []
        slots = [slot for slot, its in zip(begun[0][1].slots, mine, strict=True) if its]
        ways = [_ways(LIBRARY[name], slots, own) for own, _ in begun]
        changes = [
            self._change(one, mine, way)
            for (_, one), (_, each, _, _) in zip(begun, ways, strict=True)
            for way in each
        ]
        columns = self.problem.white(self.factor, np.column_stack(changes))
        shadows = forward(self.root, self.own.T @ columns)
        score = columns.T @ self.left - shadows.T @ self.taken
        found, end = [], 0
        for (own, _), (none, each, least, most) in zip(begun, ways, strict=True):
            here = slice(end, end := end + len(each))
            seen = columns[:, here].T @ columns[:, here] - shadows[:, here].T @ shadows[:, here]
            seen += np.eye(len(each))
            size = _within(seen, score[here], least, most)
            z = self._at(mine, own if len(each) == 1 else none + size @ (each - none))
            gain = size @ score[here] - 0.5 * size @ seen @ size
            found.append(Shown(name, float(gain), z))
        return found

    def _at(self, mine: NDArray[np.bool_], own: Floats) -> Floats:
        """Give the explanation's point with further parameters `own`."""
        z = np.empty(5 + mine.size)
        z[:5], z[5:][~mine], z[5:][mine] = self.base.z[:5], self.base.z[5:], own
        return z

    def _change(self, one: AngleProblem, mine: NDArray[np.bool_], own: Floats) -> Floats:
        """Give what an effect with parameters `own` changes, at all rows."""
        z = self._at(mine, own)
        angle, fixed = one.predict(z)
        rows, drift = self.problem.rows.merged(angle - self.angle), one.drifted(z) - self.drifted
        return self.problem.stacked(rows, fixed - self.fixed, drift)


def _ways(
    effect: Effect, slots: Sequence[Slot], own: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Say in which ways an effect with parameters `own` shows: by how they are, or by each size.

    Of what begins at a moment the sizes are as good as free: what it moves goes with them. So are
    those of a sum.

    Returns
    -------
    none : (parameters,) array
        Of no effect.
    ways : (ways, parameters) array
        Of it.
    least, most : (ways,) arrays
        Multiples of each that may be.
    """
    each = [slot.parameter for slot in slots]
    sizes = [k for k, p in enumerate(each) if not (p.log or p.is_moment)]
    if (effect.moment is None and not effect.is_sum) or len(sizes) < 2:
        least = -_FARTHEST if each[0].low < 0.0 else 0.0
        return own, own[None], np.array([least]), np.array([_FARTHEST])
    none = own.copy()
    none[sizes] = [effect.neutral.get(each[k].name, 0.0) for k in sizes]
    ways = np.tile(none, (len(sizes), 1))
    for way, k in zip(ways, sizes, strict=True):
        begins = each[k].starts[0]
        way[k] = begins if begins != none[k] else none[k] + each[k].spread
    units = np.array([way[k] - none[k] for way, k in zip(ways, sizes, strict=True)])
    ends = (
        np.array([[each[k].low - none[k], each[k].high - none[k]] for k in sizes]) / units[:, None]
    )
    return none, ways, ends.min(axis=1), ends.max(axis=1)


def _within(seen: Floats, score: Floats, least: Floats, most: Floats) -> Floats:
    """Maximise s'score - s'seen s / 2 over sizes s within bounds."""
    size = np.linalg.solve(seen, score)
    if score.size == 1:
        return np.asarray(np.clip(size, least, most))
    if np.all((size >= least) & (size <= most)):
        return np.asarray(size)
    root = np.linalg.cholesky(seen)
    return np.asarray(lsq_linear(root.T, forward(root, score), (least, most)).x)


class _Logged:
    """Moments of a campaign by how much was logged before: in a rest between trials is none.

    A moment is searched as a share of the whole time; here it is a share of what was logged.
    """

    def __init__(self, grid: CampaignGrid, slot: Slot) -> None:
        self.slot, self.before_s = slot, grid.cell_starts * FINEST_STEP_S
        self.seconds, first_s = float(self.before_s[-1]), grid.trials[0].started_s
        self.started_s = np.array([trial.started_s - first_s for trial in grid.trials])
        self.whole_s = float(grid.middle_s[-1]) - first_s

    def begun(self, points: Sequence[Floats], moment: int) -> list[Floats]:
        """Take the moments of an effect's parameters for shares of what was logged."""
        return [self._at(own, moment, self.slot.value(own[moment])) for own in points]

    def about(self, own: Floats, moment: int, step: float) -> list[Floats]:
        """Give parameters at moments near theirs, in steps of what was logged."""
        near = self._share(own[moment]) + step * np.arange(-_STEPS, _STEPS + 1)
        inside = (near >= _ENDS) & (near <= 1.0 - _ENDS)
        return [self._at(own, moment, share) for share in near[inside].tolist()]

    def share(self, own: Floats, other: Floats, moment: int) -> float:
        """Say how much was logged between the moments of two effects' parameters."""
        return self._share(own[moment]) - self._share(other[moment])

    def _share(self, searched: float) -> float:
        since_s = self.slot.value(searched) * self.whole_s
        trial = max(int(np.searchsorted(self.started_s, since_s, side="right")) - 1, 0)
        logged_s = self.before_s[trial] + since_s - self.started_s[trial]
        return float(min(logged_s, self.before_s[trial + 1]) / self.seconds)

    def _at(self, own: Floats, moment: int, share: float) -> Floats:
        logged_s = share * self.seconds
        trial = int(np.searchsorted(self.before_s[1:-1], logged_s, side="right"))
        since = (self.started_s[trial] + logged_s - self.before_s[trial]) / self.whole_s
        point, parameter = own.copy(), self.slot.parameter
        point[moment] = self.slot.searched(float(np.clip(since, parameter.low, parameter.high)))
        return point
