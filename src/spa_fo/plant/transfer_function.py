"""The fractional-order model of the bending angle."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

PARAMETERS = ("alpha2", "alpha1", "a1", "a0", "b0")
"""Names of the five parameters, in the order of every array of parameters."""

ORDER_LIMIT = 2.0
"""Both orders are above zero; alpha2 is this at most, where the actuator has a mass."""


@dataclass(frozen=True)
class TransferFunction:
    """G(s) = b0 / (s^alpha2 + a1 s^alpha1 + a0), Eq. 11 of arXiv:2512.18213.

    The input is u = pressure / reference pressure (dimensionless), the output the bending angle
    in rad; time in s.

    Parameters
    ----------
    alpha2, alpha1 : float
        Orders, 0 < alpha1 < alpha2 <= 2.
    a1, a0, b0 : float
        Coefficients; a1 and a0 are positive.

    Raises
    ------
    ValueError
        A parameter is not finite or out of its range; the text names it.
    """

    alpha2: float
    alpha1: float
    a1: float
    a0: float
    b0: float

    def __post_init__(self) -> None:
        for name, value in zip(PARAMETERS, astuple(self), strict=True):
            if not math.isfinite(value):
                raise ValueError(f"{name} must be a finite number, not {value}")
        if not 0 < self.alpha1 < self.alpha2 <= ORDER_LIMIT:
            raise ValueError(
                "the orders must satisfy 0 < alpha1 < alpha2 <= 2, "
                f"not alpha1 = {self.alpha1}, alpha2 = {self.alpha2}"
            )
        for name in ("a1", "a0"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name} must be positive, not {getattr(self, name)}")

    @classmethod
    def from_array(cls, x: ArrayLike) -> Self:
        """Make one from five numbers in the order of `PARAMETERS`."""
        alpha2, alpha1, a1, a0, b0 = (float(value) for value in np.asarray(x).ravel())
        return cls(alpha2, alpha1, a1, a0, b0)

    def as_array(self) -> NDArray[np.float64]:
        """Return the parameters, shape (5,), in the order of `PARAMETERS`."""
        return np.array(astuple(self), dtype=np.float64)

    @property
    def gain(self) -> float:
        """Static gain K = b0 / a0, rad for u = 1."""
        return self.b0 / self.a0
