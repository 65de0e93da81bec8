"""What is tried: commands as held levels and ramps, in shares of the largest level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Rng = np.random.Generator

_MOST_S = 470.0  # of log in a campaign
_STEPS_SHARE = 0.62  # of it for the steps, where there is more


@dataclass(frozen=True)
class Piece:
    """A stretch of command: from `begin` to `end` in a straight line, or held if they agree."""

    length_s: float
    begin: float
    end: float


@dataclass(frozen=True)
class Experiment:
    """One profile and how often it is tried.

    Attributes
    ----------
    name, protocol : str
        As in campaign.yaml.
    pieces : tuple of Piece
        The command.
    level : float or None
        Share of the one level it holds.
    repeats : int
        Trials.
    """

    name: str
    protocol: str
    pieces: tuple[Piece, ...]
    level: float | None
    repeats: int

    @property
    def length_s(self) -> float:
        """Length of a trial."""
        return sum(piece.length_s for piece in self.pieces)

    def command(self, times: Floats) -> Floats:
        """Return the share commanded at nominal times from the start of the log."""
        ends = np.cumsum([piece.length_s for piece in self.pieces])
        place = np.minimum(np.searchsorted(ends, times + 1e-9, side="right"), ends.size - 1)
        lengths = np.array([piece.length_s for piece in self.pieces])
        begins = np.array([piece.begin for piece in self.pieces])
        rises = np.array([piece.end for piece in self.pieces]) - begins
        within = (times - (ends - lengths)[place]) / lengths[place]
        return np.asarray(begins[place] + rises[place] * np.clip(within, 0.0, 1.0))

    def shortened(self, factor: float) -> Experiment:
        """Return the same with all its times multiplied."""
        pieces = tuple(replace(p, length_s=p.length_s * factor) for p in self.pieces)
        return replace(self, pieces=pieces)


def experiments(name: str, repeats: int, rng: Rng) -> tuple[Experiment, ...]:
    """Draw the experiments of one class of protocol, at most 470 s of log together.

    Parameters
    ----------
    name : str
        up_steps, releases, rich, everything or single.
    repeats : int
        Trials an experiment; the long ones may get fewer.
    rng : Generator
        Draws levels, dwells, ramps and numbers.
    """
    if name == "single":
        if rng.random() < 0.5:
            return _budget((_long_log(rng),), ())
        return _budget(_steps(rng, 1, release=True), _rich(rng, 1))
    steps = _steps(rng, repeats, release=name != "up_steps")
    if name in ("up_steps", "releases"):
        return _budget(steps, ())
    others = _rich(rng, repeats)
    if name == "everything":
        others = (*others, *_free(rng, repeats))
    return _budget(steps, others)


def later_experiments(rng: Rng) -> tuple[Experiment, ...]:
    """Draw what the specimen is tried with afterwards: other levels, at most 120 s of log."""
    first = _step(rng, "check_a", rng.uniform(0.72, 0.92), 2, (8.0, 10.0), (6.0, 8.0))
    second = _step(rng, "check_b", rng.uniform(0.38, 0.55), 2, (7.0, 9.0), (5.0, 7.0))
    levels = rng.permutation([0.3, 0.62, 0.88])
    held = [Piece(rng.uniform(5.0, 6.5), float(x), float(x)) for x in levels]
    third = Experiment("check_c", "free", (_rest(rng), *held, Piece(5.0, 0.0, 0.0)), None, 1)
    chosen = (first, second, third)
    total = sum(e.length_s * e.repeats for e in chosen)
    return tuple(e.shortened(min(1.0, 118.0 / total)) for e in chosen)


def earlier_experiments(rng: Rng) -> tuple[Experiment, ...]:
    """Draw what the specimen was tried with before: steps at two levels, 4 to 6 trials."""
    return _steps(rng, int(rng.integers(2, 4)), release=bool(rng.random() < 0.5))


def _budget(steps: Sequence[Experiment], others: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Keep the log within its length: fewer repeats of the long experiments, shorter dwells."""
    share = _STEPS_SHARE if others else 1.0
    needed = sum(e.length_s * e.repeats for e in steps)
    steps = [e.shortened(min(1.0, share * _MOST_S / needed)) for e in steps]
    left = _MOST_S - sum(e.length_s * e.repeats for e in steps)
    if others:
        once = sum(e.length_s for e in others)
        repeats = max(1, min(others[0].repeats, int(left // once)))
        factor = min(1.0, left / (once * repeats))
        others = [replace(e, repeats=repeats).shortened(factor) for e in others]
    return (*steps, *others)


def _rest(rng: Rng) -> Piece:
    return Piece(rng.uniform(0.8, 2.0), 0.0, 0.0)


def _step(
    rng: Rng,
    name: str,
    level: float,
    repeats: int,
    hold: tuple[float, float],
    release: tuple[float, float] | None,
) -> Experiment:
    pieces = [_rest(rng), Piece(rng.uniform(*hold), level, level)]
    if release is not None:
        pieces.append(Piece(rng.uniform(*release), 0.0, 0.0))
    protocol = "step" if release is None else "step_release"
    return Experiment(name, protocol, tuple(pieces), level, repeats)


def _steps(rng: Rng, repeats: int, release: bool) -> tuple[Experiment, ...]:
    hold = (9.0, 14.0) if release else (10.0, 20.0)
    vent = (7.0, 11.0) if release else None
    low = rng.uniform(0.42, 0.65)
    return (
        _step(rng, "level_low", low, repeats, hold, vent),
        _step(rng, "level_high", 1.0, repeats, hold, vent),
    )


def _rich(rng: Rng, repeats: int) -> tuple[Experiment, ...]:
    count = int(rng.integers(3, 6))
    rising = np.linspace(1.0 / count, rng.uniform(0.85, 1.0), count)
    falling = rising[-2::-1] if rng.random() < 0.6 else rising[:0]
    dwell = rng.uniform(3.5, 6.0)
    stairs = [Piece(dwell, float(x), float(x)) for x in (*rising, *falling)]
    peak, ramp = rng.uniform(0.75, 1.0), rng.uniform(4.0, 8.0)
    cycles = int(rng.integers(1, 4))
    ramps = [Piece(ramp, 0.0, peak), Piece(ramp, peak, 0.0)] * cycles
    level = rng.uniform(0.55, 0.9)
    held = Piece(rng.uniform(35.0, 50.0), level, level)
    vent = Piece(rng.uniform(5.0, 10.0), 0.0, 0.0)
    return (
        Experiment("stairs", "staircase", (_rest(rng), *stairs, vent), None, repeats),
        Experiment("ramps", "triangle", (_rest(rng), *ramps, vent), None, repeats),
        Experiment("long_hold", "hold", (_rest(rng), held, vent), level, repeats),
    )


def _free(rng: Rng, repeats: int) -> tuple[Experiment, ...]:
    levels = rng.uniform(0.1, 0.95, int(rng.integers(6, 10)))
    held = [Piece(rng.uniform(2.0, 4.5), float(x), float(x)) for x in levels]
    bias, peak = rng.uniform(0.25, 0.45), rng.uniform(0.75, 1.0)
    pulse = rng.uniform(2.0, 3.5)
    train = [Piece(pulse, peak, peak), Piece(pulse, bias, bias)] * int(rng.integers(3, 5))
    climb = Piece(rng.uniform(2.0, 4.0), 0.0, bias)
    return (
        Experiment("random_levels", "free", (_rest(rng), *held), None, repeats),
        Experiment("biased_pulses", "free", (_rest(rng), climb, *train), None, repeats),
    )


def _long_log(rng: Rng) -> Experiment:
    """One log that holds many levels, up and down and back to zero now and then."""
    pieces = [_rest(rng)]
    for number in range(int(rng.integers(14, 22))):
        level = 1.0 if number == 2 else float(rng.uniform(0.15, 0.98))
        pieces.append(Piece(rng.uniform(6.0, 14.0), level, level))
        if rng.random() < 0.35:
            pieces.append(Piece(rng.uniform(6.0, 10.0), 0.0, 0.0))
    return Experiment("one_log", "free", tuple(pieces), None, 1)
