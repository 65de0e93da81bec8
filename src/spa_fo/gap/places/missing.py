"""What an `unknown` cause looks like: where the missing law sits, and how far it closes the gap."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import noise_floor
from spa_fo.gap.data.hold_out import fraction_closed, judged, rmse
from spa_fo.gap.decide.examine import Examined
from spa_fo.gap.decide.explanation import Explanation, simulate
from spa_fo.gap.diagnosis import LawFound
from spa_fo.gap.places.law_problem import LawFit
from spa_fo.gap.places.laws import drive_law, place_laws
from spa_fo.gap.places.resemblance import likeness_words, likenesses
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY, Ids
from spa_fo.plant.law import PLACES
from spa_fo.plant.lawful import TooSteep

_TWO_SIGMA = 1.96


@dataclass(frozen=True)
class Missing:
    """Laws beside what is known.

    `known_closed` is the share of the gap that closes on the held-out trials without any law: with
    what has a name, or with the plain model identified again.
    """

    laws: tuple[LawFound, ...] = ()  # the most probable first
    known: Ids = ()  # what has a name
    known_closed: float = 0.0

    @property
    def gains(self) -> bool:
        """Whether the most probable law closes more than closes without it."""
        gained = self.laws[0].fraction_closed - max(self.known_closed, 0.0)
        return gained >= SETTINGS.gains

    @property
    def worth_a_model(self) -> LawFound | None:
        """The most probable law, where it stands beside all that is known and closes enough."""
        if not self.laws or self.laws[0].beside != self.known or not self.gains:
            return None
        return self.laws[0] if self.laws[0].fraction_closed >= SETTINGS.worth else None


def find_missing(
    examined: Examined, known: Explanation, curves: Mapping[str, Floats], unknown_drive: float
) -> Missing:
    """Fit free-form laws beside what is known, and hold them against the held-out trials.

    `known` is the plain model where nothing has a name. `curves` are the plain model's predictions
    for all samples, deg: as given, ``plain``, and identified again, ``refit``. `unknown_drive` is
    the probability that what is unknown is the drive's.
    """
    everything, bench = examined.everything, examined.found.bench
    drive_share = unknown_drive if everything.has_pressure else 0.0
    # The pressure and the angle are asked apart: each may lack something.
    placed = [
        (replace(fit, probability=(1.0 - drive_share) * fit.probability), known)
        for fit in place_laws(bench, known.angle)
    ]
    if drive_share > SETTINGS.least:
        # A law of the drive stands in the place of what the pressure says of it.
        ids = tuple(name for name in known.ids if LIBRARY[name].stage != "drive")
        fit = replace(drive_law(bench.evidence, known.angle), probability=drive_share)
        placed.append((fit, replace(known, ids=ids, drive=None)))
    where = judged(everything, examined.held)

    def closed(curve: Floats) -> float:
        scatter = noise_floor(everything, curve, otherwise=examined.floor_deg)
        floor = min(examined.floor_deg, scatter, rmse(everything, curve, where))
        before, after = (rmse(everything, each, where) ** 2 for each in (curves["plain"], curve))
        return float(fraction_closed(before, after, floor))

    found = []
    for fit, beside in sorted(placed, key=lambda each: -each[0].probability):
        with suppress(TooSteep):  # too steep for a motion that no fitted trial shows
            curve = simulate(replace(beside, angle=fit.beside), everything, law=fit.law)
            found.append(_found(fit, beside.ids, closed(curve)))
    bare = simulate(known, everything) if known.ids else curves["refit"]
    return Missing(tuple(found), known.ids, closed(bare))


def _found(fit: LawFit, beside: Ids, closed: float) -> LawFound:
    curve = fit.basis.curve(fit.basis.over)
    value = curve @ fit.e
    half = _TWO_SIGMA * np.sqrt(np.einsum("ij,jk,ik->i", curve, fit.covariance, curve))
    return LawFound(
        place=fit.basis.place,
        stage=fit.law.stage,
        probability=fit.probability,
        fraction_closed=closed,
        log_evidence=fit.nats,
        resembles=likenesses(fit.basis, fit.e, fit.covariance),
        beside=beside,
        over=fit.basis.over,
        value=value,
        low=value - half,
        high=value + half,
    )


def law_finding(missing: Missing, examined: Examined) -> tuple[str, ...]:
    """Say where the missing law sits, what it resembles, and how far it closes the gap."""
    if not missing.laws:
        return ()
    first = missing.laws[0]
    place = PLACES[first.place]
    where = f"in the {first.stage}, in {place.words}"
    if first.place == "input_map" and not examined.everything.has_pressure:
        where += " (or in the drive: its pressure was not logged)"
    like = "It resembles none of the known forms"
    if first.resembles:
        like = f"It resembles {likeness_words(first.resembles[0], place)}"
    trials = "held-out trials" if examined.held.trials.any() else "the fitted trials"
    beside = f" beside {' + '.join(first.beside)}" if first.beside else ""
    hint = "" if missing.gains else ": only a hint where to look"
    closed, known = (f"{max(f, 0.0):.0%}" for f in (first.fraction_closed, missing.known_closed))
    return (
        f"A free-form law{beside} is most probable {where}, with probability "
        f"{first.probability:.2f} among the places. {like}. On {trials} {closed} of the gap closes "
        f"with it, {known} without{hint}.",
    )
