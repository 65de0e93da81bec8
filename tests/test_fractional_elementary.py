"""The vectorising exp and sincos against libm."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from spa_fo.fractional._elementary import fast_exp, fast_sincos


@settings(deadline=None, max_examples=300)
@given(st.floats(-700.0, 700.0))
def test_exp(x):
    assert abs(fast_exp(x) / math.exp(x) - 1.0) < 5e-16


@settings(deadline=None, max_examples=300)
@given(st.floats(-1e5, 1e5))
def test_sincos(x):
    sine, cosine = fast_sincos(x)
    assert abs(sine - math.sin(x)) < 5e-16
    assert abs(cosine - math.cos(x)) < 5e-16


def test_exp_beyond_its_range():
    assert fast_exp(-1e6) == fast_exp(-700.0) < 1e-300
    assert fast_exp(1e6) == fast_exp(700.0) > 1e300
