"""Parameters of an explanation with their intervals, by the fits' normal approximation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from spa_fo.gap.decide.explanation import Explanation
from spa_fo.gap.search.drive import DriveFit
from spa_fo.plant.effects.library import LIBRARY, at_port

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Errors = dict[tuple[str, str], float]

_WIDTH, _LOW = 1.96, 0.025


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
    angle = explanation.angle
    sigma = np.sqrt(np.diag(angle.covariance))
    _of_slots(angle.ids, sigma[5:], absolute, relative)
    if explanation.drive is not None:
        _of_slots(explanation.drive.ids, explanation.drive.sigma, absolute, relative)
    shift, curve = at_port("coefficients", explanation.ids), at_port("curve", explanation.ids)
    if shift:
        _of_shift(shift, given, angle.covariance, absolute, relative)
    if curve:
        for parameter, error in zip(LIBRARY[curve].parameters, angle.curve_sigma_deg, strict=True):
            absolute[(curve, parameter.name)] = float(error)
    zeros = at_port("zeros", explanation.ids)
    if zeros:
        _of_zeros(zeros, angle.zeros_deg, orders, absolute)
    return {
        name: {
            key: {"value": value, "ci95": _interval(value, (name, key), absolute, relative)}
            for key, value in own.items()
        }
        for name, own in explanation.parameters(given, orders).items()
    }


def drive_intervals(fit: DriveFit) -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
    """List the parameters of a fit of the pressure in the same way."""
    absolute: Errors = {}
    relative: Errors = {}
    _of_slots(fit.ids, fit.sigma, absolute, relative)
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for name in fit.ids:
        values = fit.effects[LIBRARY[name].slots].tolist()
        found[name] = {
            p.name: {
                "value": (inside := float(np.clip(value, p.low, p.high))),
                "ci95": _interval(inside, (name, p.name), absolute, relative),
            }
            for p, value in zip(LIBRARY[name].parameters, values, strict=True)
        }
    return found


def _interval(
    value: float, key: tuple[str, str], absolute: Errors, relative: Errors
) -> list[float] | None:
    if key in relative:
        return [value * float(np.exp(side * _WIDTH * relative[key])) for side in (-1, 1)]
    if key in absolute:
        return [value - _WIDTH * absolute[key], value + _WIDTH * absolute[key]]
    return None


def _of_slots(ids: tuple[str, ...], sigma: Floats, absolute: Errors, relative: Errors) -> None:
    """Errors of what was searched; `sigma` begins with the first effect's first parameter."""
    at = 0
    for name in ids:
        if LIBRARY[name].port != "chain":
            continue
        for parameter in LIBRARY[name].parameters:
            errors = relative if parameter.log else absolute
            errors[(name, parameter.name)] = float(sigma[at])
            at += 1


def _of_shift(
    name: str, given: Floats, covariance: Floats, absolute: Errors, relative: Errors
) -> None:
    """Errors of the coefficients' ratios: searched were the orders, ln a1, ln a0 and ln b0/a0."""
    sigma = np.sqrt(np.diag(covariance)[:5])
    absolute[(name, "alpha2")] = float(sigma[0] / given[0])
    absolute[(name, "alpha1")] = float(sigma[1] / given[1])
    relative[(name, "a1")] = float(sigma[2])
    relative[(name, "a0")] = float(sigma[3])
    relative[(name, "b0")] = float(np.sqrt(covariance[3:5, 3:5].sum()))


def _of_zeros(name: str, zeros: Floats, orders: Integers, absolute: Errors) -> None:
    """Errors of the line through the trials' zeros, by what they scatter about it."""
    if orders.size < 3:
        return
    centred = orders - orders.mean()
    square = float(centred @ centred)
    left = zeros - zeros.mean() - centred * float(centred @ zeros) / square
    scatter = float(np.sqrt(left @ left / (orders.size - 2)))
    scatter *= float(student_t.ppf(_LOW, orders.size - 2)) / -_WIDTH  # few trials
    walk, zero = LIBRARY[name].parameters
    absolute[(name, walk.name)] = scatter / float(np.sqrt(square))
    absolute[(name, zero.name)] = scatter
