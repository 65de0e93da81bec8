"""What changed between two campaigns, held against what the reference lets expect.

A diagnosis holds its answer against trials that took no part; of a change it is the reference that
says how large it has to be.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from spa_fo.arrays import Bools, Floats
from spa_fo.gap.claim.against_laws import alone_if_rare
from spa_fo.gap.claim.claimed import CLEARLY, Claim, held_to, too_large_for_none
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.decide.examine import Examined
from spa_fo.gap.decide.verdict import Kind, Verdict, judged_anew
from spa_fo.gap.fit.pressure import timing_error
from spa_fo.gap.noise.bench_noise import Beyond
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY, Ids, acts_like, alike, same_filter

SURELY = 2.0
"""Of the excess that is a change as probably as not: so large it is one, and has its name."""


@dataclass(frozen=True)
class Reference:
    """What a reference lets expect, as a diagnosis asks for it."""

    beyond: Beyond

    def sizes_deg(self, everything: Evidence, plain_deg: Floats) -> tuple[float, float]:
        """Give by how much a campaign differs, and may without any change, RMS, deg."""
        return differs(everything, plain_deg, self.beyond)

    def held(self, examined: Examined, claimed: Claim) -> Verdict:
        """Hold an answer against it."""
        everything, beyond = examined.everything, self.beyond
        verdict = alone_if_rare(held_to(examined.verdict, claimed))
        size, expected = self.sizes_deg(everything, claimed.curves["plain"])
        of_drive = times_missed_of_drive(everything, beyond)
        times = math.inf if beyond.broken else size / expected
        verdict = beyond_expected(verdict, times, beyond.changed, of_drive, claimed)
        if everything.fixture is None:
            verdict = with_equivalents(verdict, claimed, everything.has_pressure)
            verdict = unsure_of_the_sensor(verdict)
        if beyond.says_nothing:
            verdict = not_compared(verdict)
        elif beyond.says_little:
            verdict = unnamed(verdict)
        return verdict

    def held_to_claim(self, verdict: Verdict, claimed: Claim) -> Verdict:
        """Hold an answer against what is claimed of it at last."""
        return unsure_to_close(verdict, claimed)

    def only_part_differs(
        self, everything: Evidence, held: Bools, plain_deg: Floats
    ) -> Literal["held", "others"] | None:
        """Say which trials alone show that something has changed."""
        return only_part_differs(everything, held, plain_deg, self.beyond)


def beyond_expected(
    verdict: Verdict,
    size: float,
    changed: float,
    drive_size: float | None = None,
    claimed: Claim | None = None,
) -> Verdict:
    """Hold an answer against the size of the gap, over that of what a reference lets expect.

    Far beyond `changed`, of the drive beyond `CLEARLY`, something has changed, whatever it is; a
    smaller gap is one, and has a name, only as far as it is on the way there from what is expected,
    and is none no more than that.

    Parameters
    ----------
    verdict : Verdict
        The answer.
    size : float
        That ratio, of the angle; see `differs`.
    changed : float
        From which it is a change as probably as not; see `Beyond.changed`.
    drive_size : float, optional
        The same of the pressure, which shows effects of the drive by itself; None where it was not
        measured.
    claimed : Claim, optional
        What sets close of it; without one no set is a part of what is not expected.
    """
    whole = _surely(changed)
    something = max(_way(size, whole), float((drive_size or 0.0) > CLEARLY))
    if something == 1.0:
        verdict = _something(too_large_for_none(verdict, claimed))
    trusted, lost = _trusted(verdict, size, whole, drive_size, claimed)
    if something == 1.0 and all(trusted.get(s.named, 0.0) == s.probability for s in verdict.scored):
        return verdict
    unknown = something * (verdict.unknown + lost)
    none = verdict.unknown + lost - unknown
    # Nothing is no more probable than the size alone says.
    more = max(verdict.none + none - (1.0 - something), 0.0)
    again = judged_anew(
        verdict,
        lambda s: trusted[s.named] if s.named else s.probability + none - more,
        unknown + more,
    )
    rests = {r for r in map(_but_drive, verdict.sets) if _stands(r, claimed)}
    known = {*verdict.sets, *rests}
    sets = tuple(named for named in again.sets if named in known and trusted[named])
    if again.kind == "no_gap":
        return again
    return replace(
        again, kind=again.kind if sets and verdict.kind != "unknown" else "unknown", sets=sets
    )


def _trusted(
    verdict: Verdict, size: float, whole: float, drive_size: float | None, claimed: Claim | None
) -> tuple[dict[Ids, float], float]:
    """Give sets the part of their probability by which they are trusted, and what is lost.

    Of what is as little of the drive's as may be without any change the rest stands, if by itself
    it closes enough.
    """
    named = [s for s in verdict.scored if s.named]
    trust = {s.named: _trust(s.named, size, whole, drive_size) for s in named}
    found, lost = dict.fromkeys(trust, 0.0), 0.0
    for s in named:
        own, rest, passed = trust[s.named], _but_drive(s.named), 0.0
        if rest in trust and _stands(rest, claimed):
            passed = max(trust[rest] - own, 0.0)
            found[rest] += passed * s.probability
        found[s.named] += own * s.probability
        lost += (1.0 - own - passed) * s.probability
    return found, lost


def _stands(named: Ids, claimed: Claim | None) -> bool:
    """Say whether a set is known to close enough by itself, as far as a claim was made."""
    return claimed is None or (named in claimed.closed and claimed.closes(named))


def _but_drive(named: Ids) -> Ids:
    """Leave the drive's effects out of a set."""
    return tuple(name for name in named if LIBRARY[name].stage != "drive")


def _something(verdict: Verdict) -> Verdict:
    """Condition what is probable on that something has changed."""
    rest = verdict.unknown + sum(s.probability for s in verdict.scored if s.named)
    again = judged_anew(
        verdict, lambda s: s.probability / rest if s.named else 0.0, verdict.unknown / rest
    )
    return replace(again, kind=verdict.kind, sets=verdict.sets)


def _trust(named: Ids, size: float, whole: float, drive_size: float | None) -> float:
    """Say how far a set may have its name: as far as each of its parts shows clearly."""
    return min(
        _way(size, whole)
        if drive_size is None or LIBRARY[name].stage != "drive"
        else _way(drive_size, CLEARLY)
        for name in named
    )


def _surely(changed: float) -> float:
    """Give the ratio from which on something has changed for sure."""
    return 1.0 + SURELY * (changed - 1.0)


def _way(size: float, whole: float) -> float:
    """Say how far a size is on the way from what is expected to what is clear."""
    return float(np.clip((size - 1.0) / (whole - 1.0), 0.0, 1.0))


def differs(
    everything: Evidence, plain_deg: Floats, beyond: Beyond, trials: Bools | None = None
) -> tuple[float, float]:
    """Give by how much a campaign differs from what its reference lets expect, and may, RMS, deg.

    No trial took part in learning that, so all of them say it, or all those of `trials`, (trials,).
    Samples count the less the less is known of them: of a ratio of squares whose variances v
    differ, the least certain in 1/v². What a log's own zero may be off is taken off before, as far
    as it is unsure.
    """
    grid = everything.grid
    variance = beyond.variance(everything, plain_deg)
    weights, left = grid.counts / variance**2, grid.angle_deg - plain_deg
    if trials is not None:
        weights = weights * trials[grid.sample_trial]
    expected = float(np.average(variance, weights=weights))
    unsure = beyond.zero_deg**2 / (beyond.zero_deg**2 + expected)
    for rows in everything.rows:
        if weights[rows].any():
            left[rows] -= unsure * np.average(left[rows], weights=weights[rows])
    size = float(np.average(left**2, weights=weights))
    return float(np.sqrt(size)), float(np.sqrt(expected))


def only_part_differs(
    everything: Evidence, held: Bools, plain_deg: Floats, beyond: Beyond
) -> Literal["held", "others"] | None:
    """Say which trials alone show that something has changed, those `held` out or all others.

    What only those held out show nobody could explain from the others, and what they lack they
    cannot judge. So it is where it came in the midst of a few trials. None where both show it, or
    neither does.
    """
    with_rows = np.bincount(everything.grid.sample_trial, minlength=held.size) > 0
    if beyond.broken or not (held & with_rows).any() or not (~held & with_rows).any():
        return None
    of_held, of_others = (
        np.divide(*differs(everything, plain_deg, beyond, some)) for some in (held, ~held)
    )
    clear = max(CLEARLY, _surely(beyond.changed))
    if of_held > clear and of_others < beyond.changed:
        return "held"
    if of_others > clear and of_held < beyond.changed:
        return "others"
    return None


def times_missed_of_drive(everything: Evidence, beyond: Beyond) -> float | None:
    """Give the same of the pressure; None where that was not compared."""
    grid = everything.grid
    if grid.measured_kpa is None or grid.command_kpa is None or not beyond.pressure_kpa:
        return None
    left = grid.measured_kpa - grid.sampled(grid.command_kpa)
    expected = float(np.hypot(beyond.pressure_kpa, everything.pressure_noise_kpa))
    # About a jump a sample says when the pressure changed, not how much.
    weights = grid.counts / (1.0 + (timing_error(everything) / expected) ** 2)
    return float(np.sqrt(np.average(left**2, weights=weights))) / expected


def unnamed(verdict: Verdict) -> Verdict:
    """Say of a change that it is there, and not what it is."""
    named = sum(s.probability for s in verdict.scored if s.named)
    again = judged_anew(
        verdict, lambda s: 0.0 if s.named else s.probability, verdict.unknown + named
    )
    return replace(again, sets=())


def not_compared(verdict: Verdict) -> Verdict:
    """Say that nothing is known of a campaign where its reference never was."""
    return replace(judged_anew(verdict, lambda _: 0.0, 1.0, 0.0), sets=())


def with_equivalents(verdict: Verdict, claimed: Claim, pressed: bool) -> Verdict:
    """Let what acts alike in another stage stand beside what is named, if it closes as much.

    Without a calibration the two differ by details that a law learned from a reference may miss,
    and the same linear filter in the drive by nothing, unless the pressure between is measured
    (`pressed`).
    """
    if verdict.kind not in ("cause", "ambiguous"):
        return verdict
    closed = claimed.closed
    least = closed.get(verdict.sets[0], 0.0) - SETTINGS.gains
    more = [
        ids for ids in _equivalents(verdict.sets[0], pressed) if closed.get(ids, -np.inf) >= least
    ]
    sets = (*verdict.sets, *(ids for ids in more if ids not in verdict.sets))
    kind: Kind = "ambiguous" if len(sets) > 1 else "cause"
    return replace(verdict, kind=kind, sets=sets)


def unsure_of_the_sensor(verdict: Verdict) -> Verdict:
    """Take what a sensor explains for a part of an unknown cause, not for the cause.

    Without a calibration a change of the actuator that no effect describes looks the same: whose it
    is, is taken to be even. So it is beside an effect of the actuator, which then may be in another
    form than ours. It stands where a set without it does as well.
    """
    named = verdict.kind in ("cause", "ambiguous")
    return _as_a_part(verdict) if named and all(map(_by_the_sensor, verdict.sets)) else verdict


def unsure_to_close(verdict: Verdict, claimed: Claim) -> Verdict:
    """Take a cause that may close less than a name has to for a part of an unknown one.

    So it is of lone trials, of which nothing is held out, where what is expected is as large as
    what differs: the interval of what closes says so.
    """
    if verdict.kind != "cause" or claimed.shrink is None:
        return verdict
    return verdict if claimed.shrink.ci95[0] >= SETTINGS.worth else _as_a_part(verdict)


def _as_a_part(verdict: Verdict) -> Verdict:
    """Take what is named for a part of an unknown cause as probably as not."""
    half = 0.5 * sum(s.probability for s in verdict.scored if s.named)
    again = judged_anew(
        verdict,
        lambda s: (0.5 if s.named else 1.0) * s.probability,
        verdict.unknown + half,
    )
    return replace(again, kind="unknown", sets=verdict.sets[:1])


def _by_the_sensor(named: Ids) -> bool:
    """Whether a set is the sensor's alone, or has what acts like an effect of the actuator."""
    of_sensor = [name for name in named if LIBRARY[name].stage == "sensor"]
    return len(of_sensor) == len(named) or any(acts_like(name, "actuator") for name in of_sensor)


def _equivalents(ids: Ids, pressed: bool) -> Iterator[Ids]:
    """Yield sets in which one effect gives way to one of another stage that acts alike."""
    for place, name in enumerate(ids):
        for other, effect in LIBRARY.items():
            like = alike(name, other) or same_filter(name, other, pressed)
            if like and effect.stage != LIBRARY[name].stage and other not in ids:
                yield (*ids[:place], other, *ids[place + 1 :])
