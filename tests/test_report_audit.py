from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify_cases import steps
from spa_fo.fractional import step_response
from spa_fo.identify import fit_optimum, free_bounds
from spa_fo.identify.reproduction import SwarmRepeats
from spa_fo.plant import paper
from spa_fo.report.audit import (
    HOLDS,
    NOISE_DEG,
    RECORD_S,
    Identified,
    audit,
    audit_table,
    least_errors,
)

SWARM = SwarmRepeats("widened", 200, 10, seeds=30, hits=0, median_excess=0.2)


def lines_of(where: str) -> list[tuple[str, str, str]]:
    return [
        (line.statement, line.computed, line.verdict) for line in audit({}) if line.where == where
    ]


def improvements() -> list[tuple[str, str, str]]:
    return [line for line in lines_of("Claims") if "improved by" in line[0]]


def test_the_printed_series_decays_where_the_right_one_settles() -> None:
    ((_, computed, verdict),) = lines_of("Eq. 15")
    assert "as printed 0.0585" in computed
    assert "inverse of Eq. 14 0.5705" in computed
    assert verdict.startswith("does not hold")


def test_table_1_lies_outside_the_bounds() -> None:
    first, second = (line for line in lines_of("Table I") if "within the stated" in line[0])
    assert first[1] == "outside: b0 = 0.934 (bounds 1–2)"
    assert second[1] == "outside: a0 = 2.103 (bounds 1–2); b0 = 0.728 (bounds 1–2)"


def test_eq_3_is_twice_the_second_moment() -> None:
    ((_, computed, _),) = lines_of("Eq. 3")
    assert computed.startswith("n = 1: 2 × b h³/12")
    assert computed.endswith("1 × b h³/12")


def test_the_claimed_improvement_fails_at_60_degrees() -> None:
    verdicts = {statement: verdict for statement, _, verdict in improvements()}
    assert len(verdicts) == 4
    for statement, verdict in verdicts.items():
        assert (verdict == HOLDS) == ("30°" in statement), statement


def test_drift_has_no_threshold_at_four_data_sets() -> None:
    lines = lines_of("Identification")
    assert len(lines) == 2
    for _, computed, verdict in lines:
        one, four = (float(part.split()[-1]) for part in computed.split(" %")[:2])
        assert one == pytest.approx(2 * four, rel=0.01)
        assert verdict.startswith("does not hold")


def test_the_least_errors_are_those_of_many_fits() -> None:
    x = paper.TABLE_I["design_1"]
    relative, curve_deg = least_errors(x)
    t = RECORD_S * np.arange(1, paper.POINTS + 1) / paper.POINTS
    clean = step_response(t, *x.as_array())
    u = np.radians(paper.SETPOINTS_DEG) / x.gain
    generator = np.random.default_rng(1)
    small = 1e-4  # so that the bound, which is linear, is reached
    gains, a1, curves = [], [], []
    for _ in range(60):
        noise = small * np.radians(NOISE_DEG) * generator.standard_normal((2, t.size))
        data = replace(steps(1), t=t, u=u, angle_rad=u[:, np.newaxis] * clean + noise)
        found = fit_optimum(data, free_bounds()).transfer_function
        gains.append(found.gain / x.gain)
        a1.append(found.a1 / x.a1)
        curves.append(step_response(t, *found.as_array()))
    share = small / np.sqrt(2)  # of the bound, two datasets each
    assert np.std(gains) == pytest.approx(relative["K"] * share, rel=0.25)
    assert np.std(a1) == pytest.approx(relative["a1"] * share, rel=0.25)
    spread = np.degrees(np.sqrt(np.mean(np.var(curves, axis=0)) * np.mean(u**2)))
    assert spread == pytest.approx(curve_deg * share, rel=0.15)


def test_the_verdicts_follow_the_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    better = dict(paper.RMS_ERRORS)
    better["design_2", 60.0, "nonlinear"] = paper.PrintedError(6.0, 10.0)
    wide = dict.fromkeys(paper.BOUNDS, (0.1, 10.0))
    monkeypatch.setattr(paper, "RMS_ERRORS", better)
    monkeypatch.setattr(paper, "BOUNDS", wide)
    assert [verdict for _, _, verdict in improvements()].count(HOLDS) == 3
    bounded = [line for line in lines_of("Table I") if "within the stated" in line[0]]
    assert [verdict for _, _, verdict in bounded] == [HOLDS, HOLDS]


def test_what_was_identified_gets_its_lines() -> None:
    found = Identified("rubber", 1e9, ("a1",), "a1", 0.05, 16.0, 0.013, SWARM)
    lines = audit({"design_1": found})[-2:]
    assert "1.0e+09" in lines[0].computed
    assert "not determined: a1; with a1 anywhere in 0.05–16" in lines[0].computed
    assert lines[1].computed.startswith("200×10, widened bounds: 0 of 30 seeds within 1 %")
    assert all(line.verdict != HOLDS for line in lines)


def test_the_table_has_a_row_a_line() -> None:
    lines = audit({})
    table = audit_table(lines, "synthetic")
    assert len(table.rows) == len(lines)
    assert not table.rows.isna().any(axis=None)
