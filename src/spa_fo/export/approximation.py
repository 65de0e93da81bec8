"""Rational approximations of G over a band."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from spa_fo.export.fitted import fit_poles_and_zeros
from spa_fo.export.oustaloup import Operator, operator, whole_system
from spa_fo.export.rational import Rational
from spa_fo.plant import TransferFunction

METHODS = ("fitted", "oustaloup")
"""Most accurate at equal order first (benchmarks/README.md)."""
DEFAULT_ORDER = {"fitted": 10, "oustaloup": 5}
_ORDERS = {"fitted": (3, 24), "oustaloup": (1, 25)}
# The approximation reaches this factor beyond either end of the band: at the very ends of its own
# Oustaloup's filter errs by half the phase, and a step holds all frequencies.
_MARGIN = {"fitted": 3.0, "oustaloup": 10.0}
_DECADES = 100.0  # the band beyond the model's own time scales, a factor
_LEAST = 3.0  # what the sampling rate leaves of it at the least
_WIDEST = 1e9
_APART = 300.0  # of the model's two time scales, at most


@dataclass(frozen=True)
class Band:
    """Angular frequencies between which an approximation is to hold, rad/s.

    Raises
    ------
    ValueError
        They are not two rising positive numbers, or absurdly far apart.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        if not 0.0 < self.low < self.high < math.inf:
            raise ValueError(
                f"expected two rising positive frequencies, not {self.low:g} and {self.high:g}"
            )
        if self.high / self.low > _WIDEST:
            raise ValueError(f"expected at most nine decades, not {self.low:g} to {self.high:g}")

    def widened(self, factor: float) -> Band:
        """Return the band with both ends moved outwards by a factor, as far as it may be wide."""
        factor = min(factor, math.sqrt(0.999 * _WIDEST * self.low / self.high))
        return Band(self.low / factor, self.high * factor) if factor > 1.0 else self


@dataclass(frozen=True)
class Approximation:
    """A rational function in place of G.

    Attributes
    ----------
    method : str
        One of `METHODS`.
    order : int
        N of Oustaloup's filters, or the number of poles fitted.
    band, reach : Band
        Where it is to hold, and the wider one it was made for.
    rational : Rational
        The whole of G.
    operators : tuple of Operator
        Filters of s^α2 and s^α1; empty where G was fitted as a whole.
    """

    method: str
    order: int
    band: Band
    reach: Band
    rational: Rational
    operators: tuple[Operator, ...] = ()


def default_band(g: TransferFunction, sample_time_s: float | None = None) -> Band:
    """Take the band from the model's own time scales, and from the sampling where it is known.

    The terms of the denominator weigh alike at a0^(1/α2) and (a0/a1)^(1/α1); the band goes two
    decades beyond both, and at its upper end no further than half the sampling rate (but at
    least half a decade beyond the faster scale). The second counts as 300 times from the first at
    most: with a small α1 it lies where nothing was ever measured.

    Parameters
    ----------
    g : TransferFunction
        The model.
    sample_time_s : float, optional
        Of the logs it was identified from, or of the filter that is to be made.
    """
    first = math.log(g.a0) / g.alpha2
    second = (math.log(g.a0) - math.log(g.a1)) / g.alpha1
    second = min(max(second, first - math.log(_APART)), first + math.log(_APART))
    scales = (math.exp(first), math.exp(second))
    low, high = min(scales) / _DECADES, max(scales) * _DECADES
    if sample_time_s is not None:
        high = min(high, max(math.pi / sample_time_s, _LEAST * max(scales)))
    return Band(max(low, high / _WIDEST), high)


def approximate(
    g: TransferFunction,
    method: str = "fitted",
    band: Band | None = None,
    order: int | None = None,
) -> Approximation:
    """Approximate G by a rational function with the exact static gain.

    Parameters
    ----------
    g : TransferFunction
        The model.
    method : {"fitted", "oustaloup"}
        Poles and zeros of the whole fitted to the frequency response, or Oustaloup's filter for
        each fractional power.
    band : Band, optional
        Where it is to hold; `default_band` unless given.
    order : int, optional
        Number of poles (fitted, 3 to 24), or N of Oustaloup's filters with 2N + 1 poles each
        (1 to 25).

    Raises
    ------
    ValueError
        The method is unknown or the order out of its range.
    """
    if method not in METHODS:
        raise ValueError(f"expected a method of {', '.join(METHODS)}, not {method!r}")
    order = DEFAULT_ORDER[method] if order is None else order
    least, most = _ORDERS[method]
    if not least <= order <= most:
        raise ValueError(f"expected an order of {least} to {most} for {method}, not {order}")
    band = default_band(g) if band is None else band
    reach = band.widened(_MARGIN[method])
    made = _MAKE[method](g, reach, order)
    return Approximation(method, order, band, reach, *made)


_Made = tuple[Rational, tuple[Operator, ...]]


def _by_oustaloup(g: TransferFunction, reach: Band, order: int) -> _Made:
    upper, lower = (operator(a, reach.low, reach.high, order) for a in (g.alpha2, g.alpha1))
    return whole_system(g, upper, lower), (upper, lower)


def _by_fit(g: TransferFunction, reach: Band, order: int) -> _Made:
    return fit_poles_and_zeros(g, reach.low, reach.high, order), ()


_MAKE: dict[str, Callable[[TransferFunction, Band, int], _Made]] = {
    "fitted": _by_fit,
    "oustaloup": _by_oustaloup,
}
