"""Parameters of an explanation with their intervals, by the fits' normal approximation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.stats import t as student_t

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.decide.explanation import Explanation, steady_walk
from spa_fo.gap.search.drive import DriveFit
from spa_fo.plant.effects.library import LIBRARY, at_port

Parameters = dict[str, dict[str, Any]]
"""Effect -> parameter -> ``{"value": ..., "ci95": [low, high] or None}``."""
Errors = dict[tuple[str, str], tuple[float, bool]]
"""By effect and parameter: standard deviation, and whether it is the logarithm's."""

_WIDTH, _HIGH = 1.96, 0.975


def with_intervals(explanation: Explanation, given: Floats, orders: Integers) -> Parameters:
    """List the parameters of each effect with their intervals.

    `given` are the plain model's coefficients, `orders` those of the trials it was fitted to. An
    interval is None where the fit says nothing of the error: of the frequency of an interference,
    which was searched on a grid.
    """
    angle, drive, ids = explanation.angle, explanation.drive, explanation.ids
    errors = _searched(angle.ids, np.sqrt(np.diag(angle.covariance))[5:])
    if drive is not None:
        errors |= _searched(drive.ids, drive.sigma)
    if shift := at_port("coefficients", ids):
        errors |= _of_shift(shift, given, angle.covariance)
    if curve := at_port("curve", ids):
        sigmas = angle.curve_sigma_deg.tolist()  # where the knots are was chosen, and has none
        own = zip(LIBRARY[curve].parameters, sigmas, strict=False)
        errors |= {(curve, parameter.name): (sigma, False) for parameter, sigma in own}
    if zeros := at_port("zeros", ids):
        errors |= _of_zeros(zeros, angle.zeros_deg, orders)
    return _intervals(explanation.parameters(given, orders), errors)


def drive_intervals(fit: DriveFit) -> Parameters:
    """List the parameters of a fit of the pressure in the same way."""
    values = {
        name: {
            p.name: float(np.clip(fit.effects[place], p.low, p.high))
            for place, p in enumerate(LIBRARY[name].parameters, LIBRARY[name].first)
        }
        for name in fit.ids
    }
    return _intervals(values, _searched(fit.ids, fit.sigma))


def _intervals(values: Mapping[str, Mapping[str, float]], errors: Errors) -> Parameters:
    return {
        name: {
            key: {
                "value": value,
                "ci95": _interval(value, _bounds(name, key), errors.get((name, key))),
            }
            for key, value in own.items()
        }
        for name, own in values.items()
    }


def _interval(
    value: float, bounds: tuple[float, float], error: tuple[float, bool] | None
) -> list[float] | None:
    """Give the interval of a normal approximation, as far as the parameter may go.

    Of what a bound leaves of the normal it holds 95 % at least: just so much where the value is on
    the bound.
    """
    if error is None:
        return None
    sigma, of_logarithm = error
    ends = np.array([-_WIDTH, _WIDTH]) * sigma
    free = value * np.exp(ends) if of_logarithm else value + ends
    return list(np.clip(free, *bounds).tolist())


def _bounds(name: str, key: str) -> tuple[float, float]:
    """Say how far a parameter may go; coefficients' ratios are positive."""
    bounds = [(p.low, p.high) for p in LIBRARY[name].parameters if p.name == key]
    return bounds[0] if bounds else (0.0, np.inf)


def _searched(ids: tuple[str, ...], sigma: Floats) -> Errors:
    """Errors of what was searched; `sigma` begins with the first effect's first parameter."""
    searched = [(name, p) for name in ids for p in LIBRARY[name].parameters]
    searched = [(name, p) for name, p in searched if LIBRARY[name].port == "chain"]
    return {
        (name, p.name): (float(s), p.log) for (name, p), s in zip(searched, sigma, strict=False)
    }


def _of_shift(name: str, given: Floats, covariance: Floats) -> Errors:
    """Errors of the coefficients' ratios: searched were the orders, ln a1, ln a0 and ln b0/a0."""
    sigma = np.sqrt(np.diag(covariance)).tolist()
    return {
        (name, "alpha2"): (sigma[0] / given[0], False),
        (name, "alpha1"): (sigma[1] / given[1], False),
        (name, "a1"): (sigma[2], True),
        (name, "a0"): (sigma[3], True),
        (name, "b0"): (float(np.sqrt(covariance[3:5, 3:5].sum())), True),
    }


def _of_zeros(name: str, zeros: Floats, orders: Integers) -> Errors:
    """Errors of the steady walk of the trials' zeros, and of the first by as much as they jump."""
    if orders.size < 3:
        return {}
    few = float(student_t.ppf(_HIGH, orders.size - 2)) / _WIDTH
    slope = few * steady_walk(orders, zeros)[1]
    jump = slope * float(orders[-1] - orders[0]) ** 0.5
    walk, zero = LIBRARY[name].parameters
    return {(name, walk.name): (slope, False), (name, zero.name): (jump, False)}
