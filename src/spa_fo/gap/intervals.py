"""Parameters of an explanation with their intervals, by the fits' normal approximation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.drive import DriveFit
from spa_fo.gap.explain import IN_COVARIANCE, Fit
from spa_fo.gap.explanation import Explanation
from spa_fo.plant.effects.library import CURVE_KNOTS_DEG, LIBRARY

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Errors = dict[tuple[str, str], float]

_WIDTH = 1.96


def with_intervals(
    explanation: Explanation, given: Floats, orders: Integers
) -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
    """List the parameters of each effect as ``{"value": ..., "ci95": [low, high]}``.

    Parameters
    ----------
    explanation : Explanation
        Fitted.
    given : (5,) array
        Coefficients of the plain model.
    orders : (trials,) array
        Orders of the trials it was fitted to.

    Returns
    -------
    dict
        By effect and parameter. ``ci95`` is None where the fit says nothing of the error: of the
        frequency of an interference, which was searched on a grid.
    """
    absolute: Errors = {}
    relative: Errors = {}
    fit = explanation.fit
    covariance = fit.solution.covariance()
    _of_slots(fit, np.sqrt(np.diag(covariance))[5:], absolute, relative)
    if explanation.drive is not None:
        sigma = np.sqrt(np.diag(explanation.drive.solution.covariance()))
        _of_slots(explanation.drive, sigma, absolute, relative)
    _of_shift(given, covariance, absolute, relative)
    _of_curve(fit, covariance, absolute)
    if "sensor_slip" in explanation.ids:
        _of_slip(fit, covariance, orders, absolute)
    if "mains_pickup" in fit.ids:
        amplitude = np.sqrt(np.sum(fit.waves_deg[: orders.size] ** 2, axis=1))
        amplitude = amplitude[amplitude > 0.0]  # a trial that took no part has none
        error = float(np.std(amplitude) / np.sqrt(max(amplitude.size, 1)))
        absolute[("mains_pickup", "amplitude_deg")] = error
    return {
        name: {
            key: {"value": value, "ci95": _interval(value, (name, key), absolute, relative)}
            for key, value in own.items()
        }
        for name, own in explanation.parameters(given, orders).items()
    }


def _interval(
    value: float, key: tuple[str, str], absolute: Errors, relative: Errors
) -> list[float] | None:
    if key in relative:
        return [value * float(np.exp(side * _WIDTH * relative[key])) for side in (-1, 1)]
    if key in absolute:
        return [value - _WIDTH * absolute[key], value + _WIDTH * absolute[key]]
    return None


def _of_slots(fit: Fit | DriveFit, sigma: Floats, absolute: Errors, relative: Errors) -> None:
    """Errors of what was searched; `sigma` begins with the first effect's first parameter."""
    at = 0
    for name in fit.ids:
        if name in IN_COVARIANCE:
            continue
        for parameter in LIBRARY[name].parameters:
            errors = relative if parameter.log else absolute
            errors[(name, parameter.name)] = float(sigma[at])
            at += 1


def _of_shift(given: Floats, covariance: Floats, absolute: Errors, relative: Errors) -> None:
    """Errors of the coefficients' ratios: searched were the orders, ln a1, ln a0 and ln b0/a0."""
    sigma = np.sqrt(np.diag(covariance)[:5])
    absolute[("parameter_shift", "alpha2")] = float(sigma[0] / given[0])
    absolute[("parameter_shift", "alpha1")] = float(sigma[1] / given[1])
    relative[("parameter_shift", "a1")] = float(sigma[2])
    relative[("parameter_shift", "a0")] = float(sigma[3])
    relative[("parameter_shift", "b0")] = float(np.sqrt(covariance[3:5, 3:5].sum()))


def _of_curve(fit: Fit, covariance: Floats, absolute: Errors) -> None:
    knots = [parameter.name for parameter in LIBRARY["sensor_nonlinearity"].parameters]
    first = fit.searched.size
    sigma = np.sqrt(np.diag(covariance)[first : first + len(CURVE_KNOTS_DEG) - 1])
    for name, error in zip(knots, sigma.tolist(), strict=True):
        absolute[("sensor_nonlinearity", name)] = error


def _of_slip(fit: Fit, covariance: Floats, orders: Integers, absolute: Errors) -> None:
    """Errors of the zeros' line, the zeros being sums of steps and a walk."""
    walk = fit.searched.size + fit.curve_deg.size + 1
    columns = np.arange(walk, walk + 1 + orders.size)
    zeros = np.column_stack([orders - 1.0, np.tril(np.ones((orders.size, orders.size)))])
    spread = zeros @ covariance[np.ix_(columns, columns)] @ zeros.T
    absolute[("sensor_slip", "zero_deg")] = float(np.sqrt(spread[0, 0]))
    if orders.size > 1:
        centred = orders - orders.mean()
        line = centred / float(centred @ centred)
        absolute[("sensor_slip", "walk_deg")] = float(np.sqrt(line @ spread @ line))
