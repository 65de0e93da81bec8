r"""The step response as a series of Prabhakar functions, as it should read and as printed.

Inverting b0/(s D(s)) term by term gives

.. math:: y(t) = b_0 \sum_k (-a_1)^k t^{(α_2-α_1)k + α_2}
          E^{k+1}_{α_2, (α_2-α_1)k + α_2 + 1}(-a_0 t^{α_2}).

Eq. 15 of arXiv:2512.18213 prints the exponent (α2−α1)k + 1 and the index (α2−α1)k + 2 instead.
That series is the inverse transform of b0 s^(α2−2)/D(s), which decays to 0 and not to b0/a0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo.fractional.step import inverse_points


def prabhakar_series_step(
    t: ArrayLike,
    alpha2: float,
    alpha1: float,
    a1: float,
    a0: float,
    b0: float,
    printed: bool = False,
) -> NDArray[np.float64]:
    """Sum of the series of Prabhakar functions for the unit-step response.

    Both series are summed by inverting their Laplace transforms, b0/(s D(s)) and
    b0 s^(α2−2)/D(s), on a contour: in double precision the series themselves lose a factor that
    grows exponentially with t and have no digit left after some 13 s for the paper's actuators.

    Parameters
    ----------
    t : array_like
        Times in s, not negative.
    alpha2, alpha1, a1, a0, b0 : float
        As for `step_response`.
    printed : bool
        False: the corrected series, equal to `step_response`. True: Eq. 15 as printed in
        arXiv:2512.18213. Only its comparison with the former is of use.

    Returns
    -------
    ndarray
        The sum, same shape as t.

    Raises
    ------
    ValueError
        As for `step_response`.
    """
    power = float(alpha2) - 2.0 if printed else -1.0
    return inverse_points(t, power, alpha2, alpha1, a1, a0, b0)
