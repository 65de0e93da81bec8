"""What is claimed of trials that took no part: how far an explanation closes the gap there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.candidates import Candidates, Ids
from spa_fo.gap.diagnosis import Shrink
from spa_fo.gap.drive import fit_drive
from spa_fo.gap.evidence import Evidence, angle_chain
from spa_fo.gap.explain import AngleProblem
from spa_fo.gap.explanation import Explanation, simulate
from spa_fo.gap.floor import noise_floor
from spa_fo.gap.hold_out import (
    HeldOut,
    Trials,
    fraction_closed,
    in_turn,
    judged,
    last_trials,
    rmse,
    shrink,
)
from spa_fo.gap.together import each
from spa_fo.gap.verdict import Scored, Verdict, log_weight
from spa_fo.plant.effects.library import absent

Floats = NDArray[np.float64]

_PART_EXPLAINED = 0.8  # of the gap; what closes less of the last trials foretells little
_LEAST_SCATTER = 0.1  # of what trials differ by, beside an interference
_FREE_FORM_DEG = 2.0  # typical size of a correction without physics
_UNLIKE = ("triangle", "free", "staircase", "hold", "step_release", "step")
_MOST, _FEW = 6, 3  # explanations that are fitted again without some trials
_LIKELY = 0.005  # probability from which one counts among the most


@dataclass(frozen=True)
class Claim:
    """What is claimed, and on which trials.

    Attributes
    ----------
    held : HeldOut
        Trials that took no part in what predicts them.
    curves : dict
        Predictions at all averaged samples, deg: ``plain``, ``refit``, ``explained``, ``ceiling``.
    errors : dict
        RMS error of the leading explanations on those trials, deg; of the plain model under ``()``.
    shrink : Shrink or None
        How far the gap closes; None where nothing is explained.
    """

    held: HeldOut
    curves: dict[str, Floats]
    errors: dict[Ids, float]
    shrink: Shrink | None


def claim(
    candidates: Candidates,
    everything: Evidence,
    held: HeldOut,
    verdict: Verdict,
    floor_deg: float,
    rng: np.random.Generator,
) -> Claim:
    """Predict trials that took no part, and measure how far the gap closes on them.

    Some trials at a time are left out; the leading explanations are fitted to the others, the best
    there is chosen anew, and predicts them. Where the cause is unknown, what is explained stands in
    for something else, and holds better among the trials that it was fitted to than after them:
    there the last trials take no part, and only what closes most of their gap is claimed.

    Parameters
    ----------
    candidates : Candidates
        What was fitted.
    everything : Evidence
        The campaign with all its trials.
    held : HeldOut
        Trials that took no part in `candidates`.
    verdict : Verdict
        The answer.
    floor_deg : float
        The noise floor.
    rng : numpy.random.Generator
        For the trials left out, and the bootstrap over them.
    """
    unlike = _least_alike(everything)
    held, folds = _folds(everything, held, verdict, rng)
    leading = _leading(verdict)
    parts = each(lambda fold: _without(candidates, everything, fold, leading), folds)
    curves = {
        name: _assembled([part.curves[name] for part in parts], folds, everything)
        for name in parts[0].curves
    }
    where = judged(everything, held)
    errors: dict[Ids, float] = {(): rmse(everything, curves["plain"], where)}
    for s in leading:
        by_fold = [part.explained[s.named] for part in parts]
        errors[s.named] = rmse(everything, _assembled(by_fold, folds, everything), where)
    unproved = verdict.kind == "unknown" and not held.trials.any()
    if not verdict.sets or parts[0].chosen is None or unproved:
        return Claim(held, curves, errors, None)
    scatter = _scatter(everything, parts[0].chosen, curves["explained"], floor_deg)
    closed = shrink(everything, held, curves, scatter, rng)
    if verdict.kind == "unknown" and closed.fraction_closed < _PART_EXPLAINED:
        return Claim(held, curves, errors, None)
    if unlike is not None:
        part = _without(candidates, everything, unlike.trials, leading)
        closed = replace(closed, protocol=_on_protocol(part, everything, unlike, scatter))
    return Claim(held, curves, errors, closed)


def _leading(verdict: Verdict) -> list[Scored]:
    """List the explanations that may turn out best without some trials."""
    named = [s for s in verdict.scored if s.named][:_MOST]
    return [s for rank, s in enumerate(named) if rank < _FEW or s.probability >= _LIKELY]


def _folds(
    everything: Evidence, held: HeldOut, verdict: Verdict, rng: np.random.Generator
) -> tuple[HeldOut, list[Trials]]:
    """Say which trials are predicted, and which of them are left out at a time."""
    if not verdict.sets:
        return held, [held.trials]
    if verdict.kind == "unknown" and held.trials.any():
        last = last_trials(everything)
        return last, [last.trials]
    folds = in_turn(everything, held, rng)
    if len(folds) > 1:
        out = np.logical_or.reduce(folds)
        text = f"{out.sum()} trials, each predicted by a fit that had not seen it"
        held = HeldOut(out, f"{text} ({len(folds)} fits)")
    return held, folds


def _assembled(curves: Sequence[Floats], folds: Sequence[Trials], everything: Evidence) -> Floats:
    """Take each trial from the fold that leaves it out, and what none leaves out from the first."""
    whole = curves[0].copy()
    for curve, fold in zip(curves, folds, strict=True):
        rows = fold[everything.grid.sample_trial]
        whole[rows] = curve[rows]
    return whole


def _least_alike(everything: Evidence) -> HeldOut | None:
    """Find the protocol least like the others: steps say little of a triangle."""
    trials = everything.grid.trials
    protocol = {trial.experiment: trial.protocol for trial in trials}
    if len(protocol) < 2:
        return None
    name = min(protocol, key=lambda name: _UNLIKE.index(protocol[name]))
    out = np.array([trial.experiment == name for trial in trials])
    return HeldOut(out, f"{name}: {int(out.sum())} trials")


@dataclass(frozen=True)
class _Part:
    """What fits without some trials predict, at all averaged samples, deg.

    `explained` holds the leading explanations'; `chosen` is the best of them, if there are any.
    """

    curves: dict[str, Floats]
    explained: dict[Ids, Floats]
    chosen: Explanation | None


def _without(
    candidates: Candidates, everything: Evidence, out: Trials, leading: Sequence[Scored]
) -> _Part:
    """Fit the leading explanations and the plain model to the trials that are not left out."""
    evidence, given = replace(candidates.evidence, takes_part=~out), candidates.given
    centre = candidates.centre
    fitted = {s.named: refit(candidates, evidence, s.explanation) for s in leading}
    explained = {named: simulate(e, everything) for named, e in fitted.items()}
    best = max(fitted, key=lambda named: log_weight(fitted[named]), default=None)
    chain = angle_chain(evidence, given, None)
    plain, _ = chain.run(given, absent())
    start = candidates.angles[((), candidates.loose)].searched
    again = AngleProblem(evidence, chain, centre, (), candidates.loose).fit(start)
    loose = replace(evidence, tolerance_deg=_FREE_FORM_DEG)
    free_form = AngleProblem(loose, chain, centre, (), candidates.loose).fit(again.searched)
    curves = {
        "plain": plain,
        "refit": again.predicted_deg,
        "ceiling": free_form.predicted_deg + free_form.discrepancy_deg,
        "explained": plain if best is None else explained[best],
    }
    return _Part(curves, explained, None if best is None else fitted[best])


def _scatter(
    everything: Evidence, chosen: Explanation, explained_deg: Floats, floor_deg: float
) -> float:
    """Noise floor once the explanation is taken out of it, deg.

    Slip, drift and softening let repeated trials differ, and so does an interference, whose phase
    nobody can foretell: they are part of the gap.
    """
    scatter = min(floor_deg, noise_floor(everything, explained_deg))
    if chosen.pickup is None:
        return scatter
    wave = chosen.pickup[1] ** 2 / 2.0
    return float(np.sqrt(max(scatter**2 - wave, (_LEAST_SCATTER * scatter) ** 2)))


def _on_protocol(
    part: _Part, everything: Evidence, unlike: HeldOut, floor_deg: float
) -> dict[str, Any]:
    """Say how the explanation that is best without a protocol predicts it."""
    where = unlike.trials[everything.grid.sample_trial]
    before, after = (rmse(everything, part.curves[name], where) for name in ("plain", "explained"))
    return {
        "held_out_on": unlike.text,
        "set": list(part.chosen.ids) if part.chosen is not None else [],
        "before_rmse_deg": before,
        "after_rmse_deg": after,
        "fraction_closed": float(fraction_closed(before**2, after**2, floor_deg)),
    }


def refit(candidates: Candidates, evidence: Evidence, chosen: Explanation) -> Explanation:
    """Fit the chosen explanation once more, to the trials of `evidence`."""
    fit = chosen.fit
    problem = AngleProblem(
        evidence,
        candidates.chain,
        candidates.centre,
        fit.ids,
        fit.level,
        pickup=chosen.pickup if "mains_pickup" in fit.ids else None,
        changed=fit.changed,
    )
    again = problem.fit(fit.searched)
    gained = again.log_evidence - fit.log_evidence
    drive = None
    if chosen.drive is not None:
        drive = fit_drive(evidence, chosen.drive.ids)
        gained += drive.log_evidence - chosen.drive.log_evidence
    return replace(chosen, fit=again, drive=drive, log_evidence=chosen.log_evidence + gained)
