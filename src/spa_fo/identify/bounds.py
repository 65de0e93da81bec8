"""Where the parameters are searched: the paper's box, that box widened, and a loose one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.plant.paper import BOUNDS, TABLE_I
from spa_fo.plant.transfer_function import ORDER_LIMIT, PARAMETERS

ORDER_GAP = 0.02
"""The orders are kept this far apart, and from 0 and 2: closer they are one and the same."""


@dataclass(frozen=True)
class Bounds:
    """A box for the five parameters; arrays of shape (5,) in the order of `PARAMETERS`.

    Raises
    ------
    ValueError
        A bound is not finite, the two are reversed, or a coefficient may vanish.
    """

    name: str
    lower: Floats
    upper: Floats

    def __post_init__(self) -> None:
        for name, low, high in zip(PARAMETERS, self.lower, self.upper, strict=True):
            if not (np.isfinite(low) and np.isfinite(high)):
                raise ValueError(f"bounds of {name} must be finite, not {low}, {high}")
            if low > high:
                raise ValueError(f"bounds of {name} are reversed: {low:g} > {high:g}")
            if low <= 0:
                raise ValueError(f"the lower bound of {name} must be positive, not {low:g}")
        if self.lower[1] + ORDER_GAP > self.upper[0] or self.upper[0] >= ORDER_LIMIT:
            raise ValueError("the bounds leave no room for 0 < alpha1 < alpha2 < 2")

    def holds(self, x: Floats) -> bool:
        """Whether `x` (5,) lies within the box."""
        return bool(np.all((x >= self.lower) & (x <= self.upper)))

    def touched(self, x: Floats, tolerance: float = 1e-6) -> tuple[str, ...]:
        """Return where `x` (5,) lies on the box, such as ``"a0 upper"``."""
        slack = tolerance * np.maximum(self.upper, 1e-300)
        marks: list[str] = []
        for i, name in enumerate(PARAMETERS):
            if x[i] <= self.lower[i] + slack[i]:
                marks.append(f"{name} lower")
            elif x[i] >= self.upper[i] - slack[i]:
                marks.append(f"{name} upper")
        return tuple(marks)


def printed_bounds() -> Bounds:
    """Return the bounds as the paper prints them; they do not hold its Table I."""
    low, high = np.array([BOUNDS[name] for name in PARAMETERS]).T
    return Bounds("printed", low, high)


def widened_bounds(design: str | None = None) -> Bounds:
    """Return the smallest box that holds the printed bounds and Table I.

    Parameters
    ----------
    design : str, optional
        The paper's actuator whose row the box must hold; both rows unless given.
    """
    printed = printed_bounds()
    rows = TABLE_I.values() if design is None else [TABLE_I[design]]
    table = np.array([x.as_array() for x in rows])
    return Bounds(
        "widened",
        np.minimum(printed.lower, table.min(axis=0)),
        np.maximum(printed.upper, table.max(axis=0)),
    )


def free_bounds(alpha1_floor: float = ORDER_GAP) -> Bounds:
    """Return loose bounds that only keep the model meaningful: the optimum of the data.

    Parameters
    ----------
    alpha1_floor : float
        Lower bound of alpha1. Towards zero a1 s^alpha1 turns into a constant beside a0, so that
        a short record says nothing of b0/a0 any more.
    """
    order = ORDER_LIMIT - ORDER_GAP
    return Bounds(
        "free",
        np.array([alpha1_floor + ORDER_GAP, alpha1_floor, 1e-3, 1e-3, 1e-4]),
        np.array([order, order - ORDER_GAP, 1e3, 1e3, 1e4]),
    )


def own_bounds(ranges: Mapping[str, Sequence[float]]) -> Bounds:
    """Return the loose bounds with some of them replaced by a user's own.

    Parameters
    ----------
    ranges : Mapping[str, sequence of two floats]
        Lower and upper bound by parameter.

    Raises
    ------
    ValueError
        A name is no parameter, or as for `Bounds`; the text names the parameter.
    """
    loose = free_bounds()
    lower, upper = loose.lower.copy(), loose.upper.copy()
    for name, (low, high) in ranges.items():
        if name not in PARAMETERS:
            raise ValueError(f"{name} is no parameter; expected one of {', '.join(PARAMETERS)}")
        lower[PARAMETERS.index(name)] = low
        upper[PARAMETERS.index(name)] = high
    # alpha1 stays below alpha2: a bound of one is a bound of the other.
    if lower[1] + ORDER_GAP <= upper[0]:
        upper[1] = min(upper[1], upper[0] - ORDER_GAP)
        lower[0] = max(lower[0], lower[1] + ORDER_GAP)
    return Bounds("own", lower, upper)
