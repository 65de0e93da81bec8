"""Discrete filters: second-order sections for one sampling period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.signal import cont2discrete

from spa_fo.arrays import Floats
from spa_fo.export.rational import Complexes, Rational, paired

HOLDS = ("zoh", "tustin")
_REAL = 1e-3  # relative imaginary part of two zeros that coincide but for rounding
_FAR = 1e6  # zeros farther from the unit circle are numerical infinities


@dataclass(frozen=True)
class DiscreteFilter:
    """Sections for `scipy.signal.sosfilt`, and whole samples of delay before them.

    Attributes
    ----------
    sos : (sections, 6) array
        b0, b1, b2, 1, a1, a2 (b2 = a2 = 0 for a real pole); each of unit static gain but the
        last, which carries the gain.
    sample_time_s : float
        Sampling period.
    hold : {"zoh", "tustin"}
        Input held from sample to sample, or trapezoidal.
    delay_samples : int
        Nearest to the dead time.
    """

    sos: Floats
    sample_time_s: float
    hold: str
    delay_samples: int

    def run(self, u: NDArray[np.floating]) -> NDArray[np.floating]:
        """Filter samples of u, at rest before; in single precision where u is."""
        from scipy.signal import sosfilt

        late = np.concatenate([np.zeros(self.delay_samples, u.dtype), u])[: u.size]
        return np.asarray(sosfilt(self.sos.astype(u.dtype), late))


def discretise(
    rational: Rational, sample_time_s: float, hold: str = "zoh", delay_s: float = 0.0
) -> DiscreteFilter:
    """Turn a rational function into a discrete filter.

    Parameters
    ----------
    rational : Rational
        In continuous time.
    sample_time_s : float
        Sampling period, s.
    hold : {"zoh", "tustin"}
        zoh is exact for an input that is held from one sample to the next, as a command is;
        tustin takes it as straight between samples, to second order.
    delay_s : float
        Dead time, rounded to whole samples.

    Raises
    ------
    ValueError
        The hold is neither.
    """
    if hold not in HOLDS:
        raise ValueError(f"expected a hold of {', '.join(HOLDS)}, not {hold!r}")
    make = _held if hold == "zoh" else _tustin
    zeros, poles = make(rational, sample_time_s)
    sos = _sections(zeros, poles)
    sos[-1, :3] *= rational.gain
    return DiscreteFilter(sos, sample_time_s, hold, round(delay_s / sample_time_s))


def _held(rational: Rational, T: float) -> tuple[Floats, Complexes]:
    """Poles map by e^{pT}; the zeros are those of the sampled state-space form."""
    form = rational.state_space()
    A, B, C, D, _ = cont2discrete((form.A, form.B, form.C, form.D), T, method="zoh")
    n = rational.states
    pencil, mass = np.block([[A, B], [C, D]]), np.zeros((n + 1, n + 1))
    mass[:n, :n] = np.eye(n)
    found = eigvals(pencil, mass)
    zeros = found[np.isfinite(found) & (np.abs(found) < _FAR)]
    if np.any(np.abs(zeros.imag) > _REAL * np.abs(1.0 - zeros)):
        raise ValueError("the sampled zeros are complex; take another sampling period, or tustin")
    return np.asarray(zeros.real), np.exp(rational.poles * T)


def _tustin(rational: Rational, T: float) -> tuple[Floats, Complexes]:
    missing = rational.poles.size - rational.zeros.size
    zeros = (2.0 + rational.zeros * T) / (2.0 - rational.zeros * T)
    poles = (2.0 + rational.poles * T) / (2.0 - rational.poles * T)
    return np.append(zeros, np.full(missing, -1.0)), poles


def _sections(zeros: Floats, poles: Complexes) -> Floats:
    """Sections of unit static gain, the slowest first: a row for each real pole, or pair.

    Two slow poles in one row would lose digits: 1 − 2r + r² is lost before 1 − r is. A zero that
    is missing is a delay of one sample.
    """
    upper = poles[poles.imag >= 0.0]
    order = np.argsort(np.abs(1.0 - upper), kind="stable")
    zeros = zeros[np.argsort(np.abs(1.0 - zeros), kind="stable")]
    rows = []
    for z, p in paired(zeros, upper[order]):
        above, below = np.atleast_1d(np.poly(z)), np.real(np.poly(p))
        above = np.concatenate([np.zeros(p.size - z.size), above])
        above *= np.real(np.prod(1.0 - p)) / np.prod(1.0 - z)
        empty = np.zeros(3 - below.size)
        rows.append(np.concatenate([above, empty, below, empty]))
    return np.array(rows)
