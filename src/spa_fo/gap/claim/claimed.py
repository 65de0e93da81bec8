"""What is claimed of trials that took no part, the answer held against it, and the model."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import norm

from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.gap.claim.scatter import Judging
from spa_fo.gap.data.evidence import angle_chain
from spa_fo.gap.data.hold_out import judged, rmse, shrink
from spa_fo.gap.decide.examine import Examined
from spa_fo.gap.decide.explanation import (
    Explanation,
    angle_part,
    augmented_model,
    explanation_of,
    simulate,
)
from spa_fo.gap.decide.part import stands_in
from spa_fo.gap.decide.verdict import Kind, Scored, Verdict, judged_anew
from spa_fo.gap.diagnosis import LawFound, Shrink
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.noise.bench_noise import noise_beside, repeating
from spa_fo.gap.noise.coloured import level_spread
from spa_fo.gap.places.laws import law_at
from spa_fo.gap.prior import log_prior
from spa_fo.gap.search.explanations import Explanations
from spa_fo.gap.search.fitted import fit, without_others
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import Model
from spa_fo.plant.augmented import ending_memory
from spa_fo.plant.effects.library import LIBRARY, Ids, absent, at_port
from spa_fo.plant.lawful import TooSteep
from spa_fo.together import each

CLEARLY = 3.0
"""Times what is expected, or what a reference says of the pressure: something is wrong.

A gap is surely one, too: of 89 opened campaigns without any effect none was of more than 2.1 times
what repeats differ by.
"""
LIKELY = 0.005
"""Probability from which the predictions of an explanation are tried."""
_MOST = 6  # explanations whose predictions are tried
_LEAST_SHOWN = 0.1  # of the squared error: trials that show less of a gap still judge


@dataclass(frozen=True)
class Claim:
    """What is claimed of the trials that took no part.

    `curves` holds predictions at all averaged samples, deg: ``plain``, ``refit``, ``explained``,
    and ``ceiling``, a correction without any physics.
    """

    curves: dict[str, Floats]
    errors: dict[Ids, float]  # RMS of the leading explanations, deg; of the plain model under ()
    closed: dict[Ids, float]  # what each leading explanation closes of the gap
    shrink: Shrink | None  # None where nothing is explained
    # 1 sigma of what each would close if it were right, by noise and scatter.
    unsure: dict[Ids, float] = field(default_factory=dict)
    # By how much each moves trials in a way that nobody can foretell, of the squared gap.
    by_chance: dict[Ids, float] = field(default_factory=dict)
    by_refit: float = 0.0  # what the plain model closes, identified again

    def closes(self, named: Ids) -> bool:
        """Say whether a set may close enough, and as much as the plain model identified again."""
        surely = float(norm.ppf(SETTINGS.covered))  # deviations: as sure as what is named
        most = self.closed.get(named, 0.0) + self.by_chance.get(named, 0.0)
        most += surely * self.unsure.get(named, 0.0)
        least = SETTINGS.worth
        if at_port("coefficients", named) is None:
            least = max(least, self.by_refit - SETTINGS.gains)
        return most >= least


def claim(examined: Examined, verdict: Verdict, rng: np.random.Generator) -> Claim:
    """Predict the trials that took no part, and measure how far the gap closes on them.

    `rng` is for the bootstrap over trials.
    """
    everything, held, found = examined.everything, examined.held, examined.found
    causes = [s for s in verdict.scored if s.named]
    near = {s.named for s in causes[:_MOST] if s.probability >= LIKELY}
    leading = [s for s in causes if s.named in near or s.named in verdict.sets]
    where = judged(everything, held)
    given, again = examined.given, _identified_again(found)
    plain = angle_chain(everything, given, None).run(given, absent())[0]
    refit = angle_chain(everything, again, None).run(again, absent())[0]
    fits = each(lambda s: exact(s, examined), leading)
    fitted = {s.named: fit for s, fit in zip(leading, fits, strict=True)}
    predicted = {named: simulate(fit, everything) for named, fit in fitted.items()}
    first = verdict.sets[0] if verdict.sets else ()
    curves = {
        "plain": plain,
        "refit": refit,
        "explained": predicted.get(first, plain),
        # What repeats in the fitted trials beyond the refitted model: no physics.
        "ceiling": refit + repeating(everything, everything.grid.angle_deg - refit, ~held.trials),
    }
    errors = {named: rmse(everything, curve, where) for named, curve in predicted.items()}
    errors[()] = rmse(everything, plain, where)
    floor_deg = examined.floor_deg
    # A model of the campaign itself has seen the held-out trials; identified again it has not.
    before = rmse(everything, refit, where) if found.bench.own else errors[()]
    judging = {
        named: Judging(found.bench, fitted[named], everything, where, plain, curve)
        for named, curve in predicted.items()
    }
    floors = dict.fromkeys(judging, floor_deg)
    unsure: dict[Ids, float] = {}
    if not found.bench.noise.compared:  # a change is named only where it is sure
        without = refit if found.bench.own else plain
        for named, own in judging.items():
            # What these few trials happen to differ by is no gap, and nothing closes it.
            floors[named] = max(floor_deg, own.scatter(verdict.of(named).left_deg))
            unsure[named] = own.unsure(without) / _gap_of(before, floors[named])
    closed = {named: _closed(before, errors[named], floors[named]) for named in predicted}
    taken_off = everything.line_deg > 0.0
    chance = {named: _by_chance(verdict.of(named), taken_off) for named in predicted}
    by_chance = {named: chance[named] / _gap_of(before, floors[named]) for named in predicted}
    by_refit = _closed(before, rmse(everything, refit, where), floor_deg)
    made = None
    if first:
        least = floor_deg
        if found.bench.noise.spectrum.repeats:
            # These few may differ by less than repeats do. What they miss beyond that is left.
            least = min(least, judging[first].scatter(verdict.of(first).left_deg))
        if at_port("line", first) is None:  # what is not named is no part of the gap
            least = float(np.hypot(least, everything.line_deg))
        made = shrink(everything, held, curves, least, rng)
    return Claim(curves, errors, closed, made, unsure, by_chance, by_refit)


def _closed(before_deg: float, after_deg: float, floor_deg: float) -> float:
    """Share of the squared gap that closes, beyond noise as far as the trials show it."""
    return (before_deg**2 - after_deg**2) / _gap_of(before_deg, floor_deg)


def _by_chance(scored: Scored, taken_off: bool) -> float:
    """Mean square by which a set moves trials in a way of their own, deg²."""
    # A fast interference that was taken off closes nothing, unless it is all that is named.
    off = taken_off and scored.fast is not None and len(scored.named) > 1
    ports = ("zeros",) if off else ("zeros", "line")
    own = [size for name, size in scored.moved_deg.items() if LIBRARY[name].port in ports]
    if any(LIBRARY[name].filter == "delay" for name in scored.named):
        own.append(scored.angle.delays_deg)  # else they are clocks', which are noise
    return sum(size**2 for size in own)


def _gap_of(before_deg: float, floor_deg: float) -> float:
    return max(before_deg**2 - floor_deg**2, _LEAST_SHOWN * before_deg**2, 1e-24)


def exact(scored: Scored, examined: Examined, bench: Bench | None = None) -> Explanation:
    """Fit just the effects that a set names, to the trials of a bench or those that took part."""
    found, drive = examined.found, examined.drive
    own = pressed = None
    if drive is not None:
        ids = tuple(n for n in scored.named if LIBRARY[n].stage == "drive")
        own, pressed = drive.best, drive.fits.get(ids) if ids else None
    ids = angle_part(scored.named, own, scored.fast is not None)
    known = found.fits.get(ids)
    if known is None or bench is not None:
        start = without_others(scored.angle, ids) if known is None else known.z
        known = fit(bench or found.bench, ids, [start], found.plain)
        known = replace(known, level=scored.angle.level)
    return explanation_of(scored, known, pressed)


def _identified_again(found: Explanations) -> Floats:
    """Coefficients of the plain model identified again, which any cause has to beat."""
    name = at_port("coefficients")
    if found.bench.own or name is None:
        return found.plain.x
    return found.fits.get((name,), found.plain).x


def held_to(verdict: Verdict, claimed: Claim, hardly: bool = False) -> Verdict:
    """Take sets that close too little of the gap on held-out trials out of an answer.

    What they were probable by goes to an unknown cause and to no gap, as these are probable beside
    each other; where there is `hardly` a gap all of it goes to no gap, but for slips and
    interferences, which are in the noise floor.
    """
    if not verdict.sets:
        return verdict
    useless = {named for named in claimed.closed if not claimed.closes(named)}
    lost = sum(s.probability for s in verdict.scored if s.named in useless)
    none = 0.0
    if hardly:
        none = sum(s.probability for s in verdict.scored if s.named in useless and _in_gap(s.named))
    none += (lost - none) * verdict.none / max(verdict.none + verdict.unknown, 1e-300)
    again = judged_anew(
        verdict,
        lambda s: 0.0 if s.named in useless else s.probability + (0.0 if s.named else none),
        verdict.unknown + lost - none,
    )
    if again.kind == "no_gap":
        return again
    unknown = "unknown" in (verdict.kind, again.kind)
    if unknown:
        # What is no answer is said for what it explains elsewhere, also where chance is in it.
        closed = claimed.closed
        sets = [named for named in again.sets if closed.get(named, 0.0) >= SETTINGS.worth]
    else:
        sets = [named for named in again.sets if named in verdict.sets and claimed.closes(named)]
    kind: Kind = "ambiguous" if len(sets) > 1 else "cause"
    return replace(again, kind="unknown" if unknown or not sets else kind, sets=tuple(sets))


def without_none(verdict: Verdict) -> Verdict:
    """Take no gap out of an answer where there surely is one: all else is as probable as it was.

    The trials that took part may show none of it, or leave all of it to what is free in them: then
    that is one unknown effect.
    """
    as_one = SETTINGS.unknown * math.exp(stands_in() - log_prior(())) / SETTINGS.nothing
    unknown = verdict.unknown + as_one * verdict.none
    named = sum(s.probability for s in verdict.scored if s.named)
    whole = max(named + unknown, 1e-300)
    again = judged_anew(
        verdict, lambda s: s.probability / whole if s.named else 0.0, unknown / whole
    )
    if verdict.kind == "no_gap":
        return again
    return replace(again, kind=verdict.kind, sets=verdict.sets)


def too_large_for_none(verdict: Verdict, claimed: Claim | None = None) -> Verdict:
    """Take no change for an unknown cause where it is larger than all that a reference expects.

    No set stood before; with a claim one that closes enough of it is said to be a part.
    """
    if verdict.kind != "no_gap":
        return verdict
    again = judged_anew(
        verdict, lambda s: s.probability if s.named else 0.0, verdict.unknown + verdict.none
    )
    if again.kind != "unknown":
        return again
    closed = {} if claimed is None else claimed.closed
    parts = [named for named in again.sets if closed.get(named, 0.0) >= SETTINGS.worth]
    return replace(again, sets=tuple(parts))


def leaves_trials_alike(verdict: Verdict, examined: Examined) -> bool:
    """Whether trials differ by no more than on benches beside the leading set of an answer.

    By what remembers earlier trials they may differ, too.
    """
    if not verdict.sets:
        return False
    first = exact(verdict.of(verdict.sets[0]), examined)
    explained_deg = simulate(first, examined.everything)
    return noise_beside(examined.everything, examined.given, explained_deg).is_ordinary


def if_it_varies(verdict: Verdict) -> Verdict:
    """Take sets by which all trials are alike for a part at most, where trials are not."""
    alike = {s.named for s in verdict.scored if s.named and not any(map(_varies, s.named))}
    lost = sum(s.probability for s in verdict.scored if s.named in alike)
    if verdict.kind == "unknown" or not lost:
        return verdict
    again = judged_anew(
        verdict, lambda s: 0.0 if s.named in alike else s.probability, verdict.unknown + lost
    )
    return again if again.kind != "unknown" else replace(again, sets=verdict.sets[:1])


def _varies(name: str) -> bool:
    """Whether trials differ by an effect: by their order, from a moment on, or each in a way."""
    return "order" in LIBRARY[name].shown_in or not _in_gap((name,))


def too_small_for_any(verdict: Verdict, own: bool = False) -> Verdict:
    """Take sets for no gap where there is hardly one.

    What makes repeats differ stands: a slow interference and zeros that move, which are in the
    floor, and a fast one, which was taken off. A pressure that departs from the command all the
    same is that of the drive with which the model was identified, whatever it departs by; but of
    a model that may have been fitted to this very campaign, its `own`, what the pressure tells
    stands: it has taken up of that what it could.
    """

    def is_within(named: Ids) -> bool:
        told = own and any(LIBRARY[name].stage == "drive" for name in named)
        return bool(named) and _in_gap(named) and not told

    within = {s.named for s in verdict.scored if is_within(s.named)}
    lost = sum(s.probability for s in verdict.scored if s.named in within)
    of_drive = 0.0 if own else verdict.unknown * verdict.unknown_drive
    if verdict.kind == "unknown" and of_drive < 0.5 * verdict.unknown:
        return verdict
    lost, unknown = lost + of_drive, verdict.unknown - of_drive
    return judged_anew(
        verdict,
        lambda s: 0.0 if s.named in within else s.probability + (0.0 if s.named else lost),
        unknown,
        None if own else 0.0,
    )


def is_hardly_a_gap(gap_deg: float, floor_deg: float, repeats: int, own: bool = False) -> bool:
    """Say whether what is missed is the noise floor and no more than what counts as no gap.

    The floor is known as well as repeats tell; where there are none it is an ordinary bench's, and
    nobody knows how far from it this one is. A model of this very campaign, its `own`, misses
    little of any gap: where repeats tell the floor, what is beyond that counts.
    """
    unsure = 1.0 if own and repeats else math.exp(level_spread(repeats))
    return gap_deg < unsure * float(np.hypot(1.0, SETTINGS.no_gap)) * floor_deg


def _in_gap(named: Ids) -> bool:
    """Whether what a set makes of trials is in no difference between repeats."""
    return all(LIBRARY[name].port not in ("zeros", "line") for name in named)


# --- the model -----------------------------------------------------------------------------------


def on_all_trials(scored: Scored, examined: Examined) -> Explanation:
    """Fit a set once more, to all trials; its drive stays as it is."""
    known = exact(scored, examined)
    if not examined.held.trials.any():
        return known
    return exact(replace(scored, angle=known.angle), examined, _bench_of_all(examined))


def model_of(
    known: Explanation | None, law: LawFound | None, examined: Examined, plain: Model
) -> Model:
    """Write what is known of all trials, and a law worth it, as a model that `predict` runs.

    Where there is neither it is the plain model.
    """
    if law is not None:
        beside = known or Explanation((), examined.found.plain, None, None)
        with suppress(TooSteep, BadInput):  # too steep for the steps that a prediction takes
            again = law_at(_bench_of_all(examined), beside.angle, law.place)
            model = augmented_model(replace(beside, angle=again.beside), examined.everything, plain)
            model = replace(model, effects=(*model.effects, again.law.to_effect()))
            return _remembering(model, examined)
    if known is None:
        return plain
    return _remembering(augmented_model(known, examined.everything, plain), examined)


def _bench_of_all(examined: Examined) -> Bench:
    """Make all trials ready."""
    found, trials = examined.found, examined.held.trials
    if not trials.any():
        return found.bench
    y = found.plain.predicted_deg
    gap = examined.everything.grid.angle_deg - y
    return found.bench.without(np.zeros_like(trials)).with_gap(gap, y)


def _remembering(model: Model, examined: Examined) -> Model:
    """Let a model say what the specimen remembers at the end."""
    memory = ending_memory(model, examined.everything.data)
    return replace(model, extra={**model.extra, "memory": memory})
