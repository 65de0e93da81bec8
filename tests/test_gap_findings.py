"""What is said of the drive by the measured pressure alone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from spa_fo.gap.answer.findings import drive_finding, findings
from spa_fo.gap.claim.claimed import LIKELY
from spa_fo.gap.data.hold_out import HeldOut
from spa_fo.gap.fit.pressure import MOST_LAG_S
from spa_fo.plant.effects.library import LIBRARY, absent

EVIDENCE = cast(Any, SimpleNamespace(grid=SimpleNamespace(sample_trial=np.array([0, 0, 1, 1]))))
HELD = HeldOut(np.array([False, True]), "the second")


def drive(left_kpa: float, lag_s: float, wander: float = 0.01) -> Any:
    """A lag of the line that leaves so much of 8 kPa on the second trial."""
    effects = absent()
    slots = LIBRARY["line_lag"].slots
    effects[slots] = np.arange(1.0, 1.0 + slots.stop - slots.start)
    best = SimpleNamespace(
        ids=("line_lag",),
        effects=effects,
        residual_kpa=np.array([0.0, 0.0, left_kpa, -left_kpa]),
        z=np.array([0.5, lag_s]),
    )
    plain = SimpleNamespace(residual_kpa=np.array([1.0, 1.0, 8.0, -8.0]))
    fits = {(): plain, ("line_lag",): best}
    return SimpleNamespace(best=best, fits=fits, is_ordinary=wander <= 0.03, wander=wander)


@pytest.mark.parametrize(
    ("lag_s", "words"),
    [
        (0.0, ") reduces"),
        (0.5 * MOST_LAG_S, ", beside a lag of its sensor by 0.075 s, reduces"),
        (MOST_LAG_S, ", beside a lag by 0.15 s, as much as counts as its sensor's, reduces"),
    ],
)
def test_the_lag_that_its_sensor_takes_is_said(lag_s: float, words: str) -> None:
    (said,) = drive_finding(drive(2.0, lag_s), EVIDENCE, HELD)
    assert said.startswith("The measured pressure by itself: line_lag (time_constant_s 1,")
    assert words in said
    assert said.endswith("on held-out trials, from 8 to 2 kPa.")


def test_what_explains_little_of_the_pressure_is_not_said() -> None:
    assert drive_finding(drive(7.9, 0.0), EVIDENCE, HELD) == ()
    assert drive_finding(None, EVIDENCE, HELD) == ()


def test_a_pressure_that_wanders_too_far_is_said() -> None:
    said, explained = drive_finding(drive(2.0, 0.0, wander=0.073), EVIDENCE, HELD)
    assert explained.startswith("The measured pressure by itself: line_lag")
    assert said.startswith("The pressure of repeated trials differs by 7.3 % of the command")


@pytest.mark.parametrize(
    ("probability", "words"),
    [
        (LIKELY, "What comes nearest, line_lag, is clearly less probable than an unknown cause."),
        (0.9 * LIKELY, "No explanation of the library holds on the held-out trials."),
    ],
)
def test_what_was_tried_and_held_is_not_said_to_be_refuted(probability: float, words: str) -> None:
    near = SimpleNamespace(named=("line_lag",), probability=probability)
    verdict = SimpleNamespace(kind="unknown", sets=(), scored=(near,), unknown_drive=0.0)
    said, *_ = findings(cast(Any, verdict), own=False, repeats=True, floor_deg=0.1)
    assert said == words
