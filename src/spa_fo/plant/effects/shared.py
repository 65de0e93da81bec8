"""What several effects share: creep's spectrum, a moment, lags, knots."""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import (
    USUAL_RISE_S,
    Parameter,
    amplitude,
    lateness,
    shape,
    share,
)
from spa_fo.plant.memory import FINEST_STEP_S

CURVE_KNOTS_DEG = (-10.0, 0.0, 12.0, 24.0, 36.0, 48.0, 60.0, 75.0, 90.0)
"""Angles through which an unknown sensor curve is drawn, a natural cubic spline; right at 0°."""
_ZERO_KNOT = CURVE_KNOTS_DEG.index(0.0)


def _straight_beyond(spline: CubicSpline) -> PPoly:
    """Let a natural spline go on straight beyond its ends, where it is not bent."""
    ends = spline.x[[0, -1]]
    (low, high), slopes = spline(ends), spline(ends, 1)
    none = np.zeros_like(low)
    before, after = (none, none, slopes[0], low - slopes[0]), (none, none, slopes[1], high)
    pieces = np.concatenate([[before], spline.c.swapaxes(0, 1), [after]])
    return PPoly(pieces.swapaxes(0, 1), np.array([ends[0] - 1.0, *spline.x, ends[1] + 1.0]))


CURVE_SPLINES = _straight_beyond(
    CubicSpline(
        CURVE_KNOTS_DEG,
        np.delete(np.eye(len(CURVE_KNOTS_DEG)), _ZERO_KNOT, axis=1),
        bc_type="natural",
    )
)
"""What a unit error of an unknown sensor curve at each knot but 0° makes of it."""
CREEP_TIMES_S = np.logspace(-1.0, 3.5, 10)  # two a decade
SINCE = shape(
    "since",
    "1",
    "when, as a share of the campaign",
    centre=0.5,
    factor=100.0,  # in each tenfold of time as probable as in any other
    low=1e-5,
    high=1.0,
    starts=tuple(np.linspace(0.02, 0.98, 49).tolist()),  # a score test looks at each
)
"""The moment that an effect begins at."""
CREEP_AT_DEG = 60.0
"""The size of a creep that grows faster than what drives it is that at this angle."""
GROWTH = Parameter(
    *("growth", "1", 0.0, 0.5, 0.0, 2.0),
    starts=(0.0,),
    means="by which power more than what drives it it grows; its size is that at 60 deg",
    is_addition=True,
)
"""How creep grows faster than what drives it, as polymers do beyond small strains."""

_DECADE = 0.5  # of creep time that one element stands for


def spectrum(low: float = 0.0) -> tuple[Parameter, ...]:
    """Give a creep's spectrum: a bell over the logarithm of time, which bends with any of them.

    Narrow it is a single element, broad a logarithmic law, broad and late a power law. `low` is
    the least growth in each tenfold of time.
    """
    return (
        amplitude(
            "per_decade",
            "1",
            "growth in each tenfold of time, as a share of the angle",
            spread=0.05,
            low=low,
            high=0.5,
            start=0.03,
        ),
        shape(
            "typical_s",
            "s",
            "time about which most of it happens",
            centre=12.0,
            factor=4.0,
            low=0.1,
            high=3000.0,
            searched=(USUAL_RISE_S, np.inf),  # what comes with a step is the coefficients'
        ),
        shape(
            "decades",
            "1",
            "over how many tenfolds of time it spreads",
            centre=1.0,
            factor=1.8,
            low=0.35,
            high=5.0,
        ),
    )


@njit
def creep_sizes(per_decade: float, typical_s: float, decades: float) -> Floats:
    """Share of the static value that each of the elements at `CREEP_TIMES_S` adds in the end."""
    sizes = np.empty(CREEP_TIMES_S.size)
    for j in range(sizes.size):
        away = math.log10(CREEP_TIMES_S[j] / typical_s) / decades
        sizes[j] = per_decade * _DECADE * math.exp(-0.5 * away * away)
    return sizes


@njit
def driving(towards: float, growth: float, at: float) -> float:
    """Give what creep is a share of: what drives it, by a power that leaves `at` as it is."""
    return towards * (abs(towards) / at) ** growth if growth > 0.0 else towards


_TAIL = 4.0  # times as late as the rest. Assumed, as a sensor's of one rig that was opened.


def lag(excess: str) -> tuple[Parameter, ...]:
    """Give a lag of one pole or two, and of a tail beside them; a fall takes longer by `excess`."""
    return (
        lateness("time_constant_s", "how late a slow change comes, on the mean"),
        share(
            "second_pole",
            "part of it that a second, equal filter has: 0 is a single exponential",
            high=0.5,
        ),
        Parameter(
            *("tail_share", "1", 0.0, 0.2, 0.0, 0.45),
            starts=(0.05,),
            # Of more of it than of the rest a lag would be one of a longer time by another name.
            means="part of a change that comes four times as late as the rest",
            is_addition=True,
        ),
        Parameter(
            *(excess, "1", 0.0, 0.25, -0.7, 3.0),
            starts=(0.0,),
            means="by how much longer a fall takes than a rise, as a part of that",
            is_addition=True,
        ),
    )


@njit
def poles(time_constant: float, second: float, tail: float) -> tuple[float, float, float]:
    """Share a mean lateness out to two poles in series, and to that of the tail beside them."""
    quick = time_constant / (1.0 + (_TAIL - 1.0) * tail)
    return quick * (1.0 - second), quick * second, _TAIL * quick


_SOFT_S = 0.05  # how long a switch takes: a sample or two. Assumed
_BEFORE_S = 1.0


def switched(time_s: Floats, since: float) -> Floats:
    """Go from 0 to 1 at a moment that is a share of the campaign; 0 in a series at rest."""
    if time_s[-1] < _BEFORE_S:
        return np.zeros(time_s.size)  # before anything has happened
    return np.asarray(0.5 * (1.0 + np.tanh((time_s - since * time_s[-1]) / _SOFT_S)))


REACHED_KPA = 1e-12
"""What is nearer is there: a vented line would fade to the least of numbers."""


@njit
def low_pass(p: Floats, starts: Integers, time_constant: float, venting_excess: float) -> None:
    """First-order lag; means over cells of an input that is constant in each.

    A fall takes longer than a rise by `venting_excess`, as a part of that.
    """
    if time_constant <= 0.0:
        return
    x = FINEST_STEP_S / (time_constant * np.array([1.0, 1.0 + venting_excess]))
    keeps, means = np.exp(-x), -np.expm1(-x) / x
    for trial in range(starts.size - 1):
        now = 0.0
        for i in range(starts[trial], starts[trial + 1]):
            distance = now - p[i]
            if abs(distance) < REACHED_KPA:
                now = p[i]
                continue
            falls = 1 if distance > 0.0 else 0
            p[i] += distance * means[falls]
            now += distance * (keeps[falls] - 1.0)
