"""What is claimed of trials that took no part: how far an explanation closes the gap there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.candidates import Candidates
from spa_fo.gap.diagnosis import Shrink
from spa_fo.gap.drive import fit_drive
from spa_fo.gap.evidence import Evidence, angle_chain
from spa_fo.gap.explain import AngleProblem
from spa_fo.gap.explanation import Explanation, simulate
from spa_fo.gap.floor import noise_floor
from spa_fo.gap.hold_out import HeldOut, fraction_closed, rmse, shrink
from spa_fo.gap.verdict import Verdict

Floats = NDArray[np.float64]

_PART_EXPLAINED = 0.5  # of the gap: less is nothing explained
_LEAST_SCATTER = 0.1  # of what trials differ by, beside an interference
_FREE_FORM_DEG = 2.0  # typical size of a correction without physics
_UNLIKE = ("triangle", "free", "staircase", "hold", "step_release", "step")
_LEADING = 4  # explanations that are chosen from without a protocol
_FEWEST_TRIALS = 3  # to fit an explanation to


@dataclass(frozen=True)
class Claim:
    """What is claimed, and on which trials.

    Attributes
    ----------
    held : HeldOut
        Trials that took no part.
    curves : dict
        Predictions at all averaged samples, deg: ``plain``, ``refit``, ``explained``, ``ceiling``.
    shrink : Shrink or None
        How far the gap closes; None where nothing is explained.
    """

    held: HeldOut
    curves: dict[str, Floats]
    shrink: Shrink | None


def claim(
    candidates: Candidates,
    everything: Evidence,
    held: HeldOut,
    verdict: Verdict,
    chosen: Explanation,
    floor_deg: float,
    rng: np.random.Generator,
) -> Claim:
    """Predict trials that took no part, and measure how far the gap closes on them.

    Where the cause is unknown, what is explained stands in for something else. That holds on
    trials of the kind it was fitted to, and fails on others: there a whole protocol more takes no
    part.

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
    chosen : Explanation
        The explanation that the claim is of.
    floor_deg : float
        The noise floor.
    rng : numpy.random.Generator
        For the bootstrap over trials.
    """
    unlike = _least_alike(everything)
    if verdict.kind == "unknown" and verdict.sets and unlike is not None:
        out = held.trials | unlike.trials
        if np.count_nonzero(~out) >= _FEWEST_TRIALS:
            held = HeldOut(out, f"{held.text}; {unlike.text}")
            evidence = replace(candidates.evidence, takes_part=~out)
            candidates = replace(candidates, evidence=evidence)
            chosen = _chosen_on(candidates, verdict)
    curves = _curves(candidates, everything, chosen)
    if not verdict.sets:
        return Claim(held, curves, None)
    scatter = _scatter(everything, chosen, curves["explained"], floor_deg)
    closed = shrink(everything, held, curves, scatter, rng)
    if verdict.kind == "unknown" and closed.fraction_closed < _PART_EXPLAINED:
        return Claim(held, curves, None)
    if unlike is not None:
        on_unlike = _on_protocol(candidates, everything, unlike, verdict, curves["plain"], scatter)
        closed = replace(closed, protocol=on_unlike)
    return Claim(held, curves, closed)


def _least_alike(everything: Evidence) -> HeldOut | None:
    """Find the protocol least like the others: steps say little of a triangle."""
    trials = everything.grid.trials
    protocol = {trial.experiment: trial.protocol for trial in trials}
    if len(protocol) < 2:
        return None
    name = min(protocol, key=lambda name: _UNLIKE.index(protocol[name]))
    out = np.array([trial.experiment == name for trial in trials])
    return HeldOut(out, f"{name}: {int(out.sum())} trials")


def _chosen_on(candidates: Candidates, verdict: Verdict) -> Explanation:
    """Choose among the leading explanations, fitted to the trials that take part."""
    fitted = [
        refit(candidates, candidates.evidence, s.explanation)
        for s in verdict.scored[:_LEADING]
        if s.named
    ]
    return max(
        fitted,
        key=lambda e: e.fit.log_evidence + (e.drive.log_evidence if e.drive is not None else 0.0),
    )


def _curves(candidates: Candidates, everything: Evidence, chosen: Explanation) -> dict[str, Floats]:
    """Predictions from the command at all averaged samples, deg."""
    evidence, given = candidates.evidence, candidates.given
    chain = angle_chain(everything, given, None)
    nothing = np.full_like(chosen.effects(), np.nan)
    plain, _ = chain.run(given, nothing)
    start = candidates.angles[((), candidates.loose)].searched
    again = AngleProblem(evidence, chain, given, (), candidates.loose).fit(start)
    loose = replace(evidence, tolerance_deg=_FREE_FORM_DEG)
    free_form = AngleProblem(loose, chain, given, (), candidates.loose).fit(again.searched)
    return {
        "plain": plain,
        "refit": again.predicted_deg,
        "ceiling": free_form.predicted_deg + free_form.discrepancy_deg,
        "explained": simulate(chosen, everything),
    }


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
    candidates: Candidates,
    everything: Evidence,
    unlike: HeldOut,
    verdict: Verdict,
    plain_deg: Floats,
    floor_deg: float,
) -> dict[str, Any]:
    """Choose among the leading explanations and fit them without one protocol; predict that one."""
    evidence = replace(candidates.evidence, takes_part=~unlike.trials)
    best = _chosen_on(replace(candidates, evidence=evidence), verdict)
    where = unlike.trials[everything.grid.sample_trial]
    before = rmse(everything, plain_deg, where)
    after = rmse(everything, simulate(best, everything), where)
    return {
        "held_out_on": unlike.text,
        "set": list(best.ids),
        "before_rmse_deg": before,
        "after_rmse_deg": after,
        "fraction_closed": float(fraction_closed(before**2, after**2, floor_deg)),
    }


def refit(candidates: Candidates, evidence: Evidence, chosen: Explanation) -> Explanation:
    """Fit the chosen explanation once more, to the trials of `evidence`."""
    fit = chosen.fit
    pickup_hz = None
    if "mains_pickup" in fit.ids and chosen.pickup is not None:
        pickup_hz = chosen.pickup[0]
    problem = AngleProblem(
        evidence,
        candidates.chain,
        candidates.given,
        fit.ids,
        fit.level,
        pickup_hz=pickup_hz,
        changed=fit.changed,
    )
    drive = chosen.drive
    if drive is not None:
        drive = fit_drive(evidence, drive.ids)
    return replace(chosen, fit=problem.fit(fit.searched), drive=drive)
