"""The measured pressure and one explanation of it by drive effects.

Where the pressure was measured the chain splits: what the drive does to the command is seen in the
pressure alone, whatever the actuator makes of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from spa_fo.gap.data.evidence import Evidence, modelled_pressure
from spa_fo.gap.data.searched import Slot
from spa_fo.gap.fit.least_squares import Explained
from spa_fo.gap.noise.whitening import Factor, Whitening
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.effect import Parameter
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.plant.memory import FINEST_STEP_S

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_UNIFORM = 1.0 / np.sqrt(12.0)  # sigma of what may be anywhere in an interval of 1
_OF_A_JUMP = 0.5


def blur(evidence: Evidence, at: Integers) -> Floats:
    """Change of command and pressure within one row about some cells, kPa."""
    grid, reach = evidence.grid, _reach(evidence)
    total = np.zeros(at.size)
    for cells in (grid.pressure_kpa, grid.command_kpa):
        assert cells is not None
        before, after = _beside(cells, at, reach)
        total += np.abs(after - before)
    return total


def timing_error(evidence: Evidence) -> Floats:
    """Error of the averaged samples as the pressure moves while one is taken, 1 sigma, kPa.

    A ramp is known but for when in its cell it is read; of a jump a row may see any part, and so
    may the rows beside it.
    """
    grid, reach = evidence.grid, _reach(evidence)
    middle = grid.first_cell[grid.sample_step] + grid.cells[grid.sample_step] // 2
    last = int(grid.cell_starts[-1]) - 1
    squares = np.zeros(middle.size)
    for cells in (grid.pressure_kpa, grid.command_kpa):
        assert cells is not None
        before, after = _beside(cells, middle, reach)
        squares += (_UNIFORM * (after - before) / (2.0 * reach)) ** 2
        jump = np.zeros(middle.size)
        for side in (-1, 0, 1):
            at = np.clip(middle + side, 0, last)
            before, after = _beside(cells, at, reach)
            jump = np.maximum(jump, np.abs(after - 2.0 * cells[at] + before))
        squares += (_OF_A_JUMP * jump) ** 2
    return np.asarray(np.sqrt(squares))


def interval_s(evidence: Evidence) -> float:
    """Time between two samples, s."""
    return float(np.median(np.concatenate([np.diff(t.t_s) for t in evidence.grid.trials])))


def _reach(evidence: Evidence) -> int:
    """Cells between two samples."""
    return max(1, round(interval_s(evidence) / FINEST_STEP_S))


def _beside(cells: Floats, at: Integers, reach: int) -> tuple[Floats, Floats]:
    after = cells[np.minimum(at + reach, cells.size - 1)]
    return cells[np.maximum(at - reach, 0)], after


def lagged(cells_kpa: Floats, starts: Integers, lag_s: float) -> Floats:
    """Give what a sensor of the first order shows of a pressure, (cells,), kPa.

    Parameters
    ----------
    cells_kpa : (cells,) array
        Means over the grid's cells, held within each.
    starts : (trials + 1,) array
        Where each trial's cells begin; it begins at rest.
    lag_s : float
        Time constant.
    """
    if lag_s <= 0.0:
        return cells_kpa
    decay = float(np.exp(-FINEST_STEP_S / lag_s))
    within = lag_s / FINEST_STEP_S * (1.0 - decay)
    shown = np.empty_like(cells_kpa)
    for first, end in pairwise(starts.tolist()):
        held = cells_kpa[first:end]
        state = lfilter([0.0, 1.0 - decay], [1.0, -decay], held - held[0]) + held[0]
        shown[first:end] = held + within * (state - held)
    return shown


def resolution(evidence: Evidence) -> float:
    """Smallest step of the measured pressure, kPa."""
    values = np.concatenate(
        [t.pressure_kpa for t in evidence.grid.trials if t.pressure_kpa is not None]
    )
    steps = np.diff(np.unique(np.round(values, 6)))
    return float(np.quantile(steps, 0.1)) if steps.size else 0.0


_SLOWEST = 5.0  # times the usual lag; what is later is the drive's
_LAG = Parameter(
    name="lag_s",
    unit="s",
    centre=0.0,
    spread=SETTINGS.pressure_lag_s,
    low=0.0,
    high=_SLOWEST * SETTINGS.pressure_lag_s,
    starts=(0.01,),
)
_LAG_LEFT = replace(_LAG, spread=SETTINGS.angle_late_s)  # where a lag is expected already
_RIG_LAG_S = 1.0 / (2.0 * np.pi * 100.0)
_RIG_LAG = replace(_LAG, spread=_RIG_LAG_S, high=_RIG_LAG_S, starts=(0.0,))
"""Of a spa-rig log, whose sensor has a bandwidth of more than 100 Hz by its format."""


def _lag_of(evidence: Evidence, known: bool) -> Parameter:
    if evidence.data.campaign.log.format == "spa-rig":
        return _RIG_LAG
    return _LAG_LEFT if known else _LAG


class PressureProblem(Explained):
    """The pressure of a campaign and an explanation of it.

    Searched are the effects' parameters and, last, the lag of the pressure's sensor.

    Parameters
    ----------
    evidence : Evidence
        The campaign.
    whitening : Whitening
        Of the rows of the trials that take part.
    ids : sequence of str
        Drive effects.
    lag_known : bool
        Whether the sensor's lag is in the command already, as it is in a nominal drive.
    """

    def __init__(
        self,
        evidence: Evidence,
        whitening: Whitening,
        ids: Sequence[str],
        lag_known: bool = False,
    ) -> None:
        self.evidence, self.whitening = evidence, whitening
        self.rows = whitening.rows
        self.ids = tuple(ids)
        slots = [
            Slot(parameter, LIBRARY[name].first + k)
            for name in ids
            for k, parameter in enumerate(LIBRARY[name].parameters)
        ]
        slots.append(Slot(_lag_of(evidence, lag_known), -1))
        none = np.zeros(0)
        super().__init__(slots, none, np.zeros((0, 0)), none, none, np.ones(1))
        self.group = np.full(3, -1)
        # When within its interval a row is read, cells as long do not know.
        late_s = float(np.hypot(SETTINGS.angle_late_s, _UNIFORM * interval_s(evidence)))
        self.variance = np.square([SETTINGS.pressure_offset_kpa, SETTINGS.pressure_gain, late_s])
        self._known: dict[bytes, Floats] = {}

    def effects(self, z: Floats) -> Floats:
        """Parameters of all effects."""
        e = absent()
        for slot, value in zip(self.slots[:-1], z[:-1], strict=True):
            e[slot.place] = slot.value(float(value))
        return e

    def cells(self, z: Floats) -> Floats:
        """Give the true pressure on the grid's cells, kPa."""
        return modelled_pressure(self.evidence, self.effects(z))

    def shown(self, z: Floats) -> Floats:
        """Pressure on the grid's cells as the sensor shows it, kPa."""
        return lagged(self.cells(z), self.evidence.grid.cell_starts, float(z[-1]))

    def predict(self, z: Floats) -> Floats:
        """Pressure at the grid's samples as the sensor shows it, kPa."""
        key = z.tobytes()
        if key not in self._known:
            if len(self._known) > 64:
                self._known.clear()
            grid = self.evidence.grid
            self._known[key] = grid.read(self.shown(z))
        return self._known[key]

    def left(self, z: Floats) -> Floats:
        """Measured less predicted, (rows,), kPa."""
        measured = self.evidence.grid.measured_kpa
        assert measured is not None
        return self.rows.merged(measured - self.predict(z))

    def slopes(self, z: Floats) -> Floats:
        """Slopes over the searched parameters, (rows, parameters)."""
        y = self.predict(z)
        columns = np.zeros((y.size, self.parameters))
        for k in range(self.parameters):
            step, moved = self.slope_step(z, k), z.copy()
            moved[k] += step
            columns[:, k] = (self.predict(moved) - y) / step
        return self.rows.merged(columns)

    def columns(self, z: Floats) -> Floats:
        """Columns of the sensor: offset, gain, lateness, (rows, 3)."""
        y = self.predict(z)
        late = np.clip(-self.evidence.grid.slopes(y), -20.0, 20.0)
        return self.rows.merged(np.column_stack([np.ones(y.size), y, late]))

    def white(self, factor: Factor, values: Floats) -> Floats:
        """Whiten what stands at all rows."""
        return self.whitening.white(factor, values)


def starts(problem: PressureProblem, delays: Sequence[float]) -> list[Floats]:
    """List starting points: each effect's own; a delay from many."""
    points = [np.zeros(0)]
    for slot in problem.slots:
        every = delays if slot.parameter.name == "delay_s" else slot.parameter.starts
        points = [np.append(point, slot.searched(v)) for point in points for v in every]
    return points
