"""Effects of the reading itself: what becomes of an angle, and of its noise, once it was felt.

They act on a trial's samples, never in the fixture, and depend on when in the campaign they are
taken. Two forms each, others than the library's on purpose.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import numpy as np

from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.bench import Specimen

# How to make the effect of an amplitude; a typical and the largest sensible amplitude.
_Drawn = tuple[Callable[[float], object], float, float]

Felt = tuple[Array, Array]
"""The angle that a sensor feels at each sample, and the noise on it, deg."""


@dataclass(frozen=True)
class Moments:
    """When samples are taken: in which trial, counted from the bench's first one, and when in it.

    `time_s` and `lasts_s` count from the trial's start.
    """

    trial: int
    time_s: Array
    lasts_s: float

    def since(self, trial: int, share: float) -> Array:
        """Time since a moment, s: infinite in later trials, below zero before."""
        if self.trial != trial:
            return np.full(self.time_s.size, np.inf if self.trial > trial else -np.inf)
        return np.asarray(self.time_s - share * self.lasts_s)

    def value_at(self, signal: Array, share: float) -> float:
        """Give a signal's value at a moment of this trial, straight between its samples."""
        return float(np.interp(share * self.lasts_s, self.time_s, signal))


class ReadingEffect(Protocol):
    """What a reading may suffer from."""

    def read(self, when: Moments, felt: Felt) -> Felt:
        """Give what is read instead."""


@dataclass(frozen=True)
class ReadSpecimen(Specimen):
    """A specimen whose readings suffer from something."""

    reading: tuple[ReadingEffect, ...] = ()


@dataclass(frozen=True)
class Reader:
    """What a specimen's reading makes of the samples of one trial."""

    effects: tuple[ReadingEffect, ...]
    when: Moments

    def __call__(self, angle_deg: Array, noise_deg: Array) -> Array:
        """Angle that is read, with its noise."""
        felt = (angle_deg, noise_deg)
        for effect in self.effects:
            felt = effect.read(self.when, felt)
        return felt[0] + felt[1]


def reader_of(specimen: Specimen, when: Moments) -> Reader | None:
    """Give what reads a specimen in a trial; None where nothing comes between."""
    if not isinstance(specimen, ReadSpecimen):
        return None
    return Reader(specimen.reading, when)


def place(specimen: Specimen, effect: Any) -> Specimen:
    """Give a specimen an effect of the reading."""
    if not isinstance(effect, Folded | Blended | Torn | Peeling | Jammed | Stuck):
        raise TypeError(f"{type(effect).__name__} is none of these effects")
    if not isinstance(specimen, ReadSpecimen):
        parts = {part.name: getattr(specimen, part.name) for part in fields(specimen)}
        return ReadSpecimen(**parts, reading=(effect,))
    return replace(specimen, reading=(*specimen.reading, effect))


# --- unsigned -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Folded:
    """A reading without a sign, of a sensor whose own zero is at `zero_deg`.

    Tared where the body is bent, it never goes below that: what does is mirrored.
    """

    zero_deg: float

    def read(self, when: Moments, felt: Felt) -> Felt:
        """Fold the noise with it."""
        read = self.zero_deg + np.abs(felt[0] + felt[1] - self.zero_deg)
        return read, np.zeros_like(read)


@dataclass(frozen=True)
class Blended:
    """The size of two axes by the sum of their fourth powers, on one of them `aside_deg` at rest.

    It is that of the angle where this is large; tared as `Folded` is.
    """

    zero_deg: float
    aside_deg: float

    def read(self, when: Moments, felt: Felt) -> Felt:
        """Fold the noise with it."""
        along = felt[0] + felt[1] - self.zero_deg
        read = self.zero_deg + np.sqrt(np.hypot(along**2, self.aside_deg**2))
        return read, np.zeros_like(read)


_LOWEST_DEG = -18.0  # no body swings back further, so that none would be mirrored


def draw_folded(rng: np.random.Generator, _: int) -> _Drawn:
    """Draw nothing: the higher its zero the more is mirrored."""
    return lambda x: Folded(_LOWEST_DEG + x), -_LOWEST_DEG, 34.0


def draw_blended(rng: np.random.Generator, _: int) -> _Drawn:
    """Draw the other axis."""
    aside_deg = rng.uniform(1.0, 4.0)
    return lambda x: Blended(_LOWEST_DEG + x, aside_deg), -_LOWEST_DEG, 34.0


# --- detached -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Torn:
    """A sensor that tears off at one end: at once it loses a share of the angle and jumps.

    Parameters
    ----------
    lost : float
        Share of the angle.
    jump_deg : float
        Of the zero.
    trial, at : int, float
        In which trial it happens, and when in it (share of its length).
    """

    lost: float
    jump_deg: float
    trial: int
    at: float

    def read(self, when: Moments, felt: Felt) -> Felt:
        """Lose it from then on."""
        off = when.since(self.trial, self.at) >= 0.0
        return felt[0] + off * (self.jump_deg - self.lost * felt[0]), felt[1]


@dataclass(frozen=True)
class Peeling:
    """A sensor that peels off, as e-functions do, and has slack then: it loses more of large bends.

    Parameters
    ----------
    lost : float
        Share of a large angle; of `slack_deg` it loses half as much of it.
    jump_deg : float
        Of the zero.
    trial, at : int, float
        In which trial it begins, and when in it (share of its length).
    peels_s : float
        Time constant.
    slack_deg : float
        Above.
    """

    lost: float
    jump_deg: float
    trial: int
    at: float
    peels_s: float
    slack_deg: float

    def read(self, when: Moments, felt: Felt) -> Felt:
        """Lose it little by little."""
        done = -np.expm1(-np.maximum(when.since(self.trial, self.at), 0.0) / self.peels_s)
        bent = np.abs(felt[0])
        lost = self.lost * bent / (bent + self.slack_deg)
        return felt[0] + done * (self.jump_deg - lost * felt[0]), felt[1]


def draw_torn(rng: np.random.Generator, trials: int) -> _Drawn:
    """Draw when, and how much of it is gain and how much zero."""
    gain, zero = _gain_and_zero(rng)
    trial, at = _moment(rng, trials)
    return lambda x: Torn(x * gain, x * zero, trial, at), 4.0, 40.0


def draw_peeling(rng: np.random.Generator, trials: int) -> _Drawn:
    """Draw when and how soon, and how much of it is gain and how much zero."""
    gain, zero = _gain_and_zero(rng)
    trial, at = _moment(rng, trials)
    peels_s, slack_deg = rng.uniform(0.5, 5.0), rng.uniform(5.0, 20.0)
    return lambda x: Peeling(x * gain, x * zero, trial, at, peels_s, slack_deg), 4.0, 40.0


def _gain_and_zero(rng: np.random.Generator) -> tuple[float, float]:
    """Draw the share lost and the zero's jump for each degree that is missing at 60°."""
    gain, zero = ((1.0, 0.0), (0.0, 1.0), (0.8, 0.6))[int(rng.integers(3))]
    # Rather upward: nobody could read on far below the fixture's 0°.
    return gain / 60.0, zero if rng.random() < 0.7 else 0.0 - zero


def _moment(rng: np.random.Generator, trials: int) -> tuple[int, float]:
    """Draw a trial, early or late in a campaign but rather not at its ends, and when in it."""
    return round(1 + (trials - 1) * rng.uniform(0.2, 0.65)), rng.uniform(0.1, 0.7)


# --- frozen -------------------------------------------------------------------------------------

Window = tuple[int, float, float]
"""A trial, and from when until when in it, as shares of its length."""


@dataclass(frozen=True)
class Jammed:
    """A film that jams in its pocket and then slides back; what is read still has its noise.

    Parameters
    ----------
    windows : tuple of Window
        In which trials, and when in them.
    slides_s : float
        Time constant of its way back.
    """

    windows: tuple[Window, ...]
    slides_s: float

    def read(self, when: Moments, felt: Felt) -> Felt:
        """Hold the angle felt."""
        angle = felt[0].copy()
        for trial, start, end in self.windows:
            if trial == when.trial:
                held = when.value_at(felt[0], start)
                inside = (when.since(trial, start) >= 0.0) & (when.since(trial, end) < 0.0)
                angle[inside] = held
                after = when.since(trial, end)
                behind = held - when.value_at(felt[0], end)
                angle += behind * np.exp(-np.maximum(after, 0.0) / self.slides_s) * (after >= 0.0)
        return angle, felt[1]


@dataclass(frozen=True)
class Stuck:
    """A register that is not written any more: one value again and again, noise and all.

    `windows` are the trials, and when in them.
    """

    windows: tuple[Window, ...]

    def read(self, when: Moments, felt: Felt) -> Felt:
        """Hold all that is read."""
        angle, noise = felt[0].copy(), felt[1].copy()
        for trial, start, end in self.windows:
            if trial == when.trial:
                inside = (when.since(trial, start) >= 0.0) & (when.since(trial, end) < 0.0)
                angle[inside] = when.value_at(felt[0], start)
                noise[inside] = when.value_at(felt[1], start)
        return angle, noise


def draw_jammed(rng: np.random.Generator, trials: int) -> _Drawn:
    """Draw in which trials it jams, one after the other as the effect grows, and from when on."""
    order = _some(rng, trials)
    starts = rng.uniform(0.03, 0.6, len(order)).tolist()
    slides_s = rng.uniform(0.1, 0.6)

    def make(amplitude: float) -> Jammed:
        windows = [
            (trial, start, start + part * (1.0 - start))
            for trial, start, part in zip(order, starts, _parts(amplitude, order), strict=True)
            if part > 0.0
        ]
        return Jammed(tuple(windows), slides_s)

    return make, 1.0, float(len(order))


def draw_stuck(rng: np.random.Generator, trials: int) -> _Drawn:
    """Draw in which trials it sticks, one after the other as the effect grows, and until when."""
    order = _some(rng, trials)
    to_the_end = bool(rng.random() < 0.5)
    ends = [1.0 if to_the_end else end for end in rng.uniform(0.6, 0.95, len(order)).tolist()]

    def make(amplitude: float) -> Stuck:
        windows = [
            (trial, end - part * (end - 0.03), end)
            for trial, end, part in zip(order, ends, _parts(amplitude, order), strict=True)
            if part > 0.0
        ]
        return Stuck(tuple(windows))

    return make, 1.0, float(len(order))


def _some(rng: np.random.Generator, trials: int) -> list[int]:
    """Draw half of the trials at most, in the order in which an effect that grows takes them."""
    return [int(trial) + 1 for trial in rng.permutation(trials)[: max(1, trials // 2)]]


def _parts(amplitude: float, order: list[int]) -> list[float]:
    """List how much of the longest time each trial has, at an amplitude counted in trials."""
    return [min(max(amplitude - i, 0.0), 1.0) for i in range(len(order))]
