from __future__ import annotations

import math

import numpy as np
import pytest

from spa_fo.plant import PARAMETERS, TABLE_I, TransferFunction


def test_arrays_keep_the_order_of_the_parameters() -> None:
    g = TransferFunction(1.4, 1.2, 0.8, 1.6, 0.9)
    assert [getattr(g, name) for name in PARAMETERS] == g.as_array().tolist()
    assert TransferFunction.from_array(g.as_array()) == g


def test_the_gain_of_table_i() -> None:
    assert math.degrees(TABLE_I["design_1"].gain) == pytest.approx(32.7, abs=0.05)
    assert math.degrees(TABLE_I["design_2"].gain) == pytest.approx(19.8, abs=0.05)


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ((1.2, 1.4, 1, 1, 1), "alpha1 < alpha2"),
        ((1.2, 1.2, 1, 1, 1), "alpha1 < alpha2"),
        ((2.01, 1.2, 1, 1, 1), "<= 2"),
        ((1.2, 0.0, 1, 1, 1), "0 <"),
        ((1.4, 1.2, 0, 1, 1), "a1 must be positive"),
        ((1.4, 1.2, 1, -1, 1), "a0 must be positive"),
        ((1.4, 1.2, 1, 1, np.nan), "b0 must be a finite"),
        ((np.inf, 1.2, 1, 1, 1), "alpha2 must be a finite"),
    ],
)
def test_what_is_no_model_is_refused(values: tuple[float, ...], word: str) -> None:
    with pytest.raises(ValueError, match=word):
        TransferFunction(*values)
