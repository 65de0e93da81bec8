"""What is claimed of trials that took no part: how far an explanation closes the gap there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.claim.own_scatter import own_scatter
from spa_fo.gap.data.evidence import Evidence, angle_chain, repeats
from spa_fo.gap.data.hold_out import HeldOut, judged, rmse, shrink
from spa_fo.gap.decide.explanation import Explanation, angle_part, explanation_of, simulate
from spa_fo.gap.decide.verdict import Scored, Verdict
from spa_fo.gap.diagnosis import Shrink
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.search.drive import Drive, DriveFit
from spa_fo.gap.search.explanations import Explanations
from spa_fo.gap.search.fitted import Fitted, fit, without_others
from spa_fo.gap.together import each
from spa_fo.plant.effects.library import LIBRARY, absent, at_port

Floats = NDArray[np.float64]
Ids = tuple[str, ...]

_MOST = 6  # explanations whose predictions are tried
_LIKELY = 0.005  # probability from which one is


@dataclass(frozen=True)
class Claim:
    """What is claimed, and on which trials.

    Attributes
    ----------
    held : HeldOut
        Trials that took no part in choosing or fitting.
    curves : dict
        Predictions at all averaged samples, deg: ``plain``, ``refit``, ``explained``, ``ceiling``.
    errors : dict
        RMS error of the leading explanations on those trials, deg; of the plain model under ``()``.
    closed : dict
        What each leading explanation closes of the gap there.
    shrink : Shrink or None
        How far the gap closes; None where nothing is explained.
    """

    held: HeldOut
    curves: dict[str, Floats]
    errors: dict[Ids, float]
    closed: dict[Ids, float]
    shrink: Shrink | None


def by_chance(ids: Ids) -> bool:
    """Whether what a set does to a trial is the trial's own, so that nobody can foretell it."""
    return any(at_port(port, ids) for port in ("zeros", "line"))


def exact(scored: Scored, found: Explanations, drive: Drive | None, bench: Bench) -> Explanation:
    """Fit just the effects that a set names, to the trials of a bench."""
    pressed = None
    if drive is not None:
        ids = tuple(n for n in scored.named if LIBRARY[n].stage == "drive")
        pressed = drive.fits.get(ids) if ids else None
    ids = angle_part(scored.named, _own_drive(drive), scored.fast is not None)
    known = found.fits.get(ids)
    if known is not None and bench is found.bench:
        return explanation_of(scored, known, pressed)
    start = known.z if known is not None else without_others(scored.angle, ids)
    return explanation_of(scored, fit(bench, ids, [start], found.plain), pressed)


def _own_drive(drive: Drive | None) -> DriveFit | None:
    return None if drive is None else drive.best


def claim(
    found: Explanations,
    drive: Drive | None,
    everything: Evidence,
    held: HeldOut,
    verdict: Verdict,
    given: Floats,
    floor_deg: float,
    rng: np.random.Generator,
) -> Claim:
    """Predict the trials that took no part, and measure how far the gap closes on them.

    Parameters
    ----------
    found : Explanations
        Fits of the angle to the other trials.
    drive : Drive or None
        Fits of the pressure to these.
    everything : Evidence
        The campaign with all its trials.
    held : HeldOut
        Trials that took no part.
    verdict : Verdict
        The answer.
    given : (5,) array
        Coefficients of the given model.
    floor_deg : float
        The noise floor.
    rng : numpy.random.Generator
        For the bootstrap over trials.
    """
    leading = [s for s in verdict.scored if s.named][:_MOST]
    leading = [s for s in leading if s.named in verdict.sets or s.probability >= _LIKELY]
    where = judged(everything, held)
    chain = angle_chain(everything, given, None)
    curves = {"plain": chain.run(given, absent())[0]}
    again = _identified_again(found)
    curves["refit"] = angle_chain(everything, again.x, None).run(again.x, absent())[0]
    errors: dict[Ids, float] = {(): rmse(everything, curves["plain"], where)}
    fits = each(lambda s: exact(s, found, drive, found.bench), leading)
    predicted = {s.named: simulate(e, everything) for s, e in zip(leading, fits, strict=True)}
    closed = {}
    for named, curve in predicted.items():
        errors[named] = rmse(everything, curve, where)
        closed[named] = 1.0 - (errors[named] / max(errors[()], 1e-12)) ** 2
    first = verdict.sets[0] if verdict.sets else ()
    curves["explained"] = predicted.get(first, curves["plain"])
    curves["ceiling"] = curves["refit"] + _repeating(everything, held, curves["refit"])
    made = None
    if first:
        chosen = next(e for s, e in zip(leading, fits, strict=True) if s.named == first)
        left_deg = verdict.of(first).left_deg
        scatter = own_scatter(found.bench, chosen, everything, where, curves, left_deg)
        if not found.bench.noise.spectrum.repeats:
            scatter = max(scatter, floor_deg)  # nothing tells what is left from noise
        made = shrink(everything, held, curves, scatter, rng)
    return Claim(held, curves, errors, closed, made)


def _identified_again(found: Explanations) -> Fitted:
    """Return the plain model identified again, which any cause has to beat."""
    name = at_port("coefficients")
    if found.bench.own or name is None:
        return found.plain
    return found.fits[(name,)]


def _repeating(everything: Evidence, held: HeldOut, curve: Floats) -> Floats:
    """Give what repeats in the fitted trials beyond a curve, at all samples, deg: no physics."""
    grid = everything.grid
    left = grid.angle_deg - curve
    out = np.zeros_like(left)
    for repeated in repeats(everything, left, ~held.trials):
        seen = np.isfinite(repeated.values)
        mean = np.where(seen, repeated.values, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
        time = grid.time_s[repeated.rows]
        number = everything.alike[grid.sample_trial[repeated.rows[0]]]
        for trial in np.flatnonzero(everything.alike == number):
            rows = everything.rows[trial]
            out[rows] = np.interp(grid.time_s[rows], time, mean)
    return out


def closes(claimed: Claim, named: Ids, least: float) -> bool:
    """Say whether a set closes enough of the gap on the held-out trials."""
    return by_chance(named) or claimed.closed.get(named, 0.0) >= least
