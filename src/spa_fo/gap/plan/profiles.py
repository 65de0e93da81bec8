"""Commanded pressures that a next experiment may consist of: a catalogue, drawn within limits."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.optimize import bisect

from spa_fo.arrays import Floats
from spa_fo.atomic import write_text
from spa_fo.plant.grid import CampaignGrid
from spa_fo.rig.command_profile import COLUMNS

Move = tuple[float, float, float]
"""A share of the largest pressure, the seconds to get there, and those for which it is held."""

RATE_HZ = 50.0
BANNER = "# spa-fo profile 1 "

_LEAD_S = 1.5  # at rest before anything happens
_DURATION_S = 120.0  # long enough for a hold and its recovery
_JUMP = 0.1  # of the largest command, from one sample to the next
_SLOPE_S = 0.25  # a slope counts over so long, as commands may be rounded
_SHORTEST = 0.3  # of a profile's natural times: shorter, it is another experiment
_TRACE_S = 0.1


@dataclass(frozen=True)
class Limits:
    """What a profile may ask: its largest command, its length, and its steepest slope (kPa/s).

    The slope is infinite where jumps are allowed.
    """

    pressure_kpa: float
    duration_s: float = _DURATION_S
    rate_kpa_s: float = math.inf


@dataclass(frozen=True)
class Profile:
    """A commanded pressure, straight between its corners; two corners at one time are a jump.

    `name` is for tables, `words` for the person at the bench; the corners begin at (0, 0). It is
    run `repeats` times, `every_s` from one start to the next.
    """

    name: str
    words: str
    time_s: tuple[float, ...]
    pressure_kpa: tuple[float, ...]
    repeats: int = 1
    every_s: float = 0.0

    @property
    def duration_s(self) -> float:
        """Length of one run, s."""
        return self.time_s[-1]

    def sampled(self) -> tuple[Floats, Floats]:
        """Return times (s) and commands (kPa) at `RATE_HZ`, each held until the next."""
        t = np.arange(math.floor(self.duration_s * RATE_HZ + 1e-9) + 1) / RATE_HZ
        # A jump belongs to the sample that falls on it: look just after each instant.
        command = np.interp(t + 1e-6, self.time_s, self.pressure_kpa)
        highest = math.floor(100.0 * max(self.pressure_kpa) + 1e-9) / 100.0
        return t, np.minimum(np.round(command, 2), highest)


def limits_of(grid: CampaignGrid) -> Limits:
    """Take limits from what a campaign has asked of its actuator already.

    Durations are no strain: the longest profile is 2 min, or as long as the longest trial.
    """
    cells = grid.command_kpa if grid.command_kpa is not None else grid.pressure_kpa
    assert cells is not None
    largest = max(float(cells.max()), 0.0)
    steepest, longest = 0.0, _DURATION_S
    for trial in grid.trials:
        signal = trial.command_kpa if trial.command_kpa is not None else trial.pressure_kpa
        assert signal is not None
        jumps = np.abs(np.diff(signal, prepend=0.0)) > _JUMP * largest  # a log may begin with one
        if trial.command_kpa is not None and jumps.any():
            steepest = math.inf
        elif trial.t_s[-1] > trial.t_s[0]:
            at = np.arange(0.0, trial.t_s[-1] + _SLOPE_S, _SLOPE_S)
            slopes = np.diff(np.interp(at, trial.t_s, signal)) / _SLOPE_S
            steepest = max(steepest, float(np.abs(slopes).max()))
        longest = max(longest, float(trial.t_s[-1]))
    return Limits(largest, longest, steepest or math.inf)


def _steps(shares: Iterable[float], hold_s: float, vent_s: float) -> list[Move]:
    return [move for share in shares for move in ((share, 0.0, hold_s), (0.0, 0.0, vent_s))]


def _triangles(count: int, ramp_s: float, rest_s: float) -> list[Move]:
    return [*[(1.0, ramp_s, 0.0), (0.0, ramp_s, 0.0)] * count, (0.0, 0.0, rest_s)]


def _return_curves() -> list[Move]:
    depths = (0.25, 0.5, 0.75, 1.0)
    turns = [move for d in depths for move in ((1.0 - d, 10.0 * d, 0.0), (1.0, 10.0 * d, 0.0))]
    return [(1.0, 10.0, 0.0), *turns, (0.0, 10.0, 6.0)]


def _squares(halves_s: Iterable[float]) -> list[Move]:
    waves = [[(1.0, 0.0, half), (0.4, 0.0, half)] * (round(4.0 / half) + 1) for half in halves_s]
    return [*(move for wave in waves for move in wave), (0.0, 0.0, 6.0)]


def _chirp(low_hz: float, high_hz: float, seconds: float) -> list[Move]:
    """Trace a sine about half the pressure whose frequency grows exponentially."""
    rate = math.log(high_hz / low_hz) / seconds
    phase = 2.0 * np.pi * low_hz / rate * np.expm1(rate * np.arange(0.0, seconds, _TRACE_S))
    shares = (0.5 + 0.5 * np.sin(phase)).tolist()
    return [(0.5, 4.0, 4.0), *((share, _TRACE_S, 0.0) for share in shares), (0.0, 2.0, 4.0)]


_UP = (0.2, 0.4, 0.6, 0.8, 1.0)
_RICH: list[Move] = [
    *(*_steps((0.5,), 5.0, 5.0), *_steps((1.0,), 8.0, 6.0)),
    *((share, 0.0, 4.0) for share in (0.33, 0.67, 1.0, 0.67, 0.33)),
    *((0.0, 1.0, 4.0), (1.0, 8.0, 0.0), (0.5, 4.0, 0.0), (1.0, 4.0, 0.0), (0.0, 8.0, 2.0)),
    *_steps((1.0,), 22.0, 16.0),
]
_SHAPES: dict[str, tuple[str, Sequence[Move]]] = {
    "up-step": ("one up-step to {100 %}, held for {10 s}", [(1.0, 0.0, 10.0)]),
    "step and release": (
        "step to {100 %} for {10 s}, then vent for {10 s}",
        _steps((1.0,), 10.0, 10.0),
    ),
    "steps of four sizes": (
        "steps to {25 %}, {100 %}, {50 %} and {75 %} in this order, {7 s} each, vented for as "
        "long between them",
        _steps((0.25, 1.0, 0.5, 0.75), 7.0, 7.0),
    ),
    "fast triangles": (
        "eight fast triangles to {100 %}, {1 s} up and as long down",
        _triangles(8, 1.0, 6.0),
    ),
    "slow and fast triangles": (
        "a slow triangle to {100 %} ({25 s} each way), then six fast ones ({1 s} each way)",
        [*_triangles(1, 25.0, 5.0), *_triangles(6, 1.0, 6.0)],
    ),
    "staircase": (
        "a staircase up to {100 %} in five stairs and down again by the same, {7 s} on each, "
        "then vent",
        [*((share, 0.0, 7.0) for share in (*_UP, *_UP[-2::-1])), (0.0, 0.0, 10.0)],
    ),
    "hold and recovery": (
        "step to {100 %}, held for {60 s}, then vent and go on recording for {55 s}",
        _steps((1.0,), 60.0, 55.0),
    ),
    "identical cycles": (
        "ten identical cycles: {100 %} for {4 s}, vented for as long",
        _steps((1.0,) * 10, 4.0, 4.0),
    ),
    "return curves": (
        "first-order return curves: ramp to {100 %}, down to three quarters, a half, a quarter "
        "and nothing of it, each time up again, {10 s} the full way",
        _return_curves(),
    ),
    "square waves": (
        "square waves between {40 %} and {100 %}, half periods of {4 s}, {2 s}, {1 s}, {0.5 s}",
        _squares((4.0, 2.0, 1.0, 0.5)),
    ),
    "chirp": (
        "a sine about {50 %} of {50 %} amplitude, its frequency rising from 0.05 to 1.5 Hz in "
        "{45 s}",
        _chirp(0.05, 1.5, 45.0),
    ),
    "rich": (
        "a bit of everything up to {100 %}: two steps with release, a staircase up and down, a "
        "return curve, a hold and its recovery",
        _RICH,
    ),
}
"""The catalogue: words, where {50 %} is a pressure and {7 s} a time, and moves."""
_OVER_AN_HOUR = "steps over an hour"
NAMES = (*_SHAPES, _OVER_AN_HOUR)
FEW = (
    *("up-step", "steps of four sizes", "staircase", "hold and recovery", "identical cycles"),
    *("return curves", "slow and fast triangles", "square waves", _OVER_AN_HOUR),
)
"""Profiles that between them show most effects: for when time is short."""


def family(limits: Limits, names: tuple[str, ...] = NAMES) -> tuple[Profile, ...]:
    """Draw the profiles of these names as far as they fit into the limits.

    A profile that is too long is drawn faster, down to a third of its natural times.
    """
    drawn = [_drawn(name, limits) for name in names]
    return tuple(profile for profile in drawn if profile is not None)


def _drawn(name: str, limits: Limits) -> Profile | None:
    if name == _OVER_AN_HOUR:
        once = _drawn("step and release", limits)
        if once is None:
            return None
        words = f"{once.words}; seven times within an hour, one every 10 min"
        return replace(once, name=name, words=words, repeats=7, every_s=600.0)
    template, moves = _SHAPES[name]
    shares, moving_s, held_s = np.array(moves).T
    targets = shares * limits.pressure_kpa
    least_s = np.abs(np.diff(targets, prepend=0.0)) / limits.rate_kpa_s

    def corners_s(scale: float) -> Floats:
        lengths = np.column_stack([np.maximum(moving_s * scale, least_s), held_s * scale])
        return np.asarray(_LEAD_S + np.cumsum(lengths))

    def excess_s(scale: float) -> float:
        return float(corners_s(scale)[-1]) - limits.duration_s

    scale = 1.0
    if excess_s(scale) > 0.0:
        if excess_s(_SHORTEST) > 0.0:
            return None
        scale = max(bisect(excess_s, _SHORTEST, 1.0, xtol=1e-7) - 1e-6, _SHORTEST)

    def shown(quantity: re.Match[str]) -> str:
        if quantity[2] == "%":
            return f"{float(quantity[1]) / 100.0 * limits.pressure_kpa:.3g} kPa"
        return f"{float(quantity[1]) * scale:.3g} s"

    words = re.sub(r"\{([\d.]+) (%|s)\}", shown, template)
    time_s = (0.0, _LEAD_S, *corners_s(scale).tolist())
    return Profile(name, words, time_s, (0.0, 0.0, *np.repeat(targets, 2).tolist()))


def write_profile(path: Path | str, profile: Profile, purpose: str) -> None:
    """Write one run of a profile as csv: what it is for (one line), `COLUMNS`, a row a sample.

    Raises
    ------
    BadInput
        The file cannot be written.
    """
    note = " ".join(f"{profile.name}: {profile.words}; {purpose}".split())
    rows = [f"{t:.2f},{kpa:.2f}" for t, kpa in zip(*profile.sampled(), strict=True)]
    write_text(path, "\n".join([BANNER + note, COLUMNS, *rows, ""]))
