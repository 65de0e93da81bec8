"""When the input of a log first changes: what it reads before may be its zero."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from spa_fo.arrays import Floats

_COMMAND, _PRESSURE = 0.02, 0.05  # of its range, by which it has left its first value


class Driven(Protocol):
    """Times and inputs of a log, (n,) each; None where it holds none."""

    @property
    def t_s(self) -> Floats:
        """Times, s."""

    @property
    def command_kpa(self) -> Floats | None:
        """What was commanded."""

    @property
    def pressure_kpa(self) -> Floats | None:
        """What was measured."""


def before_first_change(log: Driven) -> int:
    """Count the samples before the input first leaves its first value."""
    if log.command_kpa is not None:
        signal, threshold = log.command_kpa, _COMMAND
    elif log.pressure_kpa is not None:
        signal, threshold = log.pressure_kpa, _PRESSURE
    else:
        return int(log.t_s.size)
    moved = np.abs(signal - signal[0]) > threshold * np.ptp(signal)
    return int(np.argmax(moved)) if moved.any() else int(signal.size)


def zero_until(log: Driven) -> float:
    """Time in a log, s, before which the samples stand that `before_first_change` counts."""
    since_s = log.t_s - log.t_s[0]
    before = before_first_change(log)
    return float(since_s[before]) if before < since_s.size else float(np.inf)
