"""Every explanation that is considered, fitted: drive and angle apart, then together.

Where the pressure was measured, the drive's effects are judged by it and the others by the angle
that this pressure should give; their evidence adds up. Without it the drive's effects stand in the
angle's chain like all others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.drive import DriveFit, fit_drive, fit_drives
from spa_fo.gap.evidence import Evidence, angle_chain, modelled_pressure, tolerant
from spa_fo.gap.explain import AngleProblem, Fit, Slot, best_fit, to_z
from spa_fo.gap.pickup import (
    Pickup,
    fast_line,
    is_locked,
    is_other_in_fixture,
    is_uneven,
    shows_in_fixture,
    slow_line,
)
from spa_fo.gap.together import each
from spa_fo.gap.typical import typical
from spa_fo.plant.chain import Chain
from spa_fo.plant.effects.library import IDS, LIBRARY
from spa_fo.plant.memory import FINEST_STEP_S

Floats = NDArray[np.float64]
Ids = tuple[str, ...]

_PAIRED = 6  # so many of the best single effects are tried in pairs
_MOST_TOGETHER = 5
_WORTH_ADDING = 12.0  # nats
_FREED = 8  # so many with the coefficients free
_PRUNED = 4  # of the best sets, so many lose a member to see whether it was needed
_SCREENING_STEPS, _GROWING_STEPS = 4, 7
_PROMISING = 40.0  # nats behind the best after screening
_UNSEEN_BY_STEPS = np.array([0.12, 0.03, 0.5, 0.5, 0.0])  # as searched: orders, ln a1, a0, K
_STANDS_OUT, _NOTHING_KPA = 6.0, 0.5  # of a pressure in one trial: deviations of the noise, kPa
RELEVANT, RELEVANT_PART = 0.35, 0.12
"""An effect that moves the angle by less than this part of the noise floor is none; and one that
moves it by less than this part of what the largest does may only make up for that one's form."""


@dataclass(frozen=True)
class Candidates:
    """All fits of one campaign.

    Attributes
    ----------
    evidence : Evidence
        What was fitted.
    given : (5,) array
        Coefficients of the given model.
    centre : (5,) array
        What the explanations' coefficients are expected to be near: the given ones, or typical
        ones where the given model has bent with the gap.
    own : bool
        Whether that model was fitted to this campaign's own gap.
    chain : Chain
        The simulator that the angle's fits used.
    drives : dict
        Fits of the pressure by drive effects; empty where it was not measured.
    angles : dict
        Fits of the angle by (effects, level).
    fast : Pickup
        The strongest fast line of the flex channel.
    slow : Pickup or None
        A slow one, if there is any.
    excluded : tuple of str
        Effects that the library lacked.
    """

    evidence: Evidence
    given: Floats
    centre: Floats
    own: bool
    chain: Chain
    drives: dict[Ids, DriveFit]
    angles: dict[tuple[Ids, str], Fit]
    fast: Pickup
    slow: Pickup | None
    excluded: Ids = ()

    @property
    def loose(self) -> str:
        """Level at which the plain model is identified again."""
        return "own" if self.own else "free"

    @property
    def drive(self) -> DriveFit | None:
        """The best fit of the pressure."""
        return max(self.drives.values(), key=lambda fit: fit.log_evidence, default=None)


def ordered(ids: Sequence[str]) -> Ids:
    """Put effects in the library's order."""
    return tuple(sorted(ids, key=IDS.index))


def consider(
    evidence: Evidence, given: Floats, own: bool, excluded: Sequence[str] = ()
) -> Candidates:
    """Fit everything.

    Parameters
    ----------
    evidence : Evidence
        The campaign.
    given : (5,) array
        Coefficients of the plain model.
    own : bool
        Whether the model was fitted to this campaign: then the coefficients are free in every
        explanation, as they have bent with the gap.
    excluded : sequence of str
        Effects that the library is to lack.
    """
    centre = typical(given, _horizon_s(evidence)) if own else given
    bent = [to_z(given)] if own else []
    evidence = _tolerant(evidence, given, centre, own)
    drives = fit_drives(evidence, excluded) if evidence.has_pressure else {}
    chain = angle_chain(evidence, given, _known_pressure(evidence, drives))
    fitter = _Fitter(evidence, chain, centre)
    singles = [
        name
        for name in IDS
        if name not in excluded
        and name not in ("mains_pickup", "parameter_shift")
        and not (drives and LIBRARY[name].stage == "drive")
    ]
    base = fitter.fit((), "known")
    # What every explanation has to beat.
    free = fitter.refit("own" if own else "free", [base.searched, *bent])
    if not own:
        fitter.fit((), "shifted", base.searched)
    level = "own" if own else "near"
    start = free if own else base
    ranked = fitter.singles(singles, level, start.searched)
    if not own:
        fitter.complete(ranked[:_FREED], "free", free.searched)
    # Beside the best one, an effect that shows little alone may show all the more.
    pairs = [*combinations(ranked[:_PAIRED], 2), *((ranked[0], name) for name in ranked[_PAIRED:])]
    fitter.join([ordered(pair) for pair in pairs], level)
    fitter.grow(ranked[:_FREED], level)
    if "mains_pickup" not in excluded and fitter.interfere(start, level):
        # All that was tried before had the interference to make up for.
        fitter.join([ordered(("mains_pickup", name)) for name in ranked], level)
        fitter.grow(ranked[:_FREED], level)
        if not own:
            fitter.fit(("mains_pickup",), "free", free.searched)
    fitter.prune(level)
    fast = fast_line(evidence)
    slow = fitter.slow
    return Candidates(
        evidence, given, centre, own, chain, drives, fitter.fits, fast, slow, tuple(excluded)
    )


def _horizon_s(evidence: Evidence) -> float:
    """Half a trial: about as long as its first step."""
    time = evidence.grid.time_s
    return 0.5 * float(np.median([np.ptp(time[rows]) for rows in evidence.rows]))


def _tolerant(evidence: Evidence, given: Floats, centre: Floats, own: bool) -> Evidence:
    """Look at the gaps first: what has to be explained says how exactly it has to be."""
    grid = evidence.grid
    kpa = pressure = None
    if evidence.has_pressure:
        plain = fit_drive(evidence, ())
        kpa = plain.missed_kpa
        pressure = _with_missed(evidence, plain)
    chain = angle_chain(evidence, given, pressure)
    fit = AngleProblem(evidence, chain, given, (), "known").fit(to_z(given))
    if own:
        starts = [to_z(centre), fit.searched]
        fit = _identified(AngleProblem(evidence, chain, centre, (), "own"), starts)
    deg = grid.angle_deg - fit.predicted_deg
    # A part of each trial's deviation is its own.
    deg = np.sign(deg) * np.maximum(np.abs(deg) - evidence.noise_deg, 0.0)
    return tolerant(evidence, deg, kpa)


def _identified(problem: AngleProblem, starts: Sequence[Floats]) -> Fit:
    """Identify the plain model again, from several starts along where up-steps leave it free."""
    return best_fit(
        [
            problem.fit(start[:5] + share * _UNSEEN_BY_STEPS)
            for start in starts
            for share in (0.0, -1.0, 1.0)
        ]
    )


def _known_pressure(evidence: Evidence, drives: dict[Ids, DriveFit]) -> Floats | None:
    """Take the true pressure as far as it is known: the drive's model and what it misses."""
    if not drives:
        return None
    return _with_missed(evidence, max(drives.values(), key=lambda fit: fit.log_evidence))


def _with_missed(evidence: Evidence, fit: DriveFit) -> Floats:
    """Modelled pressure on the cells, and what the model misses beyond the sensor's noise.

    That is the part that repeats, and what stands out in a single trial, such as a command that
    the drive took up later than usual.
    """
    grid = evidence.grid
    pressure = modelled_pressure(evidence, fit.effects)
    own = _standing_out(evidence, fit)
    for trial, rows in enumerate(evidence.rows):
        first, end = grid.cell_starts[trial : trial + 2]
        time = FINEST_STEP_S * (np.arange(end - first) + 0.5)
        pressure[first:end] += np.interp(time, grid.time_s[rows], fit.missed_kpa[rows])
        for row in rows[own[rows] != 0.0]:
            step = grid.sample_step[row]
            cell = grid.first_cell[step]
            pressure[cell : cell + grid.cells[step]] += own[row]
    return pressure


def _standing_out(evidence: Evidence, fit: DriveFit) -> Floats:
    """Find what single trials' pressures differ by, kPa; 0 where it may be noise.

    A lone sample beside a jump only says that it was taken just before or after: at least two in a
    row have to be off by about as much.
    """
    left = fit.residual_kpa - fit.missed_kpa
    noise = evidence.pressure_noise_kpa / np.sqrt(evidence.grid.counts)
    own = np.zeros_like(left)
    for rows in evidence.rows:
        mine = left[rows]
        loud = np.abs(mine) > _STANDS_OUT * noise[rows] + _NOTHING_KPA
        alike = mine[1:] / np.where(mine[:-1] == 0.0, np.inf, mine[:-1])
        pairs = loud[1:] & loud[:-1] & (alike > 0.5) & (alike < 2.0)
        kept = np.append(pairs, False) | np.append(False, pairs)
        own[rows] = np.where(kept, mine, 0.0)
    return own


class _Fitter:
    """Fits explanations of the angle and keeps them."""

    def __init__(self, evidence: Evidence, chain: Chain, centre: Floats) -> None:
        self.evidence = evidence
        self.chain = chain
        self.centre = centre
        self.fits: dict[tuple[Ids, str], Fit] = {}
        self.slow: Pickup | None = None

    def problem(self, ids: Ids, level: str, slow: Pickup | None = None) -> AngleProblem:
        slow = slow or self.slow
        waved = slow is not None and "mains_pickup" in ids
        return AngleProblem(
            self.evidence,
            self.chain,
            self.centre,
            ids,
            level,
            pickup=(slow.frequency_hz, slow.amplitude_deg) if slow and waved else None,
            changed=self._has_changed(level) and "sensor_nonlinearity" in ids,
        )

    def _has_changed(self, level: str) -> bool:
        """Whether the curve alone did better as that of later calibrations too."""
        alone = self.fits.get((("sensor_nonlinearity",), level))
        return alone is not None and alone.changed

    def fit(self, ids: Ids, level: str, start: Floats | None = None) -> Fit:
        problem = self.problem(ids, level)
        self.fits[(ids, level)] = problem.fit(to_z(self.centre) if start is None else start[:5])
        return self.fits[(ids, level)]

    def refit(self, level: str, starts: Sequence[Floats]) -> Fit:
        """Fit the plain model alone."""
        self.fits[((), level)] = _identified(self.problem((), level), starts)
        return self.fits[((), level)]

    def singles(self, names: Sequence[str], level: str, base: Floats) -> list[str]:
        """Fit single effects, the promising ones to the end; return them, best first."""

        def screened(name: str) -> Fit:
            problem = self.problem((name,), level)
            return best_fit(
                [
                    problem.fit(start, _SCREENING_STEPS)
                    for coefficients in self._bases(level, base)
                    for start in problem.starts(coefficients)
                ]
            )

        first = dict(zip(names, each(screened, names), strict=True))
        self.fits |= {((name,), level): fit for name, fit in first.items()}
        ranked = sorted(names, key=lambda name: -first[name].log_evidence)
        best = first[ranked[0]].log_evidence if ranked else 0.0
        promising = [
            name
            for rank, name in enumerate(ranked)
            if rank < _PAIRED or best - first[name].log_evidence < _PROMISING
        ]
        self.complete(promising, level, base)
        return sorted(names, key=lambda name: -self.fits[((name,), level)].log_evidence)

    def _bases(self, level: str, base: Floats) -> list[Floats]:
        """Coefficients to start from: the plain model identified again may have bent as well."""
        return [base, to_z(self.centre)] if level == "own" else [base]

    def complete(self, names: Sequence[str], level: str, base: Floats) -> None:
        """Fit single effects to the end."""
        fits = each(lambda name: self._single(name, level, base), names)
        self.fits |= {((name,), level): fit for name, fit in zip(names, fits, strict=True)}

    def _single(self, name: str, level: str, base: Floats) -> Fit:
        problem = self.problem((name,), level)
        earlier = self.fits.get(((name,), level)) or self.fits.get(((name,), "near"))
        starts = [earlier.searched] if earlier is not None else problem.starts(base)
        fits = [problem.fit(start) for start in starts]
        if earlier is not None and earlier.level == level:
            fits.append(earlier)
        if name == "sensor_nonlinearity" and self.evidence.drift_deg.size:
            changed = AngleProblem(
                self.evidence, self.chain, self.centre, (name,), level, changed=True
            )
            fits.append(changed.fit(starts[0]))
        return best_fit(fits)

    def join(self, sets: Sequence[Ids], level: str) -> list[Fit]:
        """Fit several effects together, some sets of them, from where each came out alone."""
        fits = each(lambda ids: self._joined(ids, level), sets)
        self.fits |= {(ids, level): fit for ids, fit in zip(sets, fits, strict=True)}
        return fits

    def _joined(self, ids: Ids, level: str) -> Fit:
        problem = self.problem(ids, level)
        known = [self.fits[((name,), level)] for name in ids]
        better = max(known, key=lambda fit: fit.log_evidence)
        values = {
            slot.place: value
            for fit in known
            for slot, value in zip(self._slots(fit), fit.searched[5:], strict=True)
        }
        at_singles = np.array([values[slot.place] for slot in problem.slots])
        return problem.fit(np.concatenate([better.searched[:5], at_singles]), _GROWING_STEPS)

    def grow(self, names: Sequence[str], level: str) -> None:
        """Add effect after effect to the best set, while each adds far more than it costs."""
        fits = [fit for (_, own), fit in self.fits.items() if own == level]
        if not fits:
            return  # the library lacks nearly everything
        best = best_fit(fits)
        while 2 <= len(best.ids) < _MOST_TOGETHER:
            wider = self.join(
                [ordered((*best.ids, name)) for name in names if name not in best.ids], level
            )
            if not wider or best_fit(wider).log_evidence < best.log_evidence + _WORTH_ADDING:
                return
            best = best_fit(wider)

    def interfere(self, plain: Fit, level: str) -> bool:
        """Look for a slow interference beside the best set, and whether that much is left for it.

        What keeps time with the response, or is in one trial alone, is none.
        """
        host = best_fit([fit for (_, own), fit in self.fits.items() if own == level] or [plain])
        if host.log_evidence < plain.log_evidence + _WORTH_ADDING:
            host = plain
        line = slow_line(self.problem(host.ids, level), host.searched)
        ids = ordered((*host.ids, "mains_pickup"))
        starts = {ids: host.searched, ("mains_pickup",): plain.searched}
        waved = each(lambda ids: self.problem(ids, level, line).fit(starts[ids]), list(starts))
        beside, alone = waved[0], waved[-1]
        # A set that explains less than the wave does may be made up from it.
        judged = [beside, alone] if alone.log_evidence > host.log_evidence else [beside]
        if all(self._is_no_interference(fit, line.frequency_hz) for fit in judged):
            return False
        self.slow = line
        self.fits[(ids, level)] = beside
        self.fits[(("mains_pickup",), level)] = alone
        best = best_fit([beside, alone])
        return best.log_evidence - line.search_price - host.log_evidence > _WORTH_ADDING

    def _is_no_interference(self, fit: Fit, hz: float) -> bool:
        in_trials = is_locked(self.evidence, fit) or is_uneven(self.evidence, fit)
        return in_trials or (
            shows_in_fixture(self.evidence, hz) and is_other_in_fixture(self.evidence, fit)
        )

    def prune(self, level: str) -> None:
        """Take members out of the best sets: what is left may do as well from where they led it."""
        fewest = 1 if level == "own" else 2  # near the given model the plain one has no valleys
        ranked = sorted(
            (fit for (ids, own), fit in self.fits.items() if own == level and len(ids) >= fewest),
            key=lambda fit: -fit.log_evidence,
        )
        smaller = [
            (fit, ids)
            for fit in ranked[:_PRUNED]
            for ids in combinations(fit.ids, len(fit.ids) - 1)
        ]
        for again in each(lambda task: self._without(*task), smaller):
            known = self.fits.get((again.ids, level))
            if known is None or again.log_evidence > known.log_evidence:
                self.fits[(again.ids, level)] = again

    def _without(self, fit: Fit, ids: Ids) -> Fit:
        """Fit what is left of a set from where the whole one came out."""
        values = dict(zip([s.place for s in self._slots(fit)], fit.searched[5:], strict=True))
        problem = self.problem(ids, fit.level)
        left = np.array([values[slot.place] for slot in problem.slots])
        return problem.fit(np.concatenate([fit.searched[:5], left]))

    def _slots(self, fit: Fit) -> list[Slot]:
        return self.problem(fit.ids, fit.level).slots
