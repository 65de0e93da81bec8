"""By how much a reference's angles are early or late is told from other noise."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from spa_fo.compare.fading_memory import Chosen, FadingMemoryLaw, Kernel
from spa_fo.compare.timing import lateness_s, rate, unsure_of_time

T_S = np.arange(0.0, 30.0, 0.02)
ANGLE_DEG = 60.0 / (1.0 + np.exp(-(T_S % 10.0 - 5.0) / 0.1))
NOISE_DEG = 0.5


def law_of(left: list[np.ndarray], sound: np.ndarray | None = None) -> FadingMemoryLaw:
    n = len(left)
    nothing = np.zeros((0, 2))
    return FadingMemoryLaw(
        lags_s=np.zeros(0),
        centre=np.zeros(2),
        scale=np.ones(2),
        at=nothing,
        missed=np.zeros(0),
        chosen=Chosen(Kernel(1.0, 1e-3, 1.0), NOISE_DEG**2, 0.0, 1.0, 1.0, True),
        left=tuple(left),
        expected=(np.full(T_S.size, NOISE_DEG),) * n,
        sound=(np.ones(T_S.size, dtype=bool) if sound is None else sound,) * n,
    )


def trials_of(left: list[np.ndarray]) -> Any:
    """Give trials whose angle was foreseen but for what is left."""
    return cast(Any, [SimpleNamespace(t_s=T_S, angle_deg=ANGLE_DEG + each) for each in left])


def missed(late_s: float, trials: int = 40) -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    return [
        late_s * rng.standard_normal() * rate(ANGLE_DEG, T_S)
        + NOISE_DEG * rng.standard_normal(T_S.size)
        for _ in range(trials)
    ]


@pytest.mark.parametrize("late_s", [0.0, 0.005, 0.02])
def test_it_is_found(late_s: float) -> None:
    left = missed(late_s)
    assert lateness_s(trials_of(left), law_of(left)) == pytest.approx(late_s, rel=0.25, abs=5e-4)


def test_what_is_not_sound_says_nothing_of_it() -> None:
    left = missed(0.0)
    wrong = rate(ANGLE_DEG, T_S) > 100.0
    off = [each + 50.0 * wrong for each in left]
    # No more than two samples: what is later is no error of timing.
    assert lateness_s(trials_of(off), law_of(off)) == pytest.approx(0.04)
    assert lateness_s(trials_of(off), law_of(off, ~wrong)) < 3e-3
    assert lateness_s(trials_of(off), law_of(off, np.zeros(T_S.size, dtype=bool))) == 0.0


def test_a_law_expects_more_where_the_angle_is_fast() -> None:
    left = missed(0.0, 2)
    law = unsure_of_time(law_of(left), trials_of(left), 0.02)
    fast = rate(ANGLE_DEG, T_S)
    for expected in law.expected:
        np.testing.assert_allclose(expected, np.hypot(NOISE_DEG, 0.02 * fast), rtol=1e-6)


def test_samples_of_one_moment_have_no_rate_without_end() -> None:
    assert np.isfinite(rate(np.array([0.0, 1.0, 2.0]), np.zeros(3))).all()
