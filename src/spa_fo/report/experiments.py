"""The experiments of a diagnosis as they are drawn: which, in what order, and which trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.diagnosis import Traces

_MOST_PANELS = 9


@dataclass(frozen=True)
class Experiment:
    """Trials of one experiment: their indices, and the one that is shown in full."""

    name: str
    trials: tuple[int, ...]
    shown: int

    @property
    def place(self) -> str:
        """Which of its trials is shown."""
        return f"trial {self.trials.index(self.shown) + 1} of {len(self.trials)}"

    @property
    def title(self) -> str:
        """Its name as people write it."""
        return self.name.replace("_", " ")


def rms(t_s: Floats, values: Floats) -> float:
    """Root mean square over time, whatever the spacing of the samples."""
    if t_s.size < 2:
        return float(np.sqrt(np.mean(values**2)))
    return float(np.sqrt(np.trapezoid(values**2, t_s) / (t_s[-1] - t_s[0])))


def experiments(traces: Traces, most: int = _MOST_PANELS) -> list[Experiment]:
    """Return the experiments of largest gap, at most so many, in the campaign's order."""
    trials: dict[str, list[int]] = {}
    for index, name in enumerate(traces.experiment):
        if np.any(traces.trial == index):
            trials.setdefault(name, []).append(index)
    every = [Experiment(name, tuple(own), shown_trial(traces, own)) for name, own in trials.items()]
    missed = {e.name: missed_rms(traces, e.shown) for e in every}
    largest = sorted(missed, key=lambda name: -missed[name])[:most]
    return [e for e in every if e.name in largest]


def worst(traces: Traces) -> Experiment:
    """Return the experiment whose shown trial the plain model misses most."""
    return experiments(traces, most=1)[0]


def shown_trial(traces: Traces, trials: Sequence[int]) -> int:
    """Return the last trial that took no part, else the last one."""
    return max(trials, key=lambda i: (bool(traces.held_out[i]), i))


def missed_rms(traces: Traces, trial: int) -> float:
    """RMS over time of what the plain model misses in a trial, deg."""
    own = traces.trial == trial
    return rms(traces.time_s[own], traces.measured_deg[own] - traces.plain_deg[own])


def has_command(traces: Traces) -> bool:
    """Say whether the command was logged; else the measured pressure drives the model."""
    return bool(np.isfinite(traces.command_kpa).all())


def driving(traces: Traces) -> Floats:
    """Return the command, or the pressure where none was logged."""
    if has_command(traces) or traces.pressure_kpa is None:
        return np.nan_to_num(traces.command_kpa)
    return traces.pressure_kpa


def mean_over_trials(
    traces: Traces, trials: Sequence[int], values: Floats
) -> tuple[Floats, Floats]:
    """Average trials of one profile on the times of the longest, as far as each one goes."""
    each = [(traces.time_s[traces.trial == i], values[traces.trial == i]) for i in trials]
    time = max((t for t, _ in each), key=lambda t: float(t[-1]))
    return time, np.nanmean([np.interp(time, t, v, right=np.nan) for t, v in each], axis=0)
