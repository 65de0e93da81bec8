"""The board's clock: which rows belong to it, and when each was taken.

``t_us`` grows by one period a sample, up to the jitter of the loop and the tolerance of a cheap
resonator; it wraps at 2^32, restarts at a reset, and jumps ahead when the board was busy. A row
whose seq or t_us was damaged without the checksum noticing agrees with none of its neighbours,
while after a real pause or reset all later rows agree with each other. So a row is accepted when
it follows the last accepted one, and a jump is believed once `CONFIRM` rows in a chain agree
with each other behind it.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np

WRAP = 2**32  # micros() is an unsigned 32-bit counter
CONFIRM = 3  # rows that must agree before a jump of the clock is believed
_JITTER = 0.9  # of a period: a sample may be late by nearly one, and the next one on time again
_RATE_TOLERANCE = 0.01  # of the time between two rows: a ceramic resonator keeps 0.5 %
_LOOSE = 8  # unconfirmed chains kept at a time


@dataclass
class Run:
    """Accepted rows between two restarts of the clock: indices and unwrapped µs since restart."""

    rows: list[int] = field(default_factory=list)
    ticks: list[int] = field(default_factory=list)
    pauses: int = 0


@dataclass
class Followed:
    """The rows of one stretch between banners, sorted out by the clock."""

    runs: list[Run] = field(default_factory=list)
    duplicates: list[int] = field(default_factory=list)
    implausible: list[int] = field(default_factory=list)


@dataclass(frozen=True)
class SampleClock:
    """How t_us grows with seq: one period a sample, give or take the tolerance (µs)."""

    period_us: float
    tolerance_us: float

    def lead(self, seq_i: int, t_i: int, seq_j: int, t_j: int) -> int:
        """Return how much later row j comes after row i than its seq promises (µs, ± half a wrap).

        A pause or a board that was busy makes it positive.
        """
        ahead = t_j - t_i - round((seq_j - seq_i) * self.period_us)
        return (ahead + WRAP // 2) % WRAP - WRAP // 2

    def follows(self, seq_i: int, t_i: int, seq_j: int, t_j: int) -> bool:
        """Say whether row j can come after row i on the same, unpaused clock."""
        steps = seq_j - seq_i
        if steps < 1:
            return False
        allowed = self.tolerance_us + _RATE_TOLERANCE * steps * self.period_us
        return abs(self.lead(seq_i, t_i, seq_j, t_j)) <= allowed


def sample_clock(seq: Sequence[int], t_us: Sequence[int], nominal_us: float) -> SampleClock:
    """Estimate the sample clock from rows next to each other: median step, and its scatter.

    The tolerance is `_JITTER` of a period, or more where the log itself is that irregular.
    """
    steps = np.mod(np.diff(np.asarray(t_us, dtype=np.int64)), WRAP)
    steps = steps[np.diff(np.asarray(seq, dtype=np.int64)) == 1]
    period = float(np.median(steps)) if steps.size else 0.0
    if period <= 0.0:
        return SampleClock(nominal_us, _JITTER * nominal_us)
    scatter = 1.4826 * float(np.median(np.abs(steps - period)))
    return SampleClock(period, max(_JITTER * period, 5.0 * scatter))


def follow(
    seq: Sequence[int], t_us: Sequence[int], content: Sequence[Hashable], clock: SampleClock
) -> Followed:
    """Sort the rows between two banners into runs of one clock, duplicates and the implausible.

    Parameters
    ----------
    seq, t_us : sequence of int, length n
        As logged, in line order.
    content : sequence of hashable, length n
        Equal for rows that are byte for byte the same.
    clock : SampleClock
        Of the whole log.

    Returns
    -------
    Followed
        Every index 0..n-1 exactly once. The runs are in order; a run after the first is a reset
        that left no banner. A jump at the very end that fewer than `CONFIRM` rows confirm counts
        as implausible.
    """

    def lead(i: int, j: int) -> int:
        return clock.lead(seq[i], t_us[i], seq[j], t_us[j])

    def follows(i: int, j: int) -> bool:
        return clock.follows(seq[i], t_us[i], seq[j], t_us[j])

    def extend(run: Run, j: int) -> None:
        if run.rows:
            i = run.rows[-1]
            elapsed = round((seq[j] - seq[i]) * clock.period_us) + lead(i, j)
            run.ticks.append(run.ticks[-1] + elapsed)
        else:
            run.ticks.append(t_us[j])
        run.rows.append(j)
        accepted.add(content[j])

    result = Followed()
    accepted: set[Hashable] = set()
    loose: list[list[int]] = []
    left_out: list[int] = []

    def believe(chain: list[int]) -> None:
        """Take a confirmed chain as the clock: a pause of the same run, or a new run."""
        runs = result.runs
        first = chain[0]
        last = runs[-1].rows[-1] if runs else None
        if last is not None and seq[first] > seq[last] and lead(last, first) > 0:
            runs[-1].pauses += 1
        else:
            runs.append(Run())
        for j in chain:
            extend(runs[-1], j)
        left_out.extend(j for other in loose if other is not chain for j in other)
        loose.clear()

    for j in range(len(seq)):
        if result.runs and follows(result.runs[-1].rows[-1], j):
            extend(result.runs[-1], j)
            if loose:
                left_out.extend(k for chain in loose for k in chain)
                loose.clear()
        elif content[j] in accepted:
            result.duplicates.append(j)
        else:
            chain = next((c for c in reversed(loose) if follows(c[-1], j)), None)
            if chain is None:
                loose.append([j])
                if len(loose) > _LOOSE:
                    left_out.extend(loose.pop(0))
            else:
                chain.append(j)
                if len(chain) == CONFIRM:
                    believe(chain)

    if not result.runs and loose:
        longest = max(loose, key=len)
        if len(longest) > 1 or len(seq) == 1:
            believe(longest)
    left_out.extend(k for chain in loose for k in chain)
    for j in left_out:
        (result.duplicates if content[j] in accepted else result.implausible).append(j)
    return result
