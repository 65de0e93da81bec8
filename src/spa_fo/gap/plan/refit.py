"""An explanation as a planned experiment meets it, and identified again on what another one makes.

It compensates for the difference by its coefficients, its effects' parameters, the trials' own
gain, rest angle and rate, the timing of the channels and the error of the calibrated curve, each
held by its prior: a least-squares problem, solved by Gauss-Newton steps and weighed by the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from spa_fo.gap.data.evidence import Evidence, curve_columns
from spa_fo.gap.data.fixture import Fixture
from spa_fo.gap.data.searched import HIGHEST, LN_GAIN, LOWEST, Slot, at_rate, to_x, to_z
from spa_fo.gap.noise.bench_noise import TYPICAL
from spa_fo.gap.plan.rivals import Rival
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.chain import Memory, Mounting, chain_for
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.grid import CampaignGrid
from spa_fo.plant.memory import STEPS_S

Floats = NDArray[np.float64]

_PIECE_S = 0.5  # the floor deviates independently from one such piece of a trial to the next
_ASSUMED_TAP_KPA = 0.5
_ROUNDS = 8
_CONVERGED = 0.05  # of a least-squares sum in noise floors
_SLOPE_STEP = 1e-4
SPECIMEN_SPREAD = np.array(
    [0.12, 0.12, 0.35, 0.3, 0.25]
)  # of another specimen's searched coefficients
_TOLERANCE_KPA = 0.08  # what no form of a drive is trusted for
_RATE_STEP = 2e-3


@dataclass(frozen=True)
class Bench:
    """What the next experiment is run on and seen with.

    Attributes
    ----------
    grid : CampaignGrid
        The campaign so far; the specimen remembers it.
    reference_kpa : float
        Pressure at which u = 1.
    floor_deg, floor_kpa : float
        What repeated trials differ by.
    tapped : bool
        Whether the pressure is measured.
    curve_sigma_deg : (knots,) array
        Error of the calibrated curve.
    fixture : Fixture or None
        The calibrations, which a sensor with a memory remembers.
    """

    grid: CampaignGrid
    reference_kpa: float
    floor_deg: float
    floor_kpa: float
    tapped: bool
    curve_sigma_deg: Floats
    fixture: Fixture | None


def bench_of(evidence: Evidence, floor_deg: float) -> Bench:
    """Take the bench as the campaign shows it."""
    noise_kpa = evidence.pressure_noise_kpa
    return Bench(
        grid=evidence.grid,
        reference_kpa=evidence.data.campaign.reference_kpa,
        floor_deg=floor_deg,
        floor_kpa=float(np.hypot(noise_kpa, _TOLERANCE_KPA))
        if evidence.has_pressure
        else _ASSUMED_TAP_KPA,
        tapped=evidence.has_pressure,
        curve_sigma_deg=evidence.curve_sigma_deg,
        fixture=evidence.fixture,
    )


class Form:
    """What is searched of an explanation: its coefficients and its effects' parameters."""

    def __init__(self, rival: Rival, bench: Bench) -> None:
        self.ids = rival.ids
        self.base = rival.effects
        self.slots = [
            Slot(parameter, LIBRARY[name].first + k)
            for name in rival.ids
            for k, parameter in enumerate(LIBRARY[name].parameters)
            if not np.isnan(rival.effects[LIBRARY[name].first])
        ]
        searched = [slot.searched(rival.effects[slot.place]) for slot in self.slots]
        self.z = np.concatenate([to_z(rival.x), searched])
        self.low = np.array([*LOWEST, *(s.limits[0] for s in self.slots)])
        self.high = np.array([*HIGHEST, *(s.limits[1] for s in self.slots)])
        spread = [slot.parameter.spread for slot in self.slots]
        self.spread = np.concatenate([SPECIMEN_SPREAD, spread])
        self.mounting = (
            Mounting() if bench.fixture is None else bench.fixture.simulate(rival.effects)[1]
        )
        nuisances = np.append(SETTINGS.angle_late_s, bench.curve_sigma_deg)
        self.precision = 1.0 / np.square(np.append(self.spread, nuisances))

    def effects(self, z: Floats) -> Floats:
        """Parameters of all effects."""
        e = self.base.copy()
        for slot, value in zip(self.slots, z[5:], strict=True):
            e[slot.place] = slot.value(value)
        return e

    def rival(self, theta: Floats) -> Rival:
        """Give the explanation with its parameters moved by `theta`."""
        z = self.within(self.z + theta)
        return Rival(self.ids, to_x(z[:5]), self.effects(z))

    def step(self, k: int) -> float:
        """How far one searched parameter moves for a slope."""
        step = _SLOPE_STEP
        if k >= 5:
            step = 0.01 * min(self.spread[k], 0.3 * max(abs(self.z[k]), 0.3))
        return step if self.z[k] + step <= self.high[k] else -step

    def within(self, z: Floats) -> Floats:
        """Take a point back to its bounds."""
        return np.clip(z, self.low, self.high)


class View:
    """A protocol as one explanation sees it: its prediction, and how that can bend.

    Attributes
    ----------
    angle_deg, pressure_kpa : arrays
        Prediction: averaged samples, and means over steps.
    angle, tap : _Rows
        How they bend.
    ends : list of Memory
        What the specimen remembers afterwards: as it is, and with each parameter moved.
    """

    def __init__(
        self, form: Form, bench: Bench, grid: CampaignGrid, starts: list[Memory] | None = None
    ) -> None:
        self.form, self.grid = form, grid
        self.pressed = np.flatnonzero(grid.cells > 0)
        pressure = grid.pressure_kpa if grid.command_kpa is None else None
        chain = chain_for(grid, to_x(form.z[:5]), bench.reference_kpa, pressure)
        self.chain = chain.mounted(form.mounting)
        starts = starts or [self.chain.memory] * (form.z.size + 1)
        self.angle_deg, self.pressure_kpa, end = self.predict(form.z, starts[0])
        self.ends = [end]
        slopes, tapped = [], []
        for k, start in enumerate(starts[1:]):
            moved = form.z.copy()
            moved[k] += form.step(k)
            angle, kpa, end = self.predict(moved, start)
            slopes.append((angle - self.angle_deg) / form.step(k))
            tapped.append((kpa - self.pressure_kpa) / form.step(k))
            self.ends.append(end)
        quick, _, _ = self.predict(form.z, starts[0], 1.0 + _RATE_STEP)
        by_rate = (quick - self.angle_deg) / _RATE_STEP
        self.seconds = STEPS_S[grid.level[grid.sample_step]]
        self.angle = self._angle_rows(np.column_stack(slopes), by_rate, bench.floor_deg)
        idle = np.zeros((self.pressed.size, form.precision.size - form.z.size))
        self.tap = _Rows(
            np.column_stack([*tapped, idle]),
            np.asarray(STEPS_S[grid.level[self.pressed]] / (_PIECE_S * bench.floor_kpa**2)),
        )

    def predict(
        self, z: Floats, memory: Memory, rate_factor: float = 1.0
    ) -> tuple[Floats, Floats, Memory]:
        """Angles (deg), pressures (kPa) and what is remembered."""
        e = self.form.effects(z)
        chain = replace(self.chain, memory=memory)
        angle, end = chain.run(at_rate(to_x(z[:5]), rate_factor), e)
        kpa = self.grid.step_means(chain.pressure(e, memory.play_kpa.copy()))
        return angle, kpa[self.pressed], end

    def _angle_rows(self, slopes: Floats, by_rate: Floats, floor_deg: float) -> _Rows:
        grid, y = self.grid, self.angle_deg
        trials = [np.flatnonzero(grid.sample_trial == i) for i in range(len(grid.trials))]
        return _Rows(
            np.column_stack([slopes, -grid.slopes(y), curve_columns(y)]),
            np.asarray(self.seconds / (_PIECE_S * floor_deg**2)),
            np.column_stack([slopes[:, LN_GAIN], np.ones(y.size), by_rate])
            * np.array([TYPICAL.gain, TYPICAL.rest_deg, TYPICAL.time_scale]),
            trials,
        )

    def rms(self, cost: float) -> float:
        """Misfit per half second as an RMS in noise floors."""
        return float(np.sqrt(max(cost, 0.0) * _PIECE_S / self.seconds.sum()))


class _Rows:
    """Rows of a least-squares problem, each trial's own nuisances being integrated out.

    Parameters
    ----------
    shared : (n, q) array
        Columns of what all trials share.
    weight : (n,) array
        Inverse variances.
    own : (n, k) array, optional
        Columns of what each trial has for itself, in units of its prior's spread.
    trials : list of arrays
        Rows of each trial.
    """

    def __init__(
        self,
        shared: Floats,
        weight: Floats,
        own: Floats | None = None,
        trials: Sequence[NDArray[np.int64]] = (),
    ) -> None:
        self.weight, self.trials = weight, trials
        self.heavy = [(own[rows].T * weight[rows]).T for rows in trials] if own is not None else []
        self.inner = [
            np.linalg.inv(np.eye(heavy.shape[1]) + own[rows].T @ heavy)
            for rows, heavy in zip(trials, self.heavy, strict=True)
            if own is not None
        ]
        self.pull = self.weighted(shared)
        self.normal = shared.T @ self.pull

    def weighted(self, d: Floats) -> Floats:
        """Multiply by the inverse covariance; shape (n,) or (n, q)."""
        out = np.asarray((d.T * self.weight).T)
        for rows, heavy, inner in zip(self.trials, self.heavy, self.inner, strict=True):
            out[rows] -= heavy @ (inner @ (heavy.T @ d[rows]))
        return out


@dataclass(frozen=True)
class Stretch:
    """A protocol as the explanation that is refitted sees it, and as the true one does."""

    view: View
    truth: View
    tapped: bool

    @property
    def rows(self) -> list[_Rows]:
        """What is seen of it."""
        return [self.view.angle, self.view.tap] if self.tapped else [self.view.angle]

    def missed(self, z: Floats, memory: Memory | None) -> tuple[list[Floats], Memory]:
        """Return what the explanation misses with `z`, for each of `rows`; and the memory."""
        angle, kpa, end = self.view.predict(z, memory or self.view.chain.memory)
        missed = [self.truth.angle_deg - angle, self.truth.pressure_kpa - kpa]
        return missed[: len(self.rows)], end


@dataclass(frozen=True)
class Refit:
    """Parameters moved by `theta`, the least squares there, and where the slopes lead from it."""

    theta: Floats
    cost: float
    aim: Floats


def refit(form: Form, course: Sequence[Stretch], start: Floats) -> Refit:
    """Identify an explanation again: Gauss-Newton with the slopes of the start.

    A step that makes it worse is halved.
    """
    kept = refit_at(form, course, start)
    aim = kept.aim
    for _ in range(_ROUNDS):
        tried = refit_at(form, course, aim)
        gained = kept.cost - tried.cost
        if gained > 0.0:
            kept, aim = tried, tried.aim
        else:
            aim = 0.5 * (kept.theta + aim)
        if 0.0 <= gained < _CONVERGED:
            break
    return kept


def refit_at(form: Form, course: Sequence[Stretch], theta: Floats) -> Refit:
    """Least squares over the nuisances with the parameters moved by `theta`."""
    z = form.within(form.z + theta)
    theta = z - form.z
    p = theta.size
    normal = np.diag(form.precision)
    cost = float(form.precision[:p] @ theta**2)
    pull = np.zeros(form.precision.size)
    memory: Memory | None = None
    for stretch in course:
        missed, memory = stretch.missed(z, memory)
        for rows, d in zip(stretch.rows, missed, strict=True):
            normal += rows.normal
            pull += rows.pull.T @ d
            cost += float(d @ rows.weighted(d))
    cost -= float(pull[p:] @ _solved(normal[p:, p:], pull[p:]))
    # The prior pulls back to where the explanation was.
    aim = (
        theta
        + _solved(normal, pull - form.precision * np.append(theta, np.zeros(pull.size - p)))[:p]
    )
    return Refit(theta, cost, aim)


def _solved(matrix: Floats, right: Floats) -> Floats:
    return np.asarray(cho_solve(cho_factor(matrix, lower=True), right))
