"""What is tried: the experiments of a campaign, their levels, and the order of its trials."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from blind.first_rig.asked import Asked
from spa_fo.virtual_rig.actuator import FractionalCore
from spa_fo.virtual_rig.actuators import Experiment, pressure_for
from spa_fo.virtual_rig.protocols import (
    Profile,
    hold,
    plateaus,
    staircase,
    step,
    step_release,
    triangle,
)

LOG_S = 480.0
_STEPS_S = 240.0  # for all steps together where there are longer experiments besides
_TOP_DEG = (46.0, 64.0)  # the core overshoots by up to a sixth


@dataclass(frozen=True)
class Programme:
    """Experiments, and the experiment of each trial in the order they are run."""

    experiments: tuple[Experiment, ...]
    order: tuple[str, ...]

    def describe(self) -> dict[str, Any]:
        """Say in plain data what is tried."""
        return {
            experiment.name: {
                "protocol": experiment.profile.protocol,
                "trials": self.order.count(experiment.name),
                "seconds": round(experiment.profile.duration_s, 2),
                "largest_kpa": max(experiment.profile.pressure_kpa),
            }
            for experiment in self.experiments
        }


@dataclass(frozen=True)
class Artist:
    """Draws experiments for one core.

    Parameters
    ----------
    core : FractionalCore
        What sets the pressure of an angle.
    top_deg : float
        Largest angle at which it settles.
    rng : numpy.random.Generator
        Of all levels and times.
    """

    core: FractionalCore
    top_deg: float
    rng: np.random.Generator

    def kpa(self, low: float, high: float) -> float:
        """Draw a level between two shares of the largest angle."""
        return pressure_for(self.core, self.top_deg * self.rng.uniform(low, high))

    def rest_s(self) -> float:
        """Draw the wait before the first command."""
        return self._time(1.0, 2.0)

    def _time(self, low: float, high: float) -> float:
        return round(self.rng.uniform(low, high), 2)

    def step(self, angle_deg: float, longest_s: float, release: bool) -> Experiment:
        """Draw a step to an angle."""
        rest_s, up_s, release_s = self.rest_s(), self._time(6.0, 12.0), self._time(5.0, 9.0)
        shrink = min(1.0, (longest_s - rest_s) / (up_s + release_s))
        kpa = pressure_for(self.core, angle_deg)
        profile = step(kpa, rest_s, round(up_s * shrink, 2))
        if release:
            times = (round(up_s * shrink, 2), round(release_s * shrink, 2))
            profile = step_release(kpa, rest_s, *times)
        return Experiment(f"step_{angle_deg:.0f}", round(angle_deg, 1), profile)

    def two_steps(self, longest_s: float, release: bool) -> list[Experiment]:
        """Draw steps to two angles."""
        low = self.top_deg * self.rng.uniform(0.4, 0.65)
        return [self.step(angle, longest_s, release) for angle in (low, self.top_deg)]

    def staircase(self) -> Experiment:
        """Draw stairs up to the top and down again."""
        up = int(self.rng.integers(3, 5))
        stairs = [(i + self.rng.uniform(-0.25, 0.25)) / up for i in range(1, up)]
        shares = [*stairs, 1.0, *stairs[:: -int(self.rng.integers(1, 3))]]
        levels = [pressure_for(self.core, self.top_deg * share) for share in shares]
        profile = staircase(levels, self.rest_s(), self._time(2.5, 4.0), self._time(3.0, 5.0))
        return Experiment("staircase", None, profile)

    def triangle(self, cycles: int, longest_ramp_s: float = 7.0) -> Experiment:
        """Draw ramps up and down."""
        kpa, ramp_s = self.kpa(0.75, 1.0), self._time(4.0, longest_ramp_s)
        profile = triangle(kpa, cycles, self.rest_s(), ramp_s, self._time(3.0, 5.0))
        return Experiment("triangle", None, profile)

    def hold(self) -> Experiment:
        """Draw a long hold."""
        angle = self.top_deg * self.rng.uniform(0.55, 0.85)
        times = self.rest_s(), self._time(25.0, 40.0), self._time(7.0, 11.0)
        profile = hold(pressure_for(self.core, angle), *times)
        return Experiment("hold", round(angle, 1), profile)

    def levels(self, name: str, count: int, dwell_s: tuple[float, float]) -> Experiment:
        """Draw levels at random, each held for a while."""
        levels = [self.kpa(0.1, 1.0) for _ in range(count)]
        times = self.rest_s(), self._time(*dwell_s), self._time(3.0, 5.0)
        return Experiment(name, None, plateaus("free", levels, *times))

    def sweep(self, name: str) -> Experiment:
        """Draw a wave whose frequency rises."""
        length_s, rest_s = self._time(20.0, 30.0), self.rest_s()
        slowest, fastest = self.rng.uniform(0.04, 0.08), self.rng.uniform(0.25, 0.5)
        time = np.arange(0.0, length_s, 0.1)
        cycles = slowest * time + (fastest - slowest) * time**2 / (2.0 * length_s)
        wave = 0.5 * self.kpa(0.75, 1.0) * (1.0 - np.cos(2.0 * np.pi * cycles))
        corners = (0.0, *(rest_s + time).tolist(), rest_s + length_s)
        return Experiment(name, None, Profile("free", corners, (0.0, *wave.tolist(), 0.0)))


def draw_top_deg(asked: Asked) -> float:
    """Draw the largest angle at which the specimen settles in any of the case's campaigns."""
    return asked.stream("largest angle").uniform(*_TOP_DEG)


def draw_programme(asked: Asked, core: FractionalCore) -> Programme:
    """Draw what the campaign itself holds."""
    rng = asked.stream("programme")
    artist = Artist(core, draw_top_deg(asked), rng)
    if asked.protocol in ("up_steps", "releases"):
        longest_s = LOG_S / (2 * asked.repeats)
        steps = artist.two_steps(longest_s, release=asked.protocol == "releases")
        return _ordered(asked, steps, [asked.repeats] * 2, rng)
    if asked.protocol == "single":
        if rng.random() < 0.5:
            long = artist.levels("levels", int(rng.integers(20, 41)), (3.5, 8.0))
            return Programme((long,), (long.name,))
        experiments = _rich(artist, 1)
        return _ordered(asked, experiments, [1] * len(experiments), rng)
    experiments = _rich(artist, asked.repeats)
    if asked.protocol == "everything":
        experiments += [artist.levels("free", int(rng.integers(6, 10)), (2.5, 4.0))]
        experiments += [artist.sweep("sweep")]
    return _ordered(asked, experiments, _fitting(experiments, asked.repeats), rng)


def draw_later(asked: Asked, core: FractionalCore) -> Programme:
    """Draw the programme of the campaign that follows: levels and protocols of its own."""
    rng = asked.stream("later programme")
    artist = Artist(core, draw_top_deg(asked), rng)
    experiments = (
        artist.step(artist.top_deg * rng.uniform(0.68, 0.85), 16.0, release=True),
        artist.triangle(1, 5.0),
        artist.levels("free_1", 6, (2.5, 3.5)),
        artist.levels("free_2", 6, (1.5, 3.0)),
    )
    names = [experiment.name for experiment in experiments]
    order = rng.permutation([names[0], *names]).tolist()
    return Programme(experiments, tuple(order))


def draw_earlier(asked: Asked, core: FractionalCore) -> Programme:
    """Draw the programme of the campaign before: the steps on which a model is identified."""
    rng = asked.stream("earlier programme")
    artist = Artist(core, draw_top_deg(asked), rng)
    steps = artist.two_steps(24.0, release=bool(rng.random() < 0.5))
    return _ordered(asked, steps, [int(rng.integers(2, 4))] * 2, rng)


def _rich(artist: Artist, repeats: int) -> list[Experiment]:
    draw: list[Callable[[], Experiment]] = [
        artist.staircase,
        lambda: artist.triangle(int(artist.rng.integers(1, 3))),
        artist.hold,
    ]
    return artist.two_steps(_STEPS_S / (2 * repeats), release=True) + [it() for it in draw]


def _fitting(experiments: list[Experiment], repeats: int) -> list[int]:
    """Count the trials of each experiment: repeats of the long ones are left out where they must.

    Steps keep theirs, and each of the long ones is there once at least.
    """
    seconds = [experiment.profile.duration_s for experiment in experiments]
    counts = [repeats] * len(experiments)
    while sum(n * s for n, s in zip(counts, seconds, strict=True)) > LOG_S:
        long = [i for i in range(2, len(counts)) if counts[i] > 1]
        counts[max(long, key=lambda i: counts[i] * seconds[i])] -= 1
    return counts


def _ordered(
    asked: Asked, experiments: list[Experiment], counts: list[int], rng: np.random.Generator
) -> Programme:
    names = [experiment.name for experiment in experiments]
    groups = [[names[i]] * counts[i] for i in rng.permutation(len(names))]
    order = [name for group in groups for name in group]
    if asked.order == "interleaved":
        order = rng.permutation(order).tolist()
    return Programme(tuple(experiments), tuple(order))
