"""The paper held against itself and against what is computed here, line by line.

Every figure in the table is computed from what the paper prints (`spa_fo.plant.paper`) or from
this run's identification; none is typed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from spa_fo.fractional import prabhakar_series_step, step_map, step_response
from spa_fo.identify.reproduction import NEAR_OPTIMUM, SwarmRepeats
from spa_fo.identify.uncertainty import DETERMINED_WITHIN
from spa_fo.plant import (
    PARAMETERS,
    TransferFunction,
    paper,
    second_moment,
    second_moment_as_printed,
)
from spa_fo.report.tables import Table

LONG_TIME_S = 100.0
# What the paper does not print and a bound on errors needs: a step test's length and noise.
RECORD_S = 10.0
NOISE_DEG = 0.5
HOLDS, FAILS = "holds", "does not hold"


@dataclass(frozen=True)
class Identified:
    """What one material's identification contributes to the audit.

    Attributes
    ----------
    label : str
        The material.
    condition_number : float
        Of the Fisher information of the five parameters.
    undetermined : tuple of str
        Parameters that the data do not determine.
    widest : str
        The parameter whose 95 % interval is widest beside its value.
    low, high : float
        That interval.
    curve_change_deg : float
        Largest change of the fitted curve while that parameter is held anywhere in its interval
        and the others are fitted again.
    swarm : SwarmRepeats
        How often the paper's swarm came near the least squares.
    """

    label: str
    condition_number: float
    undetermined: tuple[str, ...]
    widest: str
    low: float
    high: float
    curve_change_deg: float
    swarm: SwarmRepeats


@dataclass(frozen=True)
class AuditLine:
    """One statement of the paper, what is computed, and whether it holds."""

    where: str
    statement: str
    computed: str
    verdict: str


def audit(identified: Mapping[str, Identified]) -> tuple[AuditLine, ...]:
    """Check the paper's statements.

    Parameters
    ----------
    identified : Mapping[str, Identified]
        By the paper's design ("design_1", "design_2"); may be empty, then the lines that need an
        identification are left out.

    Returns
    -------
    tuple of AuditLine
    """
    lines = [
        _inverse_transform(),
        *_table_within_bounds(),
        _second_moment(),
        *_percentages(),
        _around_three_to_four(),
        *_improvements(),
        *_gains(),
        *_frequency_and_damping(),
        *_data_sets(),
    ]
    for result in identified.values():
        lines += [_identifiability(result), _swarm(result)]
    return tuple(lines)


def audit_table(lines: tuple[AuditLine, ...], provenance: str) -> Table:
    """Lay the audit out as a table."""
    rows = pd.DataFrame(
        {
            "where": [line.where for line in lines],
            "the paper says": [line.statement for line in lines],
            "computed": [line.computed for line in lines],
            "verdict": [line.verdict for line in lines],
        }
    )
    return Table(rows, f"Audit of the paper ({paper.ARXIV}), every figure computed", provenance)


def _inverse_transform() -> AuditLine:
    x = paper.TABLE_I["design_1"]
    t = np.array([LONG_TIME_S])
    five = (x.alpha2, x.alpha1, x.a1, x.a0, x.b0)
    printed = float(prabhakar_series_step(t, *five, printed=True)[0])
    correct = float(step_response(t, *five)[0])
    holds = math.isclose(printed, correct, rel_tol=1e-3)
    return AuditLine(
        "Eq. 15",
        "the step response is the inverse transform of Eq. 14",
        f"{paper.MATERIALS['design_1']} at t = {LONG_TIME_S:g} s: as printed {printed:.4f}, "
        f"inverse of Eq. 14 {correct:.4f}, b0/a0 {x.gain:.4f}",
        HOLDS if holds else f"{FAILS}: exponent and β are those of b0 s^(α2−2)/D(s)",
    )


def _table_within_bounds() -> Iterator[AuditLine]:
    for design, x in paper.TABLE_I.items():
        outside = [
            f"{name} = {getattr(x, name):g} (bounds {low:g}–{high:g})"
            for name, (low, high) in paper.BOUNDS.items()
            if not low <= getattr(x, name) <= high
        ]
        yield AuditLine(
            "Table I",
            f"{paper.MATERIALS[design]}: found by a search within the stated bounds",
            "outside: " + "; ".join(outside) if outside else "all five within the bounds",
            f"{FAILS}: such a search cannot return it" if outside else HOLDS,
        )


def _second_moment() -> AuditLine:
    b, h = paper.GEOMETRY.width_m, paper.GEOMETRY.height_m
    rectangle = b * h**3 / 12.0
    printed = second_moment_as_printed(1.0, b, h)
    corrected = second_moment(1.0, b, h)
    return AuditLine(
        "Eq. 3",
        "I_n = (1/2)^n b h^(n+2)/(n+2) is the generalised second moment of area",
        f"n = 1: {printed / rectangle:.3g} × b h³/12; with (1/2)^(n+1) "
        f"{corrected / rectangle:.3g} × b h³/12",
        HOLDS if math.isclose(printed, rectangle) else f"{FAILS}: the power is n + 1",
    )


def _percentages() -> Iterator[AuditLine]:
    off = [
        f"{paper.MATERIALS[design]} {setpoint:g}° {model}: {error.rms_deg:g}° is "
        f"{100 * error.rms_deg / setpoint:.3f} %, printed {error.percent:g} %"
        for (design, setpoint, model), error in paper.RMS_ERRORS.items()
        if abs(100 * error.rms_deg / setpoint - error.percent) > _half_a_digit(error.percent)
    ]
    yield AuditLine(
        "Figs. 4–5",
        "the per cents are the RMS errors over the setpoint, rounded",
        "; ".join(off) if off else "all agree",
        f"{FAILS} for {len(off)} of {len(paper.RMS_ERRORS)} (last digit)" if off else HOLDS,
    )


def _half_a_digit(printed: float) -> float:
    decimals = len(f"{printed:g}".partition(".")[2])
    return float(0.5 * 10.0**-decimals) + 1e-9


def _around_three_to_four() -> AuditLine:
    low, high = paper.CLAIMED_RMS_PERCENT
    percents = [
        100 * error.rms_deg / setpoint
        for (_, setpoint, model), error in paper.RMS_ERRORS.items()
        if model == "fractional"
    ]
    holds = round(min(percents)) >= low and round(max(percents)) <= high
    return AuditLine(
        "Claims",
        f"RMS errors of the fractional model are around {low:g}–{high:g} %",
        f"from {min(percents):.2f} to {max(percents):.2f} %",
        HOLDS if holds else FAILS,
    )


def _improvements() -> Iterator[AuditLine]:
    for design in paper.DESIGNS:
        for setpoint in paper.SETPOINTS_DEG:
            fractional, nonlinear = (
                100 * paper.RMS_ERRORS[design, setpoint, model].rms_deg / setpoint
                for model in paper.MODELS
            )
            gain = nonlinear - fractional
            enough = gain > paper.CLAIMED_IMPROVEMENT_PERCENT
            yield AuditLine(
                "Claims",
                f"{paper.MATERIALS[design]} at {setpoint:g}°: improved by more than "
                f"{paper.CLAIMED_IMPROVEMENT_PERCENT:g} % over the nonlinear model",
                f"{nonlinear:.2f} − {fractional:.2f} = {gain:+.2f} points "
                f"({100 * gain / nonlinear:+.0f} % of the error)".replace("-", "−"),
                HOLDS if enough else FAILS + (": the baseline is better" if gain < 0 else ""),
            )


def _gains() -> Iterator[AuditLine]:
    for design, x in paper.TABLE_I.items():
        gain_deg = math.degrees(x.gain)
        inputs = ", ".join(
            f"{setpoint:g}° needs u = {setpoint / gain_deg:.3f}" for setpoint in paper.SETPOINTS_DEG
        )
        reached = [s for s in paper.SETPOINTS_DEG if math.isclose(gain_deg, s, rel_tol=0.01)]
        yield AuditLine(
            "Table I",
            f"{paper.MATERIALS[design]}: a constant source brings "
            + " and ".join(f"{setpoint:g}°" for setpoint in paper.SETPOINTS_DEG),
            f"b0/a0 = {x.gain:.3f} rad = {gain_deg:.1f}° for a unit step; {inputs}",
            HOLDS
            if len(reached) == len(paper.SETPOINTS_DEG)
            else "not said how: here u = pressure/reference, chosen per setpoint",
        )


def _frequency_and_damping() -> Iterator[AuditLine]:
    for design, x in paper.TABLE_I.items():
        omega = math.sqrt(x.a0)
        zeta = x.a1 / (2.0 * omega)
        agrees = math.isclose(omega, paper.NATURAL_FREQUENCY, rel_tol=0.05) and math.isclose(
            zeta, paper.DAMPING_RATIO, rel_tol=0.05
        )
        yield AuditLine(
            "Eq. 11",
            f"{paper.MATERIALS[design]}: a1 = 2ζω and a0 = ω², as in the second-order model",
            f"Table I gives ω = {omega:.3f}, ζ = {zeta:.3f}; the authors' second-order code has "
            f"ω = {paper.NATURAL_FREQUENCY:g} rad/s, ζ = {paper.DAMPING_RATIO:g}",
            HOLDS if agrees else "by definition; but they are not the second-order model's numbers",
        )


def _data_sets() -> Iterator[AuditLine]:
    counts = (1, paper.DATASETS, 2 * paper.DATASETS)
    for design, x in paper.TABLE_I.items():
        error, curve_deg = least_errors(x)
        worst = max(PARAMETERS, key=error.__getitem__)
        drift = ", ".join(f"{100 * error[worst] / math.sqrt(n):.0f} %" for n in counts)
        curve = ", ".join(f"{curve_deg / math.sqrt(n):.3f}°" for n in counts)
        gain = 100 * error["K"] / math.sqrt(paper.DATASETS)
        needed = math.ceil((error[worst] / DETERMINED_WITHIN) ** 2)
        yield AuditLine(
            "Identification",
            f"{paper.MATERIALS[design]}: with {paper.DATASETS} datasets of {paper.POINTS} points "
            "the parameters no longer drift",
            f"Cramér-Rao bound at Table I, {NOISE_DEG:g}° of white noise, {RECORD_S:g} s, search "
            f"without bounds: with {', '.join(map(str, counts))} datasets {worst} ± {drift}, the "
            f"curve ± {curve}; with {paper.DATASETS} b0/a0 ± {gain:.2g} %",
            HOLDS
            if needed <= paper.DATASETS
            else f"{FAILS}: drift falls as 1/√n, without a threshold; below "
            f"{100 * DETERMINED_WITHIN:g} % with {needed} datasets",
        )


def least_errors(x: TransferFunction) -> tuple[dict[str, float], float]:
    """Bound the errors of an identification from one dataset by Cramér and Rao.

    Steps reach the paper's setpoints in equal parts; noise is white.

    Parameters
    ----------
    x : TransferFunction
        The true model.

    Returns
    -------
    relative : dict of str to float
        Standard errors of the parameters and of K = b0/a0, by their values.
    curve_deg : float
        That of the fitted curve, RMS over time.
    """
    t = RECORD_S * np.arange(1, paper.POINTS + 1) / paper.POINTS
    gain_deg = math.degrees(x.gain)
    power = np.mean([(setpoint / gain_deg) ** 2 for setpoint in paper.SETPOINTS_DEG])
    slopes = step_map(t).jacobian(x.as_array()) * x.as_array()
    covariance = np.linalg.inv(slopes.T @ slopes) * math.radians(NOISE_DEG) ** 2 / power
    relative = dict(zip(PARAMETERS, np.sqrt(np.diag(covariance)).tolist(), strict=True))
    log_gain = np.array([0.0, 0.0, 0.0, -1.0, 1.0])
    relative["K"] = math.sqrt(log_gain @ covariance @ log_gain)
    return relative, NOISE_DEG * math.sqrt(len(PARAMETERS) / paper.POINTS)


def _identifiability(result: Identified) -> AuditLine:
    return AuditLine(
        "Identification",
        f"{result.label}: step responses identify the five parameters",
        f"condition number of the Fisher information {result.condition_number:.1e}; not "
        f"determined: {', '.join(result.undetermined) or 'none'}; with {result.widest} anywhere in "
        f"{result.low:.3g}–{result.high:.3g} the refitted curve moves by at most "
        f"{result.curve_change_deg:.2f}°",
        FAILS if result.undetermined else HOLDS,
    )


def _swarm(result: Identified) -> AuditLine:
    swarm = result.swarm
    return AuditLine(
        "Identification",
        f"{result.label}: {paper.SWARM_PARTICLES} particles × {paper.SWARM_ITERATIONS} iterations "
        "find the optimum",
        f"{swarm.particles}×{swarm.iterations}, {swarm.bounds} bounds: {swarm.hits} of "
        f"{swarm.seeds} seeds within {100 * (NEAR_OPTIMUM - 1):.0f} % of the least RMSE, in the "
        f"middle {100 * swarm.median_excess:.0f} % above it",
        HOLDS if swarm.hits == swarm.seeds else FAILS,
    )
