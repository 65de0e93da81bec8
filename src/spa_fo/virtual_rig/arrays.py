"""Types the stations share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]

# A running effect: takes the next stretch of a signal, remembers its state, returns the stretch
# it makes of it. Stretches may be of any length, so a live board can run it sample by sample.
Process: TypeAlias = Callable[[Array], Array]


class Effect(Protocol):
    """What a stage may be given: its sizes, and a way to start it at rest."""

    def begin(self, step_s: float) -> Process:
        """Start it at rest, to be run every `step_s`."""


def chain(processes: list[Process]) -> Process:
    """One process that runs `processes` one after the other."""

    def advance(signal: Array) -> Array:
        for process in processes:
            signal = process(signal)
        return signal

    return advance
