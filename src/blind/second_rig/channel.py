"""The end of the reading's way: what happens to it together with its noise.

A channel that holds its last value holds that value's noise too, and one that reads a magnitude
folds the noise over with the angle; both come after noise has been added, before the converter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from blind.second_rig.effect import Effect
from blind.second_rig.sensor import When

Floats = npt.NDArray[np.float64]


def end(effects: Sequence[Effect], read: Floats, times: Floats, when: When) -> Floats:
    """Return the reading as it reaches the converter.

    Parameters
    ----------
    effects : sequence of Effect
        Those of the channel's end act, in their order; others are passed over.
    read : ndarray, shape (m,)
        Reading at the samples (deg), with its noise.
    times : ndarray, shape (m,)
        Of the samples, from the stretch's start (s).
    when : When
        Place in the campaign.
    """
    read = unsigned(effects, read, when)
    for effect in effects:
        if effect.id == "sensor_freeze" and effect.amplitude != 0.0:
            read = _frozen(effect, read, times, when)
    return read


def unsigned(effects: Sequence[Effect], read: Floats, when: When) -> Floats:
    """Return the reading of a channel that may have lost its sign; a fixture sees that as well."""
    for effect in effects:
        if effect.id == "unsigned_reading" and effect.amplitude != 0.0:
            read = _unsigned(effect, read, when)
    return read


def _unsigned(e: Effect, read: Floats, when: When) -> Floats:
    """Fold the reading over at an angle, less which it never is; the amplitude moves that angle up.

    The first calibration still saw the sign, so the angle itself has been added again.
    """
    if when.order == 0:
        return read
    about = e.shape["lowest_deg"] + e.amplitude
    beyond = read - about
    if e.form == "norm":  # of two components, the other of which stays as it is
        return np.asarray(about + np.hypot(beyond, e.shape["across"] * e.amplitude))
    # A rectifier's two halves may be unlike.
    return np.asarray(about + np.where(beyond < 0.0, -e.shape["mirrored"] * beyond, beyond))


def _frozen(e: Effect, read: Floats, times: Floats, when: When) -> Floats:
    """Hold one value up to a moment of some trials; the amplitude is for how long (s)."""
    if not e.series[when.order] >= 0.0:  # a number only where it happens
        return read
    ends = e.series[when.order] * times[-1]
    begins = max(ends - e.amplitude, 0.0)
    # The sensor is faster than the log: what it holds lies between two samples.
    held = np.interp(begins, times, read)
    return np.where((times >= begins) & (times <= ends), held, read)
