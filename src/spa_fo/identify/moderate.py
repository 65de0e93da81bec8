"""The free optimum, but no longer a memory than the data ask for.

A small alpha1 means a creep that goes on for decades of time. Records of some time constants
hardly tell it from a constant, yet the static gain and every prediction of a long hold hang on it:
at equal fit they may be off by a third. So alpha1 is held above a floor, first the paper's own
lower bound, and a lower floor is taken only where it makes the fit visibly better.
"""

from __future__ import annotations

from collections.abc import Callable

from spa_fo.identify.bounds import ORDER_GAP, Bounds, free_bounds
from spa_fo.identify.polish import Optimum
from spa_fo.plant.paper import BOUNDS

FLOORS = (BOUNDS["alpha1"][0], 0.5, 0.2, ORDER_GAP)
"""Lower bounds of alpha1, tried in this order."""
WORTH = 0.02
"""A lower floor must take this fraction off the sum of squares (1 % of the RMSE)."""


def moderate_optimum(fit: Callable[[Bounds], Optimum]) -> Optimum:
    """Return the optimum above the highest floor that fits as well as any lower one.

    Parameters
    ----------
    fit : callable
        From bounds to the optimum within them.
    """
    best = fit(free_bounds(FLOORS[0]))
    for floor in FLOORS[1:]:
        if "alpha1 lower" not in best.at_bounds:
            break
        lower = fit(free_bounds(floor))
        if lower.sum_squares < (1.0 - WORTH) * best.sum_squares:
            best = lower
    return best
