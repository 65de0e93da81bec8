"""The fit report: everything one asks of a fit, on one screen."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from spa_fo.identify.curve_report import curve_lines
from spa_fo.identify.selection import FRACTIONAL, OrderComparison
from spa_fo.identify.uncertainty import Uncertainty
from spa_fo.plant import PARAMETERS

if TYPE_CHECKING:
    from spa_fo.identify.result import FitResult

STRONG = 0.9
"""Correlations at least this large are listed."""
_UNITS = {"K": "rad per unit u"}
_WIDTH = 96


def fit_report(result: FitResult) -> str:
    """Return the report as text for one screen."""
    lines = [*head_lines(result), "", *_parameter_lines(result), "", *error_lines(result)]
    if result.orders is not None:
        lines += ["", *order_lines(result.orders)]
    if result.curve is not None:
        lines += ["", *curve_lines(result.curve)]
    if result.drive is not None:
        lines += ["", *result.drive.lines()]
    strong = strong_correlations(result.uncertainty) if result.uncertainty else []
    if strong:
        pairs = [f"{a} {b} {value:+.4f}" for a, b, value in strong]
        lines += ["", *_wrapped(f"correlations above {STRONG}: ", pairs, ", ")]
    if result.warnings:
        lines += ["", *(line for text in result.warnings for line in _wrapped("! ", [text], " "))]
    return "\n".join(lines)


def strong_correlations(assessed: Uncertainty) -> list[tuple[str, str, float]]:
    """List pairs of parameters correlated above `STRONG`, the strongest first."""
    matrix = assessed.covariance.correlation
    pairs = [
        (PARAMETERS[i], PARAMETERS[j], float(matrix[i, j]))
        for i, j in combinations(range(5), 2)
        if abs(matrix[i, j]) > STRONG
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


_COLUMNS = ("parameter", "value", "± error", "95 % profile", "95 % bootstrap", "determined", "")


def head_lines(result: FitResult) -> list[str]:
    """Say what was fitted to what, and how good the search was, a line each."""
    model, optimum = result.model, result.optimum
    kind = result.provenance
    lines = [
        f"{model.material}: {model.campaign} ({kind})   "
        f"G(s) = b0/(s^alpha2 + a1 s^alpha1 + a0), u = {model.signal}/{model.reference_kpa:g} kPa",
        f"fitted on {result.fitted_on}: {result.datasets} logs, {result.samples} samples   "
        f"rms {np.degrees(optimum.rmse):.3f}°   valid {'yes' if optimum.valid else 'NO'}   "
        f"{optimum.evaluations} evaluations   bounds {optimum.bounds.name}",
    ]
    assessed = result.uncertainty
    if assessed is not None:
        lines.append(
            f"χ²/dof {assessed.chi2:.0f}/{assessed.dof} = {assessed.chi2 / assessed.dof:.2f}   "
            f"trials' scatter {np.degrees(assessed.noise.total):.3f}° (sample to sample "
            f"{np.degrees(assessed.noise.white):.3f}°, between trials "
            f"{np.degrees(assessed.noise.between):.3f}°)"
        )
        lines.append(
            f"Fisher condition number {assessed.covariance.condition_number:.1e}   "
            f"1 sample in {assessed.noise.design_effect:.0f} independent   "
            f"errors from {_ground(assessed)}"
        )
    return lines


def _ground(assessed: Uncertainty) -> str:
    if assessed.scale > 1.0:
        return f"the lack of fit, ×{assessed.scale:.2f}"
    return "the trials' scatter"


def _parameter_lines(result: FitResult) -> list[str]:
    table = [list(_COLUMNS), *_rows(result)]
    widths = [max(len(row[i]) for row in table) for i in range(len(_COLUMNS))]
    lines = [
        "  ".join(
            cell.ljust(width) if i in (0, len(widths) - 1) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in table
    ]
    return [lines[0], "─" * max(map(len, lines)), *lines[1:]]


def _rows(result: FitResult) -> list[list[str]]:
    marks = dict(mark.split() for mark in result.optimum.at_bounds)
    assessed = result.uncertainty
    rows = []
    for i, estimate in enumerate(result.estimates):
        name = estimate.name
        value, _, error = estimate.text().partition(" ± ")
        at_bound = f"at {marks[name]} bound" if name in marks else ""
        note = at_bound or _UNITS.get(name, "")
        if assessed is None:
            rows.append([name, value, f"± {error}" if error else "", "", "", "", note])
            continue
        profile, b = assessed.profiles[i], assessed.bootstrap
        rows.append(
            [
                name,
                value,
                f"± {error}" if error else "",
                estimate.interval_text(),
                "" if b is None else f"{b.low[i]:.3g} .. {b.high[i]:.3g}",
                "yes" if profile.determined else "no",
                note,
            ]
        )
    return rows


def error_lines(result: FitResult) -> list[str]:
    """Say how well the model meets each experiment, a line each."""
    return [
        f"{error.experiment}: {error.rms_deg:.2f}° ({error.percent:.2f} %) "
        + (
            f"against the mean of {error.trials} trials, {error.each_trial_deg:.2f}° against each"
            if result.uncertainty is not None
            else f"over {error.trials} logs"
        )
        for error in result.errors
    ]


def order_lines(orders: OrderComparison) -> list[str]:
    """Hold the model against those of integer order, a line each."""
    independent, samples = f"{orders.independent:.0f}", f"{orders.samples}"
    rows = [["model", "parameters", "rms", "AIC", "BIC", ""]]
    rows += [
        [
            one.model,
            f"{len(one.parameters)}",
            f"{one.rms_deg:.3f}°",
            _criterion(one.aic),
            _criterion(one.bic),
            "" if one.model == FRACTIONAL else _short(one.parameters),
        ]
        for one in orders.contenders
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    table = [
        "  ".join(
            cell.ljust(width) if i in (0, len(widths) - 1) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    return [*table, *_wrapped("", [_choice(orders, independent, samples)], " ")]


def _choice(orders: OrderComparison, independent: str, samples: str) -> str:
    aic, bic = orders.best("aic"), orders.best("bic")
    counted = (
        f"{independent} of {samples} samples count as independent (residuals' autocorrelation)"
    )
    if aic is None or bic is None:
        return f"no AIC, no BIC: only {counted}"
    chosen = f"smallest AIC and BIC: {aic}" if aic == bic else f"smallest AIC: {aic}, BIC: {bic}"
    return f"{chosen}; {counted}"


def _criterion(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"


_SYMBOLS = {
    "gain": ("K", " rad"),
    "damping_ratio": ("ζ", ""),
    "natural_frequency": ("ωn", " rad/s"),
    "time_constant": ("τ", " s"),
}


def _short(parameters: Mapping[str, float]) -> str:
    words = [(*_SYMBOLS[name], value) for name, value in parameters.items()]
    return ", ".join(f"{symbol} {value:.3g}{unit}" for symbol, unit, value in words)


def _wrapped(lead: str, words: list[str], joint: str) -> list[str]:
    """Break a text after spaces so that no line passes the width; later lines are indented."""
    lines, line = [], lead
    for word in joint.join(words).split(" "):
        if len(line) + len(word) > _WIDTH and line.strip():
            lines.append(line.rstrip())
            line = "  "
        line += word + " "
    return [*lines, line.rstrip()]
