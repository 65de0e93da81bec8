"""Identify a nominal drive from a command that is no pressure and the measured pressure.

Least squares over all rows: levels that never fall at knots of the command, and rates. How many
knots, whether the pressure falls with a rate of its own, and whether the rate depends on the
command is chosen by cross-validation: whole logs are left out, or quarters of a lone one, and the
simplest form that predicts them as well as the best does, within a standard error, is taken. An
information criterion counts on independent residuals; those of a drive that is not quite of any
form here are not, and it takes too rich a form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from spa_fo.arrays import Bools, Floats
from spa_fo.errors import BadInput
from spa_fo.plant.nominal_drive import NominalDrive, begins_kpa
from spa_fo.rig import CampaignData, Trial

_KNOTS = (2, 3, 5, 8)
_BINS = 100  # of the commands' range: nearer ones are one level
_RATES = (0.3, 1.0, 3.0, 10.0)  # 1/s, from which a search begins
_RATE_BOUNDS = (1e-3, 50.0)  # 1/s
_MOST_VENTING = 50.0  # times as fast, or as slow
_LATEST_S = 1.5
_SMOOTH = 0.02  # of the pressure's range: weighs a knot that no log visits, and nothing else
_MOST_ROWS = 6000  # of all logs that a search looks at
_EVALUATIONS = 40
_QUARTERS = 4  # of a lone log
_MOST_FOLDS = 6


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
        venting = ", another where pressure falls" if self.venting else ""
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
        By log, measured less nominal pressure at its rows, of a drive that was fitted without them.
    left_out_by : str
        "logs", or "quarters" of a lone one.
    """

    drive: NominalDrive
    form: Form
    rms_kpa: float
    left: tuple[Floats, ...]
    left_out_by: str

    @property
    def left_out_kpa(self) -> float:
        """RMS of what is missed of what took no part."""
        return _rms(self.left)

    def sentence(self) -> str:
        """Say what was found."""
        return (
            "The command is no pressure: a nominal drive was identified from it and the measured "
            f"pressure ({self.form}), which it misses by {self.rms_kpa:.2g} kPa, and by "
            f"{self.left_out_kpa:.2g} kPa on {self.left_out_by} that it was not fitted to."
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
    folds = _folds(logs)
    tried = [_tried(logs, Form(k, venting=True), positions, folds) for k in counts]
    best = _chosen(tried)
    others = [(False, False), (False, True), (True, True)]
    tried = [_tried(logs, Form(best.form.knots, *each), positions, folds) for each in others]
    best = _chosen([best, *tried])
    by = "logs" if len(logs) > 1 else "quarters"
    return NominalFit(best.drive, best.form, _rms(best.residuals), best.left, by)


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

    def without(self, out: Bools) -> _Log:
        return replace(self, rows=self.rows[~out[self.rows]])

    def missed(self, drive: NominalDrive) -> Floats:
        """Return measured less nominal pressure at all rows."""
        return np.asarray(self.every - drive.at(self.t_s, self.commands, self.begins))


@dataclass(frozen=True)
class _Tried:
    """A form, fitted to all; `left` is what it misses of rows that it was not fitted to.

    `squares` are the means of its squares, by fold.
    """

    form: Form
    drive: NominalDrive
    residuals: tuple[Floats, ...]
    left: tuple[Floats, ...]
    squares: Floats


def _chosen(tried: Sequence[_Tried]) -> _Tried:
    """Return the simplest form that is not worse than the best by more than a standard error."""
    best = min(tried, key=lambda one: float(one.squares.mean()))
    folds = best.squares.size
    for one in sorted(tried, key=lambda one: one.form.free):
        worse = one.squares - best.squares
        if worse.mean() <= worse.std(ddof=1) / np.sqrt(folds):
            return one
    return best


def _rms(parts: Sequence[Floats]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _distinct(commands: Floats) -> Floats:
    """Return the levels that a command keeps to, to a hundredth of its range, rising."""
    low, span = float(commands.min()), float(np.ptp(commands))
    if span == 0.0:
        return np.array([low, low + 1.0])
    bins = np.round((commands - low) / span * _BINS)
    return np.array([float(commands[bins == one].mean()) for one in np.unique(bins)])


def _folds(logs: Sequence[_Log]) -> list[list[Bools]]:
    """List what is left out at a time: of each log, which of its rows."""
    if len(logs) == 1:
        rows = np.arange(logs[0].t_s.size)
        quarter = np.minimum(rows * _QUARTERS // rows.size, _QUARTERS - 1)
        return [[quarter == i] for i in range(_QUARTERS)]
    # Shuffled, so that no fold is all of one experiment; always in the same way.
    fold = np.random.default_rng(0).permutation(len(logs)) % _MOST_FOLDS
    return [
        [np.full(log.t_s.size, own == i) for log, own in zip(logs, fold, strict=True)]
        for i in range(min(len(logs), _MOST_FOLDS))
    ]


def _tried(
    logs: Sequence[_Log], form: Form, positions: Floats, folds: Sequence[Sequence[Bools]]
) -> _Tried:
    """Fit a form to all rows, and again without each fold."""
    problem = _Problem(logs, form, positions)
    z = _searched(problem, problem.starts())
    drive = problem.drive(z)
    left = [np.zeros(log.t_s.size) for log in logs]
    squares = []
    for out in folds:
        kept = [log.without(rows) for log, rows in zip(logs, out, strict=True)]
        others = _Problem([log for log in kept if log.rows.size], form, positions)
        without = others.drive(_searched(others, [z]))
        for log, rows, missed in zip(logs, out, left, strict=True):
            if rows.any():
                missed[rows] = log.missed(without)[rows]
        pairs = zip(left, out, strict=True)
        squares.append(np.mean(np.concatenate([missed[rows] for missed, rows in pairs]) ** 2))
    residuals = tuple(log.missed(drive) for log in logs)
    return _Tried(form, drive, residuals, tuple(left), np.array(squares))


def _searched(problem: _Problem, starts: Sequence[Floats]) -> Floats:
    """Return the optimum that the best start leads to."""
    low, high = problem.bounds()
    z = min(starts, key=lambda point: float(np.sum(problem.residual(point) ** 2)))
    found = least_squares(
        problem.residual,
        np.clip(z, low + 1e-6, high - 1e-6),
        bounds=(low, high),
        x_scale="jac",
        max_nfev=_EVALUATIONS,
    )
    return np.asarray(found.x)


class _Problem:
    """Residuals of all logs over z: lowest level, rises, log rates, log venting, delay."""

    def __init__(self, logs: Sequence[_Log], form: Form, positions: Floats) -> None:
        self.logs, self.form = logs, form
        at = np.round(np.linspace(0, positions.size - 1, form.knots)).astype(int)
        self.knots = positions[at]
        pressures = np.concatenate([log.every[log.rows] for log in logs])
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
        return np.concatenate([*(log.missed(drive)[log.rows] for log in self.logs), smooth])
