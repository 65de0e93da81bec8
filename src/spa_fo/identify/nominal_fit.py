"""Identify a nominal drive from a command that is no pressure and the measured pressure.

Least squares over all rows: levels that never fall at knots of the command, and rates. How many
knots, whether the pressure falls with a rate of its own, and whether the rate depends on the
command is chosen by BIC with the residuals' independent samples. Each log is predicted once more
by a drive that was fitted without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from spa_fo.errors import BadInput
from spa_fo.identify.selection import criteria, independent_samples
from spa_fo.plant.nominal_drive import NominalDrive, begins_kpa
from spa_fo.rig import CampaignData, Trial

Floats = NDArray[np.float64]

_KNOTS = (2, 3, 5, 8)
_BINS = 100  # of the commands' range: nearer ones are one level
_RATES = (0.3, 1.0, 3.0, 10.0)  # 1/s, from which a search begins
_RATE_BOUNDS = (1e-3, 50.0)  # 1/s
_MOST_VENTING = 50.0  # times as fast, or as slow
_LATEST_S = 1.5
_SMOOTH = 0.02  # of the pressure's range: weighs a knot that no log visits, and nothing else
_MOST_ROWS = 6000  # of all logs that a search looks at
_EVALUATIONS = 40


@dataclass(frozen=True)
class Form:
    """What a drive may have.

    Parameters
    ----------
    knots : int
        Of its curve.
    venting : bool
        A rate of its own where the pressure falls.
    by_command : bool
        A rate at every knot instead of one.
    """

    knots: int
    venting: bool = False
    by_command: bool = False

    @property
    def free(self) -> int:
        """Number of parameters."""
        return self.knots + (self.knots if self.by_command else 1) + self.venting + 1

    def __str__(self) -> str:
        rate = "a rate at each" if self.by_command else "one rate"
        venting = ", another where the pressure falls" if self.venting else ""
        return f"a curve of {self.knots} levels, {rate}{venting}"


@dataclass(frozen=True)
class NominalFit:
    """A drive as identified.

    Attributes
    ----------
    drive : NominalDrive
    form : Form
    rms_kpa : float
        What it misses of the logs that it was fitted to.
    left : tuple of arrays
        By log, measured less nominal pressure at its rows, of a drive that was fitted without it;
        of the drive itself where there is but one log.
    alone : bool
        Whether there is but one log.
    """

    drive: NominalDrive
    form: Form
    rms_kpa: float
    left: tuple[Floats, ...]
    alone: bool

    @property
    def left_out_kpa(self) -> float:
        """RMS of what is missed of logs that took no part."""
        return float(np.sqrt(np.mean(np.concatenate(self.left) ** 2)))

    def sentence(self) -> str:
        """Say what was found."""
        missed = f"which it misses by {self.rms_kpa:.2g} kPa"
        if not self.alone:
            missed += f", and logs it was not fitted to by {self.left_out_kpa:.2g} kPa"
        return (
            "The command is no pressure: a nominal drive was identified from it and the measured "
            f"pressure ({self.form}), {missed}."
        )


def drive_logs(data: CampaignData) -> tuple[Trial, ...]:
    """Return the trials of a campaign, whose command is no pressure.

    Raises
    ------
    BadInput
        The command or the pressure hardly changes: no drive is seen.
    """
    for name, signals in (
        ("command", [t.command_kpa for t in data.trials]),
        ("pressure", [t.pressure_kpa for t in data.trials]),
    ):
        every = np.concatenate([one for one in signals if one is not None])
        if not np.ptp(every) > 0.0:
            raise BadInput(
                data.campaign.yaml,
                f"the {name} never changes; expected one that does, to identify the drive by",
                f"log.columns.{name}",
            )
    return data.trials


def identify_drive(trials: Sequence[Trial]) -> NominalFit:
    """Identify the nominal drive of some trials, all with command and measured pressure.

    Parameters
    ----------
    trials : sequence of Trial
        See `drive_logs`.
    """
    logs = [_Log.of(trial, sum(t.t_s.size for t in trials)) for trial in trials]
    positions = _distinct(np.concatenate([log.command for log in logs]))
    counts = [k for k in _KNOTS if k <= positions.size]
    if 2 <= positions.size <= max(_KNOTS) and positions.size not in counts:
        counts.append(positions.size)
    found = [_fitted(logs, Form(k, venting=True), positions) for k in counts]
    best = found[_chosen(found)]
    rivals = [
        _fitted(logs, Form(best.form.knots, *each), positions)
        for each in product((False, True), repeat=2)
        if each != (True, False)
    ]
    found = [best, *rivals]
    best = found[_chosen(found)]
    alone = len(logs) == 1
    left = tuple(log.every - best.drive.at(log.t_s, log.commands, log.begins) for log in logs)
    if not alone:
        left = tuple(_left_out(logs, i, best) for i in range(len(logs)))
    return NominalFit(best.drive, best.form, best.rms, left, alone)


@dataclass(frozen=True)
class _Log:
    """A log; `t_s`, `commands`, `every` are all its rows, `rows` those a search looks at."""

    t_s: Floats
    commands: Floats
    every: Floats
    begins: float
    rows: NDArray[np.int64]

    @classmethod
    def of(cls, trial: Trial, total: int) -> _Log:
        assert trial.command_kpa is not None
        assert trial.pressure_kpa is not None
        begins = begins_kpa(trial)
        assert begins is not None
        rows = np.arange(0, trial.t_s.size, max(1, -(-total // _MOST_ROWS)))
        return cls(trial.t_s, trial.command_kpa, trial.pressure_kpa, begins, rows)

    @property
    def command(self) -> Floats:
        return self.commands[self.rows]

    @property
    def pressure(self) -> Floats:
        return self.every[self.rows]

    def left(self, drive: NominalDrive) -> Floats:
        nominal = drive.at(self.t_s, self.commands, self.begins)
        return np.asarray((self.every - nominal)[self.rows])


@dataclass(frozen=True)
class _Fit:
    form: Form
    drive: NominalDrive
    z: Floats
    residuals: tuple[Floats, ...]

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(np.concatenate(self.residuals) ** 2)))


def _distinct(commands: Floats) -> Floats:
    """Return the levels that a command keeps to, to a hundredth of its range, rising."""
    low, span = float(commands.min()), float(np.ptp(commands))
    if span == 0.0:
        return np.array([low, low + 1.0])
    bins = np.round((commands - low) / span * _BINS)
    return np.array([float(commands[bins == one].mean()) for one in np.unique(bins)])


def _chosen(fits: Sequence[_Fit]) -> int:
    """Return the fit with the smallest BIC; the smallest of all where the samples are too few."""
    closest = min(fits, key=lambda fit: fit.rms)
    independent = independent_samples(closest.residuals)
    scores = [criteria(fit.rms**2, fit.form.free, independent)[1] for fit in fits]
    free = [fit.form.free for fit in fits]
    return min(range(len(fits)), key=lambda i: (scores[i] or 0.0, free[i]))


def _fitted(
    logs: Sequence[_Log], form: Form, positions: Floats, start: Floats | None = None
) -> _Fit:
    problem = _Problem(logs, form, positions)
    points = [start] if start is not None else problem.starts()
    z = min(points, key=lambda point: float(np.sum(problem.residual(point) ** 2)))
    low, high = problem.bounds()
    found = least_squares(
        problem.residual,
        np.clip(z, low + 1e-6, high - 1e-6),
        bounds=(low, high),
        x_scale="jac",
        max_nfev=_EVALUATIONS,
    )
    drive = problem.drive(found.x)
    return _Fit(form, drive, found.x, tuple(log.left(drive) for log in logs))


def _left_out(logs: Sequence[_Log], i: int, best: _Fit) -> Floats:
    """Return what a drive of the same form that never saw a log misses of it."""
    others = [log for k, log in enumerate(logs) if k != i]
    drive = _fitted(others, best.form, best.drive.command, best.z).drive
    log = logs[i]
    return np.asarray(log.every - drive.at(log.t_s, log.commands, log.begins))


class _Problem:
    """Residuals of all logs over z: lowest level, rises, log rates, log venting, delay."""

    def __init__(self, logs: Sequence[_Log], form: Form, positions: Floats) -> None:
        self.logs, self.form = logs, form
        at = np.round(np.linspace(0, positions.size - 1, form.knots)).astype(int)
        self.knots = positions[at]
        pressures = np.concatenate([log.pressure for log in logs])
        self.low, self.span = float(pressures.min()), float(np.ptp(pressures))
        self.weight = _SMOOTH * self.span

    @property
    def _rates(self) -> slice:
        k = self.form.knots
        return slice(k, 2 * k if self.form.by_command else k + 1)

    def drive(self, z: Floats) -> NominalDrive:
        k = self.form.knots
        rates = np.exp(z[self._rates]) * np.ones(k)
        venting = float(np.exp(z[-2])) if self.form.venting else 1.0
        return NominalDrive(self.knots, np.cumsum(z[:k]), rates, venting, float(z[-1]))

    def starts(self) -> list[Floats]:
        k = self.form.knots
        rises = np.append(self.low, np.full(k - 1, self.span / (k - 1)))
        size = self._rates.stop - self._rates.start
        vent = np.zeros(int(self.form.venting))
        return [
            np.concatenate([rises, np.full(size, np.log(rate)), vent, [0.02]]) for rate in _RATES
        ]

    def bounds(self) -> tuple[Floats, Floats]:
        k = self.form.knots
        size = self._rates.stop - self._rates.start
        low, high = np.log(_RATE_BOUNDS)
        vent = np.full(int(self.form.venting), np.log(_MOST_VENTING))
        reach = 5.0 * self.span
        return (
            np.concatenate([[self.low - reach], np.zeros(k - 1), np.full(size, low), -vent, [0.0]]),
            np.concatenate(
                [[self.low + reach], np.full(k - 1, reach), np.full(size, high), vent, [_LATEST_S]]
            ),
        )

    def residual(self, z: Floats) -> Floats:
        drive = self.drive(z)
        k = self.form.knots
        # Neighbours alike, so weakly that it matters where nothing else says anything.
        gaps = np.diff(self.knots)
        slopes = np.diff(z[1:k] / gaps) * gaps.mean() / self.span
        rates = np.diff(z[self._rates])
        smooth = self.weight * np.concatenate([slopes, rates])
        return np.concatenate([*(log.left(drive) for log in self.logs), smooth])
