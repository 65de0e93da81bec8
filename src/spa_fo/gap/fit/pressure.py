"""The measured pressure and one explanation of it by drive effects.

Where the pressure was measured the chain splits: what the drive does to the command is seen in the
pressure alone, whatever the actuator makes of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.data.evidence import Evidence, modelled_pressure
from spa_fo.gap.data.searched import Slot
from spa_fo.gap.fit.least_squares import Explained, slots_of
from spa_fo.gap.fit.nuisances import most, told_whole
from spa_fo.gap.noise.pressure_noise import PressureNoise
from spa_fo.gap.noise.whitening import Factor, Whitening
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.effect import Parameter
from spa_fo.plant.effects.shared import low_pass
from spa_fo.plant.memory import FINEST_STEP_S

_UNIFORM = 1.0 / np.sqrt(12.0)  # sigma of what may be anywhere in an interval of 1
_OF_A_JUMP = 0.5
MOST_LAG_S = 5.0 * SETTINGS.pressure_lag_s
"""As much as a sensor may lag: what is later is the drive's."""
_LAG = Parameter(
    name="lag_s",
    unit="s",
    centre=0.0,
    spread=SETTINGS.pressure_lag_s,
    low=0.0,
    high=MOST_LAG_S,
    starts=(0.01,),
)
_LAG_LEFT = replace(_LAG, spread=SETTINGS.angle_late_s)  # where a lag is expected already
_RIG_LAG_S = 1.0 / (2.0 * np.pi * 100.0)
_RIG_LAG = replace(_LAG, spread=_RIG_LAG_S, high=_RIG_LAG_S, starts=(0.0,))
"""Of a spa-rig log, whose sensor has a bandwidth of more than 100 Hz by its format."""


def blur(evidence: Evidence) -> tuple[Floats, Floats]:
    """Change of command and pressure within one row about each cell, kPa: signed, and its size."""
    ends = [
        _beside(cells, np.arange(cells.size), row_cells(evidence)) for cells in _signals(evidence)
    ]
    changes = np.array([after - before for before, after in ends])
    return changes.sum(axis=0), np.abs(changes).sum(axis=0)


def timing_error(evidence: Evidence) -> Floats:
    """Error of the averaged samples as the pressure moves while one is taken, 1 sigma, kPa.

    A ramp is known but for when in its cell it is read; of a jump a row may see any part, and so
    may the rows beside it.
    """
    grid, reach = evidence.grid, row_cells(evidence)
    middle = grid.first_cell[grid.sample_step] + grid.cells[grid.sample_step] // 2
    near = np.clip(middle + np.array([[-1], [0], [1]]), 0, int(grid.cell_starts[-1]) - 1)
    squares = np.zeros(middle.size)
    for cells in _signals(evidence):
        before, after = _beside(cells, middle, reach)
        squares += (_UNIFORM * (after - before) / (2.0 * reach)) ** 2
        before, after = _beside(cells, near, reach)
        jump = np.abs(after - 2.0 * cells[near] + before).max(axis=0)
        squares += (_OF_A_JUMP * jump) ** 2
    return np.asarray(np.sqrt(squares))


def _signals(evidence: Evidence) -> tuple[Floats, Floats]:
    """Measured and commanded pressure, (cells,), kPa."""
    grid = evidence.grid
    assert grid.pressure_kpa is not None
    assert grid.command_kpa is not None
    return grid.pressure_kpa, grid.command_kpa


def row_cells(evidence: Evidence) -> int:
    """Cells between two samples."""
    return max(1, round(evidence.interval_s / FINEST_STEP_S))


def _beside(cells: Floats, at: Integers, reach: int) -> tuple[Floats, Floats]:
    """Give what stands a reach before and after some cells."""
    after = cells[np.minimum(at + reach, cells.size - 1)]
    return cells[np.maximum(at - reach, 0)], after


def lagged(cells_kpa: Floats, starts: Integers, lag_s: float) -> Floats:
    """Give what a sensor of the first order, time constant `lag_s`, shows of a pressure, (cells,).

    `cells_kpa` are means over the grid's cells, held within each; at `starts`, (trials + 1,), each
    trial's cells begin, at rest.
    """
    if lag_s <= 0.0:
        return cells_kpa
    rest = np.repeat(cells_kpa[starts[:-1]], np.diff(starts))
    shown = cells_kpa - rest
    low_pass(shown, starts, lag_s, 0.0)
    return rest + shown


def resolution(evidence: Evidence) -> float:
    """Smallest step of the measured pressure, kPa."""
    logged = [t.pressure_kpa for t in evidence.grid.trials if t.pressure_kpa is not None]
    steps = np.diff(np.unique(np.round(np.concatenate(logged), 6)))
    return float(np.quantile(steps, 0.1)) if steps.size else 0.0


class PressureProblem(Explained):
    """The pressure of a campaign, kPa, and an explanation of it.

    Searched are the effects' parameters and, last, the lag of the pressure's sensor. Its nuisances
    are each trial's own gain, where its scatter is given, and the sensor's offset, gain and
    lateness.

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
    noise : PressureNoise, optional
        How trials scatter, where that is known.
    """

    def __init__(
        self,
        evidence: Evidence,
        whitening: Whitening,
        ids: Sequence[str],
        lag_known: bool = False,
        noise: PressureNoise | None = None,
    ) -> None:
        self.evidence, self.whitening, self.ids = evidence, whitening, tuple(ids)
        self.rows, self.sigma = whitening.rows, np.zeros(0)
        lag = _LAG_LEFT if lag_known else _LAG
        if evidence.data.campaign.log.format == "spa-rig":
            lag = _RIG_LAG
        super().__init__([*slots_of(ids, evidence.reach), Slot(lag, -1)], np.ones(1))
        assert evidence.grid.measured_kpa is not None
        self.measured = self.rows.merged(evidence.grid.measured_kpa)
        trial = np.concatenate([g.trial for g in self.rows.groups])
        self.own = np.zeros((trial.size, 0))
        if noise is not None and noise.gain > 0.0:
            self.own = (trial[:, None] == np.unique(trial)).astype(np.float64)
            self.scales = np.array([noise.gain])
            self.strength += told_whole(noise.spectrum.repeats)
            ordinary = np.maximum(self.scales, SETTINGS.pressure_gain)
            self.most = most(noise.spectrum.repeats) * ordinary
        self.group = np.append(np.zeros(self.own.shape[1], dtype=np.int64), np.full(3, -1))
        # When within its interval a row is read, cells as long do not know.
        late_s = float(np.hypot(SETTINGS.angle_late_s, _UNIFORM * evidence.interval_s))
        sensors = np.square([SETTINGS.pressure_offset_kpa, SETTINGS.pressure_gain, late_s])
        self.variance = np.append(np.full(self.own.shape[1], self.scales[0] ** 2), sensors)

    def first_of(self, points: Sequence[Floats], factor: Factor, most: int) -> list[Floats]:
        """Choose the best starts: first of each form, then those that differ by more than a delay.

        Such as a better one has all but the delay of come last.
        """
        ranked = sorted(points, key=lambda z: self.misfit(z, factor))
        delays = [place for place, slot in enumerate(self.slots) if slot.parameter.is_delay]
        forms = [tuple(z[self.forms]) for z in ranked]
        kinds = [tuple(np.delete(z, delays)) for z in ranked]

        def comes(place: int) -> tuple[bool, bool]:
            return forms.index(forms[place]) != place, kinds.index(kinds[place]) != place

        return [ranked[place] for place in sorted(range(len(ranked)), key=comes)[:most]]

    def delayed(self, z: Floats, delays_s: Sequence[float]) -> list[Floats]:
        """Give a point with each of some delays in place of its own; none without a delay."""
        return [
            np.where(np.arange(z.size) == place, slot.searched(delay), z)
            for place, slot in enumerate(self.slots)
            if slot.parameter.is_delay
            for delay in delays_s
        ]

    @property
    def forms(self) -> list[int]:
        """Places of what says which of two forms an effect has."""
        return [place for place, slot in enumerate(self.slots) if slot.parameter.two_forms]

    def cells(self, z: Floats) -> Floats:
        """Give the true pressure on the grid's cells, kPa."""
        own = self.effects(z)
        return self.once("cells", own, lambda: modelled_pressure(self.evidence, own))

    def shown(self, z: Floats) -> Floats:
        """Pressure on the grid's cells as the sensor shows it, kPa."""
        return lagged(self.cells(z), self.evidence.grid.cell_starts, float(z[-1]))

    def predict(self, z: Floats) -> Floats:
        """Pressure at the grid's samples as the sensor shows it, kPa."""
        return self.once("predicted", z, lambda: self.evidence.grid.read(self.shown(z)))

    def at_rows(self, z: Floats) -> Floats:
        """Predict the pressure that is shown, (rows,)."""
        return self.rows.merged(self.predict(z))

    def columns(self, z: Floats) -> Floats:
        """Columns of the nuisances, (rows, trials with a gain of their own + 3)."""
        y = self.predict(z)
        late = np.clip(-self.evidence.grid.slopes(y), -20.0, 20.0)
        sensors = self.rows.merged(np.column_stack([np.ones(y.size), y, late]))
        return np.hstack([self.own * sensors[:, 1:2], sensors])
