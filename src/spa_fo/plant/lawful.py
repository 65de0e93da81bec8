"""The simulator with a free-form law at one place of its chain."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from spa_fo.plant.chain import Chain, Memory
from spa_fo.plant.law import Law
from spa_fo.plant.memory import STEPS_S

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


_NONE = Law("input_map", np.array([0.0, 1.0]), np.zeros(2))


@dataclass(frozen=True)
class LawfulChain(Chain):
    """A chain with a law beside its effects.

    Attributes
    ----------
    law : Law
        The law.
    """

    law: Law = _NONE

    def pressure(self, effects: Floats, play: Floats) -> Floats:
        """Give the true pressure on the cells, kPa: a law of the filling stands behind the pump."""
        driven = super().pressure(effects, play)
        return driven if self.is_pressure else self.law.driven(driven, self.grid.cell_starts)

    def angles(self, x: Floats, effects: Floats) -> tuple[Floats, Memory]:
        """Simulate all trials; the true angle (deg) at the end of each step, the film untouched.

        Raises
        ------
        ValueError
            The law is so steep that no motion agrees with it.
        """
        before = self.memory.copy()
        load = self._load(effects, before.play_kpa)
        load = load + self._of_input(load * self.reference_kpa) / self.reference_kpa
        memory = before.copy()
        if not self.law.follows_motion:
            return self._moved(load, x, effects, memory)

        def pushed(added_kpa: Floats) -> Floats:
            nonlocal memory
            memory = before.copy()
            angle, memory = self._moved(load + added_kpa / self.reference_kpa, x, effects, memory)
            return angle

        step_s = np.asarray(STEPS_S[self.grid.level], dtype=np.float64)
        return self.law.settled(pushed, step_s), memory

    def logged(
        self, reading: Floats, effects: Floats, step: Integers, share: Floats, trial: Integers
    ) -> Floats:
        """Take the reading at any samples; for the parameters see `Chain.logged`."""
        y = super().logged(reading, effects, step, share, trial)
        return y + self.law.of_reading(y, self.grid.orders[trial].astype(np.float64))

    def _of_input(self, pressure_kpa: Floats) -> Floats:
        """Give what the law adds to the pressure of each step, kPa; nothing in the rests."""
        added = self.law.of_input(pressure_kpa, self._order)
        return np.where(self.grid.cells > 0, added, 0.0)

    @cached_property
    def _order(self) -> Floats:
        """Each step's trial's place in the campaign; a rest before the first trial is its own."""
        ends = self.grid.step_starts[1:]
        trial = np.searchsorted(ends, np.arange(self.grid.level.size), side="right")
        return np.asarray(self.grid.orders[trial], dtype=np.float64)


def with_law(chain: Chain, law: Law) -> LawfulChain:
    """Put a law beside a chain's effects, in the place of any that it has."""
    kept = {each.name: getattr(chain, each.name) for each in fields(Chain)}
    return LawfulChain(**kept, law=law)
