"""Fit whole logs of any protocol, with the logged command or pressure as the input."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.fractional import Hold, ResponseMap, input_map
from spa_fo.identify.bounds import ORDER_GAP, Bounds, free_bounds
from spa_fo.identify.polish import Optimum
from spa_fo.plant import PARAMETERS
from spa_fo.rig import Trial

SIGNALS = ("command", "pressure")
# Where a command holds until the next sample, a pressure is sampled from a smooth curve.
HOLD: dict[str, Hold] = {"command": "zero", "pressure": "linear"}

SAMPLE_LIMIT = 8_000
"""All logs together are thinned to about this many samples, evenly in time."""
_MIN_SAMPLES = 10
_LONGEST_GAP = 3.0  # samples: within a longer one the angle is not interpolated

# Starting points: time scales in s, and pairs of orders. The best few are polished.
_TIME_SCALES = (0.1, 0.3, 1.0, 3.0, 10.0)
_ORDERS = ((1.9, 1.0), (1.4, 1.2), (1.2, 0.6), (1.0, 0.5), (0.7, 0.3))
_POLISHED = 3
_FIRST_EVALUATIONS = 25
_LAST_EVALUATIONS = 200
_REFIT_EVALUATIONS = 50


@dataclass(frozen=True)
class LogData:
    """One trial on a uniform grid, ready to fit.

    Attributes
    ----------
    trial : Trial
        Where it comes from.
    t, u, angle_rad : (n,) arrays
        Time in s, input pressure / reference pressure, angle.
    known : (n,) bool array
        False within gaps of the log and after a reset.
    hold : {"zero", "linear"}
        How the input goes on between samples.
    """

    trial: Trial
    t: Floats
    u: Floats
    angle_rad: Floats
    known: NDArray[np.bool_]
    hold: Hold


def log_data(
    trials: Sequence[Trial],
    reference_kpa: float,
    signal: str = "command",
    source: Path | str = "campaign",
) -> list[LogData]:
    """Put whole logs on uniform grids.

    The interval is each log's middle one, or longer where all logs together would pass
    `SAMPLE_LIMIT`. A command is averaged over each interval, so that the instant of a change is
    not lost; pressure and angle are interpolated.

    Raises
    ------
    BadInput
        No trial holds the signal, or a trial has too few samples.
    """
    if signal not in SIGNALS:
        raise ValueError(f"expected a signal of {', '.join(SIGNALS)}, not {signal!r}")
    usable = [trial for trial in trials if input_of(trial, signal) is not None]
    if not usable:
        raise BadInput(source, f"expected trials with a {signal} column, found none")
    total = sum(trial.t_s.size for trial in usable)
    return [
        _resample(trial, reference_kpa, signal, max(1.0, total / SAMPLE_LIMIT), source)
        for trial in usable
    ]


def held_response(log: LogData, unit_step: Callable[[Floats], Floats]) -> Floats:
    """Return the response of a linear model, known by its unit step, to a log's input.

    Parameters
    ----------
    log : LogData
        On its uniform grid; at rest before it begins.
    unit_step : callable
        Times from 0 (s) to the response to a unit step.

    Returns
    -------
    (n,) array
        In the step's unit.
    """
    after = unit_step(log.t)
    rises = np.diff(log.u, prepend=0.0)
    if log.hold == "zero":
        return _convolved(rises, after)
    # A rise that is spread evenly over an interval: the mean of the step response over it.
    middle = unit_step(log.t[:-1] + 0.5 * log.t[1])
    spread = (after[:-1] + 4.0 * middle + after[1:]) / 6.0
    response: Floats = log.u[0] * after
    response[1:] += _convolved(rises[1:], spread)
    return response


def _convolved(a: Floats, b: Floats) -> Floats:
    """Return the first values of the convolution of two arrays of one length."""
    size = 2 * a.size
    return np.asarray(np.fft.irfft(np.fft.rfft(a, size) * np.fft.rfft(b, size), size)[: a.size])


def input_of(trial: Trial, signal: str) -> Floats | None:
    """Return the trial's command or pressure in kPa, None where its log holds none."""
    return trial.command_kpa if signal == "command" else trial.pressure_kpa


def fit_whole_logs(
    logs: Sequence[LogData], bounds: Bounds | None = None, starts: Sequence[Floats] = ()
) -> Optimum:
    """Least squares over all known samples of all logs.

    The time scale is not known beforehand (soft arms take 0.1 to 10 s), so it starts from a grid
    of time scales and orders, each with its best gain, and polishes the best few by a bounded
    trust-region method with the analytic Jacobian.

    Parameters
    ----------
    logs : sequence of LogData
        From `log_data`.
    bounds : Bounds, optional
        `free_bounds` unless given.
    starts : sequence of (5,) arrays
        Further starting points, such as an earlier fit.
    """
    bounds = free_bounds() if bounds is None else bounds
    problem = _Problem(logs, bounds)
    candidates = [problem.best_gain(x) for x in [*_grid(bounds), *starts]]
    candidates.sort(key=problem.squares)
    first = [problem.polish(x, _FIRST_EVALUATIONS) for x in candidates[: _POLISHED + len(starts)]]
    best = min(first, key=lambda result: result[1])
    x, squares, converged = problem.polish(best[0], _LAST_EVALUATIONS)
    return Optimum(
        x=x,
        rmse=float(np.sqrt(squares / problem.samples)),
        sum_squares=squares,
        evaluations=problem.evaluations,
        at_bounds=bounds.touched(x),
        valid=converged,
        bounds=bounds,
    )


def log_errors(logs: Sequence[LogData], optimum: Optimum) -> Floats | None:
    """Estimate standard errors of `QUANTITIES` by leaving out one log at a time.

    Residuals of whole logs are a model's misfit, alike from sample to sample, so a log is what
    counts as one observation (jackknife: Efron and Stein 1981, doi:10.1214/aos/1176345462).

    Parameters
    ----------
    logs : sequence of LogData
        What was fitted.
    optimum : Optimum
        Its least squares, where each refit starts.

    Returns
    -------
    (6,) array or None
        Of alpha2, alpha1, a1, a0, b0 and K; NaN on a bound, where leaving logs out moves nothing.
        None for a single log.
    """
    count = len(logs)
    if count < 2:
        return None
    problem = _Problem(logs, optimum.bounds)
    x = np.array(
        [problem.without(i).polish(optimum.x, _REFIT_EVALUATIONS)[0] for i in range(count)]
    )
    quantities = np.column_stack([x, x[:, 4] / x[:, 3]])
    errors: Floats = np.sqrt((count - 1) * np.var(quantities, axis=0))
    errors[[PARAMETERS.index(mark.split()[0]) for mark in optimum.at_bounds]] = np.nan
    return errors


def _grid(bounds: Bounds) -> list[Floats]:
    """Make starting points whose three terms weigh alike at the time scale."""
    points = []
    for scale in _TIME_SCALES:
        for alpha2, alpha1 in _ORDERS:
            a0 = scale**-alpha2
            x = np.array([alpha2, alpha1, a0 * scale**alpha1, a0, a0])
            points.append(_inside(x, bounds))
    return points


def _inside(x: Floats, bounds: Bounds) -> Floats:
    x = np.clip(x, bounds.lower, bounds.upper)
    x[1] = max(min(x[1], x[0] - ORDER_GAP), bounds.lower[1])
    x[0] = max(x[0], x[1] + ORDER_GAP)
    return x


@dataclass(frozen=True)
class Scaled:
    """The variables of the search, z = (alpha2 - alpha1, alpha1, ln a1, ln a0, ln b0).

    In them the order of the orders is a bound like any other.
    """

    bounds: Bounds

    def box(self) -> tuple[Floats, Floats]:
        """Return lower and upper bounds of z."""
        low, high = self.bounds.lower, self.bounds.upper
        lower = np.concatenate([[ORDER_GAP, low[1]], np.log(low[2:])])
        upper = np.concatenate([[high[0] - low[1], high[1]], np.log(high[2:])])
        return lower, np.maximum(upper, lower + 1e-6)

    def z(self, x: Floats) -> Floats:
        """Return z of `x`, inside the box."""
        lower, upper = self.box()
        z = np.concatenate([[x[0] - x[1], x[1]], np.log(x[2:])])
        return np.asarray(np.clip(z, lower + 1e-9, upper - 1e-9))

    def x(self, z: Floats) -> Floats:
        """Return alpha2, alpha1, a1, a0, b0."""
        x = np.concatenate([[z[0] + z[1], z[1]], np.exp(z[2:])])
        # The box in z is a little larger than that of alpha2.
        x[0] = np.clip(
            x[0], max(self.bounds.lower[0], x[1] + 0.5 * ORDER_GAP), self.bounds.upper[0]
        )
        return x

    def derivative(self, x: Floats, jacobian: Floats) -> Floats:
        """Turn derivatives in x, (n, 5), into those in z, in place."""
        jacobian[:, 2:] *= x[2:]
        if self.bounds.lower[0] < x[0] < self.bounds.upper[0]:
            jacobian[:, 1] += jacobian[:, 0]
        else:
            jacobian[:, 0] = 0.0
        return jacobian


class _Problem:
    """Residuals of all logs in scaled variables."""

    def __init__(self, logs: Sequence[LogData], bounds: Bounds) -> None:
        self.maps: list[ResponseMap] = [input_map(log.t, log.u, log.hold) for log in logs]
        self.known = [log.known for log in logs]
        self.measured = np.concatenate([log.angle_rad[log.known] for log in logs])
        self.samples = self.measured.size
        self.scaled = Scaled(bounds)
        self.bounds = bounds
        self.evaluations = 0

    def without(self, left_out: int) -> _Problem:
        """Return the problem of all logs but one; the maps are shared."""
        fewer = copy.copy(self)
        kept = [i for i in range(len(self.maps)) if i != left_out]
        fewer.maps = [self.maps[i] for i in kept]
        fewer.known = [self.known[i] for i in kept]
        sizes = [int(np.count_nonzero(known)) for known in self.known]
        parts = np.split(self.measured, np.cumsum(sizes)[:-1])
        fewer.measured = np.concatenate([parts[i] for i in kept])
        fewer.samples = fewer.measured.size
        return fewer

    def response(self, x: Floats) -> Floats:
        self.evaluations += 1
        return np.concatenate(
            [m.response(x)[known] for m, known in zip(self.maps, self.known, strict=True)]
        )

    def squares(self, x: Floats) -> float:
        return float(np.sum((self.response(x) - self.measured) ** 2))

    def best_gain(self, x: Floats) -> Floats:
        y = self.response(x)
        power = float(y @ y)
        factor = float(y @ self.measured) / power if power > 0 else 1.0
        b0 = np.clip(x[4] * factor, self.bounds.lower[4], self.bounds.upper[4])
        return np.append(x[:4], b0)

    def polish(self, x: Floats, evaluations: int) -> tuple[Floats, float, bool]:
        """Return parameters, sum of squares, and whether the method converged."""
        lower, upper = self.scaled.box()
        result = least_squares(
            self._residual,
            self.scaled.z(x),
            jac=self._jacobian,
            bounds=(lower, upper),
            x_scale="jac",
            ftol=1e-10,
            xtol=1e-10,
            gtol=1e-12,
            max_nfev=evaluations,
        )
        return self.scaled.x(result.x), float(2.0 * result.cost), bool(result.status > 0)

    def _residual(self, z: Floats) -> Floats:
        return np.asarray(self.response(self.scaled.x(z)) - self.measured)

    def _jacobian(self, z: Floats) -> Floats:
        x = self.scaled.x(z)
        self.evaluations += 1
        jacobian = np.concatenate(
            [m.jacobian(x)[known] for m, known in zip(self.maps, self.known, strict=True)]
        )
        return self.scaled.derivative(x, jacobian)


def _resample(
    trial: Trial, reference_kpa: float, signal: str, thinning: float, source: Path | str
) -> LogData:
    pressure = input_of(trial, signal)
    assert pressure is not None
    # A clock may stand still for a sample: the later one of two counts.
    keep = np.append(np.diff(trial.t_s) > 0, True)
    t, angle, kpa = trial.t_s[keep], trial.angle_deg[keep], pressure[keep]
    if t.size < _MIN_SAMPLES:
        raise BadInput(
            source, f"{trial.label} has {t.size} valid samples, expected at least {_MIN_SAMPLES}"
        )
    interval = float(np.median(np.diff(t)))
    n = max(_MIN_SAMPLES, round((t[-1] - t[0]) / (interval * thinning)) + 1)
    grid = np.linspace(t[0], t[-1], n)
    if signal == "command":
        area = np.concatenate([[0.0], np.cumsum(kpa[:-1] * np.diff(t))])
        held = np.diff(np.interp(grid, t, area)) / np.diff(grid)
        u = np.append(held, kpa[-1])
    else:
        u = np.interp(grid, t, kpa)
    after = np.minimum(np.searchsorted(t, grid), t.size - 1)
    before = np.maximum(np.searchsorted(t, grid, side="right") - 1, 0)
    known = (t[after] - t[before] <= _LONGEST_GAP * interval) & ~trial.after_reset[keep][after]
    return LogData(
        trial=trial,
        t=grid - grid[0],
        u=u / reference_kpa,
        angle_rad=np.radians(np.interp(grid, t, angle)),
        known=known,
        hold=HOLD[signal],
    )
