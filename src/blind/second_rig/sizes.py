"""How large things are: the noise floor, an effect's size, and the amplitude of a size asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from blind.second_rig.bank import Core
from blind.second_rig.bench import Bench, Plan
from blind.second_rig.channel import end
from blind.second_rig.effect import Effect, Scene
from blind.second_rig.sensor import When
from blind.second_rig.timeline import play

Floats = npt.NDArray[np.float64]

_WITHIN = 0.01  # of the size asked
_LEAST_DEG, _MOST_DEG = -18.0, 84.0  # what the bench has room for
_SEARCHED = 40  # amplitudes among which a size is searched for
_PROBE = 0.01  # relative change of the rate factor


@dataclass(frozen=True)
class Ruler:
    """Measures effects on one campaign's commands, free of noise and scatter."""

    bench: Bench
    plan: Plan
    scene: Scene

    def angles(self, effects: Sequence[Effect], core: Core | None = None) -> Floats:
        """Return the read angle of all samples of all trials (deg)."""
        core = core or self.bench.core
        return _angles(core, effects, self.plan, self.scene)

    @cached_property
    def bare(self) -> Floats:
        """The read angle without any effect."""
        return self.angles(())

    @cached_property
    def floor_deg(self) -> float:
        """What repeated trials differ by from their mean, to first order in each cause."""
        surroundings = self.bench.surroundings
        scatter, noise = surroundings["scatter"], surroundings["noise"]
        faster = replace(
            self.plan, trials=tuple(replace(t, rate_factor=1.0 + _PROBE) for t in self.plan.trials)
        )
        by_rate = (_angles(self.bench.core, (), faster, self.scene) - self.bare) / _PROBE
        parts = (
            float(scatter["gain"]) * rms(self.bare),
            float(scatter["time_scale"]) * rms(by_rate),
            float(scatter["rest_deg"]),
            float(noise["coloured_deg"]),
            float(noise["white_deg"]),
            rms(self.bench.resolution_deg(self.bare)) / np.sqrt(12.0),
        )
        return float(np.sqrt(np.sum(np.square(parts))))

    def size(self, effects: Sequence[Effect]) -> float:
        """Return the RMS change of the angle that effects make, over the noise floor."""
        return rms(self.angles(effects) - self.bare) / self.floor_deg

    def sized(self, effect: Effect, asked: float) -> Effect:
        """Return the effect at the amplitude of the size asked, or at its limit if that is less.

        Parameters
        ----------
        effect : Effect
            Of any amplitude.
        asked : float
            Multiple of the noise floor.
        """
        low, high = 0.0, self._limit(effect)
        if effect.searched:
            low, high = self._crossing(effect, high, asked)
        if self.size((effect.sized(high),)) <= asked:
            return effect.sized(high)
        amplitude, low_size = 0.5 * (low + high) if low > 0.0 else 0.1 * high, 0.0
        for turn in range(40):
            found = self.size((effect.sized(amplitude),))
            if abs(found / asked - 1.0) < _WITHIN:
                break
            if found > asked:
                high = amplitude
            else:
                low, low_size = amplitude, found
            guess = amplitude * asked / max(found, 1e-9)
            inside = low < guess < high and (turn % 3 != 2 or low_size == 0.0)
            amplitude = guess if inside else 0.5 * (low + high)
        return effect.sized(amplitude)

    def _crossing(self, effect: Effect, limit: float, asked: float) -> tuple[float, float]:
        """Return amplitudes between which the size first passes the one asked.

        Where it never does, the higher one is that of the largest size.
        """
        amplitudes = np.linspace(0.0, limit, _SEARCHED + 1)
        sizes = np.array([self.size((effect.sized(float(a)),)) for a in amplitudes])
        found = int(np.argmax(sizes >= asked)) if sizes.max() >= asked else int(np.argmax(sizes))
        return float(amplitudes[max(found - 1, 0)]), float(amplitudes[found])

    def _limit(self, effect: Effect) -> float:
        """Return the largest amplitude that keeps the angle on the bench."""
        limit = effect.limit
        for _ in range(40):
            angle = self.angles((effect.sized(limit),))
            if np.isfinite(angle).all() and _LEAST_DEG <= angle.min() <= angle.max() <= _MOST_DEG:
                break
            limit *= 0.85
        return limit


def _angles(core: Core, effects: Sequence[Effect], plan: Plan, scene: Scene) -> Floats:
    readings = play(core, effects, plan.trials, scene)
    return np.concatenate(
        [
            end(effects, reading.angle, trial.times, When(trial.started_s, order))
            for order, (trial, reading) in enumerate(zip(plan.trials, readings, strict=True), 1)
        ]
    )


def rms(values: Floats) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
