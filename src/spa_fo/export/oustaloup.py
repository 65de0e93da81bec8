"""Oustaloup's recursive filter for s^γ, and G(s) made of two of them.

A. Oustaloup, F. Levron, B. Mathieu and F. M. Nanot, "Frequency-band complex noninteger
differentiator: characterization and synthesis", IEEE Trans. Circuits Syst. I 47 (2000) 25-39,
doi:10.1109/81.817385.

Each order is split as s^α = s^n s^(α−n) with the whole number n = 1 or 2 nearest to α, and only
s^(α−n), |α − n| ≤ ½ (for α < ½ down to −1), is approximated. So every term but a0 vanishes at
s = 0 and the static gain b0/a0 is exact, however the filters err there; and beyond the band the
response still falls by a whole power of s near the right one. Since the filter's zeros and poles
alternate, its phase stays between 0 and γ·90°, that of each term between 0 and 180°, and by the
argument principle every approximation is stable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.export.rational import Complexes, Rational
from spa_fo.plant import TransferFunction


@dataclass(frozen=True)
class Operator:
    """s^α ≈ s^n · gain · Π(s − z)/Π(s − p).

    Attributes
    ----------
    order : float
        α.
    whole : int
        n.
    zeros, poles : (2N + 1,) arrays
        Real, negative, rad/s; empty where α is whole.
    gain : float
        Of the filter.
    """

    order: float
    whole: int
    zeros: Floats
    poles: Floats
    gain: float

    def response(self, omega: Floats) -> Complexes:
        """Frequency response at `omega` (rad/s)."""
        s = 1j * np.asarray(omega, dtype=np.float64)[:, np.newaxis]
        fractional = np.prod((s - self.zeros) / (s - self.poles), axis=1)
        return np.asarray(self.gain * s[:, 0] ** self.whole * fractional)


def oustaloup(exponent: float, low: float, high: float, order: int) -> tuple[Floats, Floats, float]:
    """Zeros, poles and gain of Oustaloup's filter.

    Parameters
    ----------
    exponent : float
        γ, −1 < γ < 1.
    low, high : float
        Transitional frequencies ω_b and ω_h, rad/s.
    order : int
        N; the filter has 2N + 1 zeros and poles.

    Returns
    -------
    zeros, poles : (2N + 1,) arrays
        Negative, rad/s.
    gain : float
        K of K Π(s − z)/Π(s − p); |filter| = ω^γ at the middle of the band.
    """
    count = 2 * order + 1
    k = np.arange(count)
    ratio = high / low
    zeros = low * ratio ** ((k + 0.5 * (1.0 - exponent)) / count)
    poles = low * ratio ** ((k + 0.5 * (1.0 + exponent)) / count)
    return -zeros, -poles, float(high**exponent)


def whole_part(order: float) -> int:
    """Return n of s^α = s^n s^(α−n): never 0, so that the static gain is exact."""
    return 2 if order > 1.5 else 1


def operator(order: float, low: float, high: float, n: int) -> Operator:
    """Approximate s^order by `oustaloup` with N = `n`."""
    whole = whole_part(order)
    if order == whole:
        none = np.empty(0)
        return Operator(order, whole, none, none, 1.0)
    return Operator(order, whole, *oustaloup(order - whole, low, high, n))


def whole_system(g: TransferFunction, upper: Operator, lower: Operator) -> Rational:
    """Put the operators of α2 and α1 into G.

    The zeros of G are the operators' poles. Its poles are the eigenvalues of the loop
    s^n2 F2 y = b0 u − a0 y − a1 s^n1 F1 y with the filters in modal form: a diagonal matrix and a
    few full rows, which keeps every digit.
    """
    zeros = np.concatenate([upper.poles, lower.poles])
    matrix = _loop(g, upper, lower)
    # Balancing is part of eigvals; conjugate pairs come out exactly conjugate.
    poles = np.linalg.eigvals(matrix).astype(complex)
    return Rational(zeros, poles, g.gain)


def _loop(g: TransferFunction, upper: Operator, lower: Operator) -> Floats:
    """Return the state matrix: filters' states x, and one or two integrators w, v.

    With F_n = D_n + C_n x_n the sum of all terms of whole part n: dw/dt = v − F1 y, dv/dt = −a0 y
    and F2 y = w; without an F2 there is no v and F1 y = w.
    """
    poles, into, out, term = [], [], [], []
    direct = {1: 0.0, 2: 0.0}
    for part, factor in ((upper, 1.0), (lower, g.a1)):
        direct[part.whole] += factor * part.gain
        residues = factor * _residues(part)
        scale = np.sqrt(np.abs(residues))
        poles.append(part.poles)
        into.append(scale)
        out.append(np.sign(residues) * scale)
        term.append(np.full(scale.size, part.whole))
    p, b, c, n = (np.concatenate(parts) for parts in (poles, into, out, term))
    size, top = p.size, max(upper.whole, lower.whole)
    A = np.zeros((size + top, size + top))
    y = np.zeros(size + top)  # the output as a row of the states
    y[:size] = -np.where(n == top, c, 0.0) / direct[top]
    y[size] = 1.0 / direct[top]
    A[:size, :size] = np.diag(p)
    A[:size] += np.outer(b, y)
    A[-1] = -g.a0 * y
    if top == 2:
        A[size, size + 1] = 1.0
        A[size, :size] -= np.where(n == 1, c, 0.0)
        A[size] -= direct[1] * y
    return A


def _residues(part: Operator) -> Floats:
    """Residues of gain Π(s − z)/Π(s − p) at its poles."""
    z, p = part.zeros, part.poles
    residues = np.empty(p.size)
    for i in range(p.size):
        others = np.arange(p.size) != i
        residues[i] = (p[i] - z[i]) * np.prod((p[i] - z[others]) / (p[i] - p[others]))
    return np.asarray(part.gain * residues)
