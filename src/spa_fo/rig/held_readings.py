"""A channel that is read less often than rows are logged: readings that are held for a while."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import argrelmax

from spa_fo.arrays import Floats
from spa_fo.rig.trial import Trial

# Where no origin is said it is assumed.
_WINDOW = 16  # changes from row to row over which their mean square is taken
_QUIET = 0.25  # part of these in which nothing moves, at least
_CLEARLY = 0.5  # times the noise of a change that motion adds to their mean square, at least
_ALIKE = 0.25  # correlation of two successive changes below which readings may be held
_FEWEST, _LONGEST_S = 1.9, 3.0  # rows, seconds of a hold
_TURNS = 6.0  # from one hold to the next that make up what moves, as many alike
_FINER = 8.0  # by which the spectrum is finer than the longest trial's own
_TRIED, _MULTIPLES = 6, 16  # tops of the spectrum; of the periods of those that fit
_PHASES = (-0.5, -0.25, 0.0, 0.25, 0.5)  # about the spectrum's, in rows
# Of what a smooth motion would change within holds, what may be there: of 336 opened campaigns
# those whose readings are held have 0.06 at most, all others but two 0.1 and more. And by how much
# more there may be with a longer period.
_MOST_WITHIN, _AS_LITTLE = 0.1, 0.01


@dataclass(frozen=True)
class Holds:
    """How a channel holds its readings.

    Attributes
    ----------
    period_s : float
        For how long.
    interval_s : float
        Between two rows, mostly.
    noise : float
        Mean square of a change from row to row without motion, deg².
    """

    period_s: float
    interval_s: float
    noise: float

    def since_middle(self, trial: Trial) -> Floats:
        """Say how long before or after the middle of its hold each row was logged, (rows,), s.

        Every trial may begin at a moment of its own within a hold.
        """
        log = _Log(trial)
        begins_s = log.begins(self.period_s, self.interval_s, self.noise) if log.changes.size else 0
        return np.asarray((trial.t_s - begins_s) % self.period_s - 0.5 * self.period_s)


def holds_of(trials: Sequence[Trial]) -> Holds | None:
    """Find for how long the readings of the angle are held.

    Returns None where they are taken anew for every row, or motion does not tell: it has to go on
    over several holds.
    """
    moving = [log for log in map(_Log, trials) if log.changes.size >= _WINDOW]
    if not moving:
        return None
    changes = np.concatenate([log.changes for log in moving])
    noise = float(np.quantile(np.concatenate([log.windows() for log in moving]), _QUIET))
    moved = float(np.sum(changes**2)) - noise * changes.size
    if not moved > _CLEARLY * noise * changes.size:  # nor where no angle was logged
        return None
    if moved**2 < _TURNS * float(np.sum(np.maximum(changes**2 - noise, 0.0) ** 2)):
        return None
    # Noise of single rows alone correlates them by -1/2.
    alike = sum(float(log.changes[1:] @ log.changes[:-1]) for log in moving)
    if alike + 0.5 * noise * changes.size > _ALIKE * moved:
        return None
    interval_s = float(np.median(np.concatenate([np.diff(log.t_s) for log in moving])))
    period_s = _period(moving, interval_s, noise)
    return None if period_s is None else Holds(period_s, interval_s, noise)


def held(trials: Sequence[Trial]) -> Iterator[str]:
    """Say in a line that readings are held, where they are."""
    holds = holds_of(trials)
    if holds is not None:
        yield (
            f"the angle is read anew every {holds.period_s:.2g} s only, while rows come every "
            f"{holds.interval_s:.2g} s: it is late by half of that on the mean, and in steps"
        )


class _Log:
    """Times of a trial's rows, (n,), and changes of the angle from one to the next, (n - 1,)."""

    def __init__(self, trial: Trial) -> None:
        keep = ~trial.after_reset
        self.t_s, self.changes = trial.t_s[keep], np.diff(trial.angle_deg[keep])
        self.between_s = 0.5 * (self.t_s[1:] + self.t_s[:-1])

    def windows(self) -> Floats:
        """Mean squares over windows of changes."""
        whole = self.changes[: self.changes.size // _WINDOW * _WINDOW]
        return np.asarray(np.mean(whole.reshape(-1, _WINDOW) ** 2, axis=1))

    def moved(self, noise: float) -> Floats:
        """Squared changes beyond noise."""
        return np.asarray(np.maximum(self.changes**2 - noise, 0.0))

    def begins(self, period_s: float, interval_s: float, noise: float) -> float:
        """Say when a hold begins, s: so that least changes within holds."""
        wave = np.exp(2j * np.pi * self.between_s / period_s)
        middle = float(np.angle(self.moved(noise) @ wave)) * period_s / (2.0 * np.pi)
        tried = [middle + phase * interval_s for phase in _PHASES]
        return min(tried, key=lambda t: float(np.sum(self.changes[~self.turns(t, period_s)] ** 2)))

    def turns(self, begins_s: float, period_s: float) -> NDArray[np.bool_]:
        """Tell which changes are from one hold to the next."""
        return np.asarray(np.diff(np.floor((self.t_s - begins_s) / period_s)) > 0)


def _period(logs: Sequence[_Log], interval_s: float, noise: float) -> float | None:
    """Find how long readings are held, s; None where none are."""

    def within(period_s: float) -> float:
        return _within(logs, period_s, interval_s, noise)

    tried = {period: within(period) for period in _periods(logs, interval_s, noise)}
    least = min(tried.values(), default=np.inf)
    if least > _MOST_WITHIN:
        return None
    part_s = max(period for period, each in tried.items() if each <= least + _AS_LITTLE)
    # Within a part of a hold nothing changes, either.
    numbers = np.arange(2, min(_MULTIPLES, int(_LONGEST_S / part_s)) + 1)
    multiples = [_refined(logs, float(n * part_s), interval_s, noise) for n in numbers]
    return max([part_s, *(p for p in multiples if within(p) <= _MOST_WITHIN)])


def _periods(logs: Sequence[_Log], interval_s: float, noise: float) -> list[float]:
    """List the periods with which changes come in bursts the most clearly, s."""
    longest_s = max(float(log.t_s[-1]) for log in logs)
    size = 2 ** int(np.ceil(np.log2(_FINER * longest_s / interval_s)))
    power = np.zeros(size // 2 + 1)
    for log in logs:
        squares = log.moved(noise)
        at = np.rint(log.t_s[1:] / interval_s).astype(np.int64)
        laid = np.bincount(at, weights=squares, minlength=size)[:size]
        power += np.abs(np.fft.rfft(laid)) ** 2 / max(float(squares.sum()), 1e-30)
    frequency = np.arange(power.size) / (size * interval_s)
    # A motion is a burst, too, but has the less power the higher the frequency.
    clear = power * frequency
    tops = argrelmax(clear)[0]
    tops = tops[frequency[tops] < 1.0 / (_FEWEST * interval_s)]
    at = tops[np.argsort(-clear[tops])[:_TRIED]]
    before, top, after = clear[at - 1], clear[at], clear[at + 1]
    beside = 0.5 * (before - after) / (before - 2.0 * top + after)  # of a parabola through them
    clearest_s = size * interval_s / (at + beside)
    return [_refined(logs, float(period), interval_s, noise) for period in clearest_s]


def _refined(logs: Sequence[_Log], period_s: float, interval_s: float, noise: float) -> float:
    """Give the period of the line through the times of changes over the holds' numbers."""
    along = square = 0.0
    for log in logs:
        weights = log.moved(noise)
        if weights.any():
            begins_s = log.begins(period_s, interval_s, noise)
            number = np.round((log.between_s - begins_s) / period_s)
            number -= np.average(number, weights=weights)
            along += float((weights * number) @ log.between_s)
            square += float(weights @ number**2)
    return along / square if square > 0.0 else period_s


def _within(logs: Sequence[_Log], period_s: float, interval_s: float, noise: float) -> float:
    """Give what changes within holds, beyond noise, of what would if the motion were smooth."""
    changed = smooth = 0.0
    for log in logs:
        turns = log.turns(log.begins(period_s, interval_s, noise), period_s)
        changed += float(np.sum(log.changes[~turns] ** 2)) - noise * float(np.sum(~turns))
        moved = float(np.sum(log.changes**2)) - noise * turns.size
        smooth += max(moved, 0.0) * float(np.mean(~turns))
    return changed / max(smooth, 1e-30)
