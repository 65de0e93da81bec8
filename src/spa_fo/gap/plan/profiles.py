"""Commanded pressures that a next experiment may consist of: a family of them, within limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spa_fo.atomic import write_text
from spa_fo.plant.grid import CampaignGrid

Floats = NDArray[np.float64]

RATE_HZ = 50.0
COLUMNS = "t_s,cmd_kpa"
BANNER = "# spa-fo profile 1 "

_LEAD_S = 1.5  # at rest before anything happens
_DURATION_S = 120.0  # long enough for a hold and its recovery
_JUMP = 0.1  # of the largest command, from one sample to the next
_SHORTEST = 0.3  # of a profile's natural times: shorter, it is another experiment


@dataclass(frozen=True)
class Limits:
    """What a profile may ask of the actuator.

    Attributes
    ----------
    pressure_kpa : float
        Largest command.
    duration_s : float
        Longest profile.
    rate_kpa_s : float
        Steepest slope, kPa/s; infinite where jumps are allowed.
    """

    pressure_kpa: float
    duration_s: float = _DURATION_S
    rate_kpa_s: float = math.inf


@dataclass(frozen=True)
class Profile:
    """A commanded pressure, straight between its corners; two corners at one time are a jump.

    Attributes
    ----------
    name, words : str
        For tables, and for the person at the bench.
    time_s, pressure_kpa : tuple of float
        The corners, from (0, 0).
    repeats : int
        How many times it is run.
    every_s : float
        From one run's start to the next one's.
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
    driven = grid.command_kpa if grid.command_kpa is not None else grid.pressure_kpa
    assert driven is not None
    largest = max(float(driven.max()), 0.0)
    steepest, longest = 0.0, _DURATION_S
    for trial in grid.trials:
        signal = trial.command_kpa if trial.command_kpa is not None else trial.pressure_kpa
        assert signal is not None
        apart = np.diff(trial.t_s)
        change = np.abs(np.diff(signal, prepend=0.0))  # a log may begin at its full command
        if trial.command_kpa is not None and np.any(change > _JUMP * largest):
            steepest = math.inf
        elif np.any(apart > 0.0):
            # Commands may be rounded: a slope counts over a quarter second.
            at = np.arange(0.0, trial.t_s[-1] + 0.25, 0.25)
            slope = np.abs(np.diff(np.interp(at, trial.t_s, signal))) / 0.25
            steepest = max(steepest, float(slope.max()))
        longest = max(longest, float(trial.t_s[-1]))
    return Limits(largest, longest, steepest or math.inf)


class _Pen:
    """Draws the corners of a profile, never steeper than the limit.

    `time_scale` scales the natural times of what is drawn.
    """

    def __init__(self, limits: Limits, time_scale: float) -> None:
        self.top = limits.pressure_kpa
        self.rate = limits.rate_kpa_s
        self.time_scale = time_scale
        self.time_s = [0.0, _LEAD_S]
        self.pressure_kpa = [0.0, 0.0]

    def to(self, share: float, seconds: float = 0.0) -> _Pen:
        """Go to a share of the largest pressure; at once if no time is given."""
        pressure = share * self.top
        least = abs(pressure - self.pressure_kpa[-1]) / self.rate
        self.time_s.append(self.time_s[-1] + max(seconds * self.time_scale, least))
        self.pressure_kpa.append(pressure)
        return self

    def stay(self, seconds: float) -> _Pen:
        """Hold the pressure."""
        self.time_s.append(self.time_s[-1] + seconds * self.time_scale)
        self.pressure_kpa.append(self.pressure_kpa[-1])
        return self

    def seconds(self, natural: float) -> str:
        """Say a time as it is drawn."""
        return f"{natural * self.time_scale:.3g} s"

    def kpa(self, share: float = 1.0) -> str:
        """Say a pressure as it is drawn."""
        return f"{share * self.top:.3g} kPa"


def _up_step(pen: _Pen) -> str:
    pen.to(1.0).stay(10.0)
    return f"one up-step to {pen.kpa()}, held for {pen.seconds(10.0)}"


def _step_release(pen: _Pen) -> str:
    pen.to(1.0).stay(10.0).to(0.0).stay(10.0)
    return f"step to {pen.kpa()} for {pen.seconds(10.0)}, then vent for {pen.seconds(10.0)}"


def _levels(pen: _Pen) -> str:
    for share in (0.25, 1.0, 0.5, 0.75):
        pen.to(share).stay(7.0).to(0.0).stay(7.0)
    return (
        f"steps to {pen.kpa(0.25)}, {pen.kpa()}, {pen.kpa(0.5)} and {pen.kpa(0.75)} in this order, "
        f"{pen.seconds(7.0)} each, vented for as long between them"
    )


def _slow_triangle(pen: _Pen) -> str:
    for _ in range(2):
        pen.to(1.0, 25.0).to(0.0, 25.0)
    pen.stay(5.0)
    return f"two slow triangles to {pen.kpa()}, {pen.seconds(25.0)} up and as long down"


def _fast_triangles(pen: _Pen) -> str:
    for _ in range(8):
        pen.to(1.0, 1.0).to(0.0, 1.0)
    pen.stay(6.0)
    return f"eight fast triangles to {pen.kpa()}, {pen.seconds(1.0)} up and as long down"


def _two_rates(pen: _Pen) -> str:
    pen.to(1.0, 25.0).to(0.0, 25.0).stay(5.0)
    for _ in range(6):
        pen.to(1.0, 1.0).to(0.0, 1.0)
    pen.stay(6.0)
    return (
        f"a slow triangle to {pen.kpa()} ({pen.seconds(25.0)} each way), then six fast ones "
        f"({pen.seconds(1.0)} each way)"
    )


def _staircase(pen: _Pen) -> str:
    shares = (0.2, 0.4, 0.6, 0.8, 1.0, 0.8, 0.6, 0.4, 0.2)
    for share in shares:
        pen.to(share).stay(7.0)
    pen.to(0.0).stay(10.0)
    return (
        f"a staircase up to {pen.kpa()} in five stairs and down again by the same, "
        f"{pen.seconds(7.0)} on each, then vent"
    )


def _ratchet(pen: _Pen) -> str:
    for share in (0.2, 0.4, 0.6, 0.8, 1.0):
        for _ in range(2):
            pen.to(share, 2.0).stay(2.0).to(0.0, 2.0).stay(3.0)
    return f"growing peaks to {pen.kpa()} in five sizes, each twice, vented between them"


def _hold(pen: _Pen) -> str:
    pen.to(1.0).stay(60.0).to(0.0).stay(55.0)
    return (
        f"step to {pen.kpa()}, held for {pen.seconds(60.0)}, then vent and go on recording for "
        f"{pen.seconds(55.0)}"
    )


def _cycles(pen: _Pen) -> str:
    for _ in range(10):
        pen.to(1.0).stay(4.0).to(0.0).stay(4.0)
    return f"ten identical cycles: {pen.kpa()} for {pen.seconds(4.0)}, vented for as long"


def _return_curves(pen: _Pen) -> str:
    pen.to(1.0, 10.0)
    for share in (0.75, 0.5, 0.25, 0.0):
        seconds = 10.0 * (1.0 - share)
        pen.to(share, seconds).to(1.0, seconds)
    pen.to(0.0, 10.0).stay(6.0)
    return (
        f"first-order return curves: ramp to {pen.kpa()}, down to three quarters, a half, a "
        f"quarter and nothing of it, each time up again, {pen.seconds(10.0)} the full way"
    )


def _squares(pen: _Pen) -> str:
    for half in (4.0, 2.0, 1.0, 0.5):
        for _ in range(round(4.0 / half) + 1):
            pen.to(1.0).stay(half).to(0.4).stay(half)
    pen.to(0.0).stay(6.0)
    return (
        f"square waves between {pen.kpa(0.4)} and {pen.kpa()}, half periods of "
        f"{', '.join(pen.seconds(half) for half in (4.0, 2.0, 1.0, 0.5))}"
    )


def _chirp(pen: _Pen) -> str:
    pen.to(0.5, 4.0).stay(4.0)
    _trace(pen, 0.5 + 0.5 * np.sin(_swept(0.05, 1.5, 45.0)))
    pen.to(0.0, 2.0).stay(4.0)
    return (
        f"a sine about {pen.kpa(0.5)} of {pen.kpa(0.5)} amplitude, its frequency rising from 0.05 "
        f"to 1.5 Hz in {pen.seconds(45.0)}"
    )


def _multisine(pen: _Pen) -> str:
    # Schroeder's phases keep the crest low (doi:10.1109/TIT.1970.1054411).
    t = np.arange(0.0, 40.0, _TRACE_S)
    tones = np.array([1, 3, 7, 15, 31]) / 20.0
    order = np.arange(tones.size)
    phase = -np.pi * order * (order - 1) / tones.size
    wave = np.cos(2.0 * np.pi * tones[:, None] * t + phase[:, None]).sum(axis=0)
    pen.to(0.5, 4.0).stay(4.0)
    _trace(pen, 0.5 + 0.5 * wave / np.abs(wave).max())
    pen.to(0.0, 2.0).stay(4.0)
    return (
        f"five sines at once about {pen.kpa(0.5)}, between nothing and {pen.kpa()}, "
        f"for {pen.seconds(40.0)}"
    )


_TRACE_S = 0.1


def _swept(low_hz: float, high_hz: float, seconds: float) -> Floats:
    """Phase of a sine whose frequency grows exponentially."""
    rate = math.log(high_hz / low_hz) / seconds
    return 2.0 * np.pi * low_hz / rate * np.expm1(rate * np.arange(0.0, seconds, _TRACE_S))


def _trace(pen: _Pen, shares: Floats) -> None:
    for share in shares.tolist():
        pen.to(share, _TRACE_S)


def _rich(pen: _Pen) -> str:
    pen.to(0.5).stay(5.0).to(0.0).stay(5.0).to(1.0).stay(8.0).to(0.0).stay(6.0)
    for share in (0.33, 0.67, 1.0, 0.67, 0.33):
        pen.to(share).stay(4.0)
    pen.to(0.0, 1.0).stay(4.0).to(1.0, 8.0).to(0.5, 4.0).to(1.0, 4.0).to(0.0, 8.0).stay(2.0)
    pen.to(1.0).stay(22.0).to(0.0).stay(16.0)
    return (
        f"a bit of everything up to {pen.kpa()}: two steps with release, a staircase up and "
        "down, a return curve, a hold and its recovery"
    )


_SHAPES: dict[str, Callable[[_Pen], str]] = {
    "up-step": _up_step,
    "step and release": _step_release,
    "steps of four sizes": _levels,
    "slow triangles": _slow_triangle,
    "fast triangles": _fast_triangles,
    "slow and fast triangles": _two_rates,
    "staircase": _staircase,
    "ratchet": _ratchet,
    "hold and recovery": _hold,
    "identical cycles": _cycles,
    "return curves": _return_curves,
    "square waves": _squares,
    "chirp": _chirp,
    "multisine": _multisine,
    "rich": _rich,
}
_OVER_AN_HOUR = "steps over an hour"
NAMES = (*_SHAPES, _OVER_AN_HOUR)
FEW = (
    "up-step",
    "steps of four sizes",
    "staircase",
    "hold and recovery",
    "identical cycles",
    "return curves",
    "slow and fast triangles",
    "square waves",
    _OVER_AN_HOUR,
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
        return Profile(name, words, once.time_s, once.pressure_kpa, repeats=7, every_s=600.0)
    time_scale = _fitting_time_scale(_SHAPES[name], limits)
    if time_scale is None:
        return None
    pen = _Pen(limits, time_scale)
    words = _SHAPES[name](pen)
    return Profile(name, words, tuple(pen.time_s), tuple(pen.pressure_kpa))


def _fitting_time_scale(shape: Callable[[_Pen], str], limits: Limits) -> float | None:
    """Largest time_scale up to 1 at which the profile is short enough."""

    def fits(time_scale: float) -> bool:
        pen = _Pen(limits, time_scale)
        shape(pen)
        return pen.time_s[-1] <= limits.duration_s

    if fits(1.0):
        return 1.0
    low, high = _SHORTEST, 1.0
    if not fits(low):
        return None
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def write_profile(path: Path | str, profile: Profile, purpose: str) -> None:
    """Write a profile as csv: a line that says what it is for, `COLUMNS`, a row for each sample.

    Parameters
    ----------
    path : Path or str
        The file.
    profile : Profile
        What to write; one run of it.
    purpose : str
        What it separates, one line.

    Raises
    ------
    BadInput
        The file cannot be written.
    """
    note = " ".join(f"{profile.name}: {profile.words}; {purpose}".split())
    t, command = profile.sampled()
    rows = [f"{a:.2f},{b:.2f}" for a, b in zip(t.tolist(), command.tolist(), strict=True)]
    write_text(path, "\n".join([BANNER + note, COLUMNS, *rows, ""]))
