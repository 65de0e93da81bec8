"""The drive by itself: measured pressure against the command.

Where the pressure was measured the chain splits: what the drive does to the command is seen in the
pressure alone, whatever the actuator makes of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from spa_fo.gap.evidence import Evidence, modelled_pressure
from spa_fo.gap.explain import TIMING_S, Slot
from spa_fo.gap.mixed import Block, Prior, Solution
from spa_fo.gap.search import climb, point_at
from spa_fo.gap.together import each
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.plant.memory import FINEST_STEP_S

Floats = NDArray[np.float64]

_OFFSET_KPA, _GAIN = 0.4, 0.004  # of the pressure sensor

_BLUR = 0.5  # of the change of pressure within six cells: when exactly it changed is not known
_MOST_STEPS = 16
_TRIED = 4  # starts
_UNSTEADY = (0.0, 0.35)
_UNEXPLAINED = 0.05  # of the largest pressure
_OF_REACH = 0.4  # deviation of a jump that comes anywhere within its reach, of its size
# A jump that comes late by many cells does not say which way it should move.
_DELAYS_S = tuple(np.geomspace(0.01, 1.5, 40).tolist())


@dataclass(frozen=True)
class DriveFit:
    """Some drive effects fitted to the measured pressure.

    Attributes
    ----------
    ids : tuple of str
        The effects.
    effects : array
        Parameters of all effects, NaN where absent.
    predicted_kpa : (n,) array
        At the grid's averaged samples.
    residual_kpa : (n,) array
        Measured less predicted, sensor offset and gain taken out.
    missed_kpa : (n,) array
        The part of it that repeats: the discrepancy.
    discrepancy_kpa : float
        Standard deviation of what the effects do not explain.
    solution : Solution
        Of the last linearisation; the searched parameters come first.
    searched : array
        Parameters as searched.
    log_evidence : float
        Of all rows.
    """

    ids: tuple[str, ...]
    effects: Floats
    predicted_kpa: Floats
    residual_kpa: Floats
    missed_kpa: Floats
    discrepancy_kpa: float
    solution: Solution
    searched: Floats
    log_evidence: float


def fit_drive(evidence: Evidence, ids: Sequence[str], start: Floats | None = None) -> DriveFit:
    """Fit the drive effects `ids` to the pressure, from the best of their starts or from `start`.

    A dead time may be steady, or vary from jump to jump, as that of a controller which looks for
    commands now and then.
    """
    fits = []
    for unsteady in _UNSTEADY if "dead_time" in ids else (0.0,):
        problem = _Problem(evidence, ids, unsteady)
        fits.append(problem.best() if start is None else problem.fit(start))
    # What passes for unsteadiness must not hide that the rest is not explained either.
    size = float(np.max(np.abs(fits[0].predicted_kpa)))
    steady = [f for k, f in enumerate(fits) if k == 0 or f.discrepancy_kpa < _UNEXPLAINED * size]
    return max(steady, key=lambda fit: fit.log_evidence)


def fit_drives(evidence: Evidence, excluded: Sequence[str] = ()) -> dict[tuple[str, ...], DriveFit]:
    """Fit no effect, every single drive effect, and pairs of those that help, to the pressure.

    Beside the best one, an effect that shows little alone may show all the more.
    """
    names = [
        name for name, effect in LIBRARY.items() if effect.stage == "drive" and name not in excluded
    ]
    alone = [(), *((name,) for name in names)]
    fits = dict(zip(alone, each(lambda ids: fit_drive(evidence, ids), alone), strict=True))
    ranked = sorted(names, key=lambda name: -fits[(name,)].log_evidence)
    chosen = sorted({*combinations(ranked[:4], 2), *((ranked[0], n) for n in ranked[1:])})
    pairs = [tuple(sorted(pair, key=names.index)) for pair in chosen]

    def together(pair: tuple[str, ...]) -> DriveFit:
        start = np.concatenate([fits[(name,)].searched for name in pair])
        return fit_drive(evidence, pair, start)

    return fits | dict(zip(pairs, each(together, pairs), strict=True))


class _Problem:
    def __init__(self, evidence: Evidence, ids: Sequence[str], unsteady: float = 0.0) -> None:
        self.evidence = evidence
        self.unsteady = unsteady  # part of a dead time by which it varies from jump to jump
        self.ids = tuple(ids)
        grid = evidence.grid
        assert grid.measured_kpa is not None
        self.slots = [
            Slot(parameter, LIBRARY[name].first + k)
            for name in ids
            for k, parameter in enumerate(LIBRARY[name].parameters)
        ]
        self.parameters = p = len(self.slots)
        self.centre = np.array([slot.centre for slot in self.slots])
        self.spread = np.array([slot.parameter.spread for slot in self.slots])
        self.low = np.array([slot.limits[0] for slot in self.slots])
        self.high = np.array([slot.limits[1] for slot in self.slots])
        self.size = p + 3 + evidence.supports
        self.group = np.full(self.size, -1)
        self.group[p + 3 :] = 0
        sensor = np.array([_OFFSET_KPA, _GAIN, TIMING_S])
        self.variance = np.concatenate([self.spread**2, sensor**2, np.ones(evidence.supports)])
        # The cells in the middle of each averaged sample's step.
        self.at = grid.first_cell[grid.sample_step] + grid.cells[grid.sample_step] // 2
        assert grid.pressure_kpa is not None
        assert grid.command_kpa is not None
        blur = _BLUR * (self._change(grid.pressure_kpa) + self._change(grid.command_kpa))
        self.noise = evidence.pressure_noise_kpa**2 / grid.counts + blur**2 + 0.02**2
        if evidence.pressure_variance is not None:
            self.noise = self.noise + evidence.pressure_variance
        self.scales = np.array([evidence.tolerance_kpa])

    def _change(self, cells: Floats) -> Floats:
        """Change of a pressure about each averaged sample, over three cells to either side."""
        size = cells.size
        after, before = np.minimum(self.at + 3, size - 1), np.maximum(self.at - 3, 0)
        return np.asarray(np.abs(cells[after] - cells[before]))

    def effects(self, z: Floats) -> Floats:
        e = absent()
        for slot, value in zip(self.slots, z, strict=True):
            e[slot.place] = slot.value(float(value))
        return e

    def predict(self, z: Floats) -> Floats:
        return self._sampled(modelled_pressure(self.evidence, self.effects(z)))

    def _sampled(self, cells: Floats) -> Floats:
        # A row's pressure is read before its command acts: it belongs to the cell that ends there,
        # so an averaged sample is the mean over just the cells of its step.
        grid = self.evidence.grid
        return np.asarray(grid.step_means(cells)[grid.sample_step])

    def blocks(self, z: Floats) -> tuple[list[Block], Floats]:
        """Give what is left at `z`, and the columns of the sensor and the discrepancy."""
        evidence, p = self.evidence, self.parameters
        measured = evidence.grid.measured_kpa
        assert measured is not None
        y = self.predict(z)
        sensor = np.column_stack([np.ones(y.size), y, self._late(y)])
        noise = self.noise + self._unsteadiness(z)
        blocks = []
        for i in np.flatnonzero(evidence.takes_part):
            rows = evidence.rows[i]
            columns = np.hstack([sensor[rows], evidence.support[i]])
            index = p + np.concatenate([np.arange(3), 3 + evidence.support_index[i]])
            blocks.append(Block(measured[rows] - y[rows], 1.0 / noise[rows], columns, index))
        return blocks, y

    def slopes(self, z: Floats) -> list[Floats]:
        """By block, the columns of the effects' parameters at `z`."""
        y = self.predict(z)
        slopes = np.empty((y.size, self.parameters))
        for k in range(self.parameters):
            step = 0.01 * min(self.spread[k], 0.3 * max(abs(z[k]), 0.3))
            step = -step if z[k] + step > self.high[k] else step
            moved = z.copy()
            moved[k] += step
            slopes[:, k] = (self.predict(moved) - y) / step
        return [slopes[self.evidence.rows[i]] for i in np.flatnonzero(self.evidence.takes_part)]

    def _unsteadiness(self, z: Floats) -> Floats:
        """Variance of each averaged sample where a jump may come sooner or later, kPa²."""
        effects = self.effects(z)
        delay_s = effects[LIBRARY["dead_time"].first]
        if not self.unsteady * delay_s > 0.0:
            return np.zeros(self.noise.size)
        cells = modelled_pressure(self.evidence, effects)
        window = 2 * round(self.unsteady * delay_s / FINEST_STEP_S) + 1
        reach = maximum_filter1d(cells, window) - minimum_filter1d(cells, window)
        return np.square(_OF_REACH * self._sampled(reach))

    def _late(self, y: Floats) -> Floats:
        """Say what a log that is late by a second would add, to first order; jumps left out."""
        return np.clip(-self.evidence.grid.slopes(y), -20.0, 20.0)

    def best(self) -> DriveFit:
        """Fit from the most probable starts of the effects' parameters."""
        return max((self.fit(point) for point in self.starts()), key=lambda f: f.log_evidence)

    def starts(self) -> list[Floats]:
        """List the most probable starts."""
        points = [np.zeros(0)]
        for slot in self.slots:
            starts = _DELAYS_S if slot.parameter.name == "delay_s" else slot.parameter.starts
            points = [np.append(point, slot.searched(v)) for point in points for v in starts]
        if len(points) > _TRIED:
            variances = self.scales**2
            points.sort(key=lambda z: -point_at(self, self.inside(z), variances).log_posterior)
        return points[:_TRIED]

    def prior(self, z: Floats) -> Prior:
        """Prior of all columns' coefficients, those of the parameters as steps from `z`."""
        mean = np.zeros(self.size)
        mean[: self.parameters] = self.centre - z
        return Prior(mean, self.variance, self.group, self.scales)

    def inside(self, z: Floats) -> Floats:
        """Move a point to within the bounds."""
        return np.clip(z, self.low, self.high)

    def fit(self, start: Floats) -> DriveFit:
        point, solution = climb(self, start, _MOST_STEPS)
        z, y, p = point.z, point.y, self.parameters
        b = solution.coefficients
        grid = self.evidence.grid
        assert grid.measured_kpa is not None
        missed = np.empty(y.size)
        for i, rows in enumerate(self.evidence.rows):
            missed[rows] = self.evidence.support[i] @ b[p + 3 + self.evidence.support_index[i]]
        return DriveFit(
            ids=self.ids,
            effects=self.effects(z),
            predicted_kpa=y,
            residual_kpa=grid.measured_kpa - y - b[p] - b[p + 1] * y,
            missed_kpa=missed,
            discrepancy_kpa=float(np.sqrt(solution.variances[0])),
            solution=solution,
            searched=z,
            log_evidence=solution.log_evidence,
        )
