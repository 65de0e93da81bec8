"""The end of the reading's way: what happens to it together with its noise.

A channel that holds its last value holds that value's noise too, and one that reads a magnitude
folds the noise over with the angle; both come after noise has been added, before the converter.
Neither happens in the fixture of a calibration.
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
    for effect in effects:
        if effect.amplitude == 0.0:
            continue
        if effect.id == "unsigned_reading":
            read = _unsigned(effect, read)
        elif effect.id == "sensor_freeze":
            read = _frozen(effect, read, times, when)
    return read


def _unsigned(e: Effect, read: Floats) -> Floats:
    """Fold the reading over at an angle that it is never below; the amplitude moves that angle up.

    The fixture tells the sign, and a calibration keeps it: what is known of the zero has been taken
    off again, so that the reading of what bends beyond the fold is right.
    """
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
