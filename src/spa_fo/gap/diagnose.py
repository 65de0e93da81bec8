"""The diagnosis as a whole: evidence -> candidates -> verdict -> shrink -> what to say."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spa_fo.errors import BadInput
from spa_fo.gap.bench_noise import bench_noise
from spa_fo.gap.candidates import Candidates, Ids, consider
from spa_fo.gap.claim import claim, refit
from spa_fo.gap.diagnosis import (
    Cause,
    Diagnosis,
    Gap,
    Traces,
    Where,
    write_diagnosis,
)
from spa_fo.gap.evidence import Evidence, angle_chain, collect
from spa_fo.gap.explanation import Explanation, augmented_model, simulate
from spa_fo.gap.findings import drive_finding, findings, misses, offers
from spa_fo.gap.floor import noise_floor
from spa_fo.gap.hold_out import HeldOut, hold_out, judged, rmse
from spa_fo.gap.intervals import with_intervals
from spa_fo.gap.locate import shares
from spa_fo.gap.next_steps import in_words, next_steps
from spa_fo.gap.unknown import unknown_probability
from spa_fo.gap.verdict import Scored, Verdict, beating, judge, stage_shares, weigh
from spa_fo.plant import PARAMETERS, Model, read_model, write_model
from spa_fo.plant.augmented import ending_memory
from spa_fo.plant.effects.library import IDS, LIBRARY, STAGES, absent
from spa_fo.rig import CampaignData, read_campaign, read_trials
from spa_fo.validation import suggestion

Floats = NDArray[np.float64]
Progress = Callable[[str], None]

COMMONEST = "hysteresis"
"""What one hears most often about soft actuators: a baseline that always answers so."""
_SAME_MODEL = 0.01  # of the static gain: two step responses nearer than that are one model
_BY_CHANCE = {"mains_pickup", "sensor_slip"}  # phases and jumps that nobody can foretell
_AS_REPEATED = 1.15  # noise floors
_DOUBTED = 0.5  # probability of no gap below which a gap is claimed
_WORTH_TESTING = 0.01  # probability from which an explanation's predictions are tried


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
            raise BadInput("--exclude-effect", f"is '{name}'{suggestion(name, IDS)}")


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
    """
    rng = np.random.default_rng(seed)
    examined = examine(data, plain, excluded, rng, seed, progress)
    data, everything, held = examined.data, examined.everything, examined.held
    candidates, scored, floor = examined.candidates, examined.scored, examined.floor_deg
    own = candidates.own
    unknown, stress = unknown_probability(scored, candidates, floor)
    verdict = _verdict(scored, unknown)

    progress("predicting trials by fits that have not seen them")
    claimed = claim(candidates, everything, held, verdict, floor, rng)
    curves, shrunk = claimed.curves, claimed.shrink
    if shrunk is None:
        verdict = replace(verdict, sets=())

    explained = bool(verdict.sets)
    if explained:
        progress("fitting the explanation once more, to all trials")
    every = replace(candidates.evidence, takes_part=np.ones_like(held.trials))
    final = refit(candidates, every, _chosen(verdict)) if explained else None
    if not explained:
        curves["explained"] = curves["plain"]
    model = plain
    if final is not None:
        model = augmented_model(final, everything, plain)
        model = replace(model, extra={**model.extra, "memory": ending_memory(model, data)})
    located = shares(everything, everything.grid.angle_deg - curves["plain"], curves["plain"])
    everywhere = np.ones(everything.grid.angle_deg.size, dtype=bool)
    causes = _causes(candidates, everything, verdict, claimed.errors)
    progress("looking for the experiment that would decide")
    steps = next_steps(verdict.kind, verdict.sets, causes, everything, floor)
    noise = bench_noise(everything, candidates.given)
    return Diagnosis(
        campaign=data.campaign.name,
        material=data.campaign.material,
        provenance=data.campaign.provenance.kind,
        seed=seed,
        excluded=candidates.excluded,
        gap=Gap(
            rmse_deg=rmse(everything, curves["plain"], everywhere),
            noise_floor_deg=floor,
            significant=verdict.kind != "no_gap",
            p_value=verdict.p_value,
            repeats=noise.spectrum.repeats > 0,
        ),
        where=Where(stage=_stages(verdict, candidates, everything, curves["plain"]), **located),
        causes=causes,
        kind=verdict.kind,
        sets=verdict.sets,
        next_experiment=in_words(steps) if verdict.kind in ("ambiguous", "unknown") else None,
        held_out_on=claimed.held.text,
        shrink=shrunk,
        offers=offers(everything),
        misses=misses(everything),
        findings=(
            *findings(stress, own, verdict),
            *drive_finding(candidates, everything, held),
            *filter(None, [noise.sentence()]),
        ),
        baselines={"smallest_bic": _smallest_bic(candidates), "commonest": [COMMONEST]},
        traces=_traces(everything, claimed.held, curves, final),
        model=model,
        next_steps=steps,
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
    candidates : Candidates
        Fits to the others.
    scored : list of Scored
        Explanations with their probabilities, `unknown` not counted.
    floor_deg : float
        The noise floor.
    """

    data: CampaignData
    everything: Evidence
    held: HeldOut
    candidates: Candidates
    scored: list[Scored]
    floor_deg: float


def examine(
    data: CampaignData,
    plain: Model,
    excluded: Sequence[str],
    rng: np.random.Generator,
    seed: int = 1,
    progress: Progress = _silent,
) -> Examined:
    """Fit and weigh every explanation; for the parameters see `diagnose`.

    `rng` chooses the trials that are held out, `seed` is of the fit that shows whether the model
    is the campaign's own.
    """
    if plain.signal == "pressure":
        data = _driven_by_pressure(data)
    # The model's u, whatever the campaign's own would be.
    campaign = replace(data.campaign, reference_kpa=plain.reference_kpa)
    data = replace(data, campaign=campaign)
    everything = collect(data)
    if everything.grid.command_kpa is None:
        excluded = (*excluded, *(n for n in IDS if LIBRARY[n].stage == "drive"))
    held = hold_out(everything, rng)
    evidence = replace(everything, takes_part=~held.trials)
    given = plain.transfer_function.as_array()
    own = _is_own(data, plain, seed)
    floor = noise_floor(everything)

    measured = "pressure and angle" if evidence.has_pressure else "angle"
    progress(f"fitting explanations of the {measured} to {evidence.takes_part.sum()} trials")
    candidates = consider(evidence, given, own, excluded)
    progress(
        f"weighing {len(candidates.angles)} fits of the angle, {len(candidates.drives)} of the "
        "pressure"
    )
    scored = _tested(weigh(candidates, floor), candidates, everything, held, floor)
    return Examined(data, everything, held, candidates, scored, floor)


def _driven_by_pressure(data: CampaignData) -> CampaignData:
    """Leave the command out: the model takes the measured pressure for what drives it."""
    if any(trial.pressure_kpa is None for trial in data.trials):
        raise BadInput(data.campaign.folder, "expected a pressure column: it drives the model")
    trials = tuple(replace(trial, command_kpa=None) for trial in data.trials)
    return replace(data, trials=trials)


def _is_own(data: CampaignData, plain: Model, seed: int) -> bool:
    """Whether the model was fitted to this very campaign: then it has bent with the gap."""
    from spa_fo.fractional import step_response
    from spa_fo.identify import fit_campaign

    if plain.campaign != data.campaign.name:
        return False
    signal = None if plain.signal == "command" else plain.signal
    try:
        fitted = fit_campaign(data, seed=seed, signal=signal, bootstrap=None).model
    except BadInput:
        return False
    t = np.linspace(0.05, 10.0, 60)
    one = step_response(t, *plain.transfer_function.as_array())
    other = step_response(t, *fitted.transfer_function.as_array())
    return bool(np.abs(one - other).max() < _SAME_MODEL * plain.transfer_function.gain)


def _tested(
    scored: list[Scored],
    candidates: Candidates,
    everything: Evidence,
    held: HeldOut,
    floor_deg: float,
) -> list[Scored]:
    """Leave out what does not beat the plain model.

    Neither on trials that took no part: where these hardly show the gap, as late trials do not show
    softening, it is enough to predict them as well as they repeat; a model that was fitted to this
    campaign has seen them, and is identified again without. Nor on all trials as it was given.
    """
    where = judged(everything, held)
    everywhere = np.ones_like(where)
    known = unseen = _plain(everything, candidates.given)
    if candidates.own:
        unseen = _plain(everything, candidates.angles[((), "own")].x)
    as_repeated = max(rmse(everything, unseen, where), _AS_REPEATED * floor_deg)
    limits = (as_repeated, rmse(everything, known, everywhere))
    kept, errors = scored, dict[Ids, tuple[float, float]]()
    # What inherits the probability of those that fail is tried in its turn.
    while untried := [
        s
        for s in kept
        if s.named
        and s.named not in errors
        and s.probability > _WORTH_TESTING
        and not _BY_CHANCE & set(s.named)
    ]:
        for s in untried:
            curve = simulate(s.explanation, everything)
            errors[s.named] = rmse(everything, curve, where), rmse(everything, curve, everywhere)
        kept = beating(scored, errors, limits)
    return kept


def _plain(everything: Evidence, x: Floats) -> Floats:
    """Predict all averaged samples by the plain model with coefficients `x`, deg."""
    return angle_chain(everything, x, None).run(x, absent())[0]


def _verdict(scored: Sequence[Scored], unknown: float) -> Verdict:
    none = sum(s.probability for s in scored if not s.named)
    significant = none * (1.0 - unknown) < _DOUBTED
    # A Bayes factor against no gap of k is met by chance at most once in k times (Ville 1939).
    prior_odds = 0.3 / 0.7
    factor = (1.0 - none) / max(none, 1e-300) * prior_odds
    p_value = float(min(1.0, 1.0 / max(factor, 1e-300)))
    if significant and none > 0.5:
        p_value = min(p_value, 1.0 - unknown)
    return judge(scored, unknown, p_value, significant)


def _chosen(verdict: Verdict) -> Explanation:
    """Return the most probable set that stands; the most probable of all where none does."""
    for s in verdict.scored:
        if verdict.sets and s.named == verdict.sets[0]:
            return s.explanation
    return verdict.best.explanation


def _stages(
    verdict: Verdict, candidates: Candidates, everything: Evidence, plain_deg: Floats
) -> dict[str, float]:
    """Share the gap out to stages: by what explains it, or else by where it is seen."""
    if verdict.kind in ("no_gap", "cause", "ambiguous"):
        return stage_shares(verdict)
    drive, whole = 0.0, everything.grid.angle_deg - plain_deg
    if everything.has_pressure:
        # With the measured pressure for the command, what vanishes was the drive's.
        chain = angle_chain(everything, candidates.given, everything.grid.pressure_kpa)
        driven, _ = chain.run(candidates.given, absent())
        drive = float(np.mean((driven - plain_deg) ** 2))
        whole = everything.grid.angle_deg - driven
    rest = float(np.mean(whole**2)) + 1e-9
    if verdict.sets:
        # Where a part is explained, that says more of what is not the drive's.
        shares = stage_shares(verdict)
        if not everything.has_pressure:
            return shares
        beyond = max(1.0 - shares["drive"], 1e-9)
        shares = {name: share / beyond * rest for name, share in shares.items()}
    else:
        sensor = 0.0
        if everything.fixture is not None:
            fixture = everything.fixture
            sensor = max(float(np.mean(fixture.deviation_deg**2 - fixture.sigma_deg**2)), 0.0)
        sensor = min(sensor, rest)
        shares = {"actuator": rest - sensor, "sensor": sensor, "acquisition": 0.0}
    shares["drive"] = drive
    total = sum(shares.values())
    return {stage: shares[stage] / total for stage in STAGES}


def _causes(
    candidates: Candidates,
    everything: Evidence,
    verdict: Verdict,
    errors: Mapping[Ids, float],
) -> tuple[Cause, ...]:
    certain, orders = 1.0 - verdict.unknown, everything.grid.orders
    causes = []
    for s in verdict.scored:
        e = s.explanation
        x = dict(zip(PARAMETERS, e.fit.x.tolist(), strict=True))
        causes.append(
            Cause(
                set=s.named or ("none",),
                probability=certain * s.probability,
                parameters={
                    name: own
                    for name, own in with_intervals(e, candidates.given, orders).items()
                    if name in s.named
                },
                transfer_function=x,
                held_out_rmse_deg=errors.get(s.named),
                leftover_deg=s.leftover_deg,
            )
        )
    known = {cause.set for cause in causes}
    if ("none",) not in known:
        causes.append(Cause(("none",), 0.0, {}, {}, held_out_rmse_deg=errors[()]))
    causes += [
        Cause((name,), 0.0, {}, {})
        for name in IDS
        if (name,) not in known and name not in candidates.excluded
    ]
    causes.append(Cause(("unknown",), verdict.unknown, {}, {}))
    total = sum(cause.probability for cause in causes)
    causes = [replace(cause, probability=cause.probability / total) for cause in causes]
    return tuple(sorted(causes, key=lambda cause: -cause.probability))


def _smallest_bic(candidates: Candidates) -> list[str]:
    """Name what the smallest Bayesian information criterion picks among single effects."""
    evidence = candidates.evidence
    used = evidence.used
    n = int(np.count_nonzero(used))
    best: tuple[float, Ids] = (np.inf, ())
    for (ids, level), fit in candidates.angles.items():
        if len(ids) > 1 or level != candidates.loose:
            continue
        missed = (evidence.grid.angle_deg - fit.explained_deg)[used]
        square = float(np.average(missed**2, weights=evidence.grid.counts[used]))
        score = n * np.log(square) + np.log(n) * (fit.searched.size)
        if score < best[0]:
            best = (score, ids)
    return list(best[1])


def _traces(
    evidence: Evidence, held: HeldOut, curves: Mapping[str, Floats], final: Explanation | None
) -> Traces:
    grid = evidence.grid
    command = np.full(grid.angle_deg.size, np.nan)
    if grid.command_kpa is not None:
        command = grid.step_means(grid.command_kpa)[grid.sample_step]
    fixture = evidence.fixture
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
        held_out=held.trials,
        fixture_angle_deg=empty if fixture is None else fixture.known_deg,
        fixture_deg=empty if fixture is None else fixture.deviation_deg,
        fixture_explained_deg=explained,
    )
