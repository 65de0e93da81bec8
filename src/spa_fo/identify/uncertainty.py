"""How well the data determine the parameters: covariance, profile likelihood, trial bootstrap.

Noise is the trials' own scatter (`noise`). Samples of one trial deviate together, so its variance
is multiplied by the design effect. Where the model's misses of the mean response, taken as
independent from sample to sample, come to more than that (chi-square / degrees of freedom above
the design effect), errors rest on them instead.

A parameter counts as *determined* when its 95 % profile interval is closed within the bounds and
narrower than ±10 % of the estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri  # scipy.stats takes a third of a second to import

from spa_fo.arrays import Floats
from spa_fo.fractional import ResponseMap, step_map
from spa_fo.identify.noise import Noise, trial_noise
from spa_fo.identify.polish import Draws, Optimum, fit_many
from spa_fo.identify.protocol import StepData
from spa_fo.plant.estimates import QUANTITIES
from spa_fo.plant.transfer_function import PARAMETERS

DETERMINED_WITHIN = 0.10
"""Half-width of the 95 % interval, relative, below which a quantity counts as determined."""
LEVELS = (0.68, 0.95)
_PROFILE_POINTS = 81
# The static gain is profiled this far to either side (a factor), the parameters over their bounds.
_GAIN_RANGE = 2.0
_CLUSTER = 0.35  # share of the grid that lies close to the estimate


@dataclass(frozen=True)
class Covariance:
    """Gauss-Newton approximation at the optimum.

    Attributes
    ----------
    matrix : (5, 5) array
        Of the parameters, in their units; of parameters on a bound the rows are NaN.
    standard_error : (6,) array
        Of `QUANTITIES`; NaN on a bound.
    correlation : (5, 5) array
        NaN on a bound.
    condition_number : float
        Of the Fisher information of the five parameters, each scaled by its value.
    """

    matrix: Floats
    standard_error: Floats
    correlation: Floats
    condition_number: float


@dataclass(frozen=True)
class Profile:
    """Rise of chi-square while one quantity is held and the others are fitted again.

    Attributes
    ----------
    name : str
        One of `QUANTITIES`.
    values, rise : (n,) arrays
        Held values, sorted, and the rise of chi-square above its minimum.
    curve_change_deg : (n,) array
        Largest difference of the refitted curve from the optimum's, at the largest step.
    estimate : float
        At the optimum.
    low_68, high_68, low_95, high_95 : float
        Likelihood intervals; where open they end at the last value held.
    open_low, open_high : bool
        Whether the 95 % interval runs into the bounds.
    determined : bool
        The rule of this module.
    """

    name: str
    values: Floats
    rise: Floats
    curve_change_deg: Floats
    estimate: float
    low_68: float
    high_68: float
    low_95: float
    high_95: float
    open_low: bool
    open_high: bool
    determined: bool

    @property
    def likely_change_deg(self) -> float:
        """Largest change of the refitted curve while the value stays within its 95 % interval."""
        within = (self.values >= self.low_95) & (self.values <= self.high_95)
        return float(np.max(self.curve_change_deg[within]))


@dataclass(frozen=True)
class Bootstrap:
    """Fits to trials drawn with replacement within each experiment, one fewer than there are.

    Attributes
    ----------
    x : (b, 5) array
        Parameters of each fit.
    low, high : (6,) arrays
        2.5 and 97.5 % quantiles of `QUANTITIES`.
    standard_deviation : (6,) array
        Of `QUANTITIES`.
    curve_error_deg : float
        RMS over times of the curves' standard deviation, at the largest step.
    """

    x: Floats
    low: Floats
    high: Floats
    standard_deviation: Floats
    curve_error_deg: float


@dataclass(frozen=True)
class Uncertainty:
    """All of it, with the chi-square it rests on.

    Attributes
    ----------
    chi2, dof : float, int
        Of the mean responses against the model, in units of the trials' scatter of a mean,
        samples of one trial taken as independent.
    scale : float
        Factor on all errors where lack of fit exceeds the trials' scatter, at least 1.
    """

    noise: Noise
    chi2: float
    dof: int
    scale: float
    covariance: Covariance
    profiles: tuple[Profile, ...]
    bootstrap: Bootstrap | None

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Names of the parameters that the data do not determine."""
        return tuple(p.name for p in self.profiles if p.name != "K" and not p.determined)

    @property
    def widest(self) -> Profile:
        """The parameter whose 95 % interval is widest beside its value."""
        return max(self.profiles[:-1], key=lambda p: (p.high_95 - p.low_95) / abs(p.estimate))

    def profile(self, name: str) -> Profile:
        """Return the profile of one of `QUANTITIES`."""
        return self.profiles[QUANTITIES.index(name)]


def assess(data: StepData, optimum: Optimum, seed: int = 1, bootstrap: int = 400) -> Uncertainty:
    """Assess an optimum of `fit_optimum` on the same data.

    Parameters
    ----------
    data : StepData
        What was fitted.
    optimum : Optimum
        Its least squares.
    seed : int
        Of the refits' swarm and of the resampling.
    bootstrap : int
        Number of resamples; 0 for none. An experiment of one trial is not resampled.
    """
    response = step_map(data.t)
    noise = trial_noise(data, optimum.rmse)
    chi_square, dof = _lack_of_fit(data, optimum, response, noise)
    scale = max(1.0, float(np.sqrt(chi_square / dof / noise.design_effect)))
    # One sample's variance as it enters errors of estimates.
    variance = max(noise.total, 1e-12) ** 2 * noise.design_effect * scale**2
    draws = Draws.from_seed(seed)
    return Uncertainty(
        noise=noise,
        chi2=chi_square,
        dof=dof,
        scale=scale,
        covariance=_covariance(data, optimum, response, variance),
        profiles=_profiles(data, optimum, response, variance, draws),
        bootstrap=_bootstrap(data, optimum, response, draws, seed, bootstrap)
        if bootstrap > 0 and noise.repeated
        else None,
    )


def _lack_of_fit(
    data: StepData, optimum: Optimum, response: ResponseMap, noise: Noise
) -> tuple[float, int]:
    y = response.response(optimum.x)
    variance = max(noise.total, 1e-12) ** 2
    free = len(PARAMETERS) - len(optimum.at_bounds)
    if not noise.repeated:
        dof = max(data.angle_rad.size - free, 1)
        return float(dof), dof
    chi_square = sum(
        rows.size
        * float(np.sum((data.angle_rad[rows].mean(axis=0) - data.u[rows].mean() * y) ** 2))
        for rows in data.groups.values()
    )
    return chi_square / variance, max(len(data.groups) * data.points - free, 1)


def _covariance(
    data: StepData, optimum: Optimum, response: ResponseMap, variance: float
) -> Covariance:
    x = optimum.x
    jacobian = response.jacobian(x) * x * np.sqrt(np.sum(data.u**2) / variance)
    information = jacobian.T @ jacobian
    free = _off_bounds(optimum)
    matrix = np.full((5, 5), np.nan)
    matrix[np.ix_(free, free)] = np.linalg.pinv(
        information[np.ix_(free, free)], rcond=1e-15, hermitian=True
    ) * np.outer(x[free], x[free])
    deviation = np.sqrt(np.diag(matrix))
    gain = x[4] / x[3]
    slope = np.where(free, [0, 0, 0, -gain / x[3], 1 / x[3]], 0.0)
    gain_error = np.sqrt(slope[free] @ matrix[np.ix_(free, free)] @ slope[free])
    singular = np.linalg.svd(jacobian, compute_uv=False)
    return Covariance(
        matrix,
        np.append(deviation, gain_error),
        matrix / np.outer(deviation, deviation),
        float((singular[0] / singular[-1]) ** 2),
    )


def _off_bounds(optimum: Optimum) -> NDArray[np.bool_]:
    touched = {mark.split()[0] for mark in optimum.at_bounds}
    return np.array([name not in touched for name in PARAMETERS])


def _profiles(
    data: StepData, optimum: Optimum, response: ResponseMap, variance: float, draws: Draws
) -> tuple[Profile, ...]:
    x, bounds = optimum.x, optimum.bounds
    held = [_grid(x[i], bounds.lower[i], bounds.upper[i]) for i in range(5)]
    gain = x[4] / x[3]
    held.append(_grid(gain, gain / _GAIN_RANGE, gain * _GAIN_RANGE))
    sizes = [values.size for values in held]
    fits = sum(sizes)
    lower, upper = np.tile(bounds.lower, (fits, 1)), np.tile(bounds.upper, (fits, 1))
    start, gains = np.tile(x, (fits, 1)), np.full(fits, np.nan)
    first = 0
    for i, values in enumerate(held):
        rows = slice(first, first + values.size)
        if i < 5:
            lower[rows, i] = upper[rows, i] = start[rows, i] = values
        else:
            gains[rows] = values
        first += values.size
    found = fit_many(
        response, data, bounds, draws, lower=lower, upper=upper, gain=gains, start=start
    )
    optimal = response.response(x)
    rise = np.maximum(found.sum_squares - optimum.sum_squares, 0.0) / variance
    change = np.degrees(np.max(data.u)) * np.array(
        [np.max(np.abs(response.response(row) - optimal)) for row in found.x]
    )
    edges = np.cumsum([0, *sizes])
    estimates = np.append(x, gain)
    return tuple(
        _profile(name, values, rise[a:b], change[a:b], float(estimate))
        for name, values, a, b, estimate in zip(
            QUANTITIES, held, edges[:-1], edges[1:], estimates, strict=True
        )
    )


def _grid(estimate: float, low: float, high: float) -> Floats:
    """Values to hold: over the whole range, closer together near the estimate, which is one."""
    fine = round(_CLUSTER * _PROFILE_POINTS)
    side = np.geomspace(1e-3, 1.0, fine)
    logarithmic = high > 10.0 * low
    a, b, c = np.log([low, high, estimate]) if logarithmic else np.array([low, high, estimate])
    reach = 0.3 if logarithmic else 0.3 * abs(estimate)
    values = np.concatenate(
        [np.linspace(a, b, _PROFILE_POINTS - fine), c + reach * side, c - reach * side, [c]]
    )
    values = np.unique(np.clip(values, a, b))
    return np.clip(np.exp(values), low, high) if logarithmic else values


def _profile(name: str, values: Floats, rise: Floats, change: Floats, estimate: float) -> Profile:
    (low_68, high_68, _, _), (low, high, open_low, open_high) = (
        _interval(values, rise, estimate, float(chdtri(1, 1.0 - level))) for level in LEVELS
    )
    closed = not (open_low or open_high)
    return Profile(
        name=name,
        values=values,
        rise=rise,
        curve_change_deg=change,
        estimate=estimate,
        low_68=low_68,
        high_68=high_68,
        low_95=low,
        high_95=high,
        open_low=open_low,
        open_high=open_high,
        determined=closed and high - low <= 2.0 * DETERMINED_WITHIN * abs(estimate),
    )


def _interval(
    values: Floats, rise: Floats, estimate: float, level: float
) -> tuple[float, float, bool, bool]:
    """Where the rise first passes the level, to either side; open where it never does."""
    ends = []
    for side in (values <= estimate, values >= estimate):
        v, r = values[side], rise[side]
        if v[0] < estimate or v.size == 1:
            v, r = v[::-1], r[::-1]
        beyond = np.flatnonzero(r > level)
        if beyond.size == 0:
            ends.append((float(v[-1]), True))
        elif beyond[0] == 0:
            ends.append((float(v[0]), False))
        else:
            k = int(beyond[0])
            # The rise is nearly a parabola: its root is nearly a line.
            a, b = np.sqrt(r[k - 1]), np.sqrt(r[k])
            ends.append(
                (float(v[k - 1] + (v[k] - v[k - 1]) * (np.sqrt(level) - a) / (b - a)), False)
            )
    return ends[0][0], ends[1][0], ends[0][1], ends[1][1]


def _bootstrap(
    data: StepData, optimum: Optimum, response: ResponseMap, draws: Draws, seed: int, size: int
) -> Bootstrap:
    generator = np.random.default_rng(seed)
    counts = np.zeros((size, data.datasets))
    for rows in data.groups.values():
        # One trial fewer than there are, or the spread of few trials would come out too small
        # (Rao and Wu 1988, doi:10.1080/01621459.1988.10478591).
        drawn = rows[generator.integers(rows.size, size=(size, max(rows.size - 1, 1)))]
        for k in range(drawn.shape[1]):
            counts[np.arange(size), drawn[:, k]] += 1.0
    found = fit_many(
        response,
        data,
        optimum.bounds,
        draws,
        counts=counts,
        start=np.tile(optimum.x, (size, 1)),
    )
    quantities = np.column_stack([found.x, found.x[:, 4] / found.x[:, 3]])
    low, high = np.quantile(quantities, [0.025, 0.975], axis=0)
    curves = np.array([response.response(x) for x in found.x])
    spread = np.degrees(np.max(data.u)) * float(np.sqrt(np.mean(np.var(curves, axis=0))))
    return Bootstrap(found.x, low, high, np.std(quantities, axis=0), spread)
