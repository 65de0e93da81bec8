"""How well a model's output meets what was measured, in the terms of system identification."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def rms_error(measured: ArrayLike, predicted: ArrayLike) -> float:
    """Return the root mean square of measured − predicted."""
    return float(np.sqrt(np.mean((np.asarray(measured) - np.asarray(predicted)) ** 2)))


def fit_percent(measured: ArrayLike, predicted: ArrayLike) -> float:
    """Return the fit in per cent: 100 (1 − ‖y − ŷ‖ / ‖y − mean(y)‖), the normalised RMS error.

    100 for a perfect model, 0 for one that is no better than the mean of what was measured, less
    for a worse one (Ljung 1999, System Identification, 16.4).

    Parameters
    ----------
    measured, predicted : array_like
        y and ŷ, any shape.

    Returns
    -------
    float
        NaN where y does not vary: then there is nothing to explain.
    """
    y = np.asarray(measured, dtype=np.float64)
    spread = float(np.linalg.norm(y - y.mean()))
    if spread <= 0.0:
        return float("nan")
    error = float(np.linalg.norm(y - np.asarray(predicted, dtype=np.float64)))
    return 100.0 * (1.0 - error / spread)
