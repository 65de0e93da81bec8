"""What is known of an actuator's coefficients before its angles are looked at.

A model that was identified elsewhere tells the step response, and each coefficient only as far as
that decides it: coefficients that make one response lie in a narrow and curved valley, far wider
than where it is straight. So its response stands among the observations, and the prior is a usual
actuator's; or, beside a reference, as wide about the model itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import brentq, least_squares

from spa_fo.arrays import Floats
from spa_fo.fractional import step_response
from spa_fo.gap.data.searched import HIGHEST, LOWEST, at_rate, quicker, searched_spread, to_x, to_z
from spa_fo.gap.noise.bench_noise import BenchNoise
from spa_fo.gap.settings import SETTINGS
from spa_fo.identify import selection
from spa_fo.numeric.lapack import forward
from spa_fo.plant import PARAMETERS, Model
from spa_fo.plant.paper import TABLE_I

_FIRST_S, _A_DECADE = 0.05, 6  # times at which the given model's step response is known
_SLOPE_STEP = 1e-4
_RISEN = 0.63
_FASTEST, _SLOWEST = 100.0, 0.01  # as fast as the paper's actuators
_SAMPLES = 400
_DRAWS = 64  # of a shift, in pairs


@dataclass(frozen=True)
class KnownResponse:
    """The step response of a model that was identified elsewhere, as an observation."""

    times_s: Floats  # (k,), up to the longest trial: what it says of a hold it says, too
    values: Floats  # (k,), of its final value, or of the largest by then if that is less
    gain: float  # that value
    root: Floats  # (k, k), Cholesky factor, lower, of the covariance of its error

    @property
    def log_noise(self) -> float:
        """Logarithm of the determinant of that covariance."""
        return 2.0 * float(np.sum(np.log(np.diag(self.root))))

    def left(self, z: Floats) -> Floats:
        """Give what searched coefficients leave of it, whitened, (k,)."""
        left = self.values - step_response(self.times_s, *to_x(z[:5])) / self.gain
        return forward(self.root, left)

    def slopes(self, z: Floats) -> Floats:
        """Slopes of the response over the searched coefficients, whitened, (k, 5)."""
        steps = _SLOPE_STEP * np.eye(5)
        apart = [self.left(z[:5] - d) - self.left(z[:5] + d) for d in steps]
        return np.column_stack(apart) / (2.0 * _SLOPE_STEP)

    def wider(self, z: Floats, spread: Floats) -> KnownResponse:
        """Return it as it is known where coefficients near `z` have moved since, by (5, 5)."""
        slopes = self.root @ self.slopes(z)
        covariance = self.root @ self.root.T + slopes @ spread @ slopes.T
        return replace(self, root=np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))

    def shifted(self, z: Floats, spread: Floats) -> KnownResponse:
        """Return it as it is known where coefficients about `z` have shifted since by `spread`.

        A shift is so large that the response does not go straight with it, as it does in `wider`:
        its covariance is that of drawn shifts.
        """
        drawn = np.clip(z[:5] + _normal_draws() @ np.linalg.cholesky(spread).T, LOWEST, HIGHEST)
        moved = np.array([self.left(z) - self.left(one) for one in drawn]) @ self.root.T
        covariance = self.root @ self.root.T + moved.T @ moved / len(drawn)
        return replace(self, root=np.asarray(np.linalg.cholesky(covariance), dtype=np.float64))


@cache
def _normal_draws() -> Floats:
    """Draws of five standard normal numbers, in pairs about 0, whose covariance is exact."""
    half = np.random.default_rng(0).standard_normal((_DRAWS // 2, 5))
    drawn = np.vstack([half, -half])
    return np.linalg.solve(np.linalg.cholesky(drawn.T @ drawn / _DRAWS), drawn.T).T


@dataclass(frozen=True)
class Coefficients:
    """What is known of the searched coefficients: a usual actuator, and a model's response."""

    mean: Floats  # (5,), of a usual actuator as fast and as strong as the given model, or its own
    spread: Floats  # (5, 5), covariance
    response: KnownResponse | None = None  # None of a model fitted to this very campaign: it bent

    def about(self, z: Floats) -> Coefficients:
        """Return what is known as if the valley about `z` were straight, and they had shifted."""
        if self.response is None:
            return self
        slopes = self.response.slopes(z)
        known = np.linalg.inv(slopes.T @ slopes + np.linalg.inv(self.spread))
        return Coefficients(z, known + _shift(z))

    def untempered(self) -> Coefficients:
        """Return it as it counts beside rows whose evidence is tempered.

        What is missed by a form repeats over the rows; how a model errs it has said before them.
        """
        if self.response is None:
            return self
        root = np.sqrt(SETTINGS.temper) * self.response.root
        return replace(self, response=replace(self.response, root=root))

    def log_evidence(self, z: Floats) -> float:
        """Log marginal likelihood of the response that is known, by Laplace about its best `z`."""
        if self.response is None:
            return 0.0
        left, slopes, away = self.response.left(z), self.response.slopes(z), z - self.mean
        precision = np.linalg.inv(self.spread)
        fit = float(left @ left + away @ precision @ away)
        log_determinant = float(np.linalg.slogdet(self.spread @ (slopes.T @ slopes + precision))[1])
        log_noise = self.response.log_noise + left.size * np.log(2.0 * np.pi)
        return -0.5 * (fit + log_determinant + float(log_noise))

    def shifted(self, z: Floats) -> Coefficients:
        """Return what is known where the parameters have shifted since, about `z`."""
        if self.response is None:
            return self
        shift = _shift(z)
        return Coefficients(self.mean, self.spread + shift, self.response.shifted(z, shift))


def _shift(z: Floats) -> Floats:
    """Covariance of what another specimen, or a later day, differs by."""
    s = SETTINGS
    return searched_spread(z, s.shift_orders, s.shift_logs, s.shift_gain)


def usual(given: Floats, horizon_s: float) -> Coefficients:
    """Say what is usual of an actuator as fast and as strong as a given model, (5,)."""
    s, mean = SETTINGS, to_z(typical(given, horizon_s))
    return Coefficients(mean, searched_spread(mean, s.own_orders, s.own_logs, s.own_gain))


def identified(
    given: Floats,
    noise: BenchNoise,
    horizon_s: float,
    longest_s: float,
    angle_deg: float = np.inf,
    error_deg: float | None = 0.0,
) -> tuple[Floats, Coefficients]:
    """Say what a model that was identified elsewhere tells of trials that last up to `longest_s`.

    Its gain and time scale are the mean of a few trials, and its angles, about `angle_deg` in size,
    were read by a sensor calibrated as well as this one. By its own identification it errs by
    `error_deg`, see `error_of`; one that does not say so may err in its gain as in its response.

    Returns
    -------
    (5,) array
        The most probable searched coefficients.
    Coefficients
        What is known of them.
    """
    read = float(np.hypot(noise.fixture.deg or 0.0, noise.fixture.mark_deg)) / angle_deg
    own = 0.0 if error_deg is None else error_deg / angle_deg
    error = float(np.linalg.norm([SETTINGS.response_error, read, own]))
    longest_s = max(longest_s, 2.0 * _FIRST_S)
    count = 2 + int(_A_DECADE * np.log10(longest_s / _FIRST_S))
    times_s = np.geomspace(_FIRST_S, longest_s, count)
    values = step_response(times_s, *given)
    # One that hardly has an end, as no trial showed it, is known by what it reaches.
    gain = min(float(given[4] / given[3]), float(np.abs(values).max()))
    values = values / gain
    known = KnownResponse(times_s, values, gain, error * np.eye(count))
    before, inside = usual(given, horizon_s), (LOWEST + 1e-2, HIGHEST - 5e-3)
    if noise.compared:  # what the model misses, however odd it is, is known beside it
        before = Coefficients(np.clip(to_z(given), *inside), before.spread)
    root = np.linalg.cholesky(before.spread)

    def left(z: Floats) -> Floats:
        return np.append(known.left(z), forward(root, z - before.mean))

    found = [
        least_squares(left, np.clip(start, *inside), bounds=(LOWEST, HIGHEST))
        for start in (before.mean, to_z(given))
    ]
    z = np.asarray(min(found, key=lambda f: float(f.cost)).x)
    scatter, trials = noise.scatter, SETTINGS.model_trials
    moved = scatter.time_scale**2 / trials * np.outer(quicker(z), quicker(z))
    moved[4, 4] += scatter.gain**2 / trials + read**2
    if error_deg is None:
        moved[4, 4] += SETTINGS.response_error**2
    return z, replace(before, response=known.wider(z, moved))


def error_of(model: Model) -> float | None:
    """Say by how much a model's response errs by its own identification, RMS, deg.

    That is the residual of the fractional order times the root of coefficients over independent
    samples, the mean error of what a regression predicts, or less: a residual holds what trials
    differ by, which the model's gain and time scale take. None where the model does not say it.
    """
    orders: Any = model.extra.get(selection.KEY)
    try:
        left = {one["model"]: float(one["rms_deg"]) for one in orders["models"]}
        share = len(PARAMETERS) / float(orders["independent_samples"])
        regression = left[selection.FRACTIONAL] * float(np.sqrt(min(share, 1.0)))
        return SETTINGS.model_error * regression
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return None


def typical(given: Floats, horizon_s: float) -> Floats:
    """Give coefficients, (5,), of the paper's actuators as fast and as strong as a given model.

    A model that was fitted to a gap has bent with it: its damping may have vanished, or its
    inertia, and with it what tells the search the way back. It was fitted to steps of `horizon_s`.
    """
    mean = np.mean([x.as_array() for x in TABLE_I.values()], axis=0)
    rise = np.log(rise_s(given, horizon_s))

    def later(log_rate: float) -> float:
        return float(np.log(rise_s(at_rate(mean, float(np.exp(log_rate))), horizon_s)) - rise)

    ends = np.log(_SLOWEST), np.log(_FASTEST)
    signs = [later(end) for end in ends]
    log_rate = float(ends[int(np.argmin(np.abs(signs)))])
    if signs[0] * signs[1] < 0.0:
        log_rate = float(brentq(later, *ends, xtol=1e-3))
    x = at_rate(mean, float(np.exp(log_rate)))
    end = np.array([horizon_s])
    x[4] *= float(step_response(end, *given)[0] / step_response(end, *x)[0])
    return np.asarray(x)


def rise_s(x: Floats, horizon_s: float) -> float:
    """Time at which most of the response at the horizon is reached, s."""
    time = np.geomspace(1e-4, 1.0, _SAMPLES) * horizon_s
    y = step_response(time, *x)
    return float(time[int(np.argmax(y >= _RISEN * y[-1]))])
