"""The diagnosis as a whole: evidence -> candidates -> verdict -> shrink -> what to say."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spa_fo.errors import BadInput
from spa_fo.gap.bench import bench_for
from spa_fo.gap.bench_noise import Beyond
from spa_fo.gap.claim import Claim, claim, exact
from spa_fo.gap.decide import Verdict, decide, stage_shares
from spa_fo.gap.diagnosis import (
    Cause,
    Diagnosis,
    Gap,
    Traces,
    Where,
    write_diagnosis,
)
from spa_fo.gap.drive import Drive, examine_drive
from spa_fo.gap.drive_by_angle import joined
from spa_fo.gap.evidence import Evidence, angle_chain, collect
from spa_fo.gap.explanation import Explanation, explanation_of
from spa_fo.gap.explanations import Explanations, explain
from spa_fo.gap.final import model_of, on_all_trials
from spa_fo.gap.findings import drive_finding, findings, misses, offers
from spa_fo.gap.floor import noise_floor
from spa_fo.gap.held_to import beyond_expected, held_to
from spa_fo.gap.hold_out import HeldOut, hold_out, rmse
from spa_fo.gap.interference import NONE, fast_line
from spa_fo.gap.intervals import with_intervals
from spa_fo.gap.locate import shares
from spa_fo.gap.missing import NOTHING, Missing, find_missing, law_finding
from spa_fo.gap.next_steps import in_words, next_steps
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import PARAMETERS, Model, read_model, write_model
from spa_fo.plant.effects.effect import STAGES
from spa_fo.plant.effects.library import COMMONEST, LIBRARY, absent, at_port
from spa_fo.plant.effects.own import use_effects_of
from spa_fo.rig import CampaignData, read_campaign, read_trials
from spa_fo.validation import suggestion

Floats = NDArray[np.float64]
Progress = Callable[[str], None]
_IDENTIFIED = "sampling"  # a key that an identification writes to its model
_NOT_KNOWN = (
    "neither the pressure nor a calibration was logged: what is not explained may be anyone's"
)


def _silent(step: str) -> None:
    """Keep to oneself what is being done."""


def diagnose_campaign(
    folder: Path | str,
    model_path: Path | str,
    out: Path | str,
    exclude: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = _silent,
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
    progress: Progress = _silent,
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


def diagnose(
    data: CampaignData,
    plain: Model,
    *,
    excluded: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = _silent,
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
    rng = np.random.default_rng(seed)
    examined = examine(data, plain, excluded, rng, progress, beyond)
    everything, held, floor = examined.everything, examined.held, examined.floor_deg
    progress("predicting trials that took no part")
    claimed = claim(
        examined.found,
        examined.drive,
        everything,
        held,
        examined.verdict,
        examined.given,
        floor,
        rng,
    )
    least = SETTINGS.closes if beyond is None else SETTINGS.worth
    verdict = held_to(examined.verdict, claimed, least)
    if beyond is not None:
        verdict = beyond_expected(verdict, claimed.errors[()] / beyond.angle_deg)
    if verdict.sets[:1] != examined.verdict.sets[:1]:
        claimed = claim(
            examined.found, examined.drive, everything, held, verdict, examined.given, floor, rng
        )
    explained = bool(verdict.sets)
    final = _on_all_trials(examined, verdict, progress) if explained else None
    missing = _missing(examined, verdict, claimed, progress)
    model = model_of(final, missing.worth_a_model, examined.found, everything, held, plain)
    curves = claimed.curves
    located = shares(everything, everything.grid.angle_deg - curves["plain"], curves["plain"])
    everywhere = np.ones(everything.grid.angle_deg.size, dtype=bool)
    causes = _causes(examined, verdict, claimed)
    progress("looking for the experiment that would decide")
    steps = next_steps(verdict.kind, verdict.sets, causes, everything, floor)
    stage, not_known = _stages(examined, verdict, curves["plain"])
    noise = examined.found.bench.noise
    return Diagnosis(
        campaign=data.campaign.name,
        material=data.campaign.material,
        provenance=data.campaign.provenance.kind,
        seed=seed,
        excluded=examined.excluded,
        gap=Gap(
            rmse_deg=rmse(everything, curves["plain"], everywhere),
            noise_floor_deg=floor,
            significant=verdict.kind != "no_gap",
            p_value=_p_value(verdict),
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
        misses=misses(everything),
        findings=(
            *findings(verdict, examined.found.bench.own, noise.spectrum.repeats > 0, floor),
            *law_finding(missing, held, everything),
            *drive_finding(examined.drive, everything, held),
            *filter(None, [noise.sentence()]),
        ),
        baselines={"smallest_bic": _smallest_bic(examined), "commonest": [COMMONEST]},
        traces=_traces(
            examined, curves if explained else {**curves, "explained": curves["plain"]}, final
        ),
        model=model,
        next_steps=steps,
        laws=missing.carried_by(model),
    )


@dataclass(frozen=True)
class Examined:
    """A campaign with every explanation of it fitted and weighed.

    Attributes
    ----------
    data : CampaignData
        The campaign as the model sees it.
    everything : Evidence
        All its trials.
    held : HeldOut
        Trials that took no part.
    given : (5,) array
        Coefficients of the given model.
    excluded : tuple of str
        Effects that the library lacked.
    drive : Drive or None
        What the measured pressure says.
    found : Explanations
        Fits of the angle to the trials that took part.
    verdict : Verdict
        The answer, before it is held against the other trials.
    floor_deg : float
        The noise floor.
    """

    data: CampaignData
    everything: Evidence
    held: HeldOut
    given: Floats
    excluded: tuple[str, ...]
    drive: Drive | None
    found: Explanations
    verdict: Verdict
    floor_deg: float


def examine(
    data: CampaignData,
    plain: Model,
    excluded: Sequence[str],
    rng: np.random.Generator,
    progress: Progress = _silent,
    beyond: Beyond | None = None,
) -> Examined:
    """Fit and weigh every explanation; for the parameters see `diagnose`.

    `rng` chooses the trials that are held out.
    """
    if plain.signal == "pressure":
        data = _driven_by_pressure(data)
    # The model's u, whatever the campaign's own would be.
    campaign = replace(data.campaign, reference_kpa=plain.reference_kpa)
    data = replace(data, campaign=campaign)
    everything = collect(data)
    excluded = tuple(excluded)
    if everything.grid.command_kpa is None:
        drives = [n for n in LIBRARY if LIBRARY[n].stage == "drive" and n not in excluded]
        excluded = (*excluded, *drives)
    held = hold_out(everything, rng)
    evidence = replace(everything, takes_part=~held.trials)
    given = plain.transfer_function.as_array()
    progress(f"explaining {evidence.takes_part.sum()} trials")
    drive = None
    if evidence.has_pressure:
        drive = examine_drive(
            evidence, excluded, given, None if beyond is None else beyond.pressure
        )
    own = plain.campaign == data.campaign.name and _IDENTIFIED in plain.extra
    bench = bench_for(evidence, given, own, None if drive is None else drive.pressure_kpa, beyond)
    floor = noise_floor(everything)
    if not bench.noise.spectrum.repeats:
        floor = bench.noise.floor_deg(everything.grid.angle_deg)
    if beyond is not None:
        floor = max(floor, beyond.angle_deg)
    found = explain(bench, excluded)
    if drive is not None:
        before, drive = drive, joined(drive, found)
        if drive.best.ids != before.best.ids:
            found = explain(bench_for(evidence, given, own, drive.pressure_kpa, beyond), excluded)
    progress(f"weighing {len(found.fits)} explanations")
    line = at_port("line")
    fast = NONE if line in excluded else fast_line(evidence)
    drive_floor = None
    if drive is not None and beyond is not None:
        drive_floor = beyond.pressure_kpa * drive.per_kpa_deg
    verdict = decide(found, drive, fast, evidence, floor, drive_floor)
    return Examined(data, everything, held, given, excluded, drive, found, verdict, floor)


def _driven_by_pressure(data: CampaignData) -> CampaignData:
    """Leave the command out: the model takes the measured pressure for what drives it."""
    if any(trial.pressure_kpa is None for trial in data.trials):
        raise BadInput(data.campaign.folder, "expected a pressure column: it drives the model")
    trials = tuple(replace(trial, command_kpa=None) for trial in data.trials)
    return replace(data, trials=trials)


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


def _p_value(verdict: Verdict) -> float:
    """Bound the probability of so much evidence by chance.

    A Bayes factor against no gap of k is met by chance at most once in k times (Ville 1939).
    """
    odds = (1.0 - SETTINGS.none) / SETTINGS.none
    factor = (1.0 - verdict.none) / max(verdict.none, 1e-300) / odds
    return float(min(1.0, 1.0 / max(factor, 1e-300)))


def _stages(
    examined: Examined, verdict: Verdict, plain_deg: Floats
) -> tuple[dict[str, float] | None, str | None]:
    """Share the gap out to stages: by what explains it, or else by where it is seen."""
    everything = examined.everything
    if verdict.kind == "no_gap":
        return dict.fromkeys(STAGES, 0.0), None
    if verdict.kind in ("cause", "ambiguous"):
        return stage_shares(verdict), None
    if not everything.has_pressure and everything.fixture is None and not verdict.sets:
        return None, _NOT_KNOWN
    drive, whole = 0.0, everything.grid.angle_deg - plain_deg
    if everything.has_pressure:
        # With the measured pressure for the command, what vanishes was the drive's.
        chain = angle_chain(everything, examined.given, everything.grid.pressure_kpa)
        driven, _ = chain.run(examined.given, absent())
        drive = float(np.mean((driven - plain_deg) ** 2))
        whole = everything.grid.angle_deg - driven
    rest = float(np.mean(whole**2)) + 1e-9
    sensor = 0.0
    if everything.fixture is not None:
        fixture = everything.fixture
        sensor = max(float(np.mean(fixture.deviation_deg**2 - fixture.sigma_deg**2)), 0.0)
    sensor = min(sensor, rest)
    named = {"drive": drive, "actuator": rest - sensor, "sensor": sensor, "acquisition": 0.0}
    if verdict.sets:
        # Where a part is explained, that says more of what is not the drive's.
        known = stage_shares(verdict)
        if not everything.has_pressure:
            return known, None
        beyond = max(1.0 - known["drive"], 1e-9)
        named = {name: share / beyond * rest for name, share in known.items()} | {"drive": drive}
    total = sum(named.values())
    return {stage: named[stage] / total for stage in STAGES}, None


def _causes(examined: Examined, verdict: Verdict, claimed: Claim) -> tuple[Cause, ...]:
    orders, found = examined.everything.grid.orders, examined.found
    causes = []
    for s in verdict.scored:
        e = Explanation(s.named, s.angle, s.drive, None)
        if set(s.named) <= set(s.angle.ids) | set(() if s.drive is None else s.drive.ids) or s.fast:
            e = explanation_of(s, s.angle, s.drive)
        intervals = with_intervals(e, examined.given, orders) if s.named else {}
        causes.append(
            Cause(
                set=s.named or ("none",),
                probability=s.probability,
                parameters={name: own for name, own in intervals.items() if name in s.named},
                transfer_function=dict(zip(PARAMETERS, e.x.tolist(), strict=True)),
                held_out_rmse_deg=claimed.errors.get(s.named),
                leftover_deg=s.left_deg,
            )
        )
    known = {cause.set for cause in causes}
    if ("none",) not in known:
        x = dict(zip(PARAMETERS, found.plain.x.tolist(), strict=True))
        causes.append(Cause(("none",), 0.0, {}, x, held_out_rmse_deg=claimed.errors[()]))
    causes += [
        Cause((name,), 0.0, {}, {})
        for name in LIBRARY
        if (name,) not in known and name not in examined.excluded
    ]
    causes.append(Cause(("unknown",), verdict.unknown, {}, {}))
    total = sum(cause.probability for cause in causes)
    causes = [replace(cause, probability=cause.probability / total) for cause in causes]
    return tuple(sorted(causes, key=lambda cause: -cause.probability))


def _smallest_bic(examined: Examined) -> list[str]:
    """Name what the smallest Bayesian information criterion picks among single effects."""
    bench = examined.found.bench
    used, grid = bench.evidence.used, bench.evidence.grid
    n = int(np.count_nonzero(used))
    best: tuple[float, tuple[str, ...]] = (np.inf, ())
    for ids, fitted in examined.found.fits.items():
        if len(ids) > 1:
            continue
        missed = (grid.angle_deg - fitted.shared_deg)[used]
        square = float(np.average(missed**2, weights=grid.counts[used]))
        score = n * np.log(square) + np.log(n) * fitted.z.size
        if score < best[0]:
            best = (score, ids)
    return list(best[1])


def _traces(examined: Examined, curves: Mapping[str, Floats], final: Explanation | None) -> Traces:
    everything = examined.everything
    grid = everything.grid
    command = np.full(grid.angle_deg.size, np.nan)
    if grid.command_kpa is not None:
        command = grid.step_means(grid.command_kpa)[grid.sample_step]
    fixture = everything.fixture
    empty = np.zeros(0)
    explained = empty
    if fixture is not None:
        explained = np.zeros(fixture.deviation_deg.size)
        if final is not None:
            explained = fixture.simulate(final.effects())[0]
    drive = None
    if final is not None and final.drive is not None:
        drive = final.drive.predicted_kpa
    return Traces(
        experiment=tuple(trial.experiment for trial in grid.trials),
        label=tuple(trial.label for trial in grid.trials),
        trial=grid.sample_trial,
        time_s=grid.time_s,
        command_kpa=command,
        measured_deg=grid.angle_deg,
        plain_deg=curves["plain"],
        explained_deg=curves["explained"],
        refit_deg=curves["refit"],
        pressure_kpa=grid.measured_kpa,
        drive_kpa=drive,
        held_out=examined.held.trials,
        fixture_angle_deg=empty if fixture is None else fixture.known_deg,
        fixture_deg=empty if fixture is None else fixture.deviation_deg,
        fixture_explained_deg=explained,
    )
