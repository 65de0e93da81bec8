"""Fit one explanation: some effects, in their place in the chain, with the coefficients again.

Gauss-Newton on the posterior, the trials' own gain, rest angle and pace, the error of the
calibrated curve and a model discrepancy being integrated out (`mixed`). The evidence is Laplace's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.evidence import FILM_SLOTS, Evidence, Fixture, curve_columns
from spa_fo.gap.mixed import Block, Prior, Solution
from spa_fo.gap.search import climb
from spa_fo.plant.chain import Chain, Seat
from spa_fo.plant.effects.library import LIBRARY, Parameter, absent

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

GAIN, OFFSET, PACE, DISCREPANCY, SLIP, PICKUP, SWELL, HARMONIC = range(8)
SCALES = np.array([0.005, 0.2, 0.007, 0.06, 0.4, 1.0, 0.2, 0.2])
"""Typical standard deviations: relative, deg, relative, deg, deg per trial, deg, deg, deg."""

COEFFICIENT_SPREAD = {
    "known": np.array([0.003, 0.003, 0.008, 0.005, 0.003]),
    "near": np.array([0.006, 0.006, 0.018, 0.014, 0.008]),
    "shifted": np.array([0.015, 0.015, 0.08, 0.06, 0.04]),
    "free": np.array([0.12, 0.12, 0.35, 0.3, 0.25]),
    "own": np.array([0.3, 0.3, 1.0, 1.0, 0.4]),
}
"""Prior spread of (alpha2, alpha1, ln a1, ln a0, ln K) about the given model.

An effect's form is never quite the true one; near the given model the coefficients may make up
for that. Free they are those of another specimen. Shifted they are of a similar one: under the
wide prior of a free one, what a small shift explains would not pay for its five parameters. A
model of its own campaign was fitted to this very gap and to up-steps alone, which leave a1, a0 and
b0 free to go up and down together.
"""

IN_COVARIANCE = ("sensor_nonlinearity", "sensor_slip", "parameter_shift", "mains_pickup")
"""Effects that are columns or variances here, not parameters of the simulation."""

ANGLE_SLOTS = np.concatenate(
    [
        np.arange(effect.slots.start, effect.slots.stop)
        for effect in LIBRARY.values()
        if effect.stage in ("drive", "actuator")
    ]
)
"""Parameters that the true angle depends on."""

TIMING_S = 0.006
"""How well the channels of one row belong together: a part of a sample period."""

_TURNED = 0.6  # typical state, -1 to 1, of a film's hysteresis
_SLOPE_STEP = 1e-4
LN_GAIN = 4  # among the searched coefficients
MOST_STEPS = 16
_PACE_STEP = 2e-3
# Part of an interference that no wave of a few columns takes; set on blind cases opened before.
_OF_WAVE = 0.1


def to_z(x: Floats) -> Floats:
    """Take coefficients to the space they are searched in: orders, ln a1, ln a0, ln K."""
    return np.array([x[0], x[1], np.log(x[2]), np.log(x[3]), np.log(x[4] / x[3])])


def to_x(z: Floats) -> Floats:
    """Take searched coefficients back."""
    a0 = np.exp(z[3])
    return np.array([z[0], z[1], np.exp(z[2]), a0, a0 * np.exp(z[4])])


def paced(x: Floats, pace: float) -> Floats:
    """Give the coefficients of an actuator that runs `pace` times as fast."""
    fast = pace ** x[0]
    return np.array([x[0], x[1], x[2] * pace ** (x[0] - x[1]), x[3] * fast, x[4] * fast])


def wave(hz: float, time_s: Floats) -> Floats:
    """Cosine and sine, (n, 2)."""
    phase = 2.0 * np.pi * hz * time_s
    return np.column_stack([np.cos(phase), np.sin(phase)])


def ripple(hz: float, time_s: Floats) -> Floats:
    """Give what a periodic interference has beside its wave: it swells and fades, has harmonics.

    Returns
    -------
    (n, 6) array
        `SWELL` columns first, two, and those of two harmonics.
    """
    swell = 2.0 * (time_s - time_s.mean()) / max(float(np.ptp(time_s)), 1e-9)
    return np.hstack(
        [swell[:, None] * wave(hz, time_s), wave(2.0 * hz, time_s), wave(3.0 * hz, time_s)]
    )


def window_wave(hz: float, fixture: Fixture) -> Floats:
    """Cosine and sine, averaged over the windows of a calibration's dwells, (rows, 2)."""
    return wave(hz, fixture.time_s) * np.sinc(hz * fixture.window_s)[:, None]


def fixture_wave(hz: float, fixture: Fixture, logs: int) -> Floats:
    """Cosine and sine in the dwells of calibrations, a phase for each, (rows, 2 logs)."""
    phased = window_wave(hz, fixture)
    columns = np.zeros((fixture.time_s.size, 2 * logs))
    for log in range(logs):
        here = fixture.log == log
        columns[here, 2 * log : 2 * log + 2] = phased[here]
    return np.asarray(fixture.average @ columns)


def settled_wave(hz: float, fixture: Fixture, log: int) -> tuple[Floats, Floats]:
    """Give what a calibration's settled means hold of a wave: angles (k,), the wave (k, 2)."""
    phased = window_wave(hz, fixture)
    means = phased - fixture.average @ phased
    here = fixture.log == log
    angles, first = np.unique(fixture.known_deg[here], return_index=True)
    return angles, means[here][first]


def misread(hz: float, fixture: Fixture, angle_deg: Floats) -> Floats:
    """Give what the curve misreads for a wave in its calibration, (n, 2); at its ends the last."""
    angles, means = settled_wave(hz, fixture, 0)
    return -np.column_stack([np.interp(angle_deg, angles, each) for each in means.T])


def drift_wave(hz: float, fixture: Fixture, evidence: Evidence) -> Floats:
    """Give the wave in what later calibrations read at the first one's angles, (rows, 2 logs)."""
    drifts = evidence.data.drifts
    columns = np.zeros((evidence.drift_deg.size, 2 * (len(drifts) + 1)))
    columns[:, :2] = misread(hz, fixture, evidence.drift_angle_deg)
    at = 0
    for log, drift in enumerate(drifts, start=1):
        end = at + drift.angles_deg.size
        columns[at:end, 2 * log : 2 * log + 2] = settled_wave(hz, fixture, log)[1]
        at = end
    return columns


@dataclass(frozen=True)
class Slot:
    """One searched parameter of an effect and its place in the vector of all."""

    parameter: Parameter
    place: int

    def value(self, z: float) -> float:
        """Value of the searched number."""
        return float(np.exp(z)) if self.parameter.log else z

    def searched(self, value: float) -> float:
        """Give the searched number of a value."""
        return float(np.log(value)) if self.parameter.log else value

    @property
    def limits(self) -> tuple[float, float]:
        """Bounds of the searched number."""
        return self.searched(self.parameter.low), self.searched(self.parameter.high)

    @property
    def centre(self) -> float:
        """Prior mean of the searched number."""
        return self.searched(self.parameter.centre)


@dataclass(frozen=True)
class Fit:
    """An explanation fitted to the angles.

    Attributes
    ----------
    ids : tuple of str
        Its effects.
    level : {"known", "near", "shifted", "free", "own"}
        How far the coefficients could move.
    x : (5,) array
        Coefficients.
    effects : array
        Parameters of all effects, NaN where absent.
    searched : array
        Coefficients and effect parameters as searched.
    predicted_deg : (n,) array
        Of the simulation alone.
    explained_deg : (n,) array
        With the shared columns: curve and slip.
    residual_deg : (n,) array
        After everything but noise and discrepancy: trials' own deviations taken out too.
    discrepancy_deg : (n,) array
        What the discrepancy took.
    solution : Solution
        Of the last linearisation.
    curve_deg : array
        Error of the sensor's curve at its knots.
    zeros_deg : (trials,) array
        Zero of the sensor by trial.
    drift_deg : (m,) array
        What it makes of later calibrations.
    fixture_deg : (rows,) array
        What it leaves of the calibrations' dwells.
    waves_deg : (logs, 2) array
        Cosine and sine of an interference, by trial and then by calibration.
    trial_effects : (trials, 3) array
        Each trial's own gain, rest angle, pace.
    log_evidence : float
        Of all rows.
    changed : bool
        Whether an unknown sensor curve was taken for that of later calibrations too.
    """

    ids: tuple[str, ...]
    level: str
    x: Floats
    effects: Floats
    searched: Floats
    predicted_deg: Floats
    explained_deg: Floats
    residual_deg: Floats
    discrepancy_deg: Floats
    solution: Solution
    curve_deg: Floats
    zeros_deg: Floats
    drift_deg: Floats
    fixture_deg: Floats
    waves_deg: Floats
    trial_effects: Floats
    log_evidence: float
    changed: bool = False

    @property
    def discrepancy(self) -> float:
        """Standard deviation of the discrepancy, deg."""
        return float(np.sqrt(self.solution.variances[DISCREPANCY]))


@dataclass(frozen=True)
class _Base:
    """Parts of a prediction that most parameters leave as they are, while slopes are taken.

    `slopes` holds those taken so far, of the angles and of the readings in the fixture.
    """

    z: Floats
    effects: Floats
    angle_deg: Floats
    in_fixture: tuple[Floats, Seat]
    slopes: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)


@dataclass(frozen=True)
class _Steady:
    """A trial's rows and their weights, the columns that never change, and where all stand."""

    rows: Integers
    weight: Floats
    columns: Floats
    index: Integers


def _same(one: Floats, other: Floats, slots: Integers) -> bool:
    return np.array_equal(one[slots], other[slots], equal_nan=True)


class AngleProblem:
    """The angles of a campaign and one explanation of them.

    Parameters
    ----------
    evidence : Evidence
        The campaign.
    chain : Chain
        Its simulator.
    given : (5,) array
        Coefficients of the given model.
    ids : sequence of str
        Effects of the explanation.
    level : {"known", "near", "shifted", "free", "own"}
        How far the coefficients may move.
    keep : (n,) bool array, optional
        Averaged samples that take part; those of the evidence by default.
    changed : bool
        Whether an unknown sensor curve is that of later calibrations too, not of the seat alone.
    pickup : (float, float), optional
        Frequency, Hz, and amplitude, deg, of an interference that the averaged samples show.
    """

    def __init__(
        self,
        evidence: Evidence,
        chain: Chain,
        given: Floats,
        ids: Sequence[str],
        level: str,
        keep: NDArray[np.bool_] | None = None,
        pickup: tuple[float, float] | None = None,
        changed: bool = False,
    ) -> None:
        self.changed = changed
        self.pickup_hz = None if pickup is None else pickup[0]
        amplitude_deg = 0.0 if pickup is None else pickup[1]
        self.row_variance = evidence.variance + (_OF_WAVE * amplitude_deg) ** 2
        self.scales = SCALES.copy()
        self.scales[DISCREPANCY] = evidence.tolerance_deg
        self.evidence = evidence
        self.chain = chain
        self.given = given
        self.ids = tuple(ids)
        self.level = level
        self.slots = [
            Slot(parameter, LIBRARY[name].first + k)
            for name in ids
            if name not in IN_COVARIANCE
            for k, parameter in enumerate(LIBRARY[name].parameters)
        ]
        self.keep = evidence.used if keep is None else keep
        self.centre = np.concatenate([to_z(given), [slot.centre for slot in self.slots]])
        spread = [slot.parameter.spread for slot in self.slots]
        self.spread = np.concatenate([COEFFICIENT_SPREAD[level], spread])
        low = [slot.limits[0] for slot in self.slots]
        high = [slot.limits[1] for slot in self.slots]
        self.low = np.concatenate([[0.05, 0.02, -8.0, -8.0, -8.0], low])
        self.high = np.concatenate([[1.995, 1.98, 8.0, 8.0, 8.0], high])
        self.parameters = self.centre.size
        self._base: _Base | None = None
        self._lay_columns()

    def _lay_columns(self) -> None:
        evidence, p = self.evidence, self.parameters
        trials, curve = len(evidence.grid.trials), evidence.curve_sigma_deg.size
        self.curve = p + np.arange(curve)
        at = p + curve
        self.late = at
        at += 1
        self.slips = "sensor_slip" in self.ids
        self.walk = at  # the mean step of the sensor's zero
        self.steps = at + 1 + np.arange(trials if self.slips else 0)  # its step before each trial
        at += 1 + self.steps.size
        self.own = at + np.arange(3 * trials).reshape(trials, 3)
        at += 3 * trials
        logs = trials + len(evidence.data.calibrations)
        self.waves = at + np.arange(0 if self.pickup_hz is None else 2 * logs).reshape(-1, 2)
        at += self.waves.size
        # The wave in the calibration that the curve is from.
        self.first_log = self.waves[trials : trials + 1].ravel()
        self.ripples = at + np.arange(0 if self.pickup_hz is None else 6 * trials).reshape(-1, 6)
        at += self.ripples.size
        # How far a film with hysteresis had turned before each later calibration.
        later = logs - trials - 1 if "sensor_hysteresis" in self.ids else 0
        self.turned = at + np.arange(max(later, 0))
        at += self.turned.size
        self.support = at + np.arange(evidence.supports)
        self.size = at + evidence.supports
        group = np.full(self.size, -1)
        variance = np.full(self.size, 1e-12)
        group[self.own] = [GAIN, OFFSET, PACE]
        group[self.support] = DISCREPANCY
        group[self.waves] = PICKUP
        group[self.ripples[:, :2]], group[self.ripples[:, 2:]] = SWELL, HARMONIC
        bare = "sensor_hysteresis" in self.ids or "sensor_creep" in self.ids
        curve_sigma = evidence.bare_curve_sigma_deg if bare else evidence.curve_sigma_deg
        variance[self.curve] = curve_sigma**2
        if "sensor_nonlinearity" in self.ids:
            spread = [q.spread for q in LIBRARY["sensor_nonlinearity"].parameters]
            variance[self.curve] += np.square(spread)
        variance[self.late] = TIMING_S**2
        variance[self.turned] = _TURNED**2
        if self.slips:
            variance[self.walk] = LIBRARY["sensor_slip"].parameters[0].spread ** 2
            group[self.steps] = SLIP
        variance[:p] = self.spread**2
        self.group, self.variance = group, variance

    def effects(self, z: Floats) -> Floats:
        """Parameters of all effects."""
        e = absent()
        for slot, value in zip(self.slots, z[5:], strict=True):
            e[slot.place] = slot.value(value)
        return e

    def predict(self, z: Floats) -> tuple[Floats, Floats]:
        """Angles at the samples, and readings in the fixture."""
        e, base = self.effects(z), self._base
        if base is not None and _same(e, base.effects, FILM_SLOTS):
            deviation, seat = base.in_fixture
        else:
            deviation, seat = self._in_fixture(e)
        chain = self.chain.seated(seat)
        if (
            base is not None
            and np.array_equal(z[:5], base.z[:5])
            and _same(e, base.effects, ANGLE_SLOTS)
        ):
            angle = base.angle_deg
        else:
            angle, _ = chain.angles(to_x(z), e)
        return chain.observed(chain.read(angle, e, chain.memory.film.copy()), e), deviation

    def _in_fixture(self, effects: Floats) -> tuple[Floats, Seat]:
        fixture = self.evidence.fixture
        return (np.zeros(0), Seat()) if fixture is None else fixture.simulate(effects)

    def _about(self, z: Floats) -> _Base:
        """Simulate `z` itself, which blocks and slopes are both about."""
        if self._base is None or not np.array_equal(z, self._base.z):
            e = self.effects(z)
            self._base = _Base(z, e, self.chain.angles(to_x(z), e)[0], self._in_fixture(e))
        return self._base

    def _slope(self, z: Floats, k: int) -> tuple[Floats, Floats]:
        """Take the slopes over one parameter: of the angles, and of the readings in the fixture."""
        known = self._about(z).slopes
        if k not in known:
            step = _SLOPE_STEP if k < 5 else 0.01 * min(self.spread[k], 0.3 * max(abs(z[k]), 0.3))
            moved = z.copy()
            if moved[k] + step > self.high[k]:
                step = -step
            moved[k] += step
            here, there = self.predict(z), self.predict(moved)
            known[k] = (there[0] - here[0]) / step, (there[1] - here[1]) / step
        return known[k]

    def slopes(self, z: Floats) -> list[Floats]:
        """By block, the columns of the coefficients and the effects' parameters at `z`."""
        pairs = [self._slope(z, k) for k in range(self.parameters)]
        angles, in_fixture = (np.column_stack(each) for each in zip(*pairs, strict=True))
        slopes = [angles[used] for used in self.used_rows()]
        if self.evidence.fixture is not None:
            slopes.append(in_fixture)
        if self.evidence.drift_deg.size:
            slopes.append(np.zeros((self.evidence.drift_deg.size, self.parameters)))
        return slopes

    def blocks(self, z: Floats) -> tuple[list[Block], Floats]:
        """Give what is left at `z` of all trials and calibrations, and the nuisances' columns."""
        evidence, grid = self.evidence, self.evidence.grid
        base = self._about(z)
        e = base.effects
        y, fixed = self.predict(z)
        gain, _ = self._slope(z, LN_GAIN)
        _, seat = base.in_fixture
        quick, _ = self.chain.seated(seat).run(paced(to_x(z), 1.0 + _PACE_STEP), e)
        pace = (quick - y) / _PACE_STEP
        # A stop or a ceiling holds a trial's own gain back.
        moving = np.column_stack([curve_columns(y), self._misread(y), -grid.slopes(y), gain, pace])
        left = grid.angle_deg - y
        blocks = [
            Block(
                left[trial.rows],
                trial.weight,
                np.hstack([moving[trial.rows], trial.columns]),
                trial.index,
            )
            for trial in self._steady
        ]
        trials = len(grid.trials)
        fixture = evidence.fixture
        if fixture is not None:
            blocks.append(
                Block(
                    fixture.deviation_deg - fixed,
                    1.0 / fixture.sigma_deg**2,
                    np.hstack([self._fixture_wave(fixture), self._fixture_turned(fixture, e)]),
                    np.concatenate([self.waves[trials:].ravel(), self.turned]),
                )
            )
        if evidence.drift_deg.size:
            blocks.append(self._drift_block())
        return blocks, y

    @cached_property
    def _steady(self) -> list[_Steady]:
        """By trial that takes part, what is the same wherever the search is."""
        evidence, grid = self.evidence, self.evidence.grid
        trials = []
        for i, all_rows in enumerate(evidence.rows):
            local = self.keep[all_rows]
            rows = all_rows[local]
            if rows.size == 0:
                continue
            zero = np.zeros((rows.size, 1 + self.steps.size))
            zero[:, 0] = float(grid.trials[i].order - 1)
            zero[:, 1 : i + 2] = 1.0
            offset = np.ones((rows.size, 1))
            support = evidence.support[i][local]
            columns = np.hstack([zero, offset, self._wave(rows), self._ripple(rows), support])
            gain_at, offset_at, pace_at = self.own[i]
            moving = [self.curve, self.first_log, [self.late, gain_at, pace_at]]
            steady = [
                [self.walk, *self.steps, offset_at],
                self.waves[i : i + 1].ravel(),
                self.ripples[i : i + 1].ravel(),
                self.support[evidence.support_index[i]],
            ]
            index = np.concatenate([*moving, *steady])
            trials.append(_Steady(rows, 1.0 / self.row_variance[rows], columns, index))
        return trials

    def _wave(self, rows: Integers) -> Floats:
        """Give the interference in a trial, its phase being the trial's own."""
        time = self.evidence.grid.time_s[rows]
        return np.zeros((rows.size, 0)) if self.pickup_hz is None else wave(self.pickup_hz, time)

    def _ripple(self, rows: Integers) -> Floats:
        time = self.evidence.grid.time_s[rows]
        return np.zeros((rows.size, 0)) if self.pickup_hz is None else ripple(self.pickup_hz, time)

    def _misread(self, angle_deg: Floats) -> Floats:
        """Give what the sensor's curve misreads for the interference in its calibration."""
        fixture = self.evidence.fixture
        if self.pickup_hz is None or fixture is None:
            return np.zeros((angle_deg.size, 0))
        return misread(self.pickup_hz, fixture, angle_deg)

    def _fixture_wave(self, fixture: Fixture) -> Floats:
        logs = len(self.evidence.data.calibrations)
        if self.pickup_hz is None:
            return np.zeros((fixture.time_s.size, 0))
        return fixture_wave(self.pickup_hz, fixture, logs)

    def _fixture_turned(self, fixture: Fixture, effects: Floats) -> Floats:
        """Give what the later calibrations read more for a film turned once before each."""
        columns = np.zeros((fixture.log.size, self.turned.size))
        if self.turned.size:
            change = fixture.simulate(effects, 1.0)[0] - fixture.simulate(effects)[0]
            for log in range(self.turned.size):
                here = fixture.log == log + 1
                columns[here, log] = change[here]
        return columns

    def _drift_block(self) -> Block:
        evidence = self.evidence
        rows, after = evidence.drift_deg.size, evidence.drift_after
        zero = np.empty((rows, 1 + self.steps.size))
        zero[:, 0] = np.append(0.0, evidence.grid.orders)[after]
        zero[:, 1:] = np.arange(self.steps.size) < after[:, None]
        # A curve that has changed since it was calibrated shows again in a later calibration.
        shape = curve_columns(evidence.drift_angle_deg) if self.changed else np.zeros((rows, 0))
        index = self.curve if self.changed else self.curve[:0]
        waves = self.waves[len(evidence.grid.trials) :].ravel()
        return Block(
            evidence.drift_deg,
            1.0 / evidence.drift_sigma_deg**2,
            np.hstack([shape, zero, self._drift_wave()]),
            np.concatenate([index, [self.walk], self.steps, waves]),
        )

    def _drift_wave(self) -> Floats:
        """Give what the interference makes of later calibrations' settled means."""
        fixture = self.evidence.fixture
        if self.pickup_hz is None or fixture is None:
            return np.zeros((self.evidence.drift_deg.size, 0))
        return drift_wave(self.pickup_hz, fixture, self.evidence)

    def prior(self, z: Floats) -> Prior:
        """Prior of all columns' coefficients, those of the parameters as steps from `z`."""
        mean = np.zeros(self.size)
        mean[: self.parameters] = self.centre - z
        return Prior(mean, self.variance, self.group, self.scales)

    def fit(self, start: Floats, most_steps: int = MOST_STEPS) -> Fit:
        """Search from `start`.

        Returns
        -------
        Fit
            The best point met.
        """
        point, solution = climb(self, start, most_steps)
        return self._result(point.z, point.y, solution, point.blocks)

    def inside(self, z: Floats) -> Floats:
        """Move a point to within the bounds; alpha1 stays below alpha2."""
        z = np.clip(z, self.low, self.high)
        z[1] = min(z[1], z[0] - 1e-3)
        return z

    def _result(self, z: Floats, y: Floats, solution: Solution, blocks: list[Block]) -> Fit:
        evidence = self.evidence
        b = solution.coefficients
        shared = y.copy()
        residual = evidence.grid.angle_deg - y
        discrepancy = np.zeros(y.size)
        for i, rows in enumerate(evidence.rows):
            coefficients = b[self.support[evidence.support_index[i]]]
            discrepancy[rows] = evidence.support[i] @ coefficients
        curve = curve_columns(y) @ b[self.curve]
        zeros = b[self.walk] * (evidence.grid.orders - 1.0)
        if self.slips:
            zeros = zeros + np.cumsum(b[self.steps])
        curve += self._misread(y) @ b[self.first_log]
        shared += curve + zeros[evidence.grid.sample_trial]
        residual = residual - curve - zeros[evidence.grid.sample_trial]
        for block, rows in zip(blocks, self.used_rows(), strict=False):
            full = block.columns @ b[block.index]
            residual[rows] = block.residual - full + discrepancy[rows]
        return Fit(
            ids=self.ids,
            level=self.level,
            x=to_x(z),
            effects=self.effects(z),
            searched=z,
            predicted_deg=y,
            explained_deg=shared,
            residual_deg=residual,
            discrepancy_deg=discrepancy,
            solution=solution,
            curve_deg=b[self.curve],
            zeros_deg=zeros,
            drift_deg=self._drift(b),
            fixture_deg=self._fixture_left(z, b),
            waves_deg=b[self.waves],
            trial_effects=b[self.own],
            log_evidence=solution.log_evidence,
            changed=self.changed,
        )

    def _fixture_left(self, z: Floats, b: Floats) -> Floats:
        fixture = self.evidence.fixture
        if fixture is None:
            return np.zeros(0)
        predicted, _ = fixture.simulate(self.effects(z))
        waves = b[self.waves[len(self.evidence.grid.trials) :].ravel()]
        turned = self._fixture_turned(fixture, self.effects(z)) @ b[self.turned]
        predicted = predicted + self._fixture_wave(fixture) @ waves + turned
        return np.asarray(fixture.deviation_deg - predicted)

    def _drift(self, b: Floats) -> Floats:
        if not self.evidence.drift_deg.size:
            return np.zeros(0)
        block = self._drift_block()
        return np.asarray(block.columns @ b[block.index])

    def used_rows(self) -> list[Integers]:
        """By trial that takes part, its averaged samples."""
        used = [rows[self.keep[rows]] for rows in self.evidence.rows]
        return [rows for rows in used if rows.size]

    def starts(self, base: Floats) -> list[Floats]:
        """List starting points: each effect's own, on the coefficients `base` (searched)."""
        points = [base[:5]]
        for slot in self.slots:
            every = slot.parameter.starts
            points = [np.append(point, slot.searched(v)) for point in points for v in every]
        return points


def best_fit(fits: Sequence[Fit]) -> Fit:
    """Return the fit of largest evidence."""
    return max(fits, key=lambda fit: fit.log_evidence)
