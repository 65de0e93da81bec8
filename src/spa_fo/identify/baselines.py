"""The models that the fractional one is held against, fitted to the same step responses.

Ludwick's model (Eq. 5 and 22 of arXiv:2512.18213) with its constants from the literature, where
only the force scale that the paper does not print is fitted, in common or one for each setpoint;
the same with all four refitted; and the linear models of integer order, with one and two poles, on
whole logs too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from spa_fo.arrays import Floats
from spa_fo.identify.protocol import StepData
from spa_fo.identify.whole_log import LogData, held_response
from spa_fo.plant.ludwick import Ludwick, ludwick_step
from spa_fo.plant.paper import DAMPING_RATIO, NATURAL_FREQUENCY
from spa_fo.plant.second_order import second_order_step

StepFunction = Callable[[Floats, float], Floats]
"""(times in s, height of the step u) to the angle in rad."""

_STARTING_EXPONENTS = (1.0, 1.7, 2.5)
_STARTING_FREQUENCIES = (0.3, 1.0, 3.0)
_STARTING_TIMES = (0.3, 1.0, 3.0)
# Of whole logs the time scale is not known beforehand: soft arms take 0.1 to 10 s.
_LOG_TIMES = (0.1, 0.3, 1.0, 3.0, 10.0)
_STARTING_RATIOS = (0.3, 0.7, 2.0)
_LINEAR_NAMES = {1: ("gain", "time_constant"), 2: ("gain", "damping_ratio", "natural_frequency")}
# Beyond these the parameters say nothing any more; they keep the search from overflow.
_LOWEST, _HIGHEST = 1e-3, 1e4


@dataclass(frozen=True)
class Baseline:
    """A fitted baseline.

    Attributes
    ----------
    name : str
        For tables and legends.
    kind : str
        "ludwick", "first order" or "second order".
    source : str
        How its parameters came about: "literature", "literature per setpoint" or "refitted".
    parameters : Mapping[str, float]
        Values in SI units, angles in rad.
    fitted : tuple of str
        Which of them were fitted to these data.
    step : callable
        (times in s, height of the step) to the angle in rad.
    """

    name: str
    kind: str
    source: str
    parameters: Mapping[str, float]
    fitted: tuple[str, ...]
    step: StepFunction


def fit_ludwick_literature(data: StepData, exponent: float) -> Baseline:
    """Fit the force scale; the exponent as given, damping and frequency from the paper's authors.

    Parameters
    ----------
    data : StepData
        Step responses.
    exponent : float
        n + Δn of Ludwick's law.
    """

    def model(force: float) -> Ludwick:
        return Ludwick(exponent, DAMPING_RATIO, NATURAL_FREQUENCY, force)

    # The final angle gives a start: F/M u = wn² θ^n.
    level = np.mean(np.abs(data.angle_rad[:, -1]) ** exponent / np.abs(data.u))
    (force,) = _fit(
        data,
        lambda p: _ludwick(model(float(p[0]))),
        [np.array([max(NATURAL_FREQUENCY**2 * level, 10 * _LOWEST)])],
    )
    name = "Ludwick, n from the literature"
    return _ludwick_baseline(name, "literature", model(float(force)), ("force",))


def fit_ludwick_per_step(data: StepData, exponent: float) -> Baseline:
    """Fit one force for each height of the step: the reading that favours the baseline most.

    The paper does not print F/M, nor how it depends on the pressure.

    Parameters
    ----------
    data : StepData
        Step responses.
    exponent : float
        n + Δn of Ludwick's law.
    """
    heights = np.unique(data.u)
    parts = [
        fit_ludwick_literature(data.select(np.flatnonzero(data.u == u)), exponent) for u in heights
    ]

    def step(t: Floats, u: float) -> Floats:
        return parts[int(np.argmin(np.abs(heights - u)))].step(t, u)

    forces = {
        f"force at u = {u:.3f}": part.parameters["force"]
        for u, part in zip(heights, parts, strict=True)
    }
    constants = {key: value for key, value in parts[0].parameters.items() if key != "force"}
    name = "Ludwick, n from the literature, a force a setpoint"
    source = "literature per setpoint"
    return Baseline(name, "ludwick", source, {**constants, **forces}, tuple(forces), step)


def fit_ludwick(data: StepData) -> Baseline:
    """Fit the exponent, the damping ratio, the natural frequency and the force scale."""
    level = float(np.mean(np.abs(data.angle_rad[:, -1]) / np.abs(data.u)))
    rate = 10.0 / data.t[-1]
    starts = [
        np.array([n, DAMPING_RATIO, f * rate, max((f * rate) ** 2 * level**n, 10 * _LOWEST)])
        for n in _STARTING_EXPONENTS
        for f in _STARTING_FREQUENCIES
    ]
    best = _fit(data, lambda p: _ludwick(Ludwick(*(float(v) for v in p))), starts)
    model = Ludwick(*(float(value) for value in best))
    return _ludwick_baseline("Ludwick, refitted", "refitted", model, tuple(_parameters(model)))


def fit_second_order(data: StepData) -> Baseline:
    """Fit gain, damping ratio and natural frequency of the linear second-order model."""
    level = float(np.mean(np.abs(data.angle_rad[:, -1]) / np.abs(data.u)))
    rate = 10.0 / data.t[-1]
    starts = [
        np.array([max(level, 10 * _LOWEST), DAMPING_RATIO, f * rate]) for f in _STARTING_FREQUENCIES
    ]
    return _linear_baseline(_fit(data, lambda p: _scaled(_linear(p)), starts))


def fit_first_order(data: StepData) -> Baseline:
    """Fit gain and time constant of the linear first-order model."""
    level = float(np.mean(np.abs(data.angle_rad[:, -1]) / np.abs(data.u)))
    starts = [np.array([max(level, 10 * _LOWEST), t * data.t[-1] / 10.0]) for t in _STARTING_TIMES]
    best = _fit(data, lambda p: _scaled(_linear(p)), starts)
    return _linear_baseline(best)


def fit_on_logs(logs: Sequence[LogData], poles: int) -> Baseline:
    """Fit the linear model of one or two poles, with its gain, to whole logs.

    Parameters
    ----------
    logs : sequence of LogData
        From `log_data`.
    poles : {1, 2}
        Its order.
    """
    measured = np.concatenate([log.angle_rad[log.known] for log in logs])

    def response(shape: Floats) -> Floats:
        """Predict all known samples by the best gain: it is linear in that."""
        unit = _linear(np.concatenate([[1.0], np.exp(shape)]))
        parts = [held_response(log, unit)[log.known] for log in logs]
        return np.concatenate(parts)

    def gain(y: Floats) -> float:
        return float(np.clip(y @ measured / max(float(y @ y), 1e-300), _LOWEST, _HIGHEST))

    def residual(shape: Floats) -> Floats:
        y = response(shape)
        return np.asarray(gain(y) * y - measured)

    times = np.log(_LOG_TIMES)
    grid = (
        [np.array([time]) for time in times]
        if poles == 1
        else [np.array([zeta, -time]) for zeta in np.log(_STARTING_RATIOS) for time in times]
    )
    starts = sorted(grid, key=lambda shape: float(np.sum(residual(shape) ** 2)))[:2]
    limits = (np.log(_LOWEST), np.log(_HIGHEST))
    fits = [least_squares(residual, start, bounds=limits) for start in starts]
    shape = min(fits, key=lambda fit: float(fit.cost)).x
    return _linear_baseline(np.concatenate([[gain(response(shape))], np.exp(shape)]))


def _linear(p: Floats) -> Callable[[Floats], Floats]:
    """Unit-step response: gain and time constant, or gain, damping ratio, natural frequency."""
    if p.size == 2:
        gain, time = float(p[0]), float(p[1])
        return lambda t: np.asarray(-gain * np.expm1(-t / time))
    gain, zeta, omega = (float(value) for value in p)
    return lambda t: second_order_step(t, gain, zeta, omega)


def _scaled(unit: Callable[[Floats], Floats]) -> StepFunction:
    return lambda t, u: u * unit(t)


def _linear_baseline(p: Floats) -> Baseline:
    order = "first" if p.size == 2 else "second"
    names = _LINEAR_NAMES[p.size - 1]
    parameters = dict(zip(names, p.tolist(), strict=True))
    kind, name = f"{order} order", f"linear {order} order, refitted"
    return Baseline(name, kind, "refitted", parameters, names, _scaled(_linear(p)))


def _ludwick(model: Ludwick) -> StepFunction:
    return lambda t, u: ludwick_step(t, u, model)


def _ludwick_baseline(name: str, source: str, model: Ludwick, fitted: tuple[str, ...]) -> Baseline:
    return Baseline(name, "ludwick", source, _parameters(model), fitted, _ludwick(model))


def _parameters(model: Ludwick) -> dict[str, float]:
    return {
        "exponent": model.exponent,
        "damping_ratio": model.damping_ratio,
        "natural_frequency": model.natural_frequency,
        "force": model.force,
    }


def _fit(data: StepData, step_of: Callable[[Floats], StepFunction], starts: list[Floats]) -> Floats:
    """Least squares over all samples in the parameters' logarithms, from several starts.

    Data sets of one height share their curve, so each height's mean stands for them all.
    """
    heights, group = np.unique(data.u, return_inverse=True)
    counts = np.bincount(group)
    means = np.array([data.angle_rad[group == i].mean(axis=0) for i in range(heights.size)])
    scale = np.sqrt(counts)[:, np.newaxis]

    def residual(log_p: Floats) -> Floats:
        step = step_of(np.exp(log_p))
        curves = np.array([step(data.t, float(u)) for u in heights])
        errors: Floats = scale * (curves - means)
        return np.nan_to_num(errors.ravel(), nan=1e3, posinf=1e3, neginf=-1e3)

    fits = [
        least_squares(
            residual,
            np.log(np.clip(start, 2 * _LOWEST, 0.5 * _HIGHEST)),
            bounds=(np.log(_LOWEST), np.log(_HIGHEST)),
        )
        for start in starts
    ]
    best: Floats = np.exp(min(fits, key=lambda fit: float(fit.cost)).x)
    return best
