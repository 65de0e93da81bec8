"""What a model says the angle of a whole log is."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from spa_fo.fractional import simulate
from spa_fo.plant.model_file import Model


def predict_deg(
    model: Model, t_s: NDArray[np.float64], pressure_kpa: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Simulate the bending angle of a log, at rest before its first sample.

    Parameters
    ----------
    model : Model
        A plain model (no effects).
    t_s : numpy.ndarray
        Times of the samples in s, shape (n,), increasing.
    pressure_kpa : numpy.ndarray
        The signal that the model's `signal` names: the commanded gauge pressure, held from each
        sample to the next, or the measured one, which runs straight between samples.

    Returns
    -------
    numpy.ndarray
        Angle in degrees, shape (n,).
    """
    g = model.transfer_function
    u = pressure_kpa / model.reference_kpa
    hold: Literal["linear", "zero"] = "zero" if model.signal == "command" else "linear"
    theta = simulate(t_s, u, g.alpha2, g.alpha1, g.a1, g.a0, g.b0, hold=hold)
    return np.degrees(theta)
