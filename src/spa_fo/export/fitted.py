"""Poles and zeros of the whole of G fitted to its frequency response.

Least squares of ln(H/G) over the band: its real part is the error in magnitude, its imaginary
part that in phase, both relative, whatever G has fallen to. In the logarithms of poles and zeros
every candidate is stable, of minimum phase and of the exact static gain, and the Jacobian is
elementary. That is the purpose of vector fitting (Gustavsen and Semlyen 1999,
doi:10.1109/61.772353) with these constraints built in instead of mended afterwards.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from spa_fo.arrays import Floats
from spa_fo.export.oustaloup import whole_part
from spa_fo.export.rational import Complexes, Rational
from spa_fo.plant import TransferFunction

_POINTS = 120
_EVALUATIONS = 120
# Where the zeros start, in spacings from the poles: on either side and among them.
_STARTS = (-0.4, 0.0, 0.4)
_BEYOND = 0.5  # poles and zeros may leave the band by this share of its decades
_DAMPING = (0.02, 20.0)


def exact_response(g: TransferFunction, omega: Floats) -> Complexes:
    """Frequency response of G at `omega` (rad/s), same shape."""
    s = 1j * np.asarray(omega, dtype=np.float64)
    return np.asarray(g.b0 / (s**g.alpha2 + g.a1 * s**g.alpha1 + g.a0))


def fit_poles_and_zeros(g: TransferFunction, low: float, high: float, states: int) -> Rational:
    """Fit a rational function with a pair of poles and otherwise real ones.

    Parameters
    ----------
    g : TransferFunction
        What to approximate.
    low, high : float
        Where, rad/s.
    states : int
        Number of poles, at least 3; there are one or two zeros fewer, as the order falls.
    """
    problem = _Problem(g, np.geomspace(low, high, _POINTS), states)
    fits = [problem.fit(shift) for shift in _STARTS]
    _, best = min(fits, key=lambda fit: fit[0])
    zeros, poles = problem.zeros_and_poles(best)
    return Rational(zeros, poles, g.gain)


class _Problem:
    """Residuals in (ln ω0, ln ζ, ln −poles, ln −zeros)."""

    def __init__(self, g: TransferFunction, omega: Floats, states: int) -> None:
        relative = exact_response(g, omega) / g.gain
        self.target = np.log(np.abs(relative)) + 1j * np.unwrap(np.angle(relative))
        self.s = 1j * omega
        self.poles = states - 2
        self.zeros = states - whole_part(g.alpha2)
        self.low, self.high = np.log(omega[[0, -1]])
        self.middle = np.clip(np.log(g.a0) / g.alpha2, self.low, self.high)
        self.weight = 1.0 / np.sqrt(omega.size)

    def fit(self, shift: float) -> tuple[float, Floats]:
        lower, upper = self._box()
        found = least_squares(
            self._residual,
            np.clip(self._start(shift), lower + 1e-6, upper - 1e-6),
            jac=self._jacobian,
            bounds=(lower, upper),
            xtol=1e-10,
            ftol=1e-10,
            gtol=1e-12,
            max_nfev=_EVALUATIONS,
        )
        return float(found.cost), np.asarray(found.x)

    def zeros_and_poles(self, x: Floats) -> tuple[Floats, Complexes]:
        omega, damping, poles, zeros = self._parts(x)
        pair = np.roots([1.0, 2.0 * damping * omega, omega**2]).astype(complex)
        return -zeros, np.concatenate([-poles, pair])

    def _start(self, shift: float) -> Floats:
        span = self.high - self.low
        poles = self.low + span * (np.arange(self.poles) + 0.5) / max(self.poles, 1)
        zeros = self.low + span * (np.arange(self.zeros) + 0.5 + shift) / max(self.zeros, 1)
        return np.concatenate([[self.middle, np.log(0.7)], poles, zeros])

    def _box(self) -> tuple[Floats, Floats]:
        margin = _BEYOND * (self.high - self.low)
        count = self.poles + self.zeros
        lower = np.r_[self.low, np.log(_DAMPING[0]), np.full(count, self.low - margin)]
        upper = np.r_[self.high, np.log(_DAMPING[1]), np.full(count, self.high + margin)]
        return lower, upper

    def _parts(self, x: Floats) -> tuple[float, float, Floats, Floats]:
        values = np.exp(x)
        end = 2 + self.poles
        return float(values[0]), float(values[1]), values[2:end], values[end:]

    def _residual(self, x: Floats) -> Floats:
        omega, damping, poles, zeros = self._parts(x)
        s = self.s[:, np.newaxis]
        pair = 1.0 + 2.0 * damping * self.s / omega + (self.s / omega) ** 2
        value = np.log1p(s / zeros).sum(axis=1) - np.log1p(s / poles).sum(axis=1) - np.log(pair)
        return self._real(value - self.target)

    def _jacobian(self, x: Floats) -> Floats:
        omega, damping, poles, zeros = self._parts(x)
        s, scaled = self.s[:, np.newaxis], self.s / omega
        pair = 1.0 + 2.0 * damping * scaled + scaled**2
        columns = [
            ((2.0 * damping * scaled + 2.0 * scaled**2) / pair)[:, np.newaxis],
            (-2.0 * damping * scaled / pair)[:, np.newaxis],
            s / (poles + s),
            -s / (zeros + s),
        ]
        return self._real(np.concatenate(columns, axis=1))

    def _real(self, value: Complexes) -> Floats:
        return np.asarray(np.concatenate([value.real, value.imag]) * self.weight)
