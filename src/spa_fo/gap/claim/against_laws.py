"""Whether one unknown cause does better than what has a name.

A free-form law says what one unknown effect could do at its place in the chain. Beforehand it is as
probable as one effect, by the odds of an unknown cause, and nobody knows its place. So it hardly
beats a single effect that is right, but it does beat what compensates for an effect that the
library lacks, often several together.
"""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from spa_fo.gap.decide.examine import Examined
from spa_fo.gap.decide.explanation import angle_part
from spa_fo.gap.decide.verdict import Scored, Verdict, with_unknown
from spa_fo.gap.places.law_basis import ORDERED
from spa_fo.gap.places.laws import fitted_laws, standing, weighed
from spa_fo.gap.prior import log_prior
from spa_fo.gap.search.explanations import WORTH_WEIGHING
from spa_fo.gap.search.fitted import price
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.minimise import HOPE
from spa_fo.plant.effects.library import LIBRARY, log_odds, rare


def against_laws(verdict: Verdict, examined: Examined) -> Verdict:
    """Hold the leading set of an answer against laws without a name."""
    if verdict.kind not in ("cause", "ambiguous"):
        return verdict
    first = verdict.of(verdict.sets[0])
    more = float(np.exp(min(_laws(first, examined), 100.0)))
    return with_unknown(verdict, more * first.probability)


def alone_if_rare(verdict: Verdict) -> Verdict:
    """Let a rare effect be the cause of a change only by itself.

    Beside another it is no more probable than an unknown cause that does the same.
    """
    if verdict.kind not in ("cause", "ambiguous"):
        return verdict
    first = verdict.of(verdict.sets[0])
    if len(first.named) < 2 or not any(map(rare, first.named)):
        return verdict
    times = SETTINGS.unknown / float(np.exp(log_odds(first.named)))
    return with_unknown(verdict, times * first.probability)


def _laws(first: Scored, examined: Examined) -> float:
    """Say how probable laws are against a set, logarithm of the ratio."""
    found = examined.found
    drive = None if examined.drive is None else examined.drive.best
    named = angle_part(first.named, drive, first.fast is not None)
    if not named:
        return -np.inf  # the pressure says it, whatever the angle may lack
    name = log_prior(named) + weighed(first.angle.logs - price(first.angle))
    # A law's coefficients have what a given model tells beforehand, a set has it among its rows.
    told = found.bench.coefficients.untempered().log_evidence(found.bench.centre)
    least = name - log_prior(tuple(LIBRARY)[:1]) - SETTINGS.temper * (told + HOPE * WORTH_WEIGHING)
    # What goes with the trials' order may be their scatter: it is weighed as a trend. At the place
    # of a single effect a law is that effect, in another form; also beside a shift of parameters,
    # which are as free beside a law.
    alone = [effect for effect in named if LIBRARY[effect].port != "coefficients"]
    own = LIBRARY[alone[0]].place if len(alone) == 1 else ""
    laws = fitted_laws(found.bench, found.plain, least, (*ORDERED, own))
    if not laws:
        return -np.inf
    one = log_prior(tuple(LIBRARY)[:1]) + np.log(SETTINGS.unknown / len(laws))
    law = one + logsumexp([standing(fit.logs + told) for fit in laws])
    return float(law - name)
