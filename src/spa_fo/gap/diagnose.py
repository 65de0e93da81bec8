"""The diagnosis as a whole: evidence -> candidates -> verdict -> shrink -> what to say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spa_fo.blas import one_blas_thread
from spa_fo.errors import BadInput
from spa_fo.gap.answer.causes import causes_of, p_value, smallest_bic, stages, traces_of
from spa_fo.gap.answer.findings import drive_finding, findings, misses, offers
from spa_fo.gap.answer.locate import shares
from spa_fo.gap.claim.claimed import Claim, claim, exact
from spa_fo.gap.claim.final import model_of, on_all_trials
from spa_fo.gap.claim.held_to import beyond_expected, held_to
from spa_fo.gap.data.hold_out import rmse
from spa_fo.gap.decide.examine import Examined, examine, silent
from spa_fo.gap.decide.explanation import Explanation
from spa_fo.gap.decide.verdict import Verdict
from spa_fo.gap.diagnosis import (
    Diagnosis,
    Gap,
    Where,
    write_diagnosis,
)
from spa_fo.gap.noise.bench_noise import Beyond
from spa_fo.gap.places.missing import NOTHING, Missing, find_missing, law_finding
from spa_fo.gap.plan.next_steps import in_words, next_steps
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import Model, read_model, write_model
from spa_fo.plant.effects.library import COMMONEST, LIBRARY, tried_late
from spa_fo.plant.effects.own import use_effects_of
from spa_fo.plant.nominal_drive import driven_by
from spa_fo.rig import CampaignData, read_campaign, read_trials
from spa_fo.validation import suggestion

Floats = NDArray[np.float64]
Progress = Callable[[str], None]


def diagnose_campaign(
    folder: Path | str,
    model_path: Path | str,
    out: Path | str,
    exclude: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose a campaign folder; write diagnosis.json and augmented_model.json to `out`.

    For the parameters, and what is raised, see `diagnose_files` and `write_files`.
    """
    diagnosis = diagnose_files(folder, model_path, exclude, seed, progress)
    write_files(diagnosis, out)
    return diagnosis


def diagnose_files(
    folder: Path | str,
    model_path: Path | str,
    exclude: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose a campaign folder; write nothing.

    Parameters
    ----------
    folder : Path or str
        The campaign.
    model_path : Path or str
        The plain model.
    exclude : sequence of str
        Effects that the library is to lack.
    seed : int
        Of all that is random.
    progress : callable
        Told of each step in words.

    Raises
    ------
    BadInput
        Something is wrong with the campaign, the model, or an effect's name.
    """
    plain = read_model(model_path)
    use_effects_of(folder)
    check_request(plain, exclude, model_path)
    data = read_trials(read_campaign(folder))
    return diagnose(data, plain, excluded=exclude, seed=seed, progress=progress)


def check_request(plain: Model, exclude: Sequence[str], source: Path | str = "model") -> None:
    """Refuse what `diagnose` cannot work with.

    Raises
    ------
    BadInput
        The model is not plain (`source` names it) or bends the wrong way, or the library has no
        such effect.
    """
    if plain.effects:
        raise BadInput(source, "holds effects; expected a plain model", "effects")
    if not plain.transfer_function.b0 > 0.0:
        raise BadInput(source, "expected a positive number", "transfer_function.b0")
    check_effects(exclude)


def check_effects(exclude: Sequence[str]) -> None:
    """Refuse effects to exclude that the library does not hold.

    Raises
    ------
    BadInput
        There is no such effect.
    """
    for name in exclude:
        if name not in LIBRARY:
            raise BadInput("--exclude-effect", f"is '{name}'{suggestion(name, LIBRARY)}")


def write_files(diagnosis: Diagnosis, out: Path | str) -> None:
    """Write augmented_model.json and diagnosis.json to the folder `out`, made where missing.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    out = Path(out)
    write_model(out / "augmented_model.json", diagnosis.model)
    write_diagnosis(out / "diagnosis.json", diagnosis)


@one_blas_thread
def diagnose(
    data: CampaignData,
    plain: Model,
    *,
    excluded: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
    beyond: Beyond | None = None,
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
    beyond : Beyond, optional
        What is to be expected beside the bench's own noise.
    """
    use_effects_of(data.campaign.folder)
    kept = tuple(name for name in tried_late(data.trials) if name not in excluded)
    answered = _answered(data, plain, (*excluded, *kept), seed, progress, beyond)
    if kept and answered.verdict.kind == "unknown":
        progress("trying what is rare, too")
        further = _answered(data, plain, excluded, seed, progress, beyond, answered.examined)
        answered = max(answered, further, key=lambda each: (each.named, each.closes))
    examined, claimed, verdict = answered.examined, answered.claimed, answered.verdict
    everything, held, floor = examined.everything, examined.held, examined.floor_deg
    explained = bool(verdict.sets)
    final = _on_all_trials(examined, verdict, progress) if explained else None
    missing = _missing(examined, verdict, claimed, progress)
    model = model_of(final, missing.worth_a_model, examined.found, everything, held, plain)
    nominal = examined.nominal
    if nominal is not None:
        model = driven_by(model, nominal.fit.drive)
    curves = claimed.curves
    located = shares(everything, everything.grid.angle_deg - curves["plain"], curves["plain"])
    everywhere = np.ones(everything.grid.angle_deg.size, dtype=bool)
    causes = causes_of(examined, verdict, claimed)
    progress("looking for the experiment that would decide")
    steps = next_steps(verdict.kind, verdict.sets, causes, everything, floor)
    stage, not_known = stages(examined, verdict, curves["plain"])
    noise = examined.found.bench.noise
    return Diagnosis(
        campaign=data.campaign.name,
        material=data.campaign.material,
        provenance=data.campaign.provenance.kind,
        seed=seed,
        excluded=tuple(name for name in examined.excluded if name not in kept),
        gap=Gap(
            rmse_deg=rmse(everything, curves["plain"], everywhere),
            noise_floor_deg=floor,
            significant=verdict.kind != "no_gap",
            p_value=p_value(verdict),
            repeats=noise.spectrum.repeats > 0,
        ),
        where=Where(stage=stage, not_known=not_known, **located),
        causes=causes,
        kind=verdict.kind,
        sets=verdict.sets,
        next_experiment=in_words(steps) if verdict.kind in ("ambiguous", "unknown") else None,
        held_out_on=held.text,
        shrink=claimed.shrink if explained else None,
        offers=offers(everything),
        misses=misses(everything, commanded=nominal is not None),
        findings=(
            *findings(verdict, examined.found.bench.own, noise.spectrum.repeats > 0, floor),
            *law_finding(missing, held, everything),
            *(() if nominal is None else nominal.sentences(examined.drive is not None)),
            *drive_finding(examined.drive, everything, held),
            *filter(None, [noise.sentence()]),
        ),
        baselines={"smallest_bic": smallest_bic(examined), "commonest": [COMMONEST]},
        traces=traces_of(
            examined, curves if explained else {**curves, "explained": curves["plain"]}, final
        ),
        model=model,
        next_steps=steps,
        laws=missing.carried_by(model),
    )


@dataclass(frozen=True)
class _Answered:
    """An answer, held against the trials that took no part."""

    examined: Examined
    claimed: Claim
    verdict: Verdict

    @property
    def named(self) -> bool:
        """Whether it names a cause, or some."""
        return self.verdict.kind in ("cause", "ambiguous")

    @property
    def closes(self) -> float:
        """Share of the gap that its first set closes on those trials."""
        sets = self.verdict.sets
        return self.claimed.closed.get(sets[0], 0.0) if sets else 0.0


def _answered(
    data: CampaignData,
    plain: Model,
    excluded: Sequence[str],
    seed: int,
    progress: Progress,
    beyond: Beyond | None,
    earlier: Examined | None = None,
) -> _Answered:
    """Answer with what the library holds without some effects."""
    rng = np.random.default_rng(seed)
    examined = examine(data, plain, excluded, rng, progress, beyond, earlier)

    def claim_of(verdict: Verdict) -> Claim:
        return claim(
            examined.found,
            examined.drive,
            examined.everything,
            examined.held,
            verdict,
            examined.given,
            examined.floor_deg,
            rng,
        )

    progress("predicting trials that took no part")
    claimed = claim_of(examined.verdict)
    least = SETTINGS.closes if beyond is None else SETTINGS.worth
    verdict = held_to(examined.verdict, claimed, least)
    if beyond is not None:
        verdict = beyond_expected(verdict, claimed.errors[()] / beyond.angle_deg)
    if verdict.sets[:1] != examined.verdict.sets[:1]:
        claimed = claim_of(verdict)
    return _Answered(examined, claimed, verdict)


def _on_all_trials(examined: Examined, verdict: Verdict, progress: Progress) -> Explanation:
    """Fit the most probable set that stands once more, to all trials."""
    progress("fitting the explanation once more, to all trials")
    scored = verdict.of(verdict.sets[0])
    e = examined
    return on_all_trials(scored, e.found, e.drive, e.everything, e.held)


def _missing(examined: Examined, verdict: Verdict, claimed: Claim, progress: Progress) -> Missing:
    """Look for what has no name, beside the part that has one."""
    if verdict.kind != "unknown":
        return NOTHING
    progress("looking for laws that have no name")
    found, everything = examined.found, examined.everything
    known = Explanation((), found.plain, None, None)
    if verdict.sets:
        known = exact(verdict.of(verdict.sets[0]), found, examined.drive, found.bench)
    return find_missing(
        found.bench,
        known,
        everything,
        examined.held,
        claimed.curves["plain"],
        claimed.curves["refit"],
        examined.floor_deg,
        verdict.unknown_drive if everything.has_pressure else 0.0,
    )
