"""By how much angles come earlier or later than a reference lets expect.

A camera has its frames, a message its way and an actuator a pace of its own: by a hundredth of a
second, which is nothing while an angle holds, and degrees on a steep edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.compare.fading_memory import FadingMemoryLaw
from spa_fo.compare.learning import beyond_scatter
from spa_fo.rig import Trial

_LEAST_S = 1e-4  # between samples: what is logged at one moment has no rate without end
_MOST = 2.0  # intervals between samples: what is later than that is no error of timing. Assumed.


def lateness_s(trials: Sequence[Trial], law: FadingMemoryLaw) -> float:
    """Say by how much the reference's angles come early or late, 1 sigma, s.

    That is by what trials which the law did not learn from are missed beyond what it expects, as
    far as it goes with how fast the angle moves.
    """
    sound = np.concatenate(law.sound)
    if not sound.any():
        return 0.0
    rates = np.concatenate(_rates(trials, law))
    left, expected = np.concatenate(law.left), np.concatenate(law.expected)
    values = left[sound] ** 2, rates[sound] ** 2, np.ones(np.count_nonzero(sound))
    interval_s = float(np.median(np.concatenate([np.diff(trial.t_s) for trial in trials])))
    return min(float(np.sqrt(beyond_scatter(*values, expected[sound] ** 2))), _MOST * interval_s)


def unsure_of_time(law: FadingMemoryLaw, trials: Sequence[Trial], late_s: float) -> FadingMemoryLaw:
    """Let a law expect of its reference what times that are off by `late_s` make of it."""
    rates = _rates(trials, law)
    expected = [np.hypot(own, late_s * r) for own, r in zip(law.expected, rates, strict=True)]
    return replace(law, expected=tuple(expected))


def rate(angle_deg: Floats, t_s: Floats) -> Floats:
    """Say how fast an angle moves at each sample, either way, deg/s."""
    return np.asarray(np.abs(np.gradient(angle_deg)) / np.maximum(np.gradient(t_s), _LEAST_S))


def _rates(trials: Sequence[Trial], law: FadingMemoryLaw) -> list[Floats]:
    return [
        rate(trial.angle_deg - left, trial.t_s)
        for trial, left in zip(trials, law.left, strict=True)
    ]
