"""The board's micros(): 32 bits, a crystal that is a little off, and a late interrupt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spa_fo.virtual_rig.arrays import Array

WRAP = 2**32
_TICK_US = 4  # micros() of a 16 MHz AVR counts in fours


@dataclass(frozen=True)
class BoardClock:
    """Microseconds since power-on.

    Parameters
    ----------
    powered_s : float
        Campaign time of the last reset, s.
    error_ppm : float
        How much too fast the crystal runs.
    jitter_us : float
        Mean lateness of the sampling interrupt (exponential), µs.
    """

    powered_s: float
    error_ppm: float = 0.0
    jitter_us: float = 6.0

    def micros(self, campaign_s: Array, rng: np.random.Generator) -> NDArray[np.int64]:
        """Time stamps of samples taken at these campaign times, wrapped at 2³² µs."""
        elapsed = (campaign_s - self.powered_s) * 1e6 * (1.0 + self.error_ppm * 1e-6)
        late = rng.exponential(self.jitter_us, campaign_s.shape)
        ticks = np.rint((elapsed + late) / _TICK_US).astype(np.int64)
        return ticks * _TICK_US % WRAP

    def reset_at(self, campaign_s: float) -> BoardClock:
        """Restart: the same crystal, counting from 0."""
        return BoardClock(campaign_s, self.error_ppm, self.jitter_us)
