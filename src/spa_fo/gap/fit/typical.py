"""Coefficients that a soft actuator as fast and as strong as a given model usually has."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from spa_fo.fractional import step_response
from spa_fo.gap.data.searched import at_rate
from spa_fo.plant.paper import TABLE_I

Floats = NDArray[np.float64]

_RISEN = 0.63
_FASTEST, _SLOWEST = 100.0, 0.01  # as fast as the paper's actuators
_SAMPLES = 400


def typical(given: Floats, horizon_s: float) -> Floats:
    """Give the paper's actuators, as fast and as strong as a given model.

    A model that was fitted to a gap has bent with it: its damping may have vanished, or its
    inertia, and with it what tells the search the way back.

    Parameters
    ----------
    given : (5,) array
        Coefficients of the model.
    horizon_s : float
        Length of the steps that it was fitted to, s.

    Returns
    -------
    (5,) array
        Coefficients; of both actuators of Table I the mean.
    """
    usual = np.mean([x.as_array() for x in TABLE_I.values()], axis=0)
    rise = np.log(_rise_s(given, horizon_s))

    def later(log_rate: float) -> float:
        return float(np.log(_rise_s(at_rate(usual, float(np.exp(log_rate))), horizon_s)) - rise)

    ends = np.log(_SLOWEST), np.log(_FASTEST)
    signs = [later(end) for end in ends]
    if signs[0] * signs[1] < 0.0:
        log_rate = float(brentq(later, *ends, xtol=1e-3))
    else:
        log_rate = float(ends[int(np.argmin(np.abs(signs)))])
    x = at_rate(usual, float(np.exp(log_rate)))
    end = np.array([horizon_s])
    x[4] *= float(step_response(end, *given)[0] / step_response(end, *x)[0])
    return np.asarray(x)


def _rise_s(x: Floats, horizon_s: float) -> float:
    """Time at which most of the response at the horizon is reached, s."""
    time = np.geomspace(1e-4, 1.0, _SAMPLES) * horizon_s
    y = step_response(time, *x)
    return float(time[int(np.argmax(y >= _RISEN * y[-1]))])
