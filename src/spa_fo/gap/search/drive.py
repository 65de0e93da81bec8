"""The drive by itself: what explains the measured pressure, and the true pressure that follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.evidence import Evidence, angle_chain
from spa_fo.gap.data.floor import repeats
from spa_fo.gap.fit.bench import SHARES, local_size, rows_of
from spa_fo.gap.fit.least_squares import starts
from spa_fo.gap.fit.pressure import PressureProblem, blur, resolution, timing_error
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
    """Some drive effects fitted to the measured pressure."""

    ids: Ids
    z: Floats  # parameters as searched, and the sensor's lag
    effects: Floats  # parameters of all effects, NaN where absent
    cells_kpa: Floats  # (cells,), true pressure on the grid's cells
    shown_kpa: Floats  # (cells,), what a sensor that lags shows of it
    predicted_kpa: Floats  # (n,), true pressure at the grid's averaged samples
    residual_kpa: Floats  # (n,), what is left with the sensor's lag, offset and gain taken out
    sensor: Floats  # (2,), offset (kPa) and relative gain error of the pressure sensor
    sigma: Floats  # errors of `z`
    evidence: Floats  # (shares,), log evidence for each of `SHARES`
    left_kpa: float  # RMS of the residual beyond noise


@dataclass(frozen=True)
class Drive:
    """What the measured pressure says."""

    fits: dict[Ids, DriveFit]  # by effects; none is the command itself
    pressure_kpa: Floats  # (cells,), the true pressure as far as it is known
    room_kpa: Floats  # (cells,), by how much the sensor may differ from a fit that is believed
    given: Floats  # (5,), coefficients of the given model
    gap_kpa: float  # RMS of what the command misses of the true pressure
    gap_deg: float  # RMS of what that moves the given model's angle by

    @property
    def per_kpa_deg(self) -> float:
        """By how much a kPa of this kind moves the angle, deg."""
        return self.gap_deg / max(self.gap_kpa, 1e-9)

    @property
    def best(self) -> DriveFit:
        """The fit of largest evidence, at its best share."""
        return best_of(self.fits)


def best_of(fits: Mapping[Ids, DriveFit]) -> DriveFit:
    """Return the fit of largest evidence, at its best share."""
    return max(fits.values(), key=lambda fit: float(fit.evidence.max()))


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
    step, lag_known = resolution(evidence), beyond is not None  # by the same sensor
    whitening = _whitening(evidence, step, beyond)

    def problem(ids: Ids) -> PressureProblem:
        return PressureProblem(evidence, whitening, ids, lag_known)

    def alone(ids: Ids) -> DriveFit:
        own = problem(ids)
        return _fit(own, starts(own, np.zeros(0), _DELAYS_S))

    def together(ids: Ids) -> DriveFit:
        singles = [fits[(name,)].z for name in ids]
        lag = np.mean([z[-1:] for z in singles], axis=0)
        return _fit(problem(ids), [np.concatenate([*(z[:-1] for z in singles), lag])])

    fits: dict[Ids, DriveFit] = {(): alone(())}
    cells = np.arange(int(evidence.grid.cell_starts[-1]))
    room = 0.5 * step + _ROOM * evidence.pressure_noise_kpa + _BLUR * blur(evidence, cells)
    late = fits[()].z[-1] > _QUICK_S  # which may be the drive's, as far as the pressure goes
    if late or drive_of(evidence, fits, room, x).gap_deg > _NOTHING_DEG:
        names = [n for n, e in LIBRARY.items() if e.stage == "drive" and n not in excluded]
        fits |= {f.ids: f for f in each(alone, [(name,) for name in names])}
        ranked = sorted(names, key=lambda n: -float(fits[(n,)].evidence.max()))
        pairs = [
            ordered((one, other))
            for one, other in combinations(ranked[:_PAIRED], 2)
            if beside((one,), (other,))
        ]
        fits |= {f.ids: f for f in each(together, pairs)}
    return drive_of(evidence, fits, room, x)


def drive_of(evidence: Evidence, fits: dict[Ids, DriveFit], room_kpa: Floats, x: Floats) -> Drive:
    """Say what the best fit makes of the drive; for `room_kpa` and `x` see `Drive`."""
    grid, true_kpa = evidence.grid, true_pressure(evidence, best_of(fits), room_kpa)
    assert grid.command_kpa is not None
    driven, commanded = (
        angle_chain(evidence, x, kpa).run(x, absent())[0] for kpa in (true_kpa, None)
    )
    change = (driven - commanded)[evidence.used]
    return Drive(
        fits=fits,
        pressure_kpa=true_kpa,
        room_kpa=room_kpa,
        given=x,
        gap_kpa=float(np.sqrt(np.mean((true_kpa - grid.command_kpa) ** 2))),
        gap_deg=float(np.sqrt(np.average(change**2, weights=grid.counts[evidence.used]))),
    )


def true_pressure(evidence: Evidence, fitted: DriveFit, room_kpa: Floats) -> Floats:
    """Take a fit where the sensor agrees with it, within some room, else the sensor, (cells,)."""
    assert evidence.grid.pressure_kpa is not None
    measured = (evidence.grid.pressure_kpa - fitted.sensor[0]) / (1.0 + fitted.sensor[1])
    agreed = np.clip(fitted.shown_kpa, measured - room_kpa, measured + room_kpa)
    return np.asarray(fitted.cells_kpa + (agreed - fitted.shown_kpa))


def _whitening(evidence: Evidence, step_kpa: float, beyond: Spectrum | None) -> Whitening:
    """Say what is noise at the rows of the pressure, and how large the gap is."""
    known = timing_error(evidence) ** 2 + _BINNING_KPA**2
    rows = rows_of(evidence, known + _between_repeats(evidence, known))
    # What a step of the converter hides stays the same for as long as the pressure does.
    hidden = np.full(CORRELATION_S.size, step_kpa**2 / 12.0 / CORRELATION_S.size)
    spectrum = Spectrum(evidence.pressure_noise_kpa**2, hidden)
    if beyond is not None:
        spectrum = spectrum.beside(beyond)
    bare = PressureProblem(evidence, Whitening(rows, spectrum, np.zeros(rows.size)), ())
    squares = _beyond_noise(rows, spectrum.white + spectrum.coloured.sum(), bare.left(np.zeros(1)))
    whitening = Whitening(rows, spectrum, local_size(rows, squares))
    for share in (*SHARES, SETTINGS.search_share):
        whitening.factor(1.0, share)  # before processes share the work
    return whitening


def _between_repeats(evidence: Evidence, known: Floats) -> Floats:
    """Variance of repeated trials about their mean, beyond what is known, (n,), kPa².

    No effect makes a pressure that differs where all was the same.
    """
    grid, found = evidence.grid, np.zeros(known.size)
    assert grid.measured_kpa is not None
    for repeated in repeats(evidence, grid.measured_kpa, evidence.takes_part):
        several = np.isfinite(repeated.values).sum(axis=0) > 1
        if not several.any():
            continue
        rows = repeated.rows[several]
        variance = np.nanvar(repeated.values[:, several], axis=0, ddof=1)
        beyond = np.maximum(variance - known[rows], 0.0)
        alike = evidence.alike == evidence.alike[grid.sample_trial[repeated.rows[0]]]
        for trial in np.flatnonzero(alike):
            own = evidence.rows[trial]
            found[own] = np.interp(grid.time_s[own], grid.time_s[rows], beyond)
    return found


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
    """Fit from the best of some points."""
    factor = problem.whitening.factor(1.0, SETTINGS.search_share)
    if len(points) > _BEST_STARTS:
        points = sorted(points, key=lambda z: problem.misfit(z, factor))[:_BEST_STARTS]
    searched = [problem.search(z, factor, problem.variance, _ENOUGH, _MOST_TRIED) for z in points]
    z = min(searched, key=lambda each: each.at.value).z
    linear = problem.linear(z)
    weighed = [
        problem.weigh(linear, problem.whitening.factor(1.0, share), np.ones(1)) for share in SHARES
    ]
    evidence = np.array([log for log, _, _ in weighed])
    _, solution, top = weighed[int(np.argmax(evidence))]
    sensor = solution.coefficients[-3:-1]
    shown, cells, grid = problem.predict(z), problem.cells(z), problem.evidence.grid
    assert grid.measured_kpa is not None
    return DriveFit(
        ids=problem.ids,
        z=z,
        effects=problem.effects(z),
        cells_kpa=cells,
        shown_kpa=problem.shown(z),
        predicted_kpa=grid.sampled(cells),
        residual_kpa=grid.measured_kpa - shown - sensor[0] - sensor[1] * shown,
        sensor=sensor,
        sigma=np.sqrt(np.diag(problem.posterior(linear, factor, np.ones(1)))),
        evidence=evidence,
        left_kpa=problem.whitening.beyond_noise(problem.remaining(linear, solution, top)),
    )
