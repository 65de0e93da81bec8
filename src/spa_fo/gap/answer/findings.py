"""What to say of a campaign and of its diagnosis besides the verdict: sentences for the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from spa_fo.gap.claim.claimed import LIKELY
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.data.hold_out import HeldOut, judged
from spa_fo.gap.decide.verdict import Verdict
from spa_fo.gap.fit.pressure import MOST_LAG_S
from spa_fo.gap.search.drive import QUICK_S, Drive
from spa_fo.plant.effects.library import LIBRARY, at_port

MISSING = {
    "pressure": "measured pressure: without it drive and actuator cannot be told apart",
    "command": "the command: the pressure drives the model, and the drive is not diagnosed",
    "release": "release: hysteresis, backlash and creep hardly show in up-steps",
    "levels": "a staircase or triangle: effects of amplitude and direction show there",
    "hold": "a long hold: creep, leak and droop show there",
    "later calibration": "a calibration afterwards: slip and drift of the sensor",
    "calibration": "a calibration log: the sensor cannot be told from the actuator",
    "repeats": "repeated trials: without them the noise floor is that of single samples",
    "order": "interleaved order: drift and amplitude are confounded in blocks",
}
"""Evidence that a campaign may lack, and what for."""

_MANY = 100  # to one, beyond which odds say no more
_PRESSURE_EXPLAINED = 0.7  # of what the command misses: more left is nothing worth saying


def offers(evidence: Evidence) -> tuple[str, ...]:
    """Say what a campaign holds that tells causes apart."""
    trials = evidence.grid.trials
    protocols = dict.fromkeys(trial.protocol for trial in trials)
    by_pressure = evidence.grid.measured_kpa is not None and not evidence.has_pressure
    held = {
        f"{len(trials)} trials: {', '.join(protocols)}": True,
        "measured pressure, which tells the drive from the actuator": evidence.has_pressure,
        "measured pressure, which drives the model": by_pressure,
        "calibrations before and after, which show the sensor's own drift": (
            len(evidence.data.calibrations) > 1
        ),
        "calibration dwells, which show the sensor's own lag, creep and hysteresis": (
            evidence.fixture is not None
        ),
    }
    return tuple(words for words, holds in held.items() if holds)


def lacking(evidence: Evidence) -> tuple[str, ...]:
    """Name what a campaign lacks that would tell causes apart, by the names of `MISSING`."""
    trials = evidence.grid.trials
    protocols = {trial.protocol for trial in trials}
    orders = [trial.experiment for trial in trials]
    blocks = sum(a != b for a, b in pairwise(orders)) + 1
    absent = {
        "pressure": evidence.grid.measured_kpa is None,
        "command": evidence.grid.measured_kpa is not None and not evidence.has_pressure,
        "release": protocols <= {"step"},
        "levels": not protocols & {"staircase", "triangle", "free"},
        "hold": "hold" not in protocols,
        "later calibration": len(evidence.data.calibrations) < 2,
        "calibration": evidence.fixture is None,
        "repeats": np.unique(evidence.alike).size == len(trials),
        "order": 1 < blocks == len(set(orders)),
    }
    return tuple(name for name in MISSING if absent[name])


def misses(evidence: Evidence, commanded: bool = False) -> tuple[str, ...]:
    """Say what a campaign lacks that would tell causes apart.

    `commanded` says that a command was logged, though it is no pressure.
    """
    absent = [name for name in lacking(evidence) if not (commanded and name == "command")]
    return tuple(MISSING[name] for name in absent)


def drive_finding(drive: Drive | None, everything: Evidence, held: HeldOut) -> tuple[str, ...]:
    """Say what the measured pressure tells of the drive, whatever the angle says."""
    wanders: tuple[str, ...] = ()
    if drive is not None and not drive.is_ordinary:
        wanders = (
            f"The pressure of repeated trials differs by {100.0 * drive.wander:.2g} % of the "
            "command: more than a regulator lets it.",
        )
    if drive is None or not drive.best.ids:
        return wanders
    fit, where = drive.best, judged(everything, held)
    before, after = (
        float(np.sqrt(np.mean(each.residual_kpa[where] ** 2))) for each in (drive.fits[()], fit)
    )
    if after > _PRESSURE_EXPLAINED * before:
        return wanders
    effects = []
    for name in fit.ids:
        values = zip(LIBRARY[name].parameters, fit.effects[LIBRARY[name].slots], strict=True)
        effects.append(f"{name} ({', '.join(f'{p.name} {value:.3g}' for p, value in values)})")
    tried_on = ", on held-out trials," if held.trials.any() else ""
    lag_s = float(fit.z[-1])
    late = f", beside a lag of its sensor by {lag_s:.2g} s," if lag_s > QUICK_S else ""
    if lag_s >= 0.99 * MOST_LAG_S:
        late = f", beside a lag by {lag_s:.2g} s, as much as counts as its sensor's,"
    return (
        *wanders,
        f"The measured pressure by itself: {' + '.join(effects)}{late} reduces its RMS deviation "
        f"from the command{tried_on} from {before:.3g} to {after:.3g} kPa.",
    )


def line_finding(everything: Evidence, excluded: Sequence[str]) -> tuple[str, ...]:
    """Say that the readings hold an interference where the library lacks its cause."""
    if at_port("line") not in excluded or everything.line_deg <= 0.0:
        return ()
    size = f"{everything.line_deg:.2g}°"
    return (f"The readings hold an interference of {size} RMS, for which the library has no name.",)


def findings(
    verdict: Verdict, own: bool, repeats: bool, floor_deg: float, own_odds: float = math.inf
) -> tuple[str, ...]:
    """Say how sure the answer is, given the noise floor.

    `own` says that the model was fitted to this campaign, with these odds; `repeats` that some
    experiment was run more than once.
    """
    found = []
    named = [s for s in verdict.scored if s.named]
    if verdict.kind == "unknown" and not verdict.sets:
        if named and named[0].probability >= LIKELY:  # tried, and not refuted
            which = " + ".join(named[0].named)
            found.append(
                f"What comes nearest, {which}, is clearly less probable than an unknown cause."
            )
        else:
            found.append("No explanation of the library holds on the held-out trials.")
    elif verdict.kind != "no_gap" and named:
        left = named[0].left_deg
        found.append(
            f"The best explanation leaves a systematic residual of {left:.2g}°, "
            f"{left / max(floor_deg, 1e-9):.2g} noise floors."
        )
    if verdict.kind == "unknown":
        where = "the drive" if verdict.unknown_drive > 0.5 else "actuator, sensor or log"
        found.append(f"The unexplained part is most probably in {where}.")
    if not repeats:
        found.append(
            "No experiment was repeated: coloured noise cannot be told from a systematic residual, "
            "and the noise floor is that of the noise model."
        )
    if own:
        found.append(
            f"The model was {_surely(own_odds)}fitted to this campaign, so its coefficients have "
            "absorbed part of the gap: they are free in every explanation; a shift of parameters "
            "is not identifiable."
        )
    return tuple(found)


def _surely(odds: float) -> str:
    """Say how sure it is that a model was fitted to a campaign, where its file does not say it."""
    if math.isinf(odds):
        return ""
    many = f"{odds:.2g}" if odds < _MANY else f"more than {_MANY}"
    return f"probably ({many} to 1, as it explains the campaign better) "
