"""A rational transfer function by its zeros, poles and static gain.

Polynomial coefficients are never formed: with poles over many decades they lose the digits that
the poles hold.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from spa_fo.arrays import Floats

Complexes = NDArray[np.complex128]


@dataclass(frozen=True)
class StateSpace:
    """dx/dt = A x + B u, y = C x + D u; shapes (n, n), (n, 1), (1, n), (1, 1)."""

    A: Floats
    B: Floats
    C: Floats
    D: Floats


@dataclass(frozen=True)
class Rational:
    """H(s) = gain · Π(1 − s/z) / Π(1 − s/p), stable and with real zeros.

    Parameters
    ----------
    zeros : (m,) array
        Real, negative, rad/s.
    poles : (n,) complex array
        In the left half plane, rad/s; complex ones in conjugate pairs. n > m.
    gain : float
        Static gain, exact by construction.

    Raises
    ------
    ValueError
        There are not more poles than zeros.
    """

    zeros: Floats
    poles: Complexes
    gain: float

    def __post_init__(self) -> None:
        if not self.poles.size > self.zeros.size:
            raise ValueError("expected more poles than zeros")

    @property
    def states(self) -> int:
        """Number of poles."""
        return int(self.poles.size)

    @property
    def leading_gain(self) -> float:
        """Factor of Π(s − z) / Π(s − p), as zero-pole forms elsewhere want it."""
        poles = np.sort(np.abs(self.poles))
        count = self.zeros.size
        return float(
            self.gain * np.prod(poles[:count] / np.sort(-self.zeros)) * np.prod(poles[count:])
        )

    def response(self, omega: ArrayLike) -> Complexes:
        """Frequency response at `omega` (rad/s), same shape."""
        s = 1j * np.atleast_1d(np.asarray(omega, dtype=np.float64))[:, np.newaxis]
        # Zero by pole of about its size: the products alone would overflow.
        zeros = np.sort(self.zeros)[::-1]
        poles = self.poles[np.argsort(np.abs(self.poles), kind="stable")]
        count = zeros.size
        value = np.prod((1.0 - s / zeros) / (1.0 - s / poles[:count]), axis=1)
        value /= np.prod(1.0 - s / poles[count:], axis=1)
        return np.asarray(self.gain * value).reshape(np.shape(omega))

    def followed_by(self, lags_s: Sequence[float], leads_s: Sequence[float] = ()) -> Rational:
        """Return the product with first-order lags 1/(1 + T s) and leads 1 + T s."""
        poles, zeros = ([-1.0 / t for t in times if t > 0.0] for times in (lags_s, leads_s))
        return Rational(
            np.append(self.zeros, zeros), np.append(self.poles, poles).astype(complex), self.gain
        )

    def state_space(self) -> StateSpace:
        """Realise it as a chain of first- and second-order sections of unit static gain.

        The matrix is block triangular, so that its eigenvalues are the poles to the last digit;
        the static gain stands in the last row alone.
        """
        sections = _sections(self.zeros, self.poles)
        n = self.states
        A, B = np.zeros((n, n)), np.zeros((n, 1))
        row, feed = np.zeros(n), 1.0  # what the sections so far make of the states and of u
        at = 0
        for a, b, c, d in sections:
            size = b.size
            here = slice(at, at + size)
            A[here] += np.outer(b, row)
            A[here, here] += a
            B[here, 0] = b * feed
            row, feed = d * row, d * feed
            row[here] = c
            at += size
        return StateSpace(A, B, self.gain * row[np.newaxis], np.array([[self.gain * feed]]))

    def step(self, t: ArrayLike) -> Floats:
        """Unit-step response at any times `t` (s), same shape."""
        form = self.state_space()
        n = self.states
        augmented = np.zeros((n + 1, n + 1))
        augmented[:n, :n], augmented[:n, n:] = form.A, form.B
        times = np.asarray(t, dtype=np.float64)
        states = np.array([expm(augmented * time)[:n, n] for time in times.ravel()])
        return np.asarray((states @ form.C[0] + form.D[0, 0]).reshape(times.shape))


_Section = tuple[Floats, Floats, Floats, float]


def paired(zeros: Floats, poles: Complexes) -> list[tuple[Floats, Complexes]]:
    """Share zeros out to sections: each real pole takes one, each pair of poles two.

    Both in the order of their size |1 − z|, or |z| where they are of a continuous system: the
    caller hands them over sorted. What zeros there are too few of is missing in the pair that is
    damped least, or else in the last sections.

    Parameters
    ----------
    zeros, poles : arrays
        Sorted; of a conjugate pair of poles only the upper one; zeros real.

    Returns
    -------
    list of (zeros, poles)
        Of each section, in the order of the poles; pairs complete.
    """
    complex_ones = poles.imag > 0.0
    room = np.where(complex_ones, 2, 1)
    missing = int(room.sum()) - zeros.size
    damping = np.full(poles.size, 2.0)
    damping[complex_ones] = np.abs(poles.real[complex_ones]) / np.abs(poles[complex_ones])
    for i in [int(np.argmin(damping)), *range(poles.size - 1, -1, -1)]:
        taken = min(missing, int(room[i]))
        room[i] -= taken
        missing -= taken
    ends = np.cumsum(room)
    return [
        (
            zeros[end - size : end],
            np.array([pole, pole.conjugate()]) if pole.imag > 0.0 else np.array([pole]),
        )
        for pole, size, end in zip(poles, room, ends, strict=True)
    ]


def _sections(zeros: Floats, poles: Complexes) -> list[_Section]:
    upper = poles[poles.imag >= 0.0]
    pairs = paired(np.sort(zeros)[::-1], upper[np.argsort(np.abs(upper), kind="stable")])
    return [_first_order(p[0].real, z) if p.size == 1 else _second_order(p[0], z) for z, p in pairs]


def _first_order(pole: float, zeros: Floats) -> _Section:
    ratio = float(np.sum(pole / zeros))
    return np.array([[pole]]), np.array([-pole]), np.array([1.0 - ratio]), ratio


def _second_order(pole: complex, zeros: Floats) -> _Section:
    omega = abs(pole)
    damping = -pole.real / omega
    a = np.array([[0.0, omega], [-omega, -2.0 * damping * omega]])
    first = -float(np.sum(1.0 / zeros))
    second = 1.0 / float(np.prod(zeros)) if zeros.size == 2 else 0.0
    feed = second * omega**2
    c = np.array([1.0 - feed, first * omega - 2.0 * damping * feed])
    return a, np.array([0.0, omega]), c, feed
