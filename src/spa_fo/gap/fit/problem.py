"""The angles of a campaign and one explanation of them, as a least-squares problem.

The simulation holds the explanation's effects; the nuisances are the sensor curve's error, those of
the fixture's marks and of single dwells at them, the log's lateness, and every trial's own gain,
rest angle and time scale, and the branch of a loop that it began on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from scipy.linalg import block_diag

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.data.searched import LN_GAIN, quicker, to_x, wave
from spa_fo.gap.fit.bench import BRANCH, DELAY, DWELL, GAIN, LINE, REST, SLIP, TIME_SCALE, Bench
from spa_fo.gap.fit.least_squares import Explained, slots_of
from spa_fo.gap.fit.nuisances import (
    OF_TRIALS,
    most,
    most_of_trials,
    nuisance_scales,
    told_by_repeats,
    told_whole,
)
from spa_fo.gap.noise.order import trend_shapes
from spa_fo.gap.noise.whitening import Factor
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.mixed import WEAK
from spa_fo.plant.branches import CAME_BEFORE, Branches, begun, came_before, half_loop
from spa_fo.plant.effects.effect import PASSING
from spa_fo.plant.effects.library import LIBRARY, absent, at_port
from spa_fo.plant.sensor_curve import curve_columns
from spa_fo.plant.specimen import Mounting
from spa_fo.plant.stages import felt_angle

_BRANCH_STEP = 1e-3  # of a searched parameter, for the slope of what a branch makes of it
_KINK_DEG = 1.0  # over which the slope of a curve with kinks is taken
_ARRIVED = 0.5  # of what filters leave to a dwell: nobody logs how the fixture came to stand


@dataclass(frozen=True)
class Calibrated:
    """What calibrations show of effects, otherwise than they mostly do.

    Attributes
    ----------
    later : bool
        Whether later ones show what trials do of an unknown sensor curve, or of a ceiling of the
        reading, which is then not the mounting's alone: it has come since the first one.
    apart : bool
        Whether none shows a late channel: what logs them is not what logs a trial.
    """

    later: bool = False
    apart: bool = False


MOSTLY = Calibrated()
"""As they mostly do."""


class AngleProblem(Explained):
    """An explanation of a campaign.

    Its rows are those of the angle, of the fixture, of later calibrations, and of the step response
    of a model that was identified elsewhere.

    Parameters
    ----------
    bench : Bench
        The campaign.
    ids : sequence of str
        Effects of the explanation.
    calibrated : Calibrated
        What calibrations show of the effects.
    trend : bool
        Whether gain and rest angle may go with the trials' order.
    """

    def __init__(
        self, bench: Bench, ids: Sequence[str], calibrated: Calibrated = MOSTLY, trend: bool = False
    ) -> None:
        self.bench, self.ids, self.calibrated, self.trend = bench, tuple(ids), calibrated, trend
        self.evidence, self.chain, self.rows = bench.evidence, bench.chain, bench.whitening.rows
        self.line = bench.line if at_port("line", ids) else None
        shifts = at_port("coefficients", ids) is not None
        known = bench.shifted if shifts else bench.coefficients
        if not bench.noise.compared:  # what a reference's model errs by is expected beside it
            known = known.untempered()
        slips = at_port("zeros", ids) is not None
        reach = self.evidence.reach
        super().__init__(slots_of(ids, reach), nuisance_scales(bench, slips), known)
        self.strength[OF_TRIALS] += told_by_repeats(bench)
        self.strength[DWELL] += told_whole(bench.noise.fixture.told)
        if slips:
            self.strength[REST] = WEAK  # what repeats differ by at rest is the slip's
        self.most[OF_TRIALS] = most_of_trials(bench)
        self.most[BRANCH] = 2.0  # from one branch of a loop to the other
        self.most[DELAY] = 3.0**-0.5  # of a wait anywhere between none and twice its mean
        dwell = max(SETTINGS.dwell_error_deg, self.scales[DWELL])
        self.most[DWELL] = most(round(bench.noise.fixture.told)) * dwell
        self._film = LIBRARY.slots(lambda e: e.in_fixture)
        self._unseen = LIBRARY.slots(lambda e: e.in_trials_alone)
        self._later = LIBRARY.slots(lambda e: e.in_later)
        self._passing = LIBRARY.slots(lambda e: e.in_fixture and e.filter in PASSING)
        self._split = LIBRARY.slots(lambda e: e.in_fixture and e.filter not in PASSING)
        self._moving = LIBRARY.slots(lambda e: e.stage in ("drive", "actuator"))
        self.whitening, fixture, none = bench.whitening, self.evidence.fixture, np.zeros(0)
        further = [  # measured, and its error
            (none, none) if fixture is None else (fixture.deviation_deg, fixture.sigma_deg),
            (self.evidence.drift_deg, self.evidence.drift_sigma_deg),
        ]
        if known.response is not None:
            further.append((known.response.values, np.ones(known.response.values.size)))
        self.further = [values.size for values, _ in further]
        self.sigma = np.concatenate([sigma for _, sigma in further])
        angle = self.rows.merged(self.evidence.grid.angle_deg)
        self.measured = np.concatenate([angle, *(values for values, _ in further)])
        self.trial = np.concatenate([g.trial for g in self.rows.groups])
        self._loops = [name for name in self.ids if LIBRARY[name].half_loop is not None]
        looping = LIBRARY.slots(lambda e: e.half_loop is not None)
        self._looping = self.free + np.flatnonzero([s.place in looping for s in self.slots])
        delays = LIBRARY.slots(lambda e: e.filter == "delay")
        late = [s.place in delays and s.parameter.is_delay for s in self.slots]
        self._delays = self.free + np.flatnonzero(late)
        # Repeats tell clocks from what is at work, and a reference says what to expect of them.
        told = bench.noise.spectrum.repeats > 0 and not bench.noise.compared
        self._clocks_s = float(SETTINGS.angle_late_s / bench.scales[DELAY]) if told else 0.0
        self._lay()

    # --- the nuisances' columns ------------------------------------------------------------------

    def _lay(self) -> None:
        """Give each kind of nuisance its columns, and these their variances or groups."""
        evidence, bench, fixture = self.evidence, self.bench, self.evidence.fixture
        of_known = np.zeros((0, 0)) if fixture is None else fixture.of_known
        self.trials = np.unique(self.trial)
        after = came_before(self.chain.input_kpa, evidence.grid.cell_starts)[self.trials]
        self.kinds, self.after = np.unique(after, return_inverse=True)
        slips, curve = at_port("zeros", self.ids), at_port("curve", self.ids)
        passing = any(LIBRARY[n].first in self._passing for n in self.ids)
        sizes = [
            evidence.curve_sigma_deg.size,
            1,
            of_known.shape[1],
            of_known.shape[0] if bench.noise.fixture.mark_deg else 0,
            1 if fixture is not None and passing else 0,
            len(self._loops) * self.kinds.size,
            1 if slips else 0,
            len(evidence.grid.trials) if slips else 0,
            3 * self.trials.size,
            self.trials.size if self._clocks_s or self._delays.size else 0,
            2 * self.trials.size if self.line else 0,
            (3 if slips else 6) if self.trend else 0,
        ]
        self.size = sum(sizes)
        parts = np.split(np.arange(self.size), np.cumsum(sizes)[:-1])
        self.curve, self.late, self.dwells, self.marks, self.arrived, self.branch, *parts = parts
        self.walk, self.steps, own, self.delays, waves, self.trends = parts
        self.own, self.waves = own.reshape(-1, 3), waves.reshape(-1, 2)
        self.read = np.concatenate([self.curve, self.dwells, self.marks])
        self.moving = np.concatenate([self.read, self.arrived, self.branch])
        self.group, self.variance = np.full(self.size, -1), np.ones(self.size)
        self.group[self.own] = [GAIN, REST, TIME_SCALE]
        self.group[self.dwells] = DWELL
        self.group[self.branch] = BRANCH
        self.group[self.delays] = DELAY
        self.group[self.steps] = SLIP
        self.group[self.waves] = LINE
        looped = any(LIBRARY[n].first in self._split for n in self.ids)
        known = evidence.curve_apart_deg if looped else evidence.curve_sigma_deg
        self.variance[self.curve] = known**2
        if curve:
            errors = LIBRARY[curve].parameters[: self.curve.size]
            spread = [evidence.curve_share * e.at(evidence.reach).spread for e in errors]
            self.variance[self.curve] += np.square(spread)
        if self.trend:
            gain, rest = 3.0 * bench.scales[[GAIN, REST]]
            self.variance[self.trends] = np.square([gain, gain, 1.0, rest, rest, 1.0])[
                : self.trends.size
            ]
        self.variance[self.late] = SETTINGS.angle_late_s**2
        # Both ways through a calibration, and a later one, share it: nothing there tells of it.
        self.variance[self.marks] = bench.noise.fixture.mark_deg**2
        self.variance[self.arrived] = _ARRIVED**2
        if slips:
            self.variance[self.walk] = LIBRARY[slips].parameters[0].at(evidence.reach).spread ** 2
        known_angles = np.hstack([of_known, np.eye(of_known.shape[0], self.marks.size)])
        self._made_of = block_diag(np.eye(self.curve.size), known_angles)
        self._still = self._of_calibrations()

    def columns(self, z: Floats) -> Floats:
        """Columns of the nuisances about a point, (rows, size)."""
        grid, rows = self.evidence.grid, self.rows
        n, (y, _), slopes = rows.size, self.predict(z), self.slopes(z)
        gain, scale = slopes[:n, LN_GAIN], slopes[:n, : self.free] @ quicker(z)
        out = self._still.copy()
        out[:n, self.read] = self._of_reading(rows.merged(y)) @ self._made_of
        out[n:, self.moving] = self._of_moving(z)
        out[:n, self.branch] = self._of_branch(z)
        every, trial = np.arange(n), self.trial
        later = rows.merged(-grid.slopes(y)[:, None])
        out[:n, self.late] = later
        k = np.searchsorted(self.trials, trial)
        own = self.own[k].T
        out[every, own] = gain, np.ones(n), scale
        if self.delays.size:
            # Clocks are not in step, and what is polled, or queued, waits longer in one trial.
            out[every, self.delays[k]] = self.delay_s(z) * later[:, 0]
        if self.trend:
            out[:n, self.trends] = self._of_order(trial, gain)
        if self.walk.size:
            out[:n, self.walk[0]] = grid.orders[trial] - 1.0
            out[:n, self.steps] = np.arange(self.steps.size) <= trial[:, None]
        if self.line:
            waves = self.waves[np.searchsorted(self.trials, trial)].T
            phased = [
                wave(self.line, g.time_s) * np.sinc(self.line * g.width_s)[:, None]
                for g in rows.groups
            ]
            out[every, waves] = np.concatenate(phased).T
        return out

    def delay_s(self, z: Floats) -> float:
        """Say of how long a delay trials' own are parts: clocks', and effects' beyond a row."""
        waits = max(float(z[self._delays].sum()) - self.evidence.interval_s, 0.0)
        return self._clocks_s + waits

    def _of_order(self, trial: Integers, gain: Floats) -> Floats:
        """Give what goes with the trials' order, over what a trial's gain makes: gain, rest angle.

        Of a sensor that slips the rest angle does by itself.
        """
        shapes, noise = trend_shapes(len(self.evidence.grid.trials))[trial], self.bench.noise
        # Beside them what repeats let expect, about as large as they say.
        gains, zeros = noise.expected(trial)
        own = [gain[:, None] * shapes, gain[:, None] * gains[:, None], shapes, zeros[:, None]]
        return np.hstack(own)[:, : self.trends.size]

    def _of_calibrations(self) -> Floats:
        """Lay out all columns at the rows of the fixture and of later calibrations."""
        evidence, fixture, n = self.evidence, self.evidence.fixture, self.rows.size
        out = self.stacked(np.zeros((n, self.size)))
        if fixture is not None:
            end = n + fixture.deviation_deg.size
            out[n:end, self.dwells] = fixture.average @ fixture.of_dwell
            if evidence.drift_deg.size:
                self._of_drift(out[end : end + evidence.drift_deg.size])
        return out

    def _of_moving(self, z: Floats) -> Floats:
        """Give the columns that go with the point at the rows of the calibrations."""
        out = self._still[self.rows.size :, self.moving]
        if self.arrived.size:
            settled, fixture = self.effects(z), self.predict(z)[1]
            settled[self._passing] = np.nan
            out[: fixture.size, self.read.size] = fixture - self.in_fixture(settled)[0]
        return out

    def moved(self, factor: Factor, z: Floats) -> Floats:
        """Whiten what goes with the point: errors of the curve and of known angles, beginnings."""
        read = self._of_reading(self.rows.merged(self.predict(z)[0]))
        # A known angle's mark and dwells have one column between them.
        own = self.whitening.white(factor, read) @ self._made_of
        none = np.zeros((own.shape[0], self.arrived.size))
        branch = self.whitening.white(factor, self._of_branch(z))
        rest = self._of_moving(z) / self.sigma[:, None]
        return np.concatenate([np.hstack([own, none, branch]), rest])

    def slopes_beside(self, z: Floats, b: Floats) -> Floats:
        """Slopes of the prediction and of what the nuisances that go with the point make of it."""
        y, slopes, n = self.rows.merged(self.predict(z)[0]), self.slopes(z).copy(), self.rows.size
        known = self._made_of @ b[self.read]
        ends = [self._of_reading(y + side * _KINK_DEG) @ known for side in (0.5, -0.5)]
        slopes[:n] *= 1.0 + (ends[0] - ends[1])[:, None] / _KINK_DEG
        for here in self._looping:
            step = _BRANCH_STEP * np.eye(z.size)[here]
            change = self._of_branch(z + step) - self._of_branch(z)
            slopes[:n, here] += change @ b[self.branch] / _BRANCH_STEP
        if self.arrived.size:
            places = [slot.place in self._passing for slot in self.slots]
            lagging = self.free + np.flatnonzero(places)
            slopes[n : n + self.further[0], lagging] *= 1.0 + b[self.arrived]
        return slopes

    def _of_branch(self, z: Floats) -> Floats:
        """Give what the branches that trials began on make of readings, (rows, branch)."""
        return self.once("branch", z, lambda: self._branched(z))

    def _branched(self, z: Floats) -> Floats:
        """Simulate the branches that trials began on, one for all that were come to alike."""
        grid, k = self.evidence.grid, np.searchsorted(self.trials, self.trial)
        out = np.zeros((self.rows.size, len(self._loops), self.kinds.size))
        for name, here in zip(self._loops, np.moveaxis(out, 1, 0), strict=True):
            reading = half_loop(grid, name, self._angle(z), self.effects(z))
            sampled = self.rows.merged(grid.zeroed(reading[grid.sample_step]))
            here[np.arange(k.size), self.after[k]] = sampled
        return out.reshape(self.rows.size, -1)

    def branches(self, b: Floats) -> dict[str, Floats]:
        """Give the branches among the coefficients of the nuisances, by loop."""
        found = {name: np.zeros(len(CAME_BEFORE)) for name in self._loops}
        own = b[self.branch].reshape(-1, self.kinds.size)
        for of_kind, known in zip(found.values(), own, strict=True):
            of_kind[self.kinds] = known
        return found

    def begun(self, z: Floats, branches: Branches) -> Floats:
        """Give what known branches make of the angle at the grid's samples, deg."""
        grid = self.evidence.grid
        before = came_before(self.chain.input_kpa, grid.cell_starts)
        reading = begun(grid, branches, before, self._angle(z), self.effects(z))
        return grid.zeroed(reading[grid.sample_step])

    def _of_reading(self, angle_deg: Floats) -> Floats:
        """Give what errors of the curve and of each known angle make of readings, (n, k)."""
        fixture, stretch = self.evidence.fixture, self.evidence.curve_stretch
        curve = curve_columns(angle_deg, stretch)
        return curve if fixture is None else np.hstack([curve, fixture.misread(angle_deg)])

    def _of_drift(self, out: Floats) -> None:
        """Fill in the columns at the rows of later calibrations, (m, size)."""
        evidence, after = self.evidence, self.evidence.drift_after
        assert evidence.fixture is not None
        out[:, self.dwells] = evidence.fixture.drifted
        out[:, self.marks] = evidence.fixture.misread_later[:, : self.marks.size]
        if self.calibrated.later:
            drifted = curve_columns(evidence.drift_angle_deg, evidence.curve_stretch)
            out[:, self.curve] = drifted
        if self.walk.size:
            out[:, self.walk[0]] = np.append(0.0, evidence.grid.orders)[after]
            out[:, self.steps] = np.arange(self.steps.size) < after[:, None]

    # --- prediction ------------------------------------------------------------------------------

    def predict(self, z: Floats) -> tuple[Floats, Floats]:
        """Angles at the grid's samples, and readings in the fixture."""
        return self.once("predicted", z, lambda: self._predicted(z))

    def _predicted(self, z: Floats) -> tuple[Floats, Floats]:
        e = self.effects(z)
        deviation, mounting = self.in_fixture(e)
        chain, angle = self.chain.mounted(mounting).hung(to_x(z), e), self._angle(z)
        return chain.observed(chain.read(angle, e, chain.memory.film.copy()), e), deviation

    def _angle(self, z: Floats) -> Floats:
        """Give the true angles at the ends of the grid's steps, deg."""
        e = self.effects(z)
        moving = np.append(z[:5], e[self._moving])
        return self.once("angle", moving, lambda: self.chain.angles(to_x(z), e)[0])

    def in_fixture(self, effects: Floats) -> tuple[Floats, Mounting]:
        """Give what the fixture shows of effects, and how they leave the sensor after it."""
        fixture = self.evidence.fixture
        if fixture is None:
            return np.zeros(0), Mounting()
        shown = effects.copy()
        if self.calibrated.apart:
            shown[self._unseen] = np.nan
        return self.once("fixture", shown[self._film], lambda: fixture.simulate(shown))

    def drifted(self, z: Floats) -> Floats:
        """Predict what later calibrations read beyond what the first one does, (m,)."""
        at, e = self.evidence.drift_angle_deg, self.effects(z)
        if not (self.calibrated.later and at.size) or np.isnan(e[self._later]).all():
            return np.zeros(at.size)
        shown = absent()
        shown[self._later] = e[self._later]
        level = np.zeros(at.size, dtype=np.int64)
        return felt_angle(at, level, shown, Mounting().film) - at

    def at_rows(self, z: Floats) -> Floats:
        """Predict the angle, the readings in the fixture, and those of later calibrations."""
        angle, fixture = self.predict(z)
        return self.stacked(self.rows.merged(angle), fixture, self.drifted(z))

    def stacked(
        self, angle: Floats, fixture: Floats | None = None, drift: Floats | None = None
    ) -> Floats:
        """Lay what stands at the rows, in the fixture, and of later calibrations over all rows.

        What is None is 0, and so is the response.
        """
        parts = [
            np.zeros((size, *angle.shape[1:])) if part is None else part
            for part, size in zip_longest((fixture, drift), self.further)
        ]
        return np.concatenate([angle, *parts])
