"""The flex channel is logged late against command and pressure: a filter's or a buffer's delay."""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats, Integers
from spa_fo.plant.effects.effect import Effect, Parameter, lateness
from spa_fo.plant.memory import FINEST_STEP_S

EFFECT = Effect(
    id="channel_latency",
    stage="acquisition",
    parameters=(
        lateness("delay_s", "how late the angle is logged", is_delay=True),
        Parameter(
            *("window_share", "1", 0.0, 0.6, 0.0, 1.0),
            starts=(0.2,),
            means="spread of the delay, squared: 0 is a buffer, 1 a moving average",
        ),
    ),
    name="latency of the flex channel",
    means="the angle is logged late against command and pressure",
    remedy="look for a filter or a buffer in the firmware's flex channel; sample all channels at "
    "once",
    filter="delay",
    in_fixture=True,
    in_trials_alone=True,
)


_PARTS = 21  # of a window: as wide as a step's response is long, five leave a tenth of it


def smeared(delay_s: float, window_share: float) -> Floats:
    """Delays whose mean is the channel's: a buffer has one, a moving average a spread of them."""
    if window_share <= 0.0:
        return np.array([delay_s])
    middles = (np.arange(_PARTS) + 0.5) / _PARTS
    return np.asarray(delay_s * (1.0 + np.sqrt(window_share) * (2.0 * middles - 1.0)))


@njit
def read_earlier(
    before: Floats,
    reading: Floats,
    level: Integers,
    starts: Integers,
    step: Integers,
    share: Floats,
    trial: Integers,
    delay: Floats,
) -> Floats:
    """Read each sample its `delay` in seconds earlier, straight within a step."""
    out = np.empty(step.size)
    for i in range(step.size):
        j = step[i]
        first = starts[trial[i]]
        back = delay[i]
        length = FINEST_STEP_S * 2.0 ** level[j]
        at = share[i] * length - back
        while at < 0.0 and j > first:
            j -= 1
            length = FINEST_STEP_S * 2.0 ** level[j]
            at += length
        at = max(at, 0.0)
        out[i] = before[j] + (reading[j] - before[j]) * at / length
    return out
