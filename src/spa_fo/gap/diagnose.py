"""The diagnosis as a whole: evidence -> candidates -> verdict -> shrink -> what to say."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from spa_fo.arrays import Bools, Floats
from spa_fo.atomic import write_text
from spa_fo.blas import one_blas_thread
from spa_fo.errors import BadInput
from spa_fo.gap.answer.causes import causes_of, p_value, smallest_bic, stages, traces_of
from spa_fo.gap.answer.findings import drive_finding, findings, line_finding, misses, offers
from spa_fo.gap.answer.locate import shares
from spa_fo.gap.claim.against_laws import against_laws, alone_if_rare
from spa_fo.gap.claim.claimed import (
    CLEARLY,
    Claim,
    claim,
    exact,
    held_to,
    if_it_varies,
    is_hardly_a_gap,
    leaves_trials_alike,
    model_of,
    on_all_trials,
    too_small_for_any,
    without_none,
)
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.data.hold_out import HeldOut, hold_out, nothing_held_out, rmse
from spa_fo.gap.decide.examine import Examined, examine, silent
from spa_fo.gap.decide.explanation import Explanation
from spa_fo.gap.decide.verdict import Verdict
from spa_fo.gap.diagnosis import Diagnosis, Gap, Where
from spa_fo.gap.noise.bench_noise import Beyond
from spa_fo.gap.places.missing import Missing, find_missing, law_finding
from spa_fo.gap.plan.next_steps import in_words, next_steps
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import Model, read_model, write_model
from spa_fo.plant.effects.library import COMMONEST, LIBRARY
from spa_fo.plant.effects.own import use_effects_of
from spa_fo.plant.nominal_drive import driven_by
from spa_fo.rig import CampaignData, read_campaign, read_trials
from spa_fo.rig.dropouts import dropout_finding
from spa_fo.validation import suggestion

Progress = Callable[[str], None]
Answer = tuple[Examined, Claim, Verdict]


class Reference(Protocol):
    """What a campaign was before, if that is known: its answer is held against that instead."""

    @property
    def beyond(self) -> Beyond:
        """What is to be expected beside the bench's own noise."""

    def sizes_deg(self, everything: Evidence, plain_deg: Floats) -> tuple[float, float]:
        """Give by how much a campaign differs, and may without any change, RMS, deg."""

    def held(self, examined: Examined, claimed: Claim) -> Verdict:
        """Hold an answer against it."""

    def held_to_claim(self, verdict: Verdict, claimed: Claim) -> Verdict:
        """Hold an answer against what is claimed of it at last."""

    def only_part_differs(
        self, everything: Evidence, held: Bools, plain_deg: Floats
    ) -> Literal["held", "others"] | None:
        """Say which trials alone show that something has changed."""


_ALL = "none, as what could be held out is all that shows the change, or shows none of it"


def diagnose_campaign(
    folder: Path | str,
    model_path: Path | str,
    out: Path | str | None = None,
    exclude: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose a campaign folder by files; `BadInput` where something is wrong with them.

    For the parameters see `diagnose` and, where `out` is given, `write_files`.
    """
    plain = read_model(model_path)
    use_effects_of(folder)
    check_request(plain, exclude, model_path)
    data = read_trials(read_campaign(folder))
    diagnosis = diagnose(data, plain, excluded=exclude, seed=seed, progress=progress)
    if out is not None:
        write_files(diagnosis, out)
    return diagnosis


def check_request(plain: Model, exclude: Sequence[str], source: Path | str = "model") -> None:
    """Refuse, with `BadInput`, what `diagnose` cannot work with.

    The model is not plain (`source` names it) or bends the wrong way, or the library lacks an
    effect that is to be excluded.
    """
    if plain.effects:
        raise BadInput(source, "holds effects; expected a plain model", "effects")
    if not plain.transfer_function.b0 > 0.0:
        raise BadInput(source, "expected a positive number", "transfer_function.b0")
    check_effects(exclude)


def check_effects(exclude: Sequence[str]) -> None:
    """Refuse effects to exclude that the library does not hold, with `BadInput`."""
    for name in exclude:
        if name not in LIBRARY:
            raise BadInput("--exclude-effect", f"is '{name}'{suggestion(name, LIBRARY)}")


def write_files(diagnosis: Diagnosis, out: Path | str) -> None:
    """Write augmented_model.json and diagnosis.json to a folder, made where missing.

    Each is written whole or not at all; `BadInput` where it cannot be.
    """
    text = json.dumps(diagnosis.to_dict(), indent=2, allow_nan=False) + "\n"
    write_model(Path(out) / "augmented_model.json", diagnosis.model)
    write_text(Path(out) / "diagnosis.json", text)


@one_blas_thread
def diagnose(
    data: CampaignData,
    plain: Model,
    *,
    excluded: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
    reference: Reference | None = None,
) -> Diagnosis:
    """Diagnose a campaign.

    Parameters
    ----------
    data : CampaignData
        The campaign.
    plain : Model
        The plain model that misses it.
    excluded : sequence of str
        Effects that the library is to lack.
    seed : int
        Of the trials that are held out and of the bootstrap.
    progress : callable
        Told of each step in words.
    reference : Reference, optional
        Of a comparison: what is to be expected beside the bench's own noise.
    """
    use_effects_of(data.campaign.folder)
    answer = _answered(data, plain, excluded, seed, progress, reference)
    (examined, claimed, verdict), missing = _with_laws(answer, seed, progress)
    everything, floor, nominal = examined.everything, examined.floor_deg, examined.nominal
    # Repeats differ by an interference, too.
    sizes = (
        math.hypot(_gap_deg(examined, claimed), everything.line_deg),
        math.hypot(floor, everything.line_deg),
    )
    if reference is not None:
        sizes = reference.sizes_deg(everything, claimed.curves["plain"])
    noise, curves, measured = examined.found.bench.noise, claimed.curves, everything.grid.angle_deg
    repeated = noise.spectrum.repeats > 0
    final = None
    if verdict.sets:
        progress("fitting the explanation once more, to all trials")
        final = on_all_trials(verdict.of(verdict.sets[0]), examined)
    model = model_of(final, missing.worth_a_model, examined, plain)
    carried = {effect.get("place") for effect in model.effects}
    if nominal is not None:
        model = driven_by(model, nominal.fit.drive)
    causes = causes_of(examined, verdict, claimed)
    progress("looking for the experiment that would decide")
    steps = next_steps(verdict.kind, verdict.sets, causes, everything, floor)
    # Between two campaigns what makes a part doubtful says nothing of where; a law here does.
    first, expected, closed = verdict, None, 0.0
    if reference is not None:
        first = examined.verdict
        expected = reference.beyond.variance(everything, curves["plain"])
        if verdict.sets:
            closed = claimed.closed.get(verdict.sets[0], 0.0)
    arises = stages(examined, verdict, first, curves["plain"], expected, closed)
    located = shares(everything, measured - curves["plain"], curves["plain"])
    return Diagnosis(
        campaign=data.campaign.name,
        material=data.campaign.material,
        provenance=data.campaign.provenance.kind,
        seed=seed,
        excluded=tuple(excluded),
        gap=Gap(
            rmse_deg=sizes[0],
            noise_floor_deg=sizes[1],
            significant=verdict.kind != "no_gap",
            p_value=p_value(verdict, noise.compared),
            repeats=repeated,
        ),
        where=Where(arises.stage, not_known=arises.not_known, assumed=arises.assumed, **located),
        causes=causes,
        kind=verdict.kind,
        sets=verdict.sets,
        next_experiment=in_words(steps) if verdict.kind in ("ambiguous", "unknown") else None,
        held_out_on=examined.held.text,
        shrink=claimed.shrink,
        offers=offers(everything),
        misses=misses(everything, commanded=nominal is not None),
        findings=(
            *findings(verdict, examined.found.bench.own, repeated, floor, examined.own_odds),
            *law_finding(missing, examined),
            *(() if nominal is None else nominal.sentences(examined.drive is not None)),
            *drive_finding(examined.drive, everything, examined.held),
            *line_finding(everything, examined.excluded),
            *filter(None, [noise.sentence()]),
            *dropout_finding(data),
        ),
        baselines={"smallest_bic": smallest_bic(examined), "commonest": [COMMONEST]},
        traces=traces_of(examined, curves, final),
        model=model,
        next_steps=steps,
        laws=tuple(replace(law, carried=law.place in carried) for law in missing.laws),
        reach=everything.reach,
    )


def _answered(
    data: CampaignData,
    plain: Model,
    excluded: Sequence[str],
    seed: int,
    progress: Progress,
    reference: Reference | None,
) -> Answer:
    """Answer, held against the trials that took no part, or against a reference."""
    rng = np.random.default_rng(seed)
    examined, claimed = _examined(data, plain, excluded, rng, progress, reference)
    if reference is None:
        verdict = held_against_trials(examined, claimed, progress)
    else:
        verdict = reference.held(examined, claimed)
    if verdict.sets[:1] != examined.verdict.sets[:1]:
        claimed = claim(examined, verdict, rng)
    if reference is not None:
        verdict = reference.held_to_claim(verdict, claimed)
    return examined, claimed, verdict


def held_against_trials(examined: Examined, claimed: Claim, progress: Progress = silent) -> Verdict:
    """Hold what was decided against trials that took no part, laws without a name, and its size."""
    bench, drive = examined.found.bench, examined.drive
    repeats, own = bench.noise.spectrum.repeats, bench.own
    gap_deg, floor_deg = _gap_deg(examined, claimed), examined.floor_deg
    hardly, verdict = is_hardly_a_gap(gap_deg, floor_deg, repeats, own), examined.verdict
    if repeats and gap_deg > CLEARLY * floor_deg:
        verdict = without_none(verdict)
    verdict = held_to(verdict, claimed, hardly)
    progress("weighing laws that have no name against it")
    verdict = alone_if_rare(against_laws(verdict, examined))
    steady = drive is None or drive.is_ordinary
    if not (bench.noise.is_ordinary and steady):
        if verdict.kind == "no_gap":
            verdict = without_none(verdict)  # what varies is in the gap and in the floor alike
        if steady and not leaves_trials_alike(verdict, examined):
            verdict = if_it_varies(verdict)
        return verdict
    return too_small_for_any(verdict, own) if repeats and hardly else verdict


def _examined(
    data: CampaignData,
    plain: Model,
    excluded: Sequence[str],
    rng: np.random.Generator,
    progress: Progress,
    reference: Reference | None,
) -> tuple[Examined, Claim]:
    """Explain a campaign, held-out trials being such as can judge."""
    beyond = None if reference is None else reference.beyond

    def explained(held: HeldOut | None = None) -> tuple[Examined, Claim]:
        found = examine(data, plain, excluded, rng, progress, beyond, held)
        progress("predicting trials that took no part")
        return found, claim(found, found.verdict, rng)

    examined, claimed = explained()
    if reference is None:
        return examined, claimed
    everything, plain_deg = examined.everything, claimed.curves["plain"]
    part = reference.only_part_differs(everything, examined.held.trials, plain_deg)
    if part == "others":
        again = hold_out(everything, rng, everything.grid.angle_deg - plain_deg)
        part = reference.only_part_differs(everything, again.trials, plain_deg)
        if part is None:
            progress("once more: those that were held out show no change")
            return explained(again)
    if part is not None:
        progress("once more with all trials: those that are held out cannot judge")
        examined, claimed = explained(nothing_held_out(everything, _ALL))
    return examined, claimed


def _gap_deg(examined: Examined, claimed: Claim) -> float:
    """RMS of what the plain model misses over all samples, deg."""
    plain = claimed.curves["plain"]
    return rmse(examined.everything, plain, np.ones(plain.size, dtype=bool))


def _with_laws(answer: Answer, seed: int, progress: Progress) -> tuple[Answer, Missing]:
    """Look for what has no name; a part beside which a law does no better than alone is none.

    Nor is one that is clearly less probable than an unknown cause: what it closes on one motion it
    may well not on another. Of a change a part says where it is, so it stays.
    """
    examined, claimed, verdict = answer
    if verdict.kind != "unknown" or not verdict.sets:
        return answer, _missing(examined, verdict, claimed, progress)
    bare, compared = replace(verdict, sets=()), examined.found.bench.noise.compared
    alone = _missing(examined, bare, claimed, progress)
    if compared or not _is_doubtful(verdict):
        beside = _missing(examined, verdict, claimed, progress)
        if not _alone_does(alone, beside, compared):
            return answer, beside
    return (examined, claim(examined, bare, np.random.default_rng(seed)), bare), alone


def _is_doubtful(verdict: Verdict) -> bool:
    """Say whether an unknown cause is clearly more probable than the part that has a name."""
    return verdict.of(verdict.sets[0]).probability < SETTINGS.doubt * verdict.unknown


def _alone_does(alone: Missing, beside: Missing, compared: bool) -> bool:
    """Say whether a law alone closes as much as beside a part that has a name.

    Of a change a part that by itself closes as much has its place: a law fits either, and may be of
    another stage.
    """
    law = alone.worth_a_model
    if law is None:
        return False
    closed = [beside.known_closed, *(each.fraction_closed for each in beside.laws[:1])]
    part_does = beside.known_closed > law.fraction_closed - SETTINGS.gains
    return law.fraction_closed >= max(closed) - SETTINGS.gains and not (compared and part_does)


def _missing(examined: Examined, verdict: Verdict, claimed: Claim, progress: Progress) -> Missing:
    """Look for what has no name, beside the part that has one."""
    if verdict.kind != "unknown":
        return Missing()
    progress("looking for laws that have no name")
    known = Explanation((), examined.found.plain, None, None)
    if verdict.sets:
        known = exact(verdict.of(verdict.sets[0]), examined)
    return find_missing(examined, known, claimed.curves, verdict.unknown_drive)
