from __future__ import annotations

import numpy as np
import pytest

from spa_fo.identify import Bounds, free_bounds, printed_bounds, widened_bounds
from spa_fo.plant import TABLE_I

TABLE = [g.as_array() for g in TABLE_I.values()]


def test_the_printed_bounds_hold_no_row_of_table_i() -> None:
    assert not any(printed_bounds().holds(x) for x in TABLE)


def test_the_widened_bounds_hold_table_i_and_no_more() -> None:
    printed, widened = printed_bounds(), widened_bounds()
    assert all(widened.holds(x) for x in TABLE)
    moved_low = widened.lower < printed.lower
    moved_high = widened.upper > printed.upper
    assert moved_low.tolist() == [False, False, False, False, True]
    assert moved_high.tolist() == [False, False, False, True, False]
    assert widened.lower[4] == 0.728
    assert widened.upper[3] == 2.103


def test_widened_for_one_design_holds_its_row_only() -> None:
    one = widened_bounds("design_1")
    assert one.holds(TABLE[0])
    assert not one.holds(TABLE[1])


def test_the_free_bounds_hold_both_others() -> None:
    free = free_bounds()
    for bounds in (printed_bounds(), widened_bounds()):
        assert free.holds(bounds.lower)
        assert free.holds(bounds.upper)


def test_touched_names_the_bound() -> None:
    bounds = printed_bounds()
    x = np.array([1.4, 1.0, 0.7, 2.0, 1.5])
    assert bounds.touched(x) == ("alpha1 lower", "a0 upper")
    assert bounds.touched(np.array([1.4, 1.2, 0.7, 1.9, 1.5])) == ()


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"lower": [1.1, 1.0, 0.5, 3.0, 1.0]}, "a0 are reversed"),
        ({"lower": [1.1, 1.0, 0.5, np.nan, 1.0]}, "a0 must be finite"),
        ({"lower": [1.1, 1.0, 0.0, 1.0, 1.0]}, "a1 must be positive"),
        ({"upper": [2.0, 1.5, 1.0, 2.0, 2.0]}, "no room"),
        ({"upper": [1.1, 1.5, 1.0, 2.0, 2.0], "lower": [1.05, 1.2, 0.5, 1.0, 1.0]}, "no room"),
    ],
)
def test_bad_bounds(change: dict[str, list[float]], word: str) -> None:
    printed = printed_bounds()
    lower = np.array(change.get("lower", printed.lower))
    upper = np.array(change.get("upper", printed.upper))
    with pytest.raises(ValueError, match=word):
        Bounds("bad", lower, upper)
