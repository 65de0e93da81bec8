"""Fit a static curve before or behind the linear part, together with its five coefficients.

Least squares over whole logs from the plain fit. The curve's free numbers are the logarithms of
its slopes at the knots; a weak prior holds neighbours alike, so that a stretch that no log visits
goes on as the one beside it. Set and softening cannot be negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from spa_fo.arrays import Floats
from spa_fo.fractional import ResponseMap, input_map
from spa_fo.identify.bounds import Bounds
from spa_fo.identify.polish import Optimum
from spa_fo.identify.selection import independent_samples
from spa_fo.identify.whole_log import LogData, Scaled
from spa_fo.plant.static_curve import (
    BEFORE,
    BEHIND,
    MonotoneCurve,
    integrated_hats,
    level_reached,
    mean_weights,
)

ALIKE = 1.5
"""Prior standard deviation of the change of the log slope from the first knot to the last.

It walks there in steps that do not know of each other, so that a curve is as likely before the data
whatever its number of knots.
"""
_ANYWHERE = 5.0  # that of a log slope by itself: only keeps the common factor from running away
_STEEPEST = 6.0  # bound of a log slope
_MOST = 2.0  # bounds of set (rad) and softening
_EVALUATIONS = 80
_ROUNDS = 2
_TOLERANCE = 1e-8


@dataclass(frozen=True)
class Form:
    """What stands beside the linear part.

    Parameters
    ----------
    position : {"before", "behind", None}
        Of the curve; None for no curve.
    knots : int
        Of the curve.
    time_s : float or None
        Time constant of the conditioning; None for none.
    """

    position: str | None = None
    knots: int = 0
    time_s: float | None = None

    @property
    def free(self) -> int:
        """Parameters beyond the linear part's: slopes but for the mean; set, softening, time."""
        return max(0, self.knots - 1) + (0 if self.time_s is None else 3)

    def __str__(self) -> str:
        curve = f"curve {self.position}, {self.knots} knots" if self.position else "no curve"
        return curve if self.time_s is None else f"{curve}, conditioning in {self.time_s:g} s"


PLAIN = Form()


@dataclass(frozen=True)
class CurveFit:
    """A form fitted to logs; levels in u, angles in rad.

    Attributes
    ----------
    form : Form
    x : (5,) array
        Of the linear part.
    curve : MonotoneCurve or None
    top : float
        Level that set and softening refer to.
    conditioning : (2,) array
        Set (rad) and softening; zeros where there is none.
    residuals : tuple of arrays
        Measured less predicted, log by log.
    converged : bool
    """

    form: Form
    x: Floats
    curve: MonotoneCurve | None
    top: float
    conditioning: Floats
    residuals: tuple[Floats, ...] = ()
    converged: bool = True

    @property
    def squares(self) -> float:
        """Sum of squares over all logs, rad²."""
        return float(sum(one @ one for one in self.residuals))

    def residual(self, log: LogData) -> Floats:
        """Return measured less predicted at a log's known samples, rad."""
        u = log.u
        if self.form.position == BEFORE and self.curve is not None:
            u = self.curve(u)
        angle = input_map(log.t, u, log.hold).response(self.x)
        if self.form.position == BEHIND and self.curve is not None:
            angle = self.curve(angle)
        if self.form.time_s is not None:
            reached = level_reached(log.t, log.u / self.top, self.form.time_s)
            angle = angle * (1.0 + self.conditioning[1] * reached) + self.conditioning[0] * reached
        return np.asarray((log.angle_rad - angle)[log.known])


def plain_fit(logs: Sequence[LogData], optimum: Optimum) -> CurveFit:
    """Return the plain model as a form among others."""
    fit = CurveFit(PLAIN, optimum.x, None, top_level(logs), np.zeros(2))
    residuals = tuple(fit.residual(log) for log in logs)
    return CurveFit(PLAIN, optimum.x, None, fit.top, fit.conditioning, residuals, optimum.valid)


def top_level(logs: Sequence[LogData]) -> float:
    """Return the highest input of all logs."""
    return max(float(log.u.max()) for log in logs)


def top_angle(logs: Sequence[LogData]) -> float:
    """Return the highest angle of all logs but for its outliers, rad."""
    return max(float(np.percentile(log.angle_rad[log.known], 99.0)) for log in logs)


def fit_form(logs: Sequence[LogData], form: Form, bounds: Bounds, start: CurveFit) -> CurveFit:
    """Fit one form.

    The prior of the slopes is weighed against the misfit, first that of the start, then that of
    the form itself.

    Parameters
    ----------
    logs : sequence of LogData
    form : Form
        Any but the plain one.
    bounds : Bounds
        Of the linear part.
    start : CurveFit
        The plain model of these logs, or the same curve without conditioning.
    """
    problem = _Problem(logs, form, bounds)
    fit, q = start, problem.start(start)
    lower, upper = problem.box()
    for _ in range(_ROUNDS):
        problem.noise = _noise(fit)
        result = least_squares(
            problem.residual,
            np.clip(q, lower + 1e-9, upper - 1e-9),
            jac=problem.jacobian,
            bounds=(lower, upper),
            x_scale="jac",
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            max_nfev=_EVALUATIONS,
        )
        q = result.x
        fit = problem.result(q, bool(result.status > 0))
    return fit


class _Problem:
    """Residuals of all logs, weighed against the prior; q = z, log slopes, set and softening."""

    def __init__(self, logs: Sequence[LogData], form: Form, bounds: Bounds) -> None:
        self.logs, self.form = logs, form
        self.scaled = Scaled(bounds)
        self.top = top_level(logs)
        self.known = [log.known for log in logs]
        self.measured = np.concatenate([log.angle_rad[log.known] for log in logs])
        self.noise = 1.0
        self.knots = self._knots()
        self.weights = mean_weights(self.knots) if form.position else np.zeros(0)
        self.size = 5 + form.knots + (0 if form.time_s is None else 2)

    def _knots(self) -> Floats:
        if self.form.position == BEFORE:
            return np.linspace(0.0, self.top, self.form.knots)
        # Behind, the linear part's output is not known yet: the range of the angle stands for it.
        return np.linspace(0.0, top_angle(self.logs), self.form.knots)

    @cached_property
    def maps(self) -> list[list[ResponseMap]]:
        if self.form.position != BEFORE:
            return [[input_map(log.t, log.u, log.hold)] for log in self.logs]
        return [
            [input_map(log.t, part, log.hold) for part in integrated_hats(self.knots, log.u).T]
            for log in self.logs
        ]

    @cached_property
    def reached(self) -> list[Floats]:
        time = self.form.time_s
        assert time is not None
        return [level_reached(log.t, log.u / self.top, time) for log in self.logs]

    @cached_property
    def prior(self) -> Floats:
        steps = max(1, self.form.knots - 1)
        alike = np.diff(np.eye(self.form.knots), axis=0) * (np.sqrt(steps) / ALIKE)
        anywhere = np.eye(self.form.knots) / _ANYWHERE
        return np.vstack([alike, anywhere]) if self.form.knots else np.zeros((0, 0))

    def box(self) -> tuple[Floats, Floats]:
        lower, upper = self.scaled.box()
        steep = np.full(self.form.knots, _STEEPEST)
        more = self.size - 5 - self.form.knots
        return (
            np.concatenate([lower, -steep, np.zeros(more)]),
            np.concatenate([upper, steep, np.full(more, _MOST)]),
        )

    def start(self, fit: CurveFit) -> Floats:
        q = np.zeros(self.size)
        q[:5] = self.scaled.z(fit.x)
        if fit.curve is not None:
            q[5 : 5 + self.form.knots] = np.log(fit.curve.slopes)
        return q

    def slopes(self, q: Floats) -> tuple[Floats, Floats]:
        """Return the slopes, one on average, and their derivatives in the log slopes."""
        free = q[5 : 5 + self.form.knots]
        steep = np.exp(free - free.max(initial=0.0))
        slopes = steep / (self.weights @ steep)
        return slopes, np.diag(slopes) - np.outer(slopes, self.weights * slopes)

    def predicted(self, q: Floats) -> Floats:
        return np.concatenate([self._log(q, i)[self.known[i]] for i in range(len(self.logs))])

    def _log(self, q: Floats, i: int) -> Floats:
        x, position = self.scaled.x(q[:5]), self.form.position
        responses = np.column_stack([one.response(x) for one in self.maps[i]])
        if position == BEFORE:
            angle = responses @ self.slopes(q)[0]
        elif position == BEHIND:
            angle = integrated_hats(self.knots, responses[:, 0]) @ self.slopes(q)[0]
        else:
            angle = responses[:, 0]
        if self.form.time_s is None:
            return np.asarray(angle)
        rest, soft = q[-2:]
        return np.asarray(angle * (1.0 + soft * self.reached[i]) + rest * self.reached[i])

    def residual(self, q: Floats) -> Floats:
        misfit = (self.predicted(q) - self.measured) / self.noise
        return np.concatenate([misfit, self.prior @ q[5 : 5 + self.form.knots]])

    def jacobian(self, q: Floats) -> Floats:
        rows = np.concatenate([self._slope(q, i)[self.known[i]] for i in range(len(self.logs))])
        below = np.zeros((self.prior.shape[0], self.size))
        below[:, 5 : 5 + self.form.knots] = self.prior
        return np.vstack([rows / self.noise, below])

    def _slope(self, q: Floats, i: int) -> Floats:
        """Return the derivatives of one log's angle in q."""
        x, position = self.scaled.x(q[:5]), self.form.position
        responses = np.column_stack([one.response(x) for one in self.maps[i]])
        linear = np.stack([one.jacobian(x) for one in self.maps[i]])
        if position is None:
            angle, columns = responses[:, 0], [self.scaled.derivative(x, linear[0])]
        else:
            slopes, moved = self.slopes(q)
            if position == BEFORE:
                parts, inner = responses, np.tensordot(slopes, linear, 1)
            else:
                parts = integrated_hats(self.knots, responses[:, 0])
                steep = np.interp(responses[:, 0], self.knots, slopes)
                inner = linear[0] * steep[:, np.newaxis]
            angle = parts @ slopes
            columns = [self.scaled.derivative(x, inner), parts @ moved]
        if self.form.time_s is None:
            return np.hstack(columns)
        reached = self.reached[i]
        soft = (1.0 + q[-1] * reached)[:, np.newaxis]
        conditioned = np.column_stack([reached, angle * reached])
        return np.hstack([*(column * soft for column in columns), conditioned])

    def result(self, q: Floats, converged: bool) -> CurveFit:
        sizes = [0, *np.cumsum([int(np.count_nonzero(known)) for known in self.known])]
        missed = self.measured - self.predicted(q)
        curve = MonotoneCurve(self.knots, self.slopes(q)[0]) if self.form.position else None
        return CurveFit(
            self.form,
            self.scaled.x(q[:5]),
            curve,
            self.top,
            np.zeros(2) if self.form.time_s is None else q[-2:],
            tuple(missed[a:b] for a, b in pairwise(sizes)),
            converged,
        )


def _noise(fit: CurveFit) -> float:
    """Return the misfit, rad, as that of as many samples as are independent."""
    return max(1e-6, float(np.sqrt(fit.squares / independent_samples(fit.residuals))))
