from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.signal import TransferFunction, step

from spa_fo.plant import second_order_step

T = np.linspace(0.0, 12.0, 61)


@pytest.mark.parametrize("zeta", [0.05, 0.7, 0.999999, 1.0, 1.000001, 1.5, 10.0])
def test_against_the_exact_formula(zeta: float) -> None:
    omega, gain = 1.3, 0.6
    with mpmath.workdps(40):
        z, expected = mpmath.mpf(zeta), []
        root = mpmath.sqrt(z * z - 1) if zeta != 1 else mpmath.mpf(0)
        for t in T:
            tau = mpmath.mpf(omega) * mpmath.mpf(float(t))
            tail = (
                mpmath.exp(-tau) * (1 + tau)
                if zeta == 1
                else mpmath.exp(-z * tau)
                * (mpmath.cosh(root * tau) + z * mpmath.sinh(root * tau) / root)
            )
            expected.append(float(mpmath.re(gain * (1 - tail))))
    np.testing.assert_allclose(second_order_step(T, gain, zeta, omega), expected, atol=1e-14)


def test_against_scipy() -> None:
    system = TransferFunction([0.5 * 4.0], [1.0, 2 * 0.3 * 2.0, 4.0])
    _, expected = step(system, T=T)
    np.testing.assert_allclose(second_order_step(T, 0.5, 0.3, 2.0), expected, atol=1e-9)


def test_nothing_happens_before_the_step() -> None:
    assert second_order_step([-1.0, 0.0], 1.0, 0.5, 1.0).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("bad", [(0.0, 1.0), (0.5, -1.0), (np.nan, 1.0), (0.5, np.inf)])
def test_bad_parameters(bad: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="positive"):
        second_order_step(T, 1.0, *bad)
