"""What an `unknown` cause looks like: where the missing law sits, and how far it closes the gap."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.evidence import Evidence, noise_floor
from spa_fo.gap.data.hold_out import HeldOut, fraction_closed, judged, rmse
from spa_fo.gap.decide.explanation import Explanation, simulate
from spa_fo.gap.diagnosis import LawFound
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.places.law_problem import LawFit
from spa_fo.gap.places.laws import PlacedLaw, drive_law, law_at, place_laws
from spa_fo.gap.places.resemblance import likeness_words
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import Model
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.plant.law import LAW, PLACES

Floats = NDArray[np.float64]

_TWO_SIGMA = 1.96


@dataclass(frozen=True)
class Missing:
    """Laws beside what is known.

    Attributes
    ----------
    laws : tuple of LawFound
        The most probable first.
    known : tuple of str
        What has a name.
    known_closed : float
        Share of the gap that closes on the held-out trials without any law: with what has a name,
        or with the plain model identified again.
    """

    laws: tuple[LawFound, ...]
    known: tuple[str, ...]
    known_closed: float

    @property
    def worth_a_model(self) -> LawFound | None:
        """The most probable law, where it stands beside all that is known and closes enough."""
        if not self.laws or self.laws[0].beside != self.known:
            return None
        first = self.laws[0]
        worth = first.fraction_closed >= SETTINGS.worth and _gains(first, self)
        return first if worth else None

    def carried_by(self, model: Model) -> tuple[LawFound, ...]:
        """Say of the laws which one a model carries."""
        places = {effect.get("place") for effect in model.effects if effect["id"] == LAW}
        return tuple(replace(law, carried=law.place in places) for law in self.laws)


def _gains(law: LawFound, missing: Missing) -> bool:
    """Whether a law closes more than closes without it."""
    return law.fraction_closed - max(missing.known_closed, 0.0) >= SETTINGS.closes


NOTHING = Missing((), (), 0.0)


def find_missing(
    bench: Bench,
    known: Explanation,
    everything: Evidence,
    held: HeldOut,
    plain_deg: Floats,
    refit_deg: Floats,
    floor_deg: float,
    drive_share: float,
) -> Missing:
    """Fit free-form laws beside what is known, and hold them against the other trials.

    Parameters
    ----------
    bench : Bench
        The trials that take part.
    known : Explanation
        The part that has a name; the plain model where none has.
    everything : Evidence
        All trials.
    held : HeldOut
        Those that took no part.
    plain_deg, refit_deg : (n,) arrays
        What the plain model predicts for all trials, as given and identified again.
    floor_deg : float
        The noise floor.
    drive_share : float
        Probability that what is unknown is the drive's; 0 where no pressure was measured.
    """
    placed: list[tuple[PlacedLaw, Explanation, float]] = []
    if drive_share > SETTINGS.least:
        driven = _without_drive(known)
        placed.append((drive_law(bench.evidence, driven.angle), driven, drive_share))
    # The pressure and the angle are asked apart: each may lack something.
    laws = place_laws(bench, known.angle)
    placed += [(law, known, (1.0 - drive_share) * law.probability) for law in laws]
    placed.sort(key=lambda each: -each[2])
    where = judged(everything, held)

    def closed(curve: Floats) -> float:
        scatter = noise_floor(everything, curve, otherwise=floor_deg)
        floor = min(floor_deg, scatter, rmse(everything, curve, where))
        before, after = (rmse(everything, each, where) ** 2 for each in (plain_deg, curve))
        return float(fraction_closed(before, after, floor))

    found = []
    for law, beside, probability in placed:
        with suppress(ValueError):  # too steep for a motion that no fitted trial shows
            curve = _with(beside, law.fit, everything)
            found.append(_found(law, beside.ids, probability, closed(curve)))
    bare = simulate(known, everything) if known.ids else refit_deg
    return Missing(tuple(found), known.ids, closed(bare))


def _without_drive(known: Explanation) -> Explanation:
    """Leave out what the pressure says of the drive: a law of it stands in its place."""
    ids = tuple(name for name in known.ids if LIBRARY[name].stage != "drive")
    return replace(known, ids=ids, drive=None)


def _with(known: Explanation, fit: LawFit, everything: Evidence) -> Floats:
    return simulate(_beside(known, fit), everything, law=fit.law)


def _beside(known: Explanation, fit: LawFit) -> Explanation:
    """Let what is known stand as it does beside a law."""
    return replace(known, angle=replace(known.angle, z=fit.z, effects=fit.effects))


def _found(law: PlacedLaw, beside: Sequence[str], probability: float, closed: float) -> LawFound:
    basis, fit = law.fit.basis, law.fit
    over = basis.drawn_over()
    curve = basis.curve(over)
    value = curve @ fit.e
    half = _TWO_SIGMA * np.sqrt(np.einsum("ij,jk,ik->i", curve, fit.covariance, curve))
    return LawFound(
        place=basis.place,
        stage=PLACES[basis.place].stage,
        probability=probability,
        fraction_closed=closed,
        log_evidence=law.nats,
        resembles=law.resembles,
        beside=tuple(beside),
        over=over,
        value=value,
        low=value - half,
        high=value + half,
    )


def law_of_all(bench: Bench, known: Explanation, law: LawFound) -> tuple[Explanation, LawFit]:
    """Fit a law once more to the trials of a bench, and what is known beside it."""
    if law.stage == "drive":
        fit = drive_law(bench.evidence, known.angle).fit
    else:
        fit = law_at(bench, known.angle, law.place)
    return _beside(known, fit), fit


def law_finding(missing: Missing, held: HeldOut, evidence: Evidence) -> tuple[str, ...]:
    """Say where the missing law sits, what it resembles, and how far it closes the gap."""
    if not missing.laws:
        return ()
    first = missing.laws[0]
    place = PLACES[first.place]
    where = f"in the {first.stage}, in {place.words}"
    if first.place == "input_map" and not evidence.has_pressure:
        where += " (or in the drive: its pressure was not logged)"
    like = "It resembles none of the known forms"
    if first.resembles:
        like = f"It resembles {likeness_words(first.resembles[0], place)}"
    trials = "held-out trials" if held.trials.any() else "the fitted trials"
    beside = f" beside {' + '.join(first.beside)}" if first.beside else ""
    hint = "" if _gains(first, missing) else ": only a hint where to look"
    closed, known = (f"{max(f, 0.0):.0%}" for f in (first.fraction_closed, missing.known_closed))
    return (
        f"A free-form law{beside} is most probable {where}, with probability "
        f"{first.probability:.2f} among the places. {like}. On {trials} {closed} of the gap closes "
        f"with it, {known} without{hint}.",
    )
