"""The free-form law of the drive: how fast it fills and vents, by what the command is above it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.fit.mixed import Normal, Prior, Solution, solve
from spa_fo.gap.fit.pressure import resolution, timing_error
from spa_fo.gap.places.law_basis import Basis, motion_basis
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.law import Law

Floats = NDArray[np.float64]

_TIMES_S = np.geomspace(0.03, 3.0, 13)  # first-order drives that a fit may begin with
_ROUNDS, _HALVED = 8, 6
_STEP = 1e-3
_MOST_ALIKE = 0.99  # correlation of neighbouring samples


class FillingFit:
    """A law of the filling fitted to the measured pressure of the trials that take part.

    Parameters
    ----------
    evidence : Evidence
        A campaign with command and pressure.

    Attributes
    ----------
    basis : Basis
        The law's.
    e, covariance : arrays
        Its coefficients.
    """

    def __init__(self, evidence: Evidence) -> None:
        grid = evidence.grid
        assert grid.command_kpa is not None
        assert grid.measured_kpa is not None
        self._command, self._grid = grid.command_kpa, grid
        self._used = evidence.used
        self._measured = grid.measured_kpa[self._used]
        white = evidence.pressure_noise_kpa**2 / grid.counts + resolution(evidence) ** 2 / 12.0
        self._sigma = np.sqrt(white + timing_error(evidence) ** 2)[self._used]
        step_kpa = grid.sampled(self._command)[self._used]
        above = step_kpa - self._measured
        self.basis: Basis = motion_basis("filling", above, grid.counts[self._used], straight=True)
        lags = [self.basis.coefficients(self.basis.knots / time) for time in _TIMES_S]
        self.e = min(lags, key=self._misfit)
        self.covariance = self._fit()

    @property
    def law(self) -> Law:
        """The law itself."""
        return self.basis.law(self.e)

    def _predicted(self, e: Floats) -> Floats:
        cells = self.basis.law(e).driven(self._command, self._grid.cell_starts)
        return self._grid.sampled(cells)[self._used]

    def _misfit(self, e: Floats) -> float:
        left = (self._measured - self._predicted(e)) / self._sigma
        return float(left @ left) if np.isfinite(left).all() else np.inf

    def _fit(self) -> Floats:
        """Gauss-Newton with the pressure sensor's offset and gain as nuisances."""
        m, best = self.basis.size, self._misfit(self.e)
        scale = float(np.sqrt(np.mean(self.e**2)))
        variances = np.array([scale**2])
        solution = self._solved(variances, scale)
        for _ in range(_ROUNDS):
            solution = self._solved(variances, scale)
            variances = solution.variances
            step, before = solution.coefficients[:m] - self.e, best
            for _ in range(_HALVED):
                there = self._misfit(self.e + step)
                if there < best:
                    self.e, best = self.e + step, there
                    break
                step = 0.5 * step
            if before - best < 1e-3 * before:
                break
        return solution.covariance()[:m, :m] * self._overdone()

    def _overdone(self) -> float:
        """How much more of the pressure is left, and for longer, than noise would leave."""
        left = (self._measured - self._predicted(self.e)) / self._sigma
        square = float(left @ left)
        alike = min(max(float(left[1:] @ left[:-1]) / square, 0.0), _MOST_ALIKE)
        return max(square / left.size * (1.0 + alike) / (1.0 - alike), 1.0)

    def _solved(self, variances: Floats, scale: float) -> Solution:
        m, here = self.basis.size, self._predicted(self.e)
        steps = _STEP * scale * np.eye(m)
        slopes = [(self._predicted(self.e + d) - here) / (_STEP * scale) for d in steps]
        h = np.column_stack([*slopes, np.ones(here.size), here]) / self._sigma[:, None]
        left = (self._measured - here) / self._sigma + h[:, :m] @ self.e
        known = np.square([SETTINGS.pressure_offset_kpa, SETTINGS.pressure_gain])
        prior = Prior(
            np.zeros(m + 2),
            np.append(np.ones(m), known),
            np.append(np.zeros(m, dtype=np.int64), [-1, -1]),
            np.array([scale]),
        )
        return solve(
            Normal(h.T @ h, h.T @ left, float(left @ left), 0.0, here.size), prior, variances
        )
