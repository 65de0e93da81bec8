"""What changed between two campaigns whose logs hold no angle: the drive, or nothing.

As with an angle, what the drive always does to a command is learned on the reference and taken off
the measured pressure. What is left is given to the effects of the drive.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.blas import one_blas_thread
from spa_fo.compare.compare import Comparison
from spa_fo.compare.drive_law import know_drive, shows_drive
from spa_fo.errors import BadInput
from spa_fo.gap.answer.findings import drive_finding
from spa_fo.gap.answer.intervals import drive_intervals
from spa_fo.gap.answer.locate import shares
from spa_fo.gap.claim.claimed import CLEARLY
from spa_fo.gap.data.evidence import Evidence, collect
from spa_fo.gap.data.hold_out import HeldOut, hold_out, judged, rmse
from spa_fo.gap.decide.examine import silent
from spa_fo.gap.decide.verdict import chosen
from spa_fo.gap.decide.weigh import decide_drive
from spa_fo.gap.diagnosis import Cause, Diagnosis, Gap, Step, Traces, Where
from spa_fo.gap.fit.pressure import resolution
from spa_fo.gap.search.drive import Drive, DriveFit, examine_drive
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import Model, TransferFunction
from spa_fo.plant.effects.effect import STAGES
from spa_fo.plant.effects.library import COMMONEST, LIBRARY, Ids
from spa_fo.rig import CampaignData

Progress = Callable[[str], None]

_QUICK = (1.9, 0.9, 20.0, 100.0)  # of what stands for an actuator: it follows in 0.2 s
_NO_ANGLE = "no angle was logged: actuator and sensor are not seen"
_LOG_IT = Step("log the angle as well", "the actuator and the sensor may have changed unseen")


@one_blas_thread
def compare_pressure(
    reference: CampaignData,
    data: CampaignData,
    *,
    excluded: Sequence[str] = (),
    seed: int = 1,
    progress: Progress = silent,
) -> Comparison:
    """Say what changed in the drive, by command and measured pressure alone.

    Parameters
    ----------
    reference, data : CampaignData
        How it was, and how it is.
    excluded : sequence of str
        Effects that the library is to lack.
    seed : int
        Of the trials that are held out.
    progress : callable
        Told of each step in words.

    Returns
    -------
    Comparison
        What it says in degrees is in kPa.

    Raises
    ------
    BadInput
        A log lacks the command or the pressure.
    """
    for each in (reference, data):
        for trial in each.trials:
            if not shows_drive(trial):
                raise BadInput(
                    each.campaign.folder,
                    "holds no angle; expected a command and a pressure column, to compare the "
                    "drive by",
                    trial.label,
                )
    progress(f"learning what the drive does in {len(reference.trials)} trials of the reference")
    known = know_drive(reference, data)
    evidence = _pressure_for_angle(collect(replace(data, trials=known.trials)))
    held = hold_out(evidence, np.random.default_rng(seed))
    read = max(resolution(evidence) / np.sqrt(12.0), evidence.pressure_noise_kpa)
    expected_kpa = float(np.hypot(known.expected_kpa, read))
    fitted = replace(evidence, takes_part=~held.trials)
    progress(f"explaining {fitted.takes_part.sum()} trials")
    x = _stand_in(data)
    drive = examine_drive(fitted, excluded, x.transfer_function.as_array(), known.spectrum)
    drive = drive.by_itself()
    change = _said(evidence, held, drive, x, tuple(excluded), expected_kpa, seed)
    return Comparison(reference, data, change, None, known.law, known.common, known.unvisited, None)


def _pressure_for_angle(evidence: Evidence) -> Evidence:
    """Let the measured pressure stand where figures and errors look for the angle."""
    assert evidence.grid.measured_kpa is not None
    grid = replace(evidence.grid, angle_deg=evidence.grid.measured_kpa)
    noise = evidence.pressure_noise_kpa
    return replace(evidence, grid=grid, noise_deg=noise, variance=noise**2 / grid.counts)


def _stand_in(data: CampaignData) -> Model:
    """Let something quick that turns a kPa into a degree stand for the actuator."""
    campaign = data.campaign
    gain = _QUICK[-1] * float(np.radians(campaign.reference_kpa))
    curve = TransferFunction.from_array(np.array([*_QUICK, gain]))
    return Model(campaign.name, campaign.material, curve, campaign.reference_kpa)


def _said(
    evidence: Evidence,
    held: HeldOut,
    drive: Drive,
    model: Model,
    excluded: Ids,
    expected_kpa: float,
    seed: int,
) -> Diagnosis:
    grid, campaign = evidence.grid, evidence.data.campaign
    assert grid.command_kpa is not None
    command = grid.sampled(grid.command_kpa)
    weighed, fits, unknown = decide_drive(drive, evidence, expected_kpa)
    where = judged(evidence, held)
    errors = {ids: _error(evidence, fit, where) for ids, fit in fits.items() if ids}
    errors[()] = rmse(evidence, command, where)
    everywhere = np.ones(command.size, dtype=bool)
    gap_kpa = rmse(evidence, command, everywhere)
    weighed, unknown = _held_to(weighed, unknown, errors, gap_kpa > CLEARLY * expected_kpa)
    ranked = sorted(weighed.items(), key=lambda item: -item[1])
    kind, sets = chosen(ranked, unknown)
    sets = tuple(ids for ids in sets if weighed[ids] > 0.0)
    first = fits[sets[0]] if sets else None
    located = shares(evidence, grid.angle_deg - command, command)
    left = sorted(set(LIBRARY) - {n for ids in weighed for n in ids} - set(excluded))
    none = weighed.get((), 0.0)
    causes = (
        *(
            Cause(
                ids or ("none",),
                probability,
                drive_intervals(fits[ids]) if ids else {},
                {},
                held_out_rmse_deg=errors.get(ids),
            )
            for ids, probability in ranked
        ),
        *(Cause(("none",), 0.0, {}, {}) for _ in range(() not in weighed)),
        *(Cause((name,), 0.0, {}, {}) for name in left if LIBRARY[name].stage == "drive"),
        Cause(("unknown",), unknown, {}, {}),
    )
    return Diagnosis(
        campaign=campaign.name,
        material=campaign.material,
        provenance=campaign.provenance.kind,
        seed=seed,
        excluded=excluded,
        gap=Gap(
            rmse_deg=gap_kpa,
            noise_floor_deg=expected_kpa,
            significant=kind != "no_gap",
            p_value=_p_value(none),
            repeats=True,
        ),
        where=Where(
            stage={stage: float(stage == "drive" and kind != "no_gap") for stage in STAGES},
            phase=located["phase"],
            amplitude={},
            direction={},
            trial=located["trial"],
            frequency=located["frequency"],
        ),
        causes=tuple(sorted(causes, key=lambda cause: -cause.probability)),
        kind=kind,
        sets=sets,
        next_experiment=_LOG_IT.text if kind in ("ambiguous", "unknown") else None,
        held_out_on=held.text,
        shrink=None,
        offers=(),
        misses=(_NO_ANGLE,),
        findings=(f"{_NO_ANGLE.capitalize()}.", *drive_finding(drive, evidence, held)),
        baselines={"commonest": [COMMONEST]},
        traces=_traces(evidence, held, command, first),
        model=model,
        next_steps=() if kind == "no_gap" else (_LOG_IT,),
    )


def _error(evidence: Evidence, fit: DriveFit, where: NDArray[np.bool_]) -> float:
    return rmse(evidence, evidence.grid.angle_deg - fit.residual_kpa, where)


def _held_to(
    weighed: dict[Ids, float], unknown: float, errors: dict[Ids, float], clearly: bool
) -> tuple[dict[Ids, float], float]:
    """Hold probabilities against the held-out trials.

    `clearly` says whether the gap is far beyond what is missed of the reference.
    """
    found = dict(weighed)
    for ids, error in errors.items():
        closed = 1.0 - (error / max(errors[()], 1e-12)) ** 2
        if ids and not (clearly and closed >= SETTINGS.worth):
            unknown += found[ids]
            found[ids] = 0.0
    total = sum(found.values()) + unknown
    if clearly and found.get((), 0.0) >= 0.5 * total:
        unknown += found[()]
        found[()] = 0.0
    return {ids: p / total for ids, p in found.items()}, unknown / total


def _p_value(none: float) -> float:
    odds = (1.0 - SETTINGS.none) / SETTINGS.none
    return float(min(1.0, none / max(1.0 - none, 1e-300) * odds))


def _traces(evidence: Evidence, held: HeldOut, command: Floats, fit: DriveFit | None) -> Traces:
    grid, empty = evidence.grid, np.zeros(0)
    return Traces(
        experiment=tuple(trial.experiment for trial in grid.trials),
        label=tuple(trial.label for trial in grid.trials),
        trial=grid.sample_trial,
        time_s=grid.time_s,
        command_kpa=command,
        measured_deg=grid.angle_deg,
        plain_deg=command,
        explained_deg=command if fit is None else grid.angle_deg - fit.residual_kpa,
        refit_deg=command,
        pressure_kpa=grid.measured_kpa,
        drive_kpa=None if fit is None else fit.predicted_kpa,
        held_out=held.trials,
        fixture_angle_deg=empty,
        fixture_deg=empty,
        fixture_explained_deg=empty,
    )
