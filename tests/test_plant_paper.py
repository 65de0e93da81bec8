from __future__ import annotations

import pytest

from spa_fo.plant import PARAMETERS, paper


def test_the_bounds_cover_every_parameter_and_miss_table_i() -> None:
    assert set(paper.BOUNDS) == set(PARAMETERS)
    outside = {
        (design, name)
        for design, g in paper.TABLE_I.items()
        for name, (low, high) in paper.BOUNDS.items()
        if not low <= getattr(g, name) <= high
    }
    assert outside == {("design_1", "b0"), ("design_2", "b0"), ("design_2", "a0")}


def test_the_error_table_is_complete() -> None:
    assert len(paper.RMS_ERRORS) == len(paper.DESIGNS) * len(paper.SETPOINTS_DEG) * len(
        paper.MODELS
    )


@pytest.mark.parametrize("key", paper.RMS_ERRORS)
def test_percentages_are_of_the_setpoint_to_the_printed_digits(
    key: tuple[str, float, str],
) -> None:
    error = paper.RMS_ERRORS[key]
    assert error.percent == pytest.approx(100 * error.rms_deg / key[1], abs=0.06)
