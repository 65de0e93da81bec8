"""Causes and their probabilities, as pages and figures show them."""

from __future__ import annotations

from collections.abc import Sequence

from spa_fo.gap.diagnosis import Cause, Diagnosis

MOST_CAUSES = 8
"""Explanations that are shown at most."""

# The calibrated language of the IPCC (Mastrandrea and others 2010): probability from which on.
_WORDS = (
    (0.99, "virtually certain"),
    (0.9, "very likely"),
    (0.66, "likely"),
    (0.33, "about as likely as not"),
    (0.1, "unlikely"),
    (0.01, "very unlikely"),
    (0.0, "exceptionally unlikely"),
)


def likelihood(probability: float) -> str:
    """Say a probability in words."""
    return next(words for least, words in _WORDS if probability >= least)


def percent(share: float) -> str:
    """Write a share in percent; what rounds to none or all is said to be near it."""
    if 0.0 < share < 0.005:
        return "< 1 %"
    if 0.995 <= share < 1.0:
        return "> 99 %"
    return f"{100.0 * share:.0f} %".replace("-", "−")


def named(causes: Sequence[Cause], most: int) -> list[Cause]:
    """Return the most probable sets: of 0.5 % and more, and those held against unseen trials."""
    sets = [cause for cause in causes if cause.set not in (("none",), ("unknown",))]
    return [
        cause
        for cause in sets[:most]
        if cause.probability >= 0.005 or cause.held_out_rmse_deg is not None
    ]


def probability_of(causes: Sequence[Cause], name: str) -> float:
    """Probability of ``none`` or ``unknown``."""
    return sum(cause.probability for cause in causes if cause.set == (name,))


def plain_held_out(diagnosis: Diagnosis) -> float | None:
    """RMSE of the plain model on the held-out trials, deg; None where it was not computed."""
    none = [cause for cause in diagnosis.causes if cause.set == ("none",)]
    return none[0].held_out_rmse_deg if none else None
