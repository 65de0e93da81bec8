"""Free-form laws as smooth functions with a prior: knots, and how their values vary there.

Beforehand a law's values at its knots are Gaussian with the covariance that a curvature prior
leaves, ∫ f''² being charged (Wahba 1990, doi:10.1137/1.9781611970128); what gain and coefficients
can do, its straight part over what was visited, is taken out, and it is 0 at 0. A law over the
trials' order is charged for its changes and has no mean. Relaxation times are independent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import null_space, solve_triangular

from spa_fo.arrays import Floats
from spa_fo.plant.law import Law

ORDERED = ("trial_gain", "trial_rest")
"""Places of laws over the trials' order."""

_KNOTS, _SIGNED_KNOTS = 7, 9
_OF_EITHER_SIGN = ("filling", "damping")
_TIMES = 6
_QUICKEST_S = 0.3  # relaxation time: what is quicker looks like damping
_EDGE = 0.5  # per cent of the steps on either side that say nothing of the range
_ROUNDING = 1e-6  # of what was visited
_FINE = 60  # points that a curve is drawn with


@dataclass(frozen=True)
class Basis:
    """A law before it is fitted: its values at `knots` are `shape` times standard normal numbers.

    `line`, (k,), is what gain and coefficients do there: straight, or over the trials a constant.
    `taken`, (k,), is the mean that says how much of it is in values at the knots.
    """

    place: str
    knots: Floats  # (k,)
    shape: Floats  # (k, m); beforehand the law is 1 in size, RMS over what was visited
    over: Floats  # (n,), what was visited, where a curve is drawn
    line: Floats
    taken: Floats
    keeps_line: bool = False  # whether the law may be straight

    @property
    def is_odd(self) -> bool:
        """Whether it is 0 at 0 and may go on below: a law of the motion."""
        return self.place not in ORDERED

    @property
    def size(self) -> int:
        """How many coefficients it has."""
        return int(self.shape.shape[1])

    def law(self, e: Floats) -> Law:
        """Return the law of these coefficients."""
        return Law(self.place, self.knots, self.shape @ e)

    def coefficients(self, values: Floats) -> Floats:
        """Give the coefficients nearest to values at the knots, (k,) or (k, j)."""
        return np.asarray(np.linalg.lstsq(self.shape, values, rcond=None)[0])

    def without(self, column: int) -> Basis:
        """Leave one coefficient out."""
        return replace(self, shape=np.delete(self.shape, column, axis=1))

    def curve(self, at: Floats) -> Floats:
        """Give the matrix from coefficients to the curve's values, (n, m)."""
        if self.place == "relaxation":
            return self.shape
        return _splines(self.knots, at) @ self.shape


def motion_basis(place: str, over: Floats, weight: Floats, straight: bool = False) -> Basis:
    """Lay a law over a signal, (n,), `weight` being how long it stayed there.

    `straight` says whether the law keeps its straight part.
    """
    low, high = np.percentile(over, [_EDGE, 100.0 - _EDGE])
    low, high = min(float(low), 0.0), max(float(high), 0.0)
    # Beside the other side of it what only rounding visited is none.
    low, high = (end if abs(end) > _ROUNDING * (high - low) else 0.0 for end in (low, high))
    if place in _OF_EITHER_SIGN:
        # Closer about 0, where friction and valves bend.
        share = np.linspace(-1.0, 1.0, _SIGNED_KNOTS)
        knots = np.unique(np.where(share < 0.0, -low, high) * share * np.abs(share))
    else:
        knots = np.linspace(low, high, _KNOTS)
        knots[np.argmin(np.abs(knots))] = 0.0
    held, charged = (knots == 0.0).astype(np.float64)[None, :], _curvature(knots)
    if straight:
        # A slope is as likely as a curvature that turns by as much over the range.
        ends = np.zeros(knots.size)
        ends[[0, -1]] = -1.0, 1.0
        charged, taken = charged + np.outer(ends, ends), np.zeros(knots.size)
    else:
        taken = (weight * over) @ _splines(knots, over)
        taken = taken / (taken @ knots)
        held = np.vstack([held, taken])
    shape, drawn = _shape(charged, null_space(held)), np.linspace(low, high, _FINE)
    return _scaled(Basis(place, knots, shape, drawn, knots, taken, straight))


def order_basis(place: str, orders: Floats) -> Basis | None:
    """Lay a law over the trials' order; None where there are too few."""
    unique = np.unique(orders)
    if unique.size < 4:
        return None
    knots = unique[np.unique(np.linspace(0, unique.size - 1, _KNOTS).round().astype(int))]
    steps = np.diff(np.eye(knots.size), axis=0)
    charged = steps.T @ (steps / np.diff(knots)[:, None]) * float(np.ptp(knots))
    mean = _splines(knots, unique).mean(axis=0)
    shape = _shape(charged, null_space(mean[None, :]))
    over, one = np.linspace(knots[0], knots[-1], _FINE), np.ones(knots.size)
    return _scaled(Basis(place, knots, shape, over, one, mean, True))


def relaxation_basis(longest_s: float) -> Basis:
    """Lay a spectrum over relaxation times up to the longest of a trial."""
    times = np.geomspace(_QUICKEST_S, max(longest_s, 4.0 * _QUICKEST_S), _TIMES)
    none = np.zeros(_TIMES)
    return Basis("relaxation", times, np.eye(_TIMES), times, none, none)


def _splines(knots: Floats, over: Floats) -> Floats:
    """Natural splines of unit values at each knot, straight beyond, (n, k)."""
    return np.column_stack([Law("moment", knots, row).at(over) for row in np.eye(knots.size)])


def _curvature(knots: Floats) -> Floats:
    """∫ f''² over the range, the range being 1, as a matrix over values at the knots."""
    x = knots / float(np.ptp(knots))
    second = CubicSpline(x, np.eye(x.size), bc_type="natural")(x, 2)
    width = np.diff(x)
    # The second derivative is straight between the knots.
    mass = (np.diag(np.append(width, 0.0)) + np.diag(np.append(0.0, width))) / 3.0
    mass += (np.diag(width, 1) + np.diag(width, -1)) / 6.0
    return np.asarray(second.T @ mass @ second)


def _shape(charged: Floats, free: Floats) -> Floats:
    """Give values at the knots for standard normal numbers under a quadratic charge."""
    root = np.linalg.cholesky(free.T @ charged @ free)
    return np.asarray(free @ solve_triangular(root, np.eye(free.shape[1]), lower=True).T)


def _scaled(basis: Basis) -> Basis:
    """Make the law 1 in size beforehand."""
    size = float(np.sqrt(np.mean(np.sum(basis.curve(basis.over) ** 2, axis=1))))
    return replace(basis, shape=basis.shape / size)
