"""How well a protocol would tell two explanations apart, were the wrong one identified again.

One explanation is simulated as the truth, the campaign so far and then the protocol, on the same
specimen. The other compensates for the difference by its coefficients, its effects' parameters, the
trials' own gain, rest angle and rate, the timing of the channels and the error of the calibrated
curve, each held by its prior and all by the campaign: a least-squares problem, solved by
Gauss-Newton steps and weighed by the noise floor. What the protocol adds to its minimum, as an RMS
in noise floors, is the separation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence, angle_chain
from spa_fo.gap.data.searched import HIGHEST, LN_GAIN, LOWEST, Slot, at_rate, to_x, to_z
from spa_fo.gap.decide.explanation import mounting_of
from spa_fo.gap.noise.bench_noise import TYPICAL
from spa_fo.gap.plan.profiles import Profile
from spa_fo.gap.plan.rivals import Rival
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.grid import CampaignGrid, campaign_grid
from spa_fo.plant.memory import STEPS_S
from spa_fo.plant.sensor_curve import curve_columns
from spa_fo.plant.specimen import Memory
from spa_fo.rig import Trial
from spa_fo.rig.first_change import zero_until

SPECIMEN_SPREAD = np.array([0.12, 0.12, 0.35, 0.3, 0.25])
"""Standard deviations of another specimen's searched coefficients."""
_PIECE_S = 0.5  # the floor deviates independently from one such piece of a trial to the next
_TOLERANCE_KPA = 0.08  # what no form of a drive is trusted for
_ROUNDS = 8
_CONVERGED = 0.05  # of a least-squares sum in noise floors
_SLOPE_STEP, _RATE_STEP = 1e-4, 2e-3
_REST_S = 120.0  # between the campaign and what follows it
_LONGEST_LEVEL = 2  # 0.08 s: ramps and sines have no jumps that would ask for short steps


class PairwiseSeparation:
    """The separation of each pair of explanations, by a campaign and by what could follow it.

    `refits` holds each explanation identified again on the campaign that another one makes.
    """

    def __init__(self, evidence: Evidence, floor_deg: float, rivals: Sequence[Rival]) -> None:
        self.evidence, self.floor_deg = evidence, floor_deg
        self.pairs = [_directions(rivals, *pair) for pair in combinations(range(len(rivals)), 2)]
        self.searched = [_Searched(one, evidence) for one in rivals]
        self.past = [_View(one, evidence, evidence.grid, floor_deg) for one in self.searched]
        self.refits = {
            (k, truth): _refit(self.searched[k], [(self.past[k], self.past[truth])])
            for pair in self.pairs
            for k, truth in pair
        }

    def now(self) -> list[float]:
        """Say how well the campaign's own protocol separates each pair, in noise floors."""
        return self._smaller({way: self.past[way[0]].rms(r.cost) for way, r in self.refits.items()})

    def after(self, profile: Profile) -> list[float]:
        """Say how well a profile that follows the campaign would separate each pair."""
        grid = _grid_after(self.evidence.grid, profile)
        views = [
            _View(one, self.evidence, grid, self.floor_deg, past.ends)
            for one, past in zip(self.searched, self.past, strict=True)
        ]
        added = {}
        for (k, truth), before in self.refits.items():
            course = [(self.past[k], self.past[truth]), (views[k], views[truth])]
            found = _refit(self.searched[k], course, before.theta)
            # Where the first refit stopped short of its minimum, the second may show it.
            again = _least_squares(self.searched[k], course[:1], found.theta)
            added[k, truth] = views[k].rms(found.cost - min(before.cost, again.cost))
        return self._smaller(added)

    def _smaller(self, missed: dict[tuple[int, int], float]) -> list[float]:
        """Take the smaller of both directions, as either explanation may be the true one."""
        return [min(missed[way] for way in pair) for pair in self.pairs]


def _directions(rivals: Sequence[Rival], i: int, j: int) -> list[tuple[int, int]]:
    """List which explanation of a pair is refitted to which.

    One that holds all effects of the other can always do without those it has on top: only the
    smaller one can then be found wanting.
    """
    one, other = set(rivals[i].ids), set(rivals[j].ids)
    if one < other:
        return [(i, j)]
    return [(j, i)] if other < one else [(i, j), (j, i)]


class _Searched:
    """What is searched of an explanation: its coefficients and its effects' parameters."""

    def __init__(self, rival: Rival, evidence: Evidence) -> None:
        self.ids, self.base = rival.ids, rival.effects
        self.slots = [
            Slot(parameter.at(evidence.reach), LIBRARY[name].first + k)
            for name in rival.ids
            for k, parameter in enumerate(LIBRARY[name].parameters)
            if not np.isnan(rival.effects[LIBRARY[name].first])
        ]
        searched = [slot.searched(rival.effects[slot.place]) for slot in self.slots]
        limits = np.array([slot.limits for slot in self.slots]).reshape(-1, 2)
        self.z = np.append(to_z(rival.x), searched)
        self.low, self.high = np.append(LOWEST, limits[:, 0]), np.append(HIGHEST, limits[:, 1])
        spread = np.append(SPECIMEN_SPREAD, [slot.parameter.spread for slot in self.slots])
        nuisances = np.append(SETTINGS.angle_late_s, evidence.curve_sigma_deg)
        self.precision = np.append(spread, nuisances) ** -2.0
        # How far each parameter moves for a slope.
        step = 0.01 * np.minimum(spread, 0.3 * np.maximum(np.abs(self.z), 0.3))
        step[:5] = _SLOPE_STEP
        self.step = np.where(self.z + step <= self.high, step, -step)
        self.mounting = mounting_of(evidence, rival.effects)

    def effects(self, z: Floats) -> Floats:
        """Parameters of all effects."""
        e = self.base.copy()
        for slot, value in zip(self.slots, z[5:], strict=True):
            e[slot.place] = slot.value(value)
        return e

    def moved(self, theta: Floats) -> Floats:
        """Move the parameters as far as their bounds allow."""
        return np.clip(self.z + theta, self.low, self.high)


class _View:
    """A protocol as one explanation sees it: its prediction, and how that can bend.

    Rows are averaged angles and, where the pressure is measured, its means over steps. What each
    trial has for itself is integrated out.
    """

    def __init__(
        self,
        searched: _Searched,
        evidence: Evidence,
        grid: CampaignGrid,
        floor_deg: float,
        starts: Sequence[Memory] = (),
    ) -> None:
        self.searched, self.grid = searched, grid
        self.pressed = np.flatnonzero(grid.cells > 0) if evidence.has_pressure else None
        chain = angle_chain(replace(evidence, grid=grid, usual=None), to_x(searched.z[:5]), None)
        self.chain = chain.mounted(searched.mounting)
        starts = starts or [self.chain.memory] * (searched.z.size + 1)
        self.predicted, end = self.predict(searched.z, starts[0])
        self.ends = [end]  # what the specimen remembers: as it is, and with each parameter moved
        slopes = []
        for start, move in zip(starts[1:], np.diag(searched.step), strict=True):
            moved, end = self.predict(searched.z + move, start)
            slopes.append((moved - self.predicted) / move.sum())
            self.ends.append(end)
        quick, _ = self.predict(searched.z, starts[0], 1.0 + _RATE_STEP)
        by_rate = (quick - self.predicted) / _RATE_STEP

        n = grid.sample_trial.size
        angle = self.predicted[:n]
        self.seconds = STEPS_S[grid.level[grid.sample_step]]
        weight = self.seconds / (_PIECE_S * floor_deg**2)
        shared = np.column_stack(
            [-grid.slopes(angle), curve_columns(angle, evidence.curve_stretch)]
        )
        own = np.column_stack([slopes[LN_GAIN][:n], np.ones(n), by_rate[:n]])
        own *= TYPICAL.gain, TYPICAL.rest_deg, TYPICAL.time_scale
        if self.pressed is not None:
            floor_kpa = np.hypot(evidence.pressure_noise_kpa, _TOLERANCE_KPA)
            kpa_weight = STEPS_S[grid.level[self.pressed]] / (_PIECE_S * floor_kpa**2)
            weight = np.append(weight, kpa_weight)
            shared = np.vstack([shared, np.zeros((kpa_weight.size, shared.shape[1]))])
        self.weight, self.own = weight, []
        for trial in range(len(grid.trials)):
            rows = np.flatnonzero(grid.sample_trial == trial)
            heavy = own[rows] * weight[rows, None]
            self.own.append((rows, heavy, np.linalg.inv(np.eye(3) + own[rows].T @ heavy)))
        columns = np.column_stack([*slopes, shared])
        self.pull = self.weighted(columns)
        self.normal = columns.T @ self.pull

    def predict(self, z: Floats, memory: Memory, rate: float = 1.0) -> tuple[Floats, Memory]:
        """Predict the rows, and say what is remembered then."""
        e = self.searched.effects(z)
        chain = replace(self.chain, memory=memory)
        rows, end = chain.run(at_rate(to_x(z[:5]), rate), e)
        if self.pressed is not None:
            kpa = self.grid.step_means(chain.pressure(e, memory.play_kpa.copy()))
            rows = np.append(rows, kpa[self.pressed])
        return rows, end

    def weighted(self, missed: Floats) -> Floats:
        """Multiply (rows,) or (rows, q) by the inverse of the rows' covariance (Woodbury)."""
        found = np.asarray((missed.T * self.weight).T)
        for rows, heavy, inner in self.own:
            found[rows] -= heavy @ (inner @ (heavy.T @ missed[rows]))
        return found

    def rms(self, cost: float) -> float:
        """Misfit per half second as an RMS in noise floors."""
        return float(np.sqrt(max(cost, 0.0) * _PIECE_S / self.seconds.sum()))


_Course = Sequence[tuple[_View, _View]]  # protocols as who is refitted sees them, and as the truth


@dataclass(frozen=True)
class _Refit:
    """Parameters moved by `theta`, the least squares there, and where the slopes lead from it."""

    theta: Floats
    cost: float
    aim: Floats


def _refit(searched: _Searched, course: _Course, start: Floats | float = 0.0) -> _Refit:
    """Identify an explanation again: Gauss-Newton with the slopes of the start.

    A step that makes it worse is halved.
    """
    kept = _least_squares(searched, course, start)
    aim = kept.aim
    for _ in range(_ROUNDS):
        tried = _least_squares(searched, course, aim)
        gained = kept.cost - tried.cost
        if gained > 0.0:
            kept, aim = tried, tried.aim
        else:
            aim = 0.5 * (kept.theta + aim)
        if 0.0 <= gained < _CONVERGED:
            break
    return kept


def _least_squares(searched: _Searched, course: _Course, theta: Floats | float) -> _Refit:
    """Least squares over the nuisances with the parameters moved by `theta`."""
    z = searched.moved(np.asarray(theta))
    p = z.size
    normal = np.diag(searched.precision)
    held = np.zeros(searched.precision.size)
    held[:p] = z - searched.z
    # The prior pulls back to where the explanation was.
    pull = -searched.precision * held
    cost = -float(pull @ held)
    memory: Memory | None = None
    for view, truth in course:
        rows, memory = view.predict(z, memory or view.chain.memory)
        missed = truth.predicted - rows
        normal += view.normal
        pull += view.pull.T @ missed
        cost += float(missed @ view.weighted(missed))
    cost -= float(pull[p:] @ np.linalg.solve(normal[p:, p:], pull[p:]))
    return _Refit(held[:p], cost, held[:p] + np.linalg.solve(normal, pull)[:p])


def _grid_after(grid: CampaignGrid, profile: Profile) -> CampaignGrid:
    """Lay a profile behind a campaign, repeated as it asks."""
    t, command = profile.sampled()
    none = np.zeros(t.size, dtype=bool)
    trials = [
        Trial(
            experiment=profile.name,
            trial=k + 1,
            protocol="free",
            setpoint_deg=None,
            order=int(grid.orders[-1]) + 1 + k,
            started_s=grid.ends_s + _REST_S + k * profile.every_s,
            t_s=t,
            command_kpa=command,
            pressure_kpa=None,
            flex_adc=None,
            angle_deg=np.zeros(t.size),
            after_reset=none,
            outside_calibration=none,
        )
        for k in range(profile.repeats)
    ]
    if any(trial.zero_until_s > 0.0 for trial in grid.trials):  # so will these logs be
        trials = [replace(trial, zero_until_s=zero_until(trial)) for trial in trials]
    return campaign_grid(trials, profile.name, grid.ends_s, longest=_LONGEST_LEVEL)
