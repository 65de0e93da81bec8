"""From fitted explanations to probabilities, and from these to an answer, or to none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
from scipy.special import expit, logsumexp

from spa_fo.gap.data.evidence import Evidence, modelled_pressure
from spa_fo.gap.decide.part import (
    Part,
    Sizes,
    least_of,
    missing_none,
    parts_of,
    stands_in,
    with_one_more,
)
from spa_fo.gap.decide.verdict import Scored, Verdict, judge
from spa_fo.gap.fit.bench import SHARES
from spa_fo.gap.noise.interference import Line
from spa_fo.gap.prior import log_prior
from spa_fo.gap.search.drive import Drive, DriveFit, rms_of
from spa_fo.gap.search.explanations import Explanations
from spa_fo.gap.search.fitted import Fitted, price
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY, Ids, at_port, ordered

_LEAST_TOTAL = 1e-300
_BOTH = float(np.sqrt(2.0))  # what is missed anyway and a change as large add up to this


def _of_angle(found: Explanations, floor_deg: float) -> list[Part]:
    s, bench = SETTINGS, found.bench
    repeats, weight = bench.noise.spectrum.repeats > 0, bench.evidence.grid.counts
    parts: list[Part] = []

    def apart(one: Fitted, other: Ids) -> float:
        # No prediction holds waves: such as count are not done without.
        waves = at_port("line", one.ids)
        waved = waves is not None and one.moved_deg[waves] >= least_of(waves, s.no_gap * floor_deg)
        if other not in found.fits or (waved and waves not in other):
            return float("inf")
        change = one.shared_deg - found.fits[other].shared_deg
        return float(np.sqrt(np.average(change**2, weights=weight)))

    def worth(ids: Ids) -> float:
        return float(found.fits[ids].logs.max()) if ids in found.fits else -np.inf

    for ids, f in found.fits.items():
        if not np.isfinite(f.logs).all():
            continue
        if set(ids) & set(found.excluded):
            beyond = s.temper * float(f.logs.max()) + stands_in()
            parts.append(Part(ids, -np.inf, np.array([beyond]), f, {}, 0.0))
            continue
        logs, own = f.logs - price(f), partial(apart, f)
        all_deg, least_deg = min(own(()), 1e6), s.no_gap * floor_deg
        sizes = Sizes(
            all_deg,
            bench.gap_deg,
            f.left_deg,
            floor_deg,
            least_deg,
            s.left * floor_deg,
            s.right_share,
        )
        for part in parts_of(f, logs, f.moved_deg, own, worth, sizes, repeats):
            if at_port("zeros", part.named):
                part = replace(part, right=part.right + _stays(found, f, floor_deg))
            if f.trend_deg > s.no_gap * floor_deg:
                # What goes with the trials' order is left, too: an unknown effect beside a set.
                beside = s.temper * (float(logs.max()) + f.trend_nats) + with_one_more(part.named)
                odds = 2.0 if part.named else 1.0  # it is unknown, and it is beside something
                beside += odds * float(np.log(s.unknown)) + missing_none(s.right_share)
                part = replace(part, unknown=np.append(part.unknown, beside))
            parts.append(part)
    return parts


def _stays(found: Explanations, fitted: Fitted, floor_deg: float) -> float:
    """Log odds of a zero that moves before the first trial and never again, where it does.

    A sensor that slips once does so before any of the trials; but whatever moves the angle at rest
    does so from the first one on.
    """
    zeros, least_deg = fitted.zeros_deg, SETTINGS.no_gap * floor_deg
    stays = not found.bench.noise.compared and np.std(zeros) < least_deg
    return -float(np.log(zeros.size)) if stays else 0.0


def _of_drive(
    drive: Drive, evidence: Evidence, floor_deg: float, least_deg: float, small_deg: float
) -> list[Part]:
    felt = {ids: drive.felt(evidence, f.cells_kpa) for ids, f in drive.fits.items()}

    def moved(one: DriveFit, name: str) -> float:
        less = one.effects.copy()
        less[LIBRARY[name].slots] = np.nan
        without = drive.felt(evidence, modelled_pressure(evidence, less))
        return rms_of(evidence, felt[one.ids] - without)

    def apart(one: DriveFit, other: Ids) -> float:
        return rms_of(evidence, felt[one.ids] - felt[other]) if other in felt else float("inf")

    def worth(ids: Ids) -> float:
        return float(drive.fits[ids].evidence.max()) if ids in drive.fits else -np.inf

    def left(one: DriveFit) -> float:
        """By how much the angle moves with what is left, as it does with what surely is."""
        surely = evidence.grid.sampled(one.believed_kpa - one.cells_kpa)
        angle = drive.felt(evidence, one.believed_kpa) - felt[one.ids]
        per_kpa = rms_of(evidence, angle) / max(rms_of(evidence, surely), 1e-9)
        return per_kpa * one.left_kpa

    parts: list[Part] = []
    gap_deg, share = drive.gap_deg, SETTINGS.drive_share
    for f in drive.fits.values():
        by_name = {name: moved(f, name) for name in f.ids}
        sizes = Sizes(gap_deg, gap_deg, left(f), floor_deg, least_deg, small_deg, share)
        parts += parts_of(f, f.evidence, by_name, partial(apart, f), worth, sizes)
    return parts


def evidence_of(found: Explanations, floor_deg: float) -> float:
    """Log evidence of the angle for all that may explain it together, as it is weighed."""
    scores, _, unknown = _scores(_of_angle(found, floor_deg))
    return float(logsumexp([*scores.values(), unknown]))


def _normalised(
    parts: Sequence[Part],
) -> tuple[dict[Ids, float], dict[Ids, Part], float]:
    """Probabilities of what is named, the best part of each, and the probability of `unknown`."""
    if not parts:
        return {(): 1.0}, {}, 0.0
    scores, best, unknown = _scores(parts)
    all_logs = np.array([*scores.values(), unknown])
    weights = np.exp(all_logs - logsumexp(all_logs)).tolist()
    return dict(zip(scores, weights, strict=False)), best, weights[-1]


def _scores(parts: Sequence[Part]) -> tuple[dict[Ids, float], dict[Ids, Part], float]:
    """Scores of what is named, the best part of each, and the score of `unknown`: logarithms."""
    scores: dict[Ids, float] = {}
    best: dict[Ids, Part] = {}
    unknown = []
    for part in parts:
        unknown.append(float(logsumexp(part.unknown)))
        if not np.isfinite(part.right):
            continue  # the library lacks it
        # Of what makes up for its form the best is enough, too.
        if part.named not in best or part.right > scores[part.named]:
            best[part.named], scores[part.named] = part, part.right
    # What stands in for an unknown effect is no hypothesis of its own: the best is enough.
    return scores, best, max(unknown)


def decide(
    found: Explanations,
    drive: Drive | None,
    fast: Line,
    evidence: Evidence,
    floor_deg: float,
    drive_floor_deg: float | None = None,
) -> Verdict:
    """Decide.

    Parameters
    ----------
    found : Explanations
        Fits of the angle.
    drive : Drive or None
        What the measured pressure says.
    fast : Line
        An interference that only single samples show.
    evidence : Evidence
        The campaign.
    floor_deg : float
        The noise floor.
    drive_floor_deg : float, optional
        By how much the angle moves with what is to be expected of the pressure, where that is
        known; else the noise floor counts for the drive, too.
    """
    # Learned: regulators with which models were identified moved the angle by 0.83 floors at most,
    # what was put in by 1.98 at least, on an opened rig.
    sizes = floor_deg, floor_deg, floor_deg, 0.0
    if drive_floor_deg is not None:
        sizes = _expected(drive_floor_deg)
    angle, of_angle, unknown_angle = _normalised(_of_angle(found, floor_deg))
    pressed, of_drive, unknown_drive = _weighed_drive(drive, evidence, *sizes)
    lined, unknown_line = _of_line(fast, floor_deg, found.excluded)
    certain = (1.0 - unknown_angle) * (1.0 - unknown_drive) * (1.0 - unknown_line)
    # All may be beyond reckoning beside an unknown cause.
    total = max(sum(angle.values()) * sum(pressed.values()), _LEAST_TOTAL)
    joint: dict[Ids, float] = {}
    made: dict[Ids, Scored] = {}  # of the most probable way to each
    for (a, x), (d, y), (line, z) in product(angle.items(), pressed.items(), lined.items()):
        named, p = ordered((*a, *d, *line)), certain * x * y * z / total
        joint[named] = joint.get(named, 0.0) + p
        if named not in made or p > made[named].probability:
            made[named] = _scored(named, p, of_angle[a], of_drive.get(d), fast if line else None)
    if () in joint and not found.bench.noise.compared:
        joint[()] *= SETTINGS.nothing
    whole = sum(joint.values()) + 1.0 - certain
    scored = [replace(one, probability=joint[named] / whole) for named, one in made.items()]
    share = unknown_drive / max(unknown_drive + unknown_angle + unknown_line, 1e-12)
    return judge(scored, (1.0 - certain) / whole, share)


def decide_drive(
    drive: Drive, evidence: Evidence, floor_kpa: float
) -> tuple[dict[Ids, float], dict[Ids, DriveFit], float]:
    """Weigh what the measured pressure says where no angle was logged.

    Parameters
    ----------
    drive : Drive
        Its `gap_deg` is in kPa.
    evidence : Evidence
        The campaign.
    floor_kpa : float
        What is to be expected of the pressure.

    Returns
    -------
    tuple
        Probabilities of what is named, nothing among it; the best fit of each; the probability
        that the cause is unknown.
    """
    pressed, parts, unknown = _weighed_drive(drive, evidence, *_expected(floor_kpa))
    fits = {name: part.fit for name, part in parts.items() if isinstance(part.fit, DriveFit)}
    return pressed, fits, unknown


def _expected(floor: float) -> tuple[float, float, float, float]:
    """Give the sizes of a drive of which a missed pressure of some size is expected anyway."""
    return floor, _BOTH * floor, SETTINGS.no_gap * floor, SETTINGS.left * floor


def _weighed_drive(
    drive: Drive | None,
    evidence: Evidence,
    floor_deg: float,
    least_deg: float,
    member_deg: float,
    small_deg: float,
) -> tuple[dict[Ids, float], dict[Ids, Part], float]:
    """Weigh the explanations of the pressure.

    A gap below `least_deg` is none, a member moves the angle by `member_deg`, and what is left
    beyond the sensor's noise counts from `small_deg` on.
    """
    parts = [] if drive is None else _of_drive(drive, evidence, floor_deg, member_deg, small_deg)
    if drive is not None and drive.gap_deg < least_deg:
        none = np.full(len(SHARES), -np.inf)
        parts = [replace(part, unknown=none) for part in parts if not part.named]
    return _normalised(parts)


def _scored(
    named: Ids, probability: float, angle: Part, drive: Part | None, fast: Line | None
) -> Scored:
    """Put the parts of an explanation together."""
    moved, left = dict(angle.moved_deg), angle.left_deg
    pressure = None
    if drive is not None:
        assert isinstance(drive.fit, DriveFit)
        pressure = drive.fit
        moved |= drive.moved_deg
        left = float(np.hypot(left, drive.left_deg))
    line = at_port("line")
    if fast is not None and line is not None:
        moved[line] = fast.amplitude_deg / float(np.sqrt(2.0))
    assert isinstance(angle.fit, Fitted)
    return Scored(named, probability, angle.fit, pressure, fast, moved, left)


def _of_line(
    fast: Line, floor_deg: float, excluded: Sequence[str]
) -> tuple[dict[Ids, float], float]:
    """Probabilities that a fast interference is there and that it is not, and of an unknown one."""
    rms = fast.amplitude_deg / float(np.sqrt(2.0))
    name = at_port("line")
    if name is None or fast.gain <= 0.0 or rms < least_of(name, SETTINGS.no_gap * floor_deg):
        return {(): 1.0}, 0.0
    nats = SETTINGS.temper * fast.gain + log_prior((name,)) - log_prior(())
    there = float(expit(np.clip(nats, -50.0, 50.0)))
    if name in excluded:
        return {(): 1.0}, there
    return {(): 1.0 - there, (name,): there}, 0.0
