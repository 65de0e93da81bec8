"""An answer held against trials that took no part, and against a reference."""

from __future__ import annotations

from dataclasses import replace

from spa_fo.gap.claim.claimed import Claim, closes
from spa_fo.gap.decide.verdict import Verdict, judge
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY

CLEARLY = 3.0
"""Times what a reference misses, too: something has changed."""


def held_to(verdict: Verdict, claimed: Claim, closing: float = SETTINGS.closes) -> Verdict:
    """Take sets that close nothing on the held-out trials out of the answer.

    What they were probable by goes to an unknown cause.

    Parameters
    ----------
    verdict : Verdict
        The answer.
    claimed : Claim
        What its sets close there.
    closing : float
        Share of the gap that a cause has to close.
    """
    if not verdict.sets:
        return verdict
    useless = {named for named in claimed.closed if not closes(claimed, named, closing)}
    lost = sum(s.probability for s in verdict.scored if s.named in useless)
    scored = [replace(s, probability=0.0) if s.named in useless else s for s in verdict.scored]
    scored.sort(key=lambda s: -s.probability)
    again = judge(scored, verdict.unknown + lost, verdict.unknown_drive)
    sets = tuple(n for n in again.sets if n in verdict.sets)
    if "unknown" in (verdict.kind, again.kind) or not sets:
        # What is no answer is said for what it explains elsewhere, also where chance is in it.
        sets = tuple(n for n in sets if claimed.closed.get(n, 0.0) >= SETTINGS.worth)
        return replace(again, kind="unknown", sets=sets)
    sets = tuple(n for n in sets if closes(claimed, n, closing))
    if not sets:
        return replace(again, kind="unknown", sets=())
    return replace(again, kind="cause" if len(sets) == 1 else "ambiguous", sets=sets)


def beyond_expected(verdict: Verdict, size: float) -> Verdict:
    """Hold an answer against the size of the gap, over that of what a reference misses, too.

    Parameters
    ----------
    verdict : Verdict
        The answer.
    size : float
        RMS of the gap, in units of what a law learned from a reference misses of other trials.
    """
    if size <= 1.0:
        if any(LIBRARY[name].stage == "drive" for named in verdict.sets for name in named):
            return verdict  # which the pressure shows
        scored = [replace(s, probability=0.0 if s.named else 1.0) for s in verdict.scored]
        scored.sort(key=lambda s: -s.probability)
        return judge(scored, 0.0, verdict.unknown_drive)
    if verdict.kind == "no_gap" and size > CLEARLY:
        # No noise of the reference is as large.
        scored = [s if s.named else replace(s, probability=0.0) for s in verdict.scored]
        return judge(scored, verdict.unknown + verdict.none, verdict.unknown_drive)
    return verdict
