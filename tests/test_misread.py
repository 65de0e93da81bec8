"""Readings that no actuator has: still while it moves, out of its reach, or elsewhere at once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

import campaigns
from spa_fo.compare import compare
from spa_fo.compare.misread import Misread, misread, rows_of
from spa_fo.identify import fit_campaign
from spa_fo.report.change import answer, change_figure
from spa_fo.rig import CampaignData, Trial, read_campaign, read_trials


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> CampaignData:
    folder = tmp_path_factory.mktemp("steps")
    campaigns.step_campaign(folder, trials=3)
    return read_trials(read_campaign(folder))


def moving(angle_deg: np.ndarray) -> Any:
    """A trial of 10 s with these readings."""
    return cast(
        Any,
        replace(
            cast(Trial, cast(Any, EMPTY)),
            t_s=np.linspace(0.0, 10.0, angle_deg.size),
            angle_deg=angle_deg,
        ),
    )


EMPTY = Trial(
    *("steps", 1, "step", None, 1, 0.0),
    *(np.zeros(1), None, None, None, np.zeros(1)),
    *(np.zeros(1, bool), np.zeros(1, bool)),
)


def found(angle: np.ndarray, foreseen: np.ndarray, usual: np.ndarray | None = None) -> Any:
    """What is misread where the same drive bent the reference as is foreseen."""
    before = cast(
        Any, type("Data", (), {"trials": (moving(foreseen if usual is None else usual),)})
    )
    after = cast(Any, type("Data", (), {"trials": (moving(angle),)}))
    sigma = np.full(angle.size, 0.5)
    (wrong,) = misread(before, after, [foreseen], [foreseen], [sigma])
    return wrong


def rows(wrong: tuple[Misread, ...]) -> list[tuple[int, int]]:
    return [(int(each.rows[0]), int(each.rows[-1]) + 1) for each in wrong]


SWING = 20.0 * np.sin(np.linspace(0.0, 6.0, 500)) + 0.01 * np.random.default_rng(1).normal(size=500)


@pytest.mark.parametrize("value", [0.0, SWING[200]])
def test_a_reading_that_hangs_is_seen_from_its_first_row_to_its_last(value: float) -> None:
    angle = SWING.copy()
    angle[200:300] = value
    assert rows(found(angle, SWING)) == [(200, 300)]


def test_neither_a_quiet_converter_nor_a_stop_is_a_reading_that_hangs() -> None:
    coarse = np.round(SWING / 5.0) * 5.0
    assert found(coarse, SWING, usual=coarse) == ()
    blocked = np.minimum(SWING, 12.0)
    assert found(blocked, SWING) == ()
    short = SWING.copy()
    short[200:205] = 0.0
    assert found(short, SWING) == ()


def test_a_reading_of_nothing_is_none() -> None:
    assert rows(found(np.zeros(500), SWING)) == [(0, 500)]


def test_a_reading_out_of_reach_is_none_of_the_actuator_s() -> None:
    angle = SWING.copy()
    angle[100:120] = -45.0
    (wrong,) = found(angle, SWING)
    assert np.array_equal(wrong.rows, np.arange(100, 120))
    assert "-45" in wrong.text
    angle[105:] = SWING[105:]
    assert found(angle, SWING) == ()  # a dropout
    assert found(np.where(SWING > 0.0, 3.0 * SWING, SWING), SWING) == ()  # what held it is gone


HELD = np.where(np.arange(500) < 100, 0.0, 20.0 * (1.0 - np.exp(-(np.arange(500) - 100) / 20.0)))
HELD = HELD + 0.01 * np.random.default_rng(2).normal(size=500)


def held(angle: np.ndarray, drive: np.ndarray | None = None) -> Any:
    """What is misread where a step of the input has bent the actuator."""
    before, after = (cast(Any, type("Data", (), {"trials": (moving(a),)})) for a in (HELD, angle))
    step = np.where(np.arange(500) < 100, 0.0, 50.0) if drive is None else drive
    (wrong,) = misread(before, after, [step], [HELD], [np.full(500, 0.5)])
    return wrong


def test_from_a_jump_on_a_sensor_reads_of_another_place() -> None:
    angle = HELD - 6.0 * (np.arange(500) >= 300)
    (wrong,) = held(angle)
    assert abs(int(wrong.rows[0]) - 300) <= 1
    assert int(wrong.rows[-1]) == 499
    assert wrong.square == pytest.approx(36.0 * wrong.rows.size, rel=0.02)
    assert "jumps by 6" in wrong.text


def test_a_jump_counts_neither_for_a_moment_nor_slow_nor_with_the_input() -> None:
    dropout = HELD.copy()
    dropout[300:302] = 0.0
    assert held(dropout) == ()
    rows = np.arange(500)
    slow = HELD - 6.0 * np.clip((rows - 300) / 30.0, 0.0, 1.0)
    assert held(slow) == ()
    with_it = np.where(rows < 100, 0.0, np.where(rows < 300, 50.0, 35.0))
    assert held(HELD - 6.0 * (rows >= 300), with_it) == ()
    assert held(HELD - 0.5 * (rows >= 300)) == ()  # no faster than the reference ever went
    still = np.full(500, 1.0)  # where the reference never moved any jump is larger than its own
    assert found(still + 1.4 * (rows >= 300), still) == ()
    assert rows_of(found(still + 1.6 * (rows >= 300), still), 500)[300:].all()


@pytest.mark.parametrize(
    ("lost", "later", "level", "seen"),
    [
        (1, 0, 50.0, True),
        (2, 0, 50.0, True),
        (3, 0, 50.0, False),  # nobody saw it go at once
        (40, 0, 50.0, False),
        (40, 10, 50.0, True),
        (40, 10, 35.0, False),  # the input has moved, which may have come late
    ],
)
def test_a_jump_where_rows_are_lost(lost: int, later: int, level: float, seen: bool) -> None:
    """A jump at row 300, so many rows after some were lost in which the input may have moved."""
    rows = np.arange(500)
    kept = (rows < 300 - later - lost) | (rows >= 300 - later)
    angle = HELD - 6.0 * (rows >= 300)
    drive = np.where(rows < 100, 0.0, np.where(rows < 300 - later - lost, 50.0, level))
    cut = replace(moving(angle), t_s=moving(angle).t_s[kept], angle_deg=angle[kept])
    for usual in (moving(HELD), with_rows_lost_in_motion()):
        both = (cast(Any, type("Data", (), {"trials": (t,)})) for t in (usual, cut))
        (wrong,) = misread(*both, [drive[kept]], [HELD[kept]], [np.full(kept.sum(), 0.5)])
        assert [abs(int(each.rows[0]) - (300 - lost)) <= 1 for each in wrong] == [True] * seen


def with_rows_lost_in_motion() -> Any:
    """The reference, but for the rows in which it moved most."""
    rows = np.arange(500)
    kept = (rows < 101) | (rows >= 140)
    return replace(moving(HELD), t_s=moving(HELD).t_s[kept], angle_deg=HELD[kept])


def test_a_short_trial_has_no_jump() -> None:
    angle = np.append(np.zeros(4), np.full(4, 60.0))
    both = (cast(Any, type("Data", (), {"trials": (moving(a),)})) for a in (HELD, angle))
    assert misread(*both, [np.ones(8)], [np.zeros(8)], [np.full(8, 0.5)]) == ((),)


def test_no_jump_is_away_from_what_nobody_knows() -> None:
    """An actuator that comes free goes on to where the reference never was."""
    before, after = (
        cast(Any, type("Data", (), {"trials": (moving(a),)}))
        for a in (HELD, HELD + np.where(np.arange(500) >= 300, 6.0, -6.0))
    )
    step = np.where(np.arange(500) < 100, 0.0, 50.0)
    unsure = np.full(500, 0.5)
    assert misread(before, after, [step], [HELD + 2.0], [unsure]) == ((),)
    assert misread(before, after, [step], [HELD - 2.0], [unsure])[0]
    unsure[300:] = np.inf
    assert misread(before, after, [step], [HELD - 2.0], [unsure]) == ((),)


def test_what_is_read_in_later_trials_is_of_that_place_too() -> None:
    step = np.where(np.arange(500) < 100, 0.0, 50.0)
    fell = HELD - 6.0 * (np.arange(500) >= 300)
    trials = tuple(
        replace(cast(Trial, moving(angle)), started_s=start)
        for angle, start in ((HELD - 6.0, 200.0), (fell, 100.0), (HELD, 0.0))
    )
    before = cast(Any, type("Data", (), {"trials": (moving(HELD),)}))
    after = cast(Any, type("Data", (), {"trials": trials}))
    sigma = [np.full(500, 0.5)] * 3
    later, jumps, earlier = misread(before, after, [step] * 3, [HELD] * 3, sigma)
    assert rows(later) == [(0, 500)]
    assert abs(rows(jumps)[0][0] - 300) <= 1
    assert earlier == ()


def test_rows_are_those_of_all_stretches() -> None:
    angle = SWING.copy()
    angle[100:150] = angle[250:300] = 0.0
    wrong = found(angle, SWING)
    assert np.flatnonzero(rows_of(wrong, 500)).tolist() == [*range(100, 150), *range(250, 300)]


def test_what_hangs_is_a_change_of_the_sensor_and_what_is_left_is_compared(
    measured: CampaignData,
) -> None:
    first, second, *others = measured.trials
    middle = slice(second.t_s.size // 3, 2 * second.t_s.size // 3)
    angle = second.angle_deg.copy()
    angle[middle] = angle[middle.start]
    hung = replace(measured, trials=(first, replace(second, angle_deg=angle), *others))
    model = fit_campaign(measured, bootstrap=None).model
    assert compare(measured, measured, model).kind == "nothing_changed"
    comparison = compare(measured, hung, model)
    assert len(comparison.misread) == 1
    assert comparison.kind == "unknown"
    assert comparison.change.where.stage == pytest.approx(
        {"drive": 0.0, "actuator": 0.0, "sensor": 1.0, "acquisition": 0.0}
    )
    assert "stands at" in comparison.change.findings[0]
    assert "stands still" in answer(comparison)[0]
    assert answer(comparison)[1].startswith("Apart from what no actuator reads, ")
    assert sum(cause.probability for cause in comparison.change.causes) == pytest.approx(1.0)


def test_what_jumps_is_a_change_of_the_sensor_and_what_was_before_is_drawn(
    measured: CampaignData,
) -> None:
    early, jumps, *_ = measured.trials
    since_s = jumps.started_s + jumps.t_s[int(0.4 * jumps.t_s.size)]
    trials = [
        replace(t, angle_deg=t.angle_deg - 20.0 * (t.started_s + t.t_s >= since_s))
        for t in measured.trials
    ]
    model = fit_campaign(measured, bootstrap=None).model
    comparison = compare(measured, replace(measured, trials=tuple(trials)), model)
    assert comparison.kind == "unknown"
    assert comparison.change.where.stage == pytest.approx(
        {"drive": 0.0, "actuator": 0.0, "sensor": 1.0, "acquisition": 0.0}
    )
    assert "jumps" in answer(comparison)[0]
    compared = {t.label: np.isfinite(s) for t, s in zip(trials, comparison.sigma, strict=True)}
    assert compared[early.label].any()
    assert compared[jumps.label].any()
    assert not any(compared[t.label].any() for t in trials if t.started_s > since_s)
    axes, _ = change_figure(comparison).axes
    assert axes.get_title(loc="left") == "step 30, trial 2 of 3"
    assert len(axes.collections) == 1  # the band
