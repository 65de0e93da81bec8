"""A campaign with every explanation of it fitted and weighed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence, angle_chain, collect, noise_floor, with_usual
from spa_fo.gap.data.hold_out import HeldOut, hold_out
from spa_fo.gap.decide.nominal import Nominal, check_driven, driven_by_pressure, with_nominal
from spa_fo.gap.decide.verdict import Verdict, with_unknown
from spa_fo.gap.decide.weigh import decide, evidence_of
from spa_fo.gap.fit.bench import bench_for
from spa_fo.gap.fit.coefficients import error_of, rise_s
from spa_fo.gap.fit.own_model import bent_odds, is_own, still_taken
from spa_fo.gap.noise.bench_noise import Beyond
from spa_fo.gap.noise.interference import NONE, fast_line, without_lines
from spa_fo.gap.search.drive import Drive, examine_drive
from spa_fo.gap.search.drive_by_angle import joined
from spa_fo.gap.search.explanations import Explanations, explain
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import Model
from spa_fo.plant.effects.library import LIBRARY, Ids, absent, at_port
from spa_fo.rig import CampaignData
from spa_fo.rig.dropouts import without_dropouts

Progress = Callable[[str], None]
_SURE = 100.0  # nats
_IDENTIFIED = "sampling"  # a key that an identification writes to its model


def silent(step: str) -> None:
    """Keep to oneself what is being done."""


@dataclass(frozen=True)
class Examined:
    """A campaign with every explanation of it fitted and weighed."""

    everything: Evidence  # all its trials; their data as the model sees them
    held: HeldOut  # trials that took no part
    given: Floats  # (5,), coefficients of the given model
    excluded: Ids  # effects that the library lacked
    drive: Drive | None  # what the measured pressure says
    found: Explanations  # fits of the angle to the trials that took part
    verdict: Verdict  # the answer, before it is held against the other trials
    floor_deg: float  # the noise floor
    # What stands for a command that is no pressure; the campaign then holds its pressure.
    nominal: Nominal | None = None
    own_odds: float = np.inf  # of an own model, where it is one by how well that explains all


def examine(
    data: CampaignData,
    plain: Model,
    excluded: Sequence[str],
    rng: np.random.Generator,
    progress: Progress = silent,
    beyond: Beyond | None = None,
    held: HeldOut | None = None,
) -> Examined:
    """Fit and weigh every explanation; for the parameters see `diagnose`.

    `rng` chooses the trials that are held out, where these are not given.
    """
    check_driven(plain, data)
    data = without_dropouts(data)
    by_command = data.campaign.command_is_pressure
    if plain.signal == "pressure" and by_command:
        data = driven_by_pressure(data)
    # The model's u, whatever the campaign's own would be.
    campaign = replace(data.campaign, reference_kpa=plain.reference_kpa)
    data = replace(data, campaign=campaign)
    everything, given = collect(data), plain.transfer_function.as_array()
    everything = replace(everything, rise_s=rise_s(given, everything.horizon_s))
    excluded, missed_deg = tuple(excluded), None
    if by_command and beyond is None:
        plain_deg = angle_chain(everything, given, None).run(given, absent())[0]
        missed_deg = everything.grid.angle_deg - plain_deg
    if held is None:
        held = hold_out(everything, rng, missed_deg)
    fast = NONE
    # What a reference lets expect holds its own interference.
    if beyond is None or at_port("line") not in excluded:
        fast = fast_line(replace(everything, takes_part=~held.trials))
    if beyond is None:
        everything = without_lines(everything)
        data = everything.data
    line_deg, step_deg = everything.line_deg, everything.step_deg
    nominal = drive = pressure = expected_kpa = None
    if beyond is not None:
        pressure, expected_kpa = beyond.pressure, beyond.pressure_kpa
    if not by_command:
        progress("identifying the drive from command and pressure")
        nominal, drive, everything = with_nominal(data, everything, held, excluded, given)
        expected_kpa = nominal.fit.left_out_kpa
    if beyond is not None and beyond.usual:
        everything = with_usual(everything, beyond.usual, given, beyond.read_deg)
    if everything.grid.command_kpa is None:
        drives = [n for n in LIBRARY if LIBRARY[n].stage == "drive" and n not in excluded]
        excluded = (*excluded, *drives)
    everything = replace(everything, line_deg=line_deg, step_deg=step_deg)
    evidence = replace(everything, takes_part=~held.trials)
    progress(f"explaining {evidence.takes_part.sum()} trials")
    if evidence.has_pressure and drive is None:
        drive = examine_drive(evidence, excluded, given, pressure)
    own = plain.campaign == campaign.name and _IDENTIFIED in plain.extra
    taken = 1.0
    if beyond is None and not own:
        taken = still_taken(everything, given)
        own = is_own(taken)
    # What a model misses of its reference is expected beside it already.
    error_deg = error_of(plain) if beyond is None else 0.0

    pressed = drive

    def explained(own: bool) -> tuple[Explanations, Drive | None]:
        def by(drive: Drive | None) -> Explanations:
            kpa = None if drive is None else drive.pressure_kpa
            return explain(bench_for(evidence, given, own, kpa, beyond, error_deg), excluded)

        found = by(pressed)
        if pressed is None:
            return found, None
        drive = joined(pressed, found)
        same = np.array_equal(drive.pressure_kpa, pressed.pressure_kpa)
        return (found if same else by(drive)), drive

    found, drive = explained(own)
    noise = found.bench.noise
    grid = everything.grid
    floor = noise_floor(everything, noise.moved_deg(grid.sample_trial, grid.angle_deg))
    if not noise.spectrum.repeats:
        floor = noise.floor_deg(everything.grid.angle_deg)
    if beyond is not None:
        floor = beyond.floor_deg(everything)
    progress(f"weighing {len(found.fits)} explanations")
    drive_floor = None
    if drive is not None and expected_kpa is not None:
        drive_floor = expected_kpa * drive.per_kpa_deg
    verdict = decide(found, drive, fast, evidence, floor, drive_floor)
    odds = np.inf
    if (
        beyond is None
        and not own
        and plain.campaign == campaign.name
        and _may_be_bent(verdict, pressed)
    ):
        progress("once more, as if the model had been fitted to this campaign")
        again, its_drive = explained(own=True)
        bent = bent_odds(taken) * _better(again, found, floor)
        if any(map(_shifts_beside, verdict.sets[:1])):
            # It costs so much as it mostly makes up for a bent model, which is the other way here.
            bent *= SETTINGS.shift_beside
        said = decide(again, its_drive, fast, evidence, floor, drive_floor)
        # A model that was fitted to a campaign without any cause would not miss it.
        if bent > 1.0 and said.kind != "no_gap":
            found, drive, odds = again, its_drive, bent
            # The other way is no explanation that stands, but it may be the right one.
            verdict = with_unknown(said, 1.0 / odds)
    return Examined(everything, held, given, excluded, drive, found, verdict, floor, nominal, odds)


def _may_be_bent(verdict: Verdict, drive: Drive | None) -> bool:
    """Say whether the given model may have been fitted to the gap itself, and have bent with it.

    Then its own coefficients, or something else beside the cause, make up for that, or nothing
    explains what is left. What the pressure tells of the drive it tells whatever the model is.
    """

    def makes_up(ids: Ids) -> bool:
        others = [n for n in ids if drive is None or LIBRARY[n].stage != "drive"]
        return len(others) > 1 or _shifts_beside(ids)

    return verdict.kind == "unknown" or any(map(makes_up, verdict.sets))


def _shifts_beside(ids: Ids) -> bool:
    """Say whether a set holds a shift of the parameters beside something."""
    return at_port("coefficients") in ids and len(ids) > 1


def _better(own: Explanations, known: Explanations, floor_deg: float) -> float:
    """Say by how many times better a model of this campaign's own explains it than any other.

    What the model tells is among the rows of the one, and comes to the other as if any usual
    actuator had been identified.
    """
    bench = known.bench
    told = SETTINGS.temper * bench.coefficients.untempered().log_evidence(bench.centre)
    nats = evidence_of(own, floor_deg) + told - evidence_of(known, floor_deg)
    return float(np.exp(min(nats, _SURE)))
