"""What is said of an examined campaign: stages, causes with their parameters, curves."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, replace

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.answer.intervals import with_intervals
from spa_fo.gap.claim.claimed import CLEARLY, Claim
from spa_fo.gap.data.evidence import angle_chain
from spa_fo.gap.decide.examine import Examined
from spa_fo.gap.decide.explanation import Explanation, explanation_of
from spa_fo.gap.decide.verdict import Scored, StagesOf, Verdict, said, stage_shares
from spa_fo.gap.diagnosis import Cause, Traces
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import PARAMETERS
from spa_fo.plant.effects.effect import STAGES, Effect, Stage
from spa_fo.plant.effects.library import LIBRARY, Ids, absent, acts_like, at_port
from spa_fo.plant.grid import CampaignGrid

_NOT_KNOWN = (
    "neither the pressure nor a calibration was logged: what is not explained may be anyone's"
)
_DRIVEN_BY_PRESSURE = (
    "the measured pressure drives the model and no calibration was logged: what is not explained "
    "may be the actuator's or the sensor's"
)
_NO_CALIBRATION = (
    "assumed: no calibration was logged, and without one what changed in the sensor looks as if it "
    "were in the actuator"
)
_BENT = 0.5  # of the farthest that it is expected to bend: a sensor has read some of it. Assumed.
_EVENLY = "; a named part that either does alike is shared evenly"


@dataclass(frozen=True)
class StageShares:
    """What of a gap arises in each stage, as `Where` holds it."""

    stage: Mapping[str, float] | None
    not_known: str | None = None
    assumed: str | None = None


def p_value(verdict: Verdict, compared: bool = False) -> float:
    """Bound the probability of so much evidence by chance; `compared` with another campaign.

    A Bayes factor against no gap of k is met by chance at most once in k times (Ville 1939).
    """
    odds = (1.0 - SETTINGS.none) / SETTINGS.none / (1.0 if compared else SETTINGS.nothing)
    return float(min(1.0, odds * verdict.none / max(1.0 - verdict.none, 1e-300)))


def stages(
    examined: Examined,
    verdict: Verdict,
    first: Verdict,
    plain_deg: Floats,
    expected: Floats | None = None,
    closed: float = 0.0,
) -> StageShares:
    """Share the gap out to stages: by what explains it, or else by where it is seen.

    `first` says how probable each explanation was before what tells nothing of where; `expected`,
    (n,), is the variance of what is no change between two campaigns: the less of it the more a
    sample says. `closed` is what a part that is named is known to close of what changed: what it
    stands in for is there, too.
    """
    everything = examined.everything
    no_gap = np.zeros(plain_deg.size) if expected is None else expected
    weights = None if expected is None else everything.grid.counts / expected**2

    def excess(left_deg: Floats) -> float:
        return max(float(np.average(left_deg**2 - no_gap, weights=weights)), 0.0)

    grid, fixture = everything.grid, everything.fixture
    if verdict.kind == "no_gap":
        return StageShares(dict.fromkeys(STAGES, 0.0))
    uncalibrated = expected is not None and fixture is None
    stages_of = _uncalibrated(grid, plain_deg, no_gap) if uncalibrated else None
    known, evenly = _named(verdict, stages_of)
    by_command = grid.command_kpa is not None and not everything.has_pressure
    if verdict.kind != "unknown" or (verdict.sets and by_command):
        return StageShares(known, assumed=_NO_CALIBRATION + evenly if evenly else None)
    drive, rest_deg = 0.0, grid.angle_deg - plain_deg
    if everything.has_pressure:
        # With the measured pressure for the command, what vanishes was the drive's.
        chain = angle_chain(everything, examined.given, grid.pressure_kpa)
        driven, _ = chain.run(examined.given, absent())
        drive = float(np.average((driven - plain_deg) ** 2, weights=weights))
        rest_deg = grid.angle_deg - driven
    elif fixture is None and not verdict.sets and by_command:
        return StageShares(None, not_known=_NOT_KNOWN)
    elif fixture is None and not verdict.sets and expected is None:
        return StageShares(None, not_known=_DRIVEN_BY_PRESSURE)
    rest, sensor = excess(rest_deg) + 1e-9, 0.0
    if fixture is not None:
        misread = float(np.mean(fixture.deviation_deg**2 - fixture.sigma_deg**2))
        sensor = min(max(misread, 0.0), rest)
    # What nothing shows elsewhere counts as the actuator's; an interference was taken off.
    hum = everything.line_deg**2 if at_port("line") in examined.excluded else 0.0
    squares = {"actuator": rest - sensor, "sensor": sensor, "acquisition": hum}
    if verdict.sets:
        # A part that is explained says of what is not the drive's as much as it was probable, if
        # there is a gap. What made it doubtful since does the same (a rare effect), or says nothing
        # of where (a gap is there after all, or is hardly larger than expected); but where left-out
        # trials refuted an explanation, it counts as unknown.
        beyond = max(1.0 - known["drive"], 1e-9)
        weight = _stood(first, {one.named for one in verdict.scored if one.probability})
        weight = max(weight, min(closed, 1.0))
        for stage in squares:
            own = known[stage] / beyond * rest
            squares[stage] += weight * (own - squares[stage])
    squares["drive"] = drive
    total = sum(squares.values())
    shares: dict[str, float] = {stage: squares[stage] / total for stage in STAGES}
    return StageShares(shares, assumed=_NO_CALIBRATION + evenly if fixture is None else None)


def _named(verdict: Verdict, stages_of: StagesOf | None) -> tuple[Mapping[str, float], str]:
    """Share out what is named, to all stages that a part may be in, and say if that is so."""
    own = stage_shares(verdict)
    shared = own if stages_of is None else stage_shares(verdict, stages_of)
    return shared, _EVENLY if shared != own else ""


def _uncalibrated(grid: CampaignGrid, plain_deg: Floats, expected: Floats) -> StagesOf:
    """Say in which stages a part of a change may be where no calibration was logged.

    Whether it is the sensor's or the actuator's that acts alike is taken to be even. So it is of a
    sensor that came off, if nothing that it read before shows that it was sound then.
    """

    def stages_of(one: Scored, name: str) -> tuple[Stage, ...]:
        effect = LIBRARY[name]
        if effect.stage != "sensor":
            return (effect.stage,)
        either = acts_like(name, "actuator")
        if effect.moment is not None and not either:
            fitted = one.angle.effects[effect.slots]
            either = not _sound_before(effect, fitted, grid, plain_deg, expected)
        return ("sensor", "actuator") if either else ("sensor",)

    return stages_of


def _sound_before(
    effect: Effect, parameters: Floats, grid: CampaignGrid, plain_deg: Floats, expected: Floats
) -> bool:
    """Say whether a sensor is known to have been sound before the moment of its effect.

    The actuator had bent before it so far that the effect would have shown clearly, had it been
    there from the start, and what was read differed from what is expected by less than half of it.
    """
    assert effect.moment is not None
    assert effect.act is not None
    time_s = grid.middle_s[grid.sample_step] - grid.middle_s[0]
    throughout = parameters.copy()
    throughout[effect.moment] = effect.parameters[effect.moment].low
    off = np.asarray(effect.act(plain_deg, time_s, *throughout)) - plain_deg
    before = time_s < parameters[effect.moment] * time_s[-1]
    moved = np.abs(plain_deg - plain_deg[0])
    clear = (moved >= _BENT * moved.max()) & (np.abs(off) > CLEARLY * np.sqrt(expected))
    if not np.any(before & clear):
        return False
    weights = grid.counts / expected * before
    read = grid.angle_deg - plain_deg
    return bool(np.sum(weights * read**2) < 0.25 * np.sum(weights * off**2))


def _stood(first: Verdict, standing: Container[Ids]) -> float:
    """How probable, if there is a gap, what still stands was at first."""
    explained = sum(s.probability for s in first.scored if s.named and s.named in standing)
    return float(min(explained / max(1.0 - first.none, 1e-9), 1.0))


def causes_of(examined: Examined, verdict: Verdict, claimed: Claim) -> tuple[Cause, ...]:
    """List every explanation considered with its parameters, the most probable first."""
    orders, line_deg = examined.everything.grid.orders, examined.everything.line_deg
    # An interference that was taken off is in every error that is reported.
    errors = {ids: float(np.hypot(error, line_deg)) for ids, error in claimed.errors.items()}
    causes: dict[Ids, Cause] = {}
    probabilities, unknown = said(verdict)
    for s in verdict.scored:
        explanation = explanation_of(s, s.angle, s.drive)
        named = s.named or ("none",)
        causes[named] = Cause(
            set=named,
            probability=probabilities.get(s.named, 0.0),
            parameters=with_intervals(explanation, examined.given, orders),
            transfer_function=_by_name(explanation.x),
            held_out_rmse_deg=errors.get(s.named),
            leftover_deg=s.left_deg,
        )
    plain = _by_name(examined.found.plain.x)
    for cause in (
        Cause(("none",), probabilities[()], {}, plain, errors.get(())),
        *(Cause((name,), 0.0, {}, {}) for name in LIBRARY if name not in examined.excluded),
        Cause(("unknown",), unknown, {}, {}),
    ):
        causes.setdefault(cause.set, cause)
    total = sum(cause.probability for cause in causes.values())
    normed = [replace(each, probability=each.probability / total) for each in causes.values()]
    return tuple(sorted(normed, key=lambda cause: -cause.probability))


def _by_name(x: Floats) -> dict[str, float]:
    return dict(zip(PARAMETERS, x.tolist(), strict=True))


def smallest_bic(examined: Examined) -> list[str]:
    """Name what the smallest Bayesian information criterion picks among single effects."""
    bench, fits = examined.found.bench, examined.found.fits
    used, grid = bench.evidence.used, bench.evidence.grid
    n = int(np.count_nonzero(used))

    def criterion(ids: Ids) -> float:
        missed = (grid.angle_deg - fits[ids].shared_deg)[used]
        square = np.average(missed**2, weights=grid.counts[used])
        return float(n * np.log(square) + np.log(n) * fits[ids].z.size)

    allowed = [ids for ids in fits if len(ids) < 2 and not set(ids) & set(examined.excluded)]
    best = min(allowed, key=criterion)
    return list(best)


def traces_of(
    examined: Examined, curves: Mapping[str, Floats], final: Explanation | None
) -> Traces:
    """Collect the curves that figures are drawn of."""
    grid, fixture = examined.everything.grid, examined.everything.fixture
    command = np.full(grid.angle_deg.size, np.nan)
    if grid.command_kpa is not None:
        command = grid.sampled(grid.command_kpa)
    drive = None if final is None else final.drive
    known = deviation = explained = np.zeros(0)
    if fixture is not None:
        known, deviation = fixture.known_deg, fixture.deviation_deg
        explained, _ = fixture.simulate(absent() if final is None else final.in_fixture())
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
        drive_kpa=None if drive is None else drive.predicted_kpa,
        held_out=examined.held.trials,
        fixture_angle_deg=known,
        fixture_deg=deviation,
        fixture_explained_deg=explained,
    )
