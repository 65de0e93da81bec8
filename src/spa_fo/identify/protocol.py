"""From trials to data: the up-step of each step trial on one uniform time grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.plant.paper import POINTS
from spa_fo.rig import Trial

STEP_PROTOCOLS = ("step", "step_release")
# A change of the command counts when it is larger than this fraction of the trial's range of it.
_CHANGE = 0.02
_MIN_SAMPLES = 10
# A trial is left out when one gap takes more than this fraction of its window, or when its window
# is shorter than this fraction of the middle one: the common duration is the shortest window's.
_MOST = 0.5
_BASE_S = 1.0  # before a step: the angle that it rises from


@dataclass(frozen=True)
class StepData:
    """Step responses on a common grid: one row a dataset.

    Attributes
    ----------
    experiments : tuple of str
        Experiment of each dataset.
    trials : tuple of int
        1-based place in that experiment.
    orders : (datasets,) int array
        Place in the campaign.
    setpoint_deg : (datasets,) array
        NaN where there is none.
    u : (datasets,) array
        Height of the step, pressure / reference pressure.
    t : (points,) array
        Times after the step in s, j T / points for j = 1 ... points.
    angle_rad : (datasets, points) array
        Measured angle.
    left_out : tuple of str
        Trials that could not be used, and why.
    """

    experiments: tuple[str, ...]
    trials: tuple[int, ...]
    orders: NDArray[np.int64]
    setpoint_deg: Floats
    u: Floats
    t: Floats
    angle_rad: Floats
    left_out: tuple[str, ...] = ()

    @property
    def datasets(self) -> int:
        """Number of step responses."""
        return len(self.experiments)

    @property
    def points(self) -> int:
        """Points of each step response."""
        return self.t.size

    @property
    def groups(self) -> dict[str, NDArray[np.int64]]:
        """Indices of the datasets of each experiment, in order of appearance."""
        names = np.array(self.experiments)
        return {name: np.flatnonzero(names == name) for name in dict.fromkeys(self.experiments)}

    def select(self, indices: Sequence[int] | NDArray[np.int64]) -> StepData:
        """Return the datasets at `indices` (repetitions allowed)."""
        chosen = np.asarray(indices, dtype=np.int64)
        return replace(
            self,
            experiments=tuple(self.experiments[i] for i in chosen),
            trials=tuple(self.trials[i] for i in chosen),
            orders=self.orders[chosen],
            setpoint_deg=self.setpoint_deg[chosen],
            u=self.u[chosen],
            angle_rad=self.angle_rad[chosen],
        )


def is_step(trial: Trial) -> bool:
    """Whether the trial is a step experiment whose command was logged."""
    return trial.protocol in STEP_PROTOCOLS and trial.command_kpa is not None


def step_data(
    trials: Sequence[Trial],
    reference_kpa: float,
    points: int = POINTS,
    source: Path | str = "campaign",
    files: Mapping[tuple[str, int], Path] | None = None,
) -> StepData:
    """Take the up-steps of all step trials.

    The window of a trial runs from the first rise of its command to the next change or the end.
    The angle is interpolated linearly between valid samples; those after a reset of the board,
    whose time is an estimate, are not used. Where a trial's command starts above zero the step is
    its rise; where it rises no further, the step was at the first sample, from zero. All windows
    are cut to the shortest. A trial that lost most of its window to a gap or a reset is left out,
    and so is one much shorter than the others.

    Parameters
    ----------
    trials : sequence of Trial
        Of any protocols; those without an up-step protocol are passed over.
    reference_kpa : float
        Pressure at which u = 1.
    points : int
        Points taken of each response.
    source : Path or str
        Named in messages.
    files : mapping, optional
        From (experiment, 1-based trial) to the log's path, for messages.

    Returns
    -------
    StepData

    Raises
    ------
    BadInput
        There is no step trial; a trial has no step or too few samples in it; or none is usable.
    """
    if points < 2:
        raise ValueError(f"expected at least 2 points, not {points}")
    steps = [trial for trial in trials if is_step(trial)]
    if not steps:
        raise BadInput(source, "expected a step or step_release experiment with a command")
    windows, left_out = [], []
    for trial in steps:
        window = _window(trial, (files or {}).get((trial.experiment, trial.trial), source))
        if isinstance(window, str):
            left_out.append(f"{trial.label}: {window}")
        else:
            windows.append(window)
    if windows:
        middle = float(np.median([window.duration for window in windows]))
        short = [window for window in windows if window.duration < _MOST * middle]
        left_out += [
            f"{w.trial.label}: its step lasts {w.duration:.3g} s, the others' {middle:.3g} s"
            for w in short
        ]
        windows = [window for window in windows if window.duration >= _MOST * middle]
    if not windows:
        raise BadInput(source, f"no step is usable: {'; '.join(left_out)}")
    duration = min(window.duration for window in windows)
    t = duration * np.arange(1, points + 1) / points
    return StepData(
        experiments=tuple(window.trial.experiment for window in windows),
        trials=tuple(window.trial.trial for window in windows),
        orders=np.array([window.trial.order for window in windows]),
        setpoint_deg=np.array(
            [np.nan if w.trial.setpoint_deg is None else w.trial.setpoint_deg for w in windows]
        ),
        u=np.array([window.rise_kpa / reference_kpa for window in windows]),
        t=t,
        angle_rad=np.radians([np.interp(t, w.t, w.angle_deg) for w in windows]),
        left_out=tuple(left_out),
    )


def paper_selection(data: StepData, datasets: int) -> StepData:
    """Return `datasets` responses spread evenly over the experiments, the earliest of each.

    Raises
    ------
    ValueError
        There are fewer than `datasets`.
    """
    if not 1 <= datasets <= data.datasets:
        raise ValueError(f"expected 1 to {data.datasets} datasets, not {datasets}")
    queues = [
        list(rows[np.argsort(data.orders[rows], kind="stable")]) for rows in data.groups.values()
    ]
    chosen: list[int] = []
    while len(chosen) < datasets:
        for queue in queues:
            if queue and len(chosen) < datasets:
                chosen.append(int(queue.pop(0)))
    return data.select(sorted(chosen))


@dataclass(frozen=True)
class _Window:
    trial: Trial
    rise_kpa: float
    t: Floats
    angle_deg: Floats

    @property
    def duration(self) -> float:
        return float(self.t[-1])


def _window(trial: Trial, source: Path | str) -> _Window | str:
    """Cut the first up-step out of a trial, or say why it is left out."""
    command = trial.command_kpa
    assert command is not None
    base = float(command[0])
    tolerance = _CHANGE * float(np.ptp(command))
    risen = np.flatnonzero(command > base + tolerance)
    if risen.size == 0:  # at rest before the log begins
        base = 0.0
        tolerance = _CHANGE * float(command.max())
        risen = np.flatnonzero(command > tolerance)
    if tolerance <= 0.0 or risen.size == 0:
        raise BadInput(source, "expected a step, but the command never rises", trial.label)
    first = int(risen[0])
    after = np.flatnonzero(np.abs(command[first:] - command[first]) > tolerance)
    last = first + int(after[0]) if after.size else command.size
    used = slice(first, last)
    valid = ~trial.after_reset[used]
    if last - first < _MIN_SAMPLES:
        raise BadInput(
            source,
            f"expected at least {_MIN_SAMPLES} samples from the rise of the command to its next "
            f"change, found {last - first}",
            trial.label,
        )
    t = trial.t_s[used][valid] - trial.t_s[first]
    if t.size < _MIN_SAMPLES:
        return f"the board was reset {trial.t_s[used][~valid][0] - trial.t_s[first]:.3g} s into it"
    longest = float(np.diff(t, prepend=0.0).max())
    if longest > _MOST * t[-1]:
        return f"a gap of {longest:.3g} s in a step of {t[-1]:.3g} s"
    rise = float(command[first] - base)
    angle = trial.angle_deg[used][valid]
    if abs(base) > tolerance:  # the angle of the pressure it rises from is no part of the rise
        before = (trial.t_s < trial.t_s[first]) & ~trial.after_reset
        before &= trial.t_s >= trial.t_s[first] - _BASE_S
        angle = angle - (trial.angle_deg[before].mean() if before.any() else 0.0)
    return _Window(trial, rise, t, angle)
