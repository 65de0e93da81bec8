"""The drive by itself: what explains the measured pressure, and the true pressure that follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence, angle_chain, modelled_pressure
from spa_fo.gap.fit.believed import rooms_of, surely_shown
from spa_fo.gap.fit.bench import SHARES, local_size, rows_of
from spa_fo.gap.fit.least_squares import starts
from spa_fo.gap.fit.pressure import (
    PressureProblem,
    lagged,
    resolution,
    timing_error,
)
from spa_fo.gap.noise.coloured import CORRELATION_S, Spectrum
from spa_fo.gap.noise.pressure_noise import PressureNoise, between_repeats, pressure_noise
from spa_fo.gap.noise.whitening import Rows, Whitening
from spa_fo.gap.prior import log_prior
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY, Ids, absent, beside, ordered
from spa_fo.plant.memory import FINEST_STEP_S
from spa_fo.together import each

_BINNING_KPA = 0.02  # error of averaging a pressure over a step
# Of the command, RMS: on opened rigs of others regulators wander by 1 % at most, and supplies that
# cycle make 4.6 and 7.3 %. Assumed in between.
_MOST_WANDER = 0.03
_SHARP = 4.0  # times a trial's median noise: rows beyond are about a jump
_HOSTS, _PAIRED = 4, 8  # single effects that get others beside them; pairs fitted to the end
_ENOUGH, _MOST_TRIED = 0.01, 40  # of a search
_ROUGH, _ROUGH_TRIED = 0.5, 4  # of one that only says whether a pair is worth it
_BEST_STARTS = 2
_FORMS = 4  # of an effect that are tried beside another
# A jump that comes late by more than a cell does not say which way it should move.
_DELAYS_S = (0.01, *(np.arange(1, 76, 2) * FINEST_STEP_S).tolist())
QUICK_S = 0.01  # a sensor's lag that no actuator feels
NEAR = 60.0  # nats behind the best explanation of the pressure, which an angle may make up for
_NEAREST = 4  # so many of these are given to the angle
_NOTHING_DEG = 0.02  # what the drive misses, in degrees of a static actuator


@dataclass(frozen=True)
class DriveFit:
    """Some drive effects fitted to the measured pressure."""

    ids: Ids
    z: Floats  # parameters as searched, and the sensor's lag
    ends: tuple[Floats, ...]  # of the best forms, where the best search of each ended
    effects: Floats  # parameters of all effects, NaN where absent
    cells_kpa: Floats  # (cells,), true pressure on the grid's cells
    believed_kpa: Floats  # (cells,), the same as far as the sensor agrees with it
    predicted_kpa: Floats  # (n,), true pressure at the grid's averaged samples
    residual_kpa: Floats  # (n,), what is left with the sensor's lag, offset and gain taken out
    sigma: Floats  # errors of `z`
    evidence: Floats  # (shares,), log evidence for each of `SHARES`
    left_kpa: float  # RMS of the residual beyond noise
    # The same with a sensor that does not lag, where this one's does and it comes near the best.
    prompt: DriveFit | None = None


@dataclass(frozen=True)
class Drive:
    """What the measured pressure says."""

    fits: dict[Ids, DriveFit]  # by effects; none is the command itself
    pressure_kpa: Floats  # (cells,), the true pressure as far as it is known
    given: Floats  # (5,), coefficients of the given model
    gap_kpa: float  # RMS of what the command misses of the true pressure
    gap_deg: float  # RMS of what that moves the given model's angle by
    wander: float = 0.0  # RMS by which repeats differ, of that of the command
    in_kpa: bool = False  # no angle was logged: what counts is the pressure itself

    @property
    def per_kpa_deg(self) -> float:
        """By how much a kPa of this kind moves the angle, deg."""
        return self.gap_deg / max(self.gap_kpa, 1e-9)

    def by_itself(self) -> Drive:
        """Return the same where no angle was logged: sizes are of the pressure, kPa."""
        return replace(self, gap_deg=self.gap_kpa, in_kpa=True)

    def felt(self, evidence: Evidence, kpa: Floats) -> Floats:
        """Give what a true pressure on the cells comes to, (n,): the given model's angle, deg.

        An angle is moved by what is slow, and hardly by a spike.
        """
        if self.in_kpa:
            return evidence.grid.sampled(kpa)
        return angle_chain(evidence, self.given, kpa).run(self.given, absent())[0]

    @property
    def is_ordinary(self) -> bool:
        """Whether the pressure of repeats differs by no more than a regulator lets it."""
        return self.wander <= _MOST_WANDER

    @property
    def best(self) -> DriveFit:
        """The fit of largest evidence, at its best share."""
        return _best(self.fits)


def _best(fits: Mapping[Ids, DriveFit]) -> DriveFit:
    return max(fits.values(), key=lambda fit: float(fit.evidence.max()))


def examine_drive(
    evidence: Evidence, excluded: Sequence[str], x: Floats, beyond: Spectrum | None = None
) -> Drive:
    """Explain the measured pressure: no effect, every single one, and the most promising pairs.

    Parameters
    ----------
    evidence : Evidence
        The campaign, with command and pressure.
    excluded : sequence of str
        Effects that the library is to lack.
    x : (5,) array
        Coefficients of the given model: they say what a missed pressure does to the angle.
    beyond : Spectrum, optional
        What is to be expected beside the sensor's noise, kPa².
    """
    step, lag_known = resolution(evidence), beyond is not None  # by the same sensor
    noise = _noise(evidence, step, beyond)
    fitted = _looked_at(evidence, noise, evidence.takes_part)
    rough = _looked_at(evidence, noise, _one_of_each(evidence))

    def problem(ids: Ids, looked_at: _LookedAt) -> PressureProblem:
        return PressureProblem(*looked_at.by(ids), ids, lag_known, noise.of_trials)

    def alone(ids: Ids) -> DriveFit:
        own = problem(ids, fitted)
        return _fit(own, starts(own, np.zeros(0), _DELAYS_S), evidence, rooms)

    def roughly(ids: Ids) -> tuple[float, list[Floats]]:
        own = problem(ids, rough)
        factor = own.whitening.factor(1.0, SETTINGS.search_share)
        begun = _together(own, [fits[(name,)] for name in ids])
        points = own.first_of(begun, factor, _BEST_STARTS)
        first, *others = sorted(
            (own.search(z, factor, own.variance, _ROUGH, _ROUGH_TRIED) for z in points),
            key=lambda found: found.at.value,
        )
        return first.at.value, [first.z, *(other.z for other in others)]

    rooms = rooms_of(evidence, step)
    fits: dict[Ids, DriveFit] = {(): alone(())}
    wander = 0.0 if noise.of_trials is None else _wander(evidence, noise.of_trials)
    late = fits[()].z[-1] > QUICK_S  # which may be the drive's, as far as the pressure goes
    if late or drive_of(evidence, fits, x).gap_deg > _NOTHING_DEG:
        names = [n for n, e in LIBRARY.items() if e.stage == "drive" and n not in excluded]
        fits |= {f.ids: f for f in each(alone, [(name,) for name in names])}
        ranked = sorted(names, key=lambda n: -float(fits[(n,)].evidence.max()))
        # What is small beside the best may have been nothing by itself.
        both = [(a, b) for a in ranked[:_HOSTS] for b in beside((a,), names) if a != b]
        pairs = list(dict.fromkeys(map(ordered, both)))
        begun = dict(zip(pairs, each(roughly, pairs), strict=True))
        promising = sorted(pairs, key=lambda ids: begun[ids][0])[:_PAIRED]
        ended = each(
            lambda ids: _fit(problem(ids, fitted), begun[ids][1], evidence, rooms), promising
        )
        fits |= {fit.ids: fit for fit in ended}
    lagging = [f for f in near_best(fits) if f.z[-1] > QUICK_S]
    prompt = each(lambda f: _prompt(problem(f.ids, fitted), f, evidence, rooms), lagging)
    fits |= {f.ids: replace(f, prompt=one) for f, one in zip(lagging, prompt, strict=True)}
    return drive_of(evidence, fits, x, wander)


def worth(fitted: DriveFit) -> float:
    """Say what a fit is worth, nats."""
    return float(fitted.evidence.max()) + log_prior(fitted.ids) / SETTINGS.temper


def near_best(fits: Mapping[Ids, DriveFit]) -> list[DriveFit]:
    """List the fits that an angle may put first, the command itself among them if it comes near."""
    ranked = sorted(fits.values(), key=lambda fit: -worth(fit))
    near = [fit for fit in ranked if worth(fit) > worth(ranked[0]) - NEAR]
    return [fit for place, fit in enumerate(near) if place < _NEAREST or not fit.ids]


def _together(own: PressureProblem, singles: Sequence[DriveFit]) -> list[Floats]:
    """List points at which effects that were fitted alone may begin together."""
    # What is late may be the sensor for the one, and the drive for the other.
    lags = sorted({round(float(f.z[-1]), 3) for f in singles})
    ways = product(*([z[:-1] for z in fit.ends] for fit in singles))
    points = [np.array([*np.concatenate(way), lag]) for way in ways for lag in lags]
    # By itself a delay may have been nothing beside what the other makes of a jump.
    return points + [z for point in points for z in own.delayed(point, _DELAYS_S)]


def _wander(evidence: Evidence, noise: PressureNoise) -> float:
    """RMS by which repeats differ, of that of the command where it is one."""
    command_kpa = evidence.grid.command_kpa
    assert command_kpa is not None
    told = command_kpa[command_kpa != 0.0]
    if not told.size:
        return 0.0
    within = noise.spectrum.coloured.sum() / np.mean(told**2)
    return float(np.sqrt(noise.gain**2 + within))


def drive_of(
    evidence: Evidence, fits: dict[Ids, DriveFit], x: Floats, wander: float = 0.0
) -> Drive:
    """Say what the best fit makes of the drive of an actuator with coefficients `x`."""
    grid, true_kpa = evidence.grid, _best(fits).believed_kpa
    assert grid.command_kpa is not None
    gap_kpa = float(np.sqrt(np.mean((true_kpa - grid.command_kpa) ** 2)))
    drive = Drive(fits, true_kpa, x, gap_kpa, 0.0, wander)
    driven, commanded = (drive.felt(evidence, kpa) for kpa in (true_kpa, grid.command_kpa))
    return replace(drive, gap_deg=rms_of(evidence, driven - commanded))


def rms_of(evidence: Evidence, change: Floats) -> float:
    """RMS over the rows that take part of what stands at the averaged samples."""
    used = evidence.used
    return float(np.sqrt(np.average(change[used] ** 2, weights=evidence.grid.counts[used])))


@dataclass(frozen=True)
class _Noise:
    """What is noise of the measured pressure, and what repeats differ by."""

    known: Floats  # (n,), variance of each averaged sample, kPa²
    differ: Floats  # (n,), by which trials do, kPa²
    spectrum: Spectrum  # within a trial
    hidden_kpa: float  # by a converter's step, 1 sigma
    of_trials: PressureNoise | None  # None beside a reference: no more is known of them


def _noise(evidence: Evidence, step_kpa: float, beyond: Spectrum | None) -> _Noise:
    """Say what is noise; `beyond`, beside the sensor's own, holds what repeats differ by."""
    known, noise = timing_error(evidence) ** 2 + _BINNING_KPA**2, None
    spectrum = Spectrum(evidence.pressure_noise_kpa**2, np.zeros(CORRELATION_S.size))
    differ = np.zeros(known.size)
    if beyond is None:
        assert evidence.grid.measured_kpa is not None
        noise = pressure_noise(evidence, known)
        spectrum, differ = noise.spectrum, (noise.gain * evidence.grid.measured_kpa) ** 2
    known = known + between_repeats(evidence, known + spectrum.coloured.sum() + differ)
    if beyond is not None:
        spectrum = spectrum.beside(beyond)
    return _Noise(known, differ, spectrum, step_kpa / np.sqrt(12.0), noise)


@dataclass(frozen=True)
class _LookedAt:
    """Trials whose pressure is looked at, by themselves and among all."""

    alone: tuple[Evidence, Whitening]
    among_all: tuple[Evidence, Whitening]

    def by(self, ids: Ids) -> tuple[Evidence, Whitening]:
        """Say what has to be simulated: all trials only where one goes on from another."""
        carries_on = any(LIBRARY[name].carries_on for name in ids)
        return self.among_all if carries_on else self.alone


def _looked_at(evidence: Evidence, noise: _Noise, trials: NDArray[np.bool_]) -> _LookedAt:
    """Make some trials ready, before processes share the work; how large their gap is, too."""
    alone, samples = evidence.only(trials), np.flatnonzero(trials[evidence.grid.sample_trial])
    rows, spectrum = rows_of(alone, noise.known[samples]), noise.spectrum
    bare = PressureProblem(alone, Whitening(rows, spectrum, np.zeros(rows.size)), ())
    white = spectrum.white + noise.hidden_kpa**2
    coloured = spectrum.coloured.sum() + rows.merged(noise.differ[samples])
    squares = _beyond_noise(rows, white, coloured, bare.left(np.zeros(1)))
    whitening = Whitening(rows, spectrum, local_size(rows, squares), noise.hidden_kpa)
    for share in (*SHARES, SETTINGS.search_share):
        whitening.factor(1.0, share)
    return _LookedAt((alone, whitening), (evidence, whitening.renumbered(samples)))


def _one_of_each(evidence: Evidence) -> NDArray[np.bool_]:
    """Choose the first of the trials that take part of each experiment, (trials,)."""
    taking = np.flatnonzero(evidence.takes_part)
    first = taking[np.unique(evidence.alike[taking], return_index=True)[1]]
    return np.isin(np.arange(evidence.alike.size), first)


def _beyond_noise(rows: Rows, white: float, coloured: Floats, left: Floats) -> Floats:
    """Square what is left at each row, less its noise; about a jump at least as its neighbours."""
    squares = left**2
    for group in rows.groups:
        noise = group.fixed + white / group.count + coloured[group.rows]
        squares[group.rows] -= noise
        for trial in np.unique(group.trial):
            mine = np.flatnonzero(group.trial == trial)
            sharp = mine[noise[mine] <= _SHARP * np.median(noise[mine])]
            at = group.rows.start
            near = np.interp(mine, sharp, squares[at + sharp])
            squares[at + mine] = np.maximum(squares[at + mine], near)
    return squares


def _fit(
    problem: PressureProblem, points: list[Floats], everything: Evidence, rooms_kpa: list[Floats]
) -> DriveFit:
    """Fit from the best of some points.

    Within `rooms_kpa` the sensor may differ from a fit that is believed.
    """
    factor = problem.whitening.factor(1.0, SETTINGS.search_share)
    searched = [
        problem.search(z, factor, problem.variance, _ENOUGH, _MOST_TRIED)
        for z in problem.first_of(points, factor, _BEST_STARTS * (1 + len(problem.forms)))
    ]
    ends = [found.z for found in sorted(searched, key=lambda found: found.at.value)]
    best: dict[tuple[float, ...], Floats] = {}
    for end in ends:
        best.setdefault(tuple(np.round(end[problem.forms])), end)
    return replace(
        _fitted(problem, ends[0], everything, rooms_kpa), ends=tuple(best.values())[:_FORMS]
    )


def _prompt(
    problem: PressureProblem, fit: DriveFit, everything: Evidence, rooms_kpa: list[Floats]
) -> DriveFit:
    """Fit once more with a sensor that does not lag: its evidence is less by what fits worse."""
    factor = problem.whitening.factor(1.0, SETTINGS.search_share)
    before = problem.search(fit.z, factor, problem.variance, _ENOUGH, 0)
    problem.low[-1] = problem.high[-1] = 0.0
    points = starts(problem, np.zeros(0), _DELAYS_S)
    ends = [
        problem.search(z, factor, problem.variance, _ENOUGH, _MOST_TRIED)
        for z in (fit.z, *problem.first_of(points, factor, _BEST_STARTS))
    ]
    found = min(ends, key=lambda end: end.at.value)
    prompt = _fitted(problem, found.z, everything, rooms_kpa)
    return replace(prompt, evidence=fit.evidence - (found.at.value - before.at.value))


def _fitted(
    problem: PressureProblem, z: Floats, everything: Evidence, rooms_kpa: list[Floats]
) -> DriveFit:
    """Weigh the end of a search, and predict all trials."""
    factor = problem.whitening.factor(1.0, SETTINGS.search_share)
    linear = problem.linear(z)
    weighed = [
        problem.weigh(linear, problem.whitening.factor(1.0, share), problem.scales**2)
        for share in SHARES
    ]
    evidence = np.array([log for log, _, _ in weighed])
    _, solution, top = weighed[int(np.argmax(evidence))]
    offset, gain = solution.coefficients[-3:-1]
    effects, grid = problem.effects(z), everything.grid
    cells = modelled_pressure(everything, effects)
    there = lagged(cells, grid.cell_starts, float(z[-1]))
    shown = grid.read(there)
    assert grid.measured_kpa is not None
    assert grid.pressure_kpa is not None
    sensed = (grid.pressure_kpa - offset) / (1.0 + gain)
    surely = surely_shown(sensed - there, grid.cell_starts, rooms_kpa)
    return DriveFit(
        ids=problem.ids,
        z=z,
        ends=(z,),
        effects=effects,
        cells_kpa=cells,
        believed_kpa=cells + surely,
        predicted_kpa=grid.sampled(cells),
        residual_kpa=grid.measured_kpa - shown - offset - gain * shown,
        sigma=np.sqrt(np.diag(problem.posterior(linear, factor, problem.scales**2))),
        evidence=evidence,
        left_kpa=problem.whitening.beyond_noise(problem.remaining(linear, solution, top)),
    )
