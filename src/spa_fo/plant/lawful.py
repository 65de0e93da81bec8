"""The simulator with a free-form law at one place of its chain.

Beside no effect of the actuator a law that follows the motion is solved for step by step, however
steep it resists. Beside others it is found by fixed point over a window of steps: the plant answers
later than it is pushed, so that in a window that is short enough the rounds converge, as they do
for Volterra's equations (Brunner 2017, doi:10.1017/9781316162491); one that does not is halved.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.errors import BadInput
from spa_fo.plant.chain import Chain
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.effects.own import acting
from spa_fo.plant.law import Law, Past
from spa_fo.plant.law_kernel import DAMPING, MOMENT, RELAXATION, follow
from spa_fo.plant.memory import STEPS_S, kept_or_chosen, rises
from spa_fo.plant.specimen import Memory

_ROUNDS, _PATIENCE = 40, 5  # of the fixed point; turns that may not come nearer
_SETTLED_DEG = 1e-6
_SHORTEST = 8  # steps of a window
_NONE = Law("input_map", np.array([0.0, 1.0]), np.zeros(2))
_KINDS = {"moment": MOMENT, "damping": DAMPING, "relaxation": RELAXATION}


class TooSteep(ValueError):
    """A law with which no motion agrees, at a place of the chain."""

    def __str__(self) -> str:
        """Say it, of the place that is the only argument."""
        return f"the law at {self.args[0]} is too steep: no motion agrees with it"


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
        TooSteep
            The law is so steep that no motion agrees with it.
        """
        memory = self.hung(x, effects).memory.copy()
        load = self._load(effects, memory.play_kpa)
        load = load + self._of_input(load * self.reference_kpa) / self.reference_kpa
        if not self.law.follows_motion:
            angle, memory = self._moved(load, x, effects, memory)
            if not np.isfinite(angle).all():
                raise self._too_steep()
            return angle, memory
        if np.isnan(effects[LIBRARY.slots(lambda e: e.stage == "actuator")]).all():
            return self._followed(load, x, memory)
        angle, past, rise = np.empty_like(load), None, rises(load, self.grid.level)
        windows = [slice(0, load.size)]
        while windows:
            window = windows.pop()
            found = self._settled(load, rise, x, effects, window, memory, past)
            if found is None:
                windows += self._halves(window, effects)
            else:
                angle[window], memory, past = found
        return angle, memory

    def _followed(self, load: Floats, x: Floats, memory: Memory) -> tuple[Floats, Memory]:
        """Angle of the linear plant under the law, `memory` carried on in place."""
        c, law = kept_or_chosen(self.contour, x), self.law
        over, values = (law.knots, law.values) if law.place == "relaxation" else law.table()
        angle = follow(
            load,
            self.grid.fading,
            x,
            c.nodes,
            c.angles,
            c.weights,
            c.keep,
            c.gain,
            c.tilt,
            memory.modes,
            _KINDS[law.place],
            over,
            values,
            self.reference_kpa,
        )
        if not np.isfinite(angle).all():
            raise self._too_steep()
        memory.stops[-1] = np.radians(angle[-1])
        return angle, replace(memory, ends_s=self.grid.ends_s)

    def _settled(
        self,
        load: Floats,
        rise: Floats,
        x: Floats,
        effects: Floats,
        window: slice,
        memory: Memory,
        past: Past | None,
    ) -> tuple[Floats, Memory, Past] | None:
        """Solve a window of steps for angles that agree with the law; None where none is met."""
        step_s = np.asarray(STEPS_S[self.grid.fading[window]], dtype=np.float64)
        added, angle, first = np.zeros(step_s.size), np.full(step_s.size, np.inf), np.inf
        for turn in range(_ROUNDS):
            held = added / self.reference_kpa
            try:
                state = memory.copy()
                own = load[window], x, effects, state, window, held, rise[window]
                again, after = self._moved(*own)
            except BadInput:  # the law pushes an effect of a campaign's own too far
                if turn == 0:
                    raise
                break
            change = float(np.max(np.abs(again - angle)))
            if change < _SETTLED_DEG:
                return again, after, self.law.of_motion(again, step_s, past)[1]
            first = change if turn == 1 else first
            if turn > _PATIENCE and not change < first:
                break
            angle, (added, _) = again, self.law.of_motion(again, step_s, past)
        return None

    def _halves(self, window: slice, effects: Floats) -> list[slice]:
        """Split a window of steps, the first half last."""
        # An effect of a campaign's own is shown all of it, or what it remembers is lost.
        whole = any(acting(effects, "actuator"))
        if whole or window.stop - window.start < 2 * _SHORTEST:
            raise self._too_steep()
        middle = (window.start + window.stop) // 2
        return [slice(middle, window.stop), slice(window.start, middle)]

    def _too_steep(self) -> TooSteep:
        return TooSteep(self.law.place)

    def _misread(self, reading: Floats, trial: Integers) -> Floats:
        return reading + self.law.of_reading(reading, self.grid.orders[trial].astype(np.float64))

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
