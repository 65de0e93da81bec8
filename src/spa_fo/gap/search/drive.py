"""The drive by itself: what explains the measured pressure, and the true pressure that follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.evidence import Evidence, angle_chain, repeats
from spa_fo.gap.fit.bench import SHARES, local_size, rows_of
from spa_fo.gap.fit.pressure import PressureProblem, blur, resolution, starts, timing_error
from spa_fo.gap.noise.coloured import CORRELATION_S, Spectrum
from spa_fo.gap.noise.whitening import Rows, Whitening
from spa_fo.gap.settings import SETTINGS
from spa_fo.gap.together import each
from spa_fo.plant.effects.library import LIBRARY, absent, beside, ordered

Floats = NDArray[np.float64]
Ids = tuple[str, ...]

_BINNING_KPA = 0.02  # error of averaging a pressure over a step
_BLUR = 0.5  # of the change of pressure about a cell: when exactly it changed is not known
_ROOM = 2.0  # deviations of the pressure's noise within which the model is believed
_SHARP = 4.0  # times a trial's median noise: rows beyond are about a jump
_PAIRED = 4  # of the best single effects
_ENOUGH, _MOST_TRIED = 0.01, 40  # of a search
_BEST_STARTS = 2
# A jump that comes late by many cells does not say which way it should move.
_DELAYS_S = tuple(np.geomspace(0.01, 1.5, 30).tolist())
_QUICK_S = 0.01  # a sensor's lag that no actuator feels
_NOTHING_DEG = 0.02  # what the drive misses, in degrees of a static actuator


@dataclass(frozen=True)
class DriveFit:
    """Some drive effects fitted to the measured pressure.

    Attributes
    ----------
    ids : tuple of str
        The effects.
    z : array
        Parameters as searched, and the sensor's lag.
    effects : array
        Parameters of all effects, NaN where absent.
    cells_kpa, shown_kpa : (cells,) arrays
        True pressure on the grid's cells, and what a sensor that lags shows of it.
    predicted_kpa, residual_kpa : (n,) arrays
        True pressure at the grid's averaged samples; what is left with the sensor's lag, offset and
        gain taken out.
    sensor : (2,) array
        Offset (kPa) and relative gain error of the pressure sensor.
    sigma : array
        Errors of `z`.
    evidence : (shares,) array
        Log evidence for each of `SHARES`.
    left_kpa : float
        RMS of the residual beyond noise.
    decrement : float
        What the search left.
    """

    ids: Ids
    z: Floats
    effects: Floats
    cells_kpa: Floats
    shown_kpa: Floats
    predicted_kpa: Floats
    residual_kpa: Floats
    sensor: Floats
    sigma: Floats
    evidence: Floats
    left_kpa: float
    decrement: float


@dataclass(frozen=True)
class Drive:
    """What the measured pressure says.

    Attributes
    ----------
    fits : dict
        By effects; none is the command itself.
    pressure_kpa : (cells,) array
        The true pressure as far as it is known.
    room_kpa : (cells,) array
        By how much the sensor may differ from a fit that is believed.
    given : (5,) array
        Coefficients of the given model.
    gap_kpa, gap_deg : float
        RMS of what the command misses of it, and of what that moves the given model's angle by.
    """

    fits: dict[Ids, DriveFit]
    pressure_kpa: Floats
    room_kpa: Floats
    given: Floats
    gap_kpa: float
    gap_deg: float

    def of(self, evidence: Evidence, fits: dict[Ids, DriveFit]) -> Drive:
        """Return what these fits make of the drive."""
        return _drive_of(evidence, fits, self.room_kpa, self.given)

    @property
    def per_kpa_deg(self) -> float:
        """By how much a kPa of this kind moves the angle, deg."""
        return self.gap_deg / max(self.gap_kpa, 1e-9)

    @property
    def best(self) -> DriveFit:
        """The fit of largest evidence, at its best share."""
        return max(self.fits.values(), key=lambda fit: float(fit.evidence.max()))


def examine_drive(
    evidence: Evidence, excluded: Sequence[str], x: Floats, beyond: Spectrum | None = None
) -> Drive:
    """Explain the measured pressure: no effect, every single one, and pairs of the best.

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
    step = resolution(evidence)
    known = timing_error(evidence) ** 2 + _BINNING_KPA**2
    rows = rows_of(evidence, known + _between_repeats(evidence, known))
    # What a step of the converter hides stays the same for as long as the pressure does.
    hidden = np.full(CORRELATION_S.size, step**2 / 12.0 / CORRELATION_S.size)
    spectrum = Spectrum(evidence.pressure_noise_kpa**2, hidden)
    if beyond is not None:
        spectrum = spectrum.beside(beyond)
    lag_known = beyond is not None  # what is expected was learned from the same sensor
    bare = PressureProblem(evidence, Whitening(rows, spectrum, np.zeros(rows.size)), (), lag_known)
    squares = _beyond_noise(rows, spectrum.white + spectrum.coloured.sum(), bare.left(np.zeros(1)))
    size = local_size(rows, squares)
    whitening = Whitening(rows, spectrum, size)
    for share in (*SHARES, SETTINGS.search_share):
        whitening.factor(1.0, share)
    fits: dict[Ids, DriveFit] = {}
    nothing = PressureProblem(evidence, whitening, (), lag_known)
    fits[()] = _fit(nothing, starts(nothing, ()))
    cells = np.arange(int(evidence.grid.cell_starts[-1]))
    room = 0.5 * step + _ROOM * evidence.pressure_noise_kpa + _BLUR * blur(evidence, cells)
    late = fits[()].z[-1] > _QUICK_S  # which may be the drive's, as far as the pressure goes
    if late or _drive_of(evidence, fits, room, x).gap_deg > _NOTHING_DEG:
        names = [n for n, e in LIBRARY.items() if e.stage == "drive" and n not in excluded]

        def alone(name: str) -> DriveFit:
            problem = PressureProblem(evidence, whitening, (name,), lag_known)
            return _fit(problem, starts(problem, _DELAYS_S))

        for fit in each(alone, names):
            fits[fit.ids] = fit
        ranked = sorted(names, key=lambda n: -float(fits[(n,)].evidence.max()))
        pairs = [
            ordered((one, other))
            for one, other in combinations(ranked[:_PAIRED], 2)
            if beside((one,), (other,))
        ]

        def together(ids: Ids) -> DriveFit:
            problem = PressureProblem(evidence, whitening, ids, lag_known)
            alone = [fits[(name,)].z for name in ids]
            lag = np.mean([z[-1:] for z in alone], axis=0)
            return _fit(problem, [np.concatenate([*(z[:-1] for z in alone), lag])])

        for fit in each(together, pairs):
            fits[fit.ids] = fit
    return _drive_of(evidence, fits, room, x)


def _between_repeats(evidence: Evidence, known: Floats) -> Floats:
    """Variance of repeated trials about their mean, beyond what is known, (n,), kPa².

    No effect makes a pressure that differs where all was the same.
    """
    grid, found = evidence.grid, np.zeros(known.size)
    assert grid.measured_kpa is not None
    for repeated in repeats(evidence, grid.measured_kpa, evidence.takes_part):
        rows = repeated.rows
        several = np.isfinite(repeated.values).sum(axis=0) > 1
        if not several.any():
            continue
        variance = np.nanvar(repeated.values[:, several], axis=0, ddof=1)
        beyond = np.maximum(variance - known[rows[several]], 0.0)
        alike = evidence.alike == evidence.alike[grid.sample_trial[rows[0]]]
        for trial in np.flatnonzero(alike):
            own = evidence.rows[trial]
            found[own] = np.interp(grid.time_s[own], grid.time_s[rows[several]], beyond)
    return found


def true_pressure(evidence: Evidence, fitted: DriveFit, room_kpa: Floats) -> Floats:
    """Take a fit where the sensor agrees with it, within some room, else the sensor, (cells,)."""
    assert evidence.grid.pressure_kpa is not None
    measured = (evidence.grid.pressure_kpa - fitted.sensor[0]) / (1.0 + fitted.sensor[1])
    agreed = np.clip(fitted.shown_kpa, measured - room_kpa, measured + room_kpa)
    return np.asarray(fitted.cells_kpa + (agreed - fitted.shown_kpa))


def _drive_of(evidence: Evidence, fits: dict[Ids, DriveFit], room_kpa: Floats, x: Floats) -> Drive:
    """Say what the best fit makes of the drive."""
    grid = evidence.grid
    best = max(fits.values(), key=lambda fit: float(fit.evidence.max()))
    true_kpa = true_pressure(evidence, best, room_kpa)
    assert grid.command_kpa is not None
    driven, commanded = (
        angle_chain(evidence, x, kpa).run(x, absent())[0] for kpa in (true_kpa, None)
    )
    change = (driven - commanded)[evidence.used]
    weight = grid.counts[evidence.used]
    return Drive(
        fits=fits,
        pressure_kpa=true_kpa,
        room_kpa=room_kpa,
        given=x,
        gap_kpa=float(np.sqrt(np.mean((true_kpa - grid.command_kpa) ** 2))),
        gap_deg=float(np.sqrt(np.average(change**2, weights=weight))),
    )


def _beyond_noise(rows: Rows, white: float, left: Floats) -> Floats:
    """Square what is left at each row, less its noise; about a jump at least as its neighbours."""
    squares = left**2
    for group in rows.groups:
        noise = group.fixed + white / group.count
        squares[group.rows] -= noise
        for trial in np.unique(group.trial):
            mine = np.flatnonzero(group.trial == trial)
            sharp = mine[noise[mine] <= _SHARP * np.median(noise[mine])]
            at = group.rows.start
            near = np.interp(mine, sharp, squares[at + sharp])
            squares[at + mine] = np.maximum(squares[at + mine], near)
    return squares


def _fit(problem: PressureProblem, points: list[Floats]) -> DriveFit:
    factor = problem.whitening.factor(1.0, SETTINGS.search_share)
    if len(points) > _BEST_STARTS:
        points = sorted(points, key=lambda z: problem.misfit(z, factor))[:_BEST_STARTS]
    found = min(
        (problem.search(z, factor, problem.variance, _ENOUGH, _MOST_TRIED) for z in points),
        key=lambda each: each.at.value,
    )
    linear = problem.linear(found.z)
    weighed = [
        problem.weigh(linear, problem.whitening.factor(1.0, share), np.ones(1)) for share in SHARES
    ]
    evidence = np.array([log for log, _, _ in weighed])
    _, solution, top = weighed[int(np.argmax(evidence))]
    left_kpa = problem.whitening.beyond_noise(problem.remaining(linear, solution, top))
    sensor = solution.coefficients[-3:]
    shown = problem.predict(found.z)
    grid, cells = problem.evidence.grid, problem.cells(found.z)
    measured = grid.measured_kpa
    assert measured is not None
    return DriveFit(
        ids=problem.ids,
        z=found.z,
        effects=problem.effects(found.z),
        cells_kpa=cells,
        shown_kpa=problem.shown(found.z),
        predicted_kpa=grid.sampled(cells),
        residual_kpa=measured - shown - sensor[0] - sensor[1] * shown,
        sensor=sensor[:2],
        sigma=problem.errors(linear, factor),
        evidence=evidence,
        left_kpa=left_kpa,
        decrement=found.decrement,
    )
