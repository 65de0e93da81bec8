"""What is said of an examined campaign: stages, causes with their parameters, curves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.answer.intervals import with_intervals
from spa_fo.gap.claim.claimed import Claim
from spa_fo.gap.data.evidence import angle_chain
from spa_fo.gap.decide.examine import Examined
from spa_fo.gap.decide.explanation import Explanation, explanation_of
from spa_fo.gap.decide.verdict import Verdict, stage_shares
from spa_fo.gap.diagnosis import Cause, Traces
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant import PARAMETERS
from spa_fo.plant.effects.effect import STAGES
from spa_fo.plant.effects.library import LIBRARY, absent

Floats = NDArray[np.float64]

_NOT_KNOWN = (
    "neither the pressure nor a calibration was logged: what is not explained may be anyone's"
)
_DRIVEN_BY_PRESSURE = (
    "the measured pressure drives the model and no calibration was logged: what is not explained "
    "may be the actuator's or the sensor's"
)


def p_value(verdict: Verdict) -> float:
    """Bound the probability of so much evidence by chance.

    A Bayes factor against no gap of k is met by chance at most once in k times (Ville 1939).
    """
    odds = (1.0 - SETTINGS.none) / SETTINGS.none
    factor = (1.0 - verdict.none) / max(verdict.none, 1e-300) / odds
    return float(min(1.0, 1.0 / max(factor, 1e-300)))


def stages(
    examined: Examined, verdict: Verdict, plain_deg: Floats
) -> tuple[dict[str, float] | None, str | None]:
    """Share the gap out to stages: by what explains it, or else by where it is seen."""
    everything = examined.everything
    if verdict.kind == "no_gap":
        return dict.fromkeys(STAGES, 0.0), None
    if verdict.kind in ("cause", "ambiguous"):
        return stage_shares(verdict), None
    if not everything.has_pressure and everything.fixture is None and not verdict.sets:
        by_command = everything.grid.command_kpa is not None
        return None, _NOT_KNOWN if by_command else _DRIVEN_BY_PRESSURE
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


def causes_of(examined: Examined, verdict: Verdict, claimed: Claim) -> tuple[Cause, ...]:
    """List every explanation considered with its parameters, the most probable first."""
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


def smallest_bic(examined: Examined) -> list[str]:
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


def traces_of(
    examined: Examined, curves: Mapping[str, Floats], final: Explanation | None
) -> Traces:
    """Collect the curves that figures are drawn of."""
    everything = examined.everything
    grid = everything.grid
    command = np.full(grid.angle_deg.size, np.nan)
    if grid.command_kpa is not None:
        command = grid.sampled(grid.command_kpa)
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
