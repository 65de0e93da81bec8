"""The angles of a campaign and one explanation of them, as a least-squares problem.

The simulation holds the explanation's effects; the nuisances are the sensor curve's error, the
calibration dwells', the log's lateness, and every trial's own gain, rest angle and time scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from spa_fo.gap.data.evidence import curve_columns
from spa_fo.gap.data.searched import (
    HIGHEST,
    LN_GAIN,
    LOWEST,
    Slot,
    at_rate,
    to_x,
    wave,
)
from spa_fo.gap.fit.bench import DWELL, GAIN, LINE, REST, SLIP, TIME_SCALE, Bench
from spa_fo.gap.fit.least_squares import Explained
from spa_fo.gap.noise.whitening import Factor
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.chain import Mounting
from spa_fo.plant.effects.library import LIBRARY, absent, at_port

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_SLOPE_STEP = 1e-4
_SCALE_STEP = 2e-3
_OF_TRIALS = [GAIN, REST, TIME_SCALE]
_SURELY = 1e-3  # probability that a scatter is larger than its bound


@dataclass(frozen=True)
class _Base:
    z: Floats
    effects: Floats
    angle_deg: Floats
    in_fixture: tuple[Floats, Mounting]
    predicted: tuple[Floats, Floats] | None = None
    slopes: dict[int, tuple[Floats, Floats]] = field(default_factory=dict)


def _same(one: Floats, other: Floats, slots: Integers) -> bool:
    return np.array_equal(one[slots], other[slots], equal_nan=True)


class AngleProblem(Explained):
    """An explanation of a campaign.

    Parameters
    ----------
    bench : Bench
        The campaign.
    ids : sequence of str
        Effects of the explanation.
    changed : bool
        Whether an unknown sensor curve is that of later calibrations too, not the mounting's alone.
    """

    def __init__(
        self, bench: Bench, ids: Sequence[str], changed: bool = False, trend: bool = False
    ) -> None:
        self.changed, self.trend = changed, trend
        self.line = bench.line if at_port("line", ids) else None
        self.bench = bench
        self.ids = tuple(ids)
        evidence = bench.evidence
        self.evidence, self.chain = evidence, bench.chain
        self.rows = bench.whitening.rows
        slots = [
            Slot(parameter, LIBRARY[name].first + k)
            for name in ids
            if LIBRARY[name].port == "chain"
            for k, parameter in enumerate(LIBRARY[name].parameters)
        ]
        known = bench.coefficients
        if at_port("coefficients", ids) is not None:
            known = known.shifted(bench.centre)
        self.response = known.response
        super().__init__(
            slots,
            known.mean,
            known.spread,
            LOWEST,
            HIGHEST,
            nuisance_scales(bench, at_port("zeros", ids) is not None),
            0.0 if known.response is None else known.response.log_noise,
        )
        # Nuisances do not hide what all trials show: repeats have said how large they are, and
        # so have the ways through a calibration.
        ordinary = [SETTINGS.gain_scatter, SETTINGS.rest_scatter_deg, SETTINGS.time_scatter]
        usual = np.maximum(bench.scales[_OF_TRIALS], ordinary)
        self.most[_OF_TRIALS] = most(bench.noise.spectrum.repeats) * usual
        self.most[DWELL] = SETTINGS.most_scatter * max(SETTINGS.dwell_error_deg, self.scales[DWELL])
        self.film_slots = LIBRARY.slots(lambda e: e.in_fixture)
        self.angle_slots = LIBRARY.slots(lambda e: e.stage in ("drive", "actuator"))
        self._base: _Base | None = None
        self._lay()

    # --- the nuisances' columns ------------------------------------------------------------------

    def _lay(self) -> None:
        evidence = self.evidence
        self.trials = np.unique(np.concatenate([g.trial for g in self.rows.groups]))
        knots = evidence.curve_sigma_deg.size
        fixture = evidence.fixture
        self.curve = np.arange(knots)
        self.late = knots
        at = knots + 1
        dwells = 0 if fixture is None else int(fixture.dwell.max()) + 1
        self.dwells = at + np.arange(dwells)
        at += dwells
        slips = at_port("zeros", self.ids)
        self.walk = at + np.arange(1 if slips else 0)
        at += self.walk.size
        every = len(evidence.grid.trials)
        self.steps = at + np.arange(every if slips else 0)
        at += self.steps.size
        self.own = at + np.arange(3 * self.trials.size).reshape(-1, 3)
        at += self.own.size
        self.waves = at + np.arange(2 * self.trials.size if self.line else 0).reshape(-1, 2)
        at += self.waves.size
        self.trends = at + np.arange(4 if self.trend else 0)
        at += self.trends.size
        self.size = at
        group, variance = np.full(at, -1), np.ones(at)
        group[self.own] = [GAIN, REST, TIME_SCALE]
        group[self.dwells] = DWELL
        group[self.steps] = SLIP
        group[self.waves] = LINE
        variance[self.curve] = evidence.curve_sigma_deg**2
        curve = at_port("curve", self.ids)
        if curve:
            variance[self.curve] += np.square([q.spread for q in LIBRARY[curve].parameters])
        if self.trend:
            gain, rest = self.bench.scales[[GAIN, REST]]
            variance[self.trends] = np.square([3.0 * gain, 3.0 * gain, 3.0 * rest, 3.0 * rest])
        variance[self.late] = SETTINGS.angle_late_s**2
        if slips:
            variance[self.walk] = LIBRARY[slips].parameters[0].spread ** 2
        self.group, self.variance = group, variance

    def columns(self, z: Floats) -> Floats:
        """Columns of the nuisances about a point, (rows, size)."""
        evidence, grid, rows = self.evidence, self.evidence.grid, self.rows
        base = self._about(z)
        y, _ = self.predict(z)
        gain, _ = self._slope(z, LN_GAIN)
        _, mounting = base.in_fixture
        quick, _ = self.chain.mounted(mounting).run(
            at_rate(to_x(z[:5]), 1.0 + _SCALE_STEP), base.effects
        )
        scale = (quick - y) / _SCALE_STEP
        fixture = evidence.fixture
        tied = np.zeros((y.size, 0))
        if fixture is not None:
            tied = fixture.misread(y)
        moving = rows.merged(
            np.column_stack([curve_columns(y), -grid.slopes(y), tied, gain, scale])
        )
        knots, n = self.curve.size, rows.size
        f = 0 if fixture is None else fixture.deviation_deg.size
        d = evidence.drift_deg.size
        out = self.stacked(np.zeros((n, self.size)))
        out[:n, : knots + 1] = moving[:, : knots + 1]
        out[:n, self.dwells] = moving[:, knots + 1 : knots + 1 + self.dwells.size]
        orders = grid.orders
        for g in rows.groups:
            here = np.arange(g.rows.start, g.rows.stop)
            which = np.searchsorted(self.trials, g.trial)
            out[here, self.own[which, 0]] = moving[g.rows, -2]
            out[here, self.own[which, 1]] = 1.0
            out[here, self.own[which, 2]] = moving[g.rows, -1]
            if self.trend:
                place = (g.trial + 0.5) / len(grid.trials)
                late, early = place - 0.5, np.exp(-6.0 * place)
                out[here, self.trends[0]] = late * moving[g.rows, -2]
                out[here, self.trends[1]] = early * moving[g.rows, -2]
                out[here, self.trends[2]] = late
                out[here, self.trends[3]] = early
            if self.walk.size:
                out[here, self.walk[0]] = orders[g.trial] - 1.0
                out[here[:, None], self.steps[None, :]] = (
                    np.arange(self.steps.size)[None, :] <= g.trial[:, None]
                )
            if self.line:
                phased = wave(self.line, g.time_s)
                phased *= np.sinc(self.line * g.width_s)[:, None]
                out[here, self.waves[which, 0]] = phased[:, 0]
                out[here, self.waves[which, 1]] = phased[:, 1]
        if fixture is not None:
            out[n : n + f, self.dwells] = fixture.average @ fixture.of_dwell
        if d:
            assert fixture is not None
            later = slice(n + f, n + f + d)
            out[later, self.dwells] = fixture.drifted
            if self.changed:
                out[later, self.curve] = curve_columns(evidence.drift_angle_deg)
            if self.walk.size:
                after = evidence.drift_after
                out[later, self.walk[0]] = np.append(0.0, orders)[after]
                out[later, self.steps] = np.arange(self.steps.size)[None, :] < after[:, None]
        return out

    # --- prediction ------------------------------------------------------------------------------

    def effects(self, z: Floats) -> Floats:
        """Parameters of all effects."""
        e = absent()
        for slot, value in zip(self.slots, z[5:], strict=True):
            e[slot.place] = slot.value(value)
        return e

    def predict(self, z: Floats) -> tuple[Floats, Floats]:
        """Angles at the grid's samples, and readings in the fixture."""
        e, base = self.effects(z), self._base
        if base is not None and base.predicted is not None and np.array_equal(z, base.z):
            return base.predicted
        if base is not None and _same(e, base.effects, self.film_slots):
            deviation, mounting = base.in_fixture
        else:
            deviation, mounting = self._in_fixture(e)
        chain = self.chain.mounted(mounting)
        if (
            base is not None
            and np.array_equal(z[:5], base.z[:5])
            and _same(e, base.effects, self.angle_slots)
        ):
            angle = base.angle_deg
        else:
            angle, _ = chain.angles(to_x(z), e)
        return chain.observed(chain.read(angle, e, chain.memory.film.copy()), e), deviation

    def _in_fixture(self, effects: Floats) -> tuple[Floats, Mounting]:
        fixture = self.evidence.fixture
        return (np.zeros(0), Mounting()) if fixture is None else fixture.simulate(effects)

    def _about(self, z: Floats) -> _Base:
        if self._base is None or not np.array_equal(z, self._base.z):
            e = self.effects(z)
            self._base = _Base(z.copy(), e, self.chain.angles(to_x(z), e)[0], self._in_fixture(e))
            self._base = replace(self._base, predicted=self.predict(z))
        return self._base

    def _slope(self, z: Floats, k: int) -> tuple[Floats, Floats]:
        base = self._about(z)
        known, here = base.slopes, self.predict(z)
        if k not in known:
            step = _SLOPE_STEP if k < 5 else self.slope_step(z, k)
            moved = z.copy()
            moved[k] += step
            there = self.predict(moved)
            known[k] = (there[0] - here[0]) / step, (there[1] - here[1]) / step
        return known[k]

    def stacked(
        self,
        angle: Floats,
        fixture: Floats | None = None,
        drift: Floats | None = None,
        response: Floats | None = None,
    ) -> Floats:
        """Lay what stands at the rows, in the fixture, of later calibrations and of the response.

        What is None is 0; of the response everything is whitened already.
        """
        evidence, rest = self.evidence, angle.shape[1:]
        fixed = 0 if evidence.fixture is None else evidence.fixture.deviation_deg.size
        known = 0 if self.response is None else self.response.values.size
        sizes = fixed, evidence.drift_deg.size, known
        parts = [
            np.zeros((size, *rest)) if part is None else part
            for part, size in zip((fixture, drift, response), sizes, strict=True)
        ]
        return np.concatenate([angle, *parts])

    def left(self, z: Floats) -> Floats:
        """Measured less predicted, (all rows,); see `stacked`."""
        y, fixed = self.predict(z)
        evidence = self.evidence
        return self.stacked(
            self.rows.merged(evidence.grid.angle_deg - y),
            None if evidence.fixture is None else evidence.fixture.deviation_deg - fixed,
            evidence.drift_deg,
            None if self.response is None else self.response.left(z),
        )

    def slopes(self, z: Floats) -> Floats:
        """Slopes of the prediction over the searched parameters, (all rows, parameters)."""
        self._about(z)
        pairs = [self._slope(z, k) for k in range(self.parameters)]
        known = None
        if self.response is not None:
            known = np.pad(self.response.slopes(z), ((0, 0), (0, self.parameters - 5)))
        return self.stacked(
            self.rows.merged(np.column_stack([pair[0] for pair in pairs])),
            np.column_stack([pair[1] for pair in pairs]),
            response=known,
        )

    # --- whitening -------------------------------------------------------------------------------

    def white(self, factor: Factor, values: Floats) -> Floats:
        """Whiten what stands at all rows."""
        n, fixture = self.rows.size, self.evidence.fixture
        sigma = np.ones(values.shape[0] - n)
        known = np.append(
            np.zeros(0) if fixture is None else fixture.sigma_deg, self.evidence.drift_sigma_deg
        )
        sigma[: known.size] = known
        rest = (values[n:].T / sigma).T
        return np.concatenate([self.bench.whitening.white(factor, values[:n]), rest])


def most(repeats: int) -> float:
    """Bound a scatter, in units of its estimate from so many differences of repeats."""
    if repeats < 1:
        return SETTINGS.most_scatter
    return min(float(np.sqrt(repeats / chi2.ppf(_SURELY, repeats))), SETTINGS.most_scatter)


def nuisance_scales(bench: Bench, slips: bool) -> Floats:
    """Typical standard deviations of the nuisances.

    Beside a slip, which lets repeats differ at rest, the bench's rest scatter is a usual one.
    """
    scales = bench.scales.copy()
    if slips:
        scales[REST] = min(scales[REST], SETTINGS.rest_scatter_deg)
    return scales


def starts(problem: AngleProblem, coefficients: Floats) -> list[Floats]:
    """List starting points: each effect's own, on these searched coefficients."""
    points = [coefficients[:5]]
    for slot in problem.slots:
        every = slot.parameter.starts
        points = [np.append(point, slot.searched(v)) for point in points for v in every]
    return points
