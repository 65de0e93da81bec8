"""Which explanations of the angle are worth a fit, and their fits.

Every effect is weighed first by a score test beside a fitted explanation: the change that it makes,
whitened, cleared of what nuisances and parameters may take, against what is left. Only the best are
fitted; so are pairs, of what shows beside the best single effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from spa_fo.gap.bench import LEVELS, LINE, SHARES, Bench, level_prior, plain_deg
from spa_fo.gap.evidence import curve_columns
from spa_fo.gap.interference import NONE, Line, slow_line
from spa_fo.gap.problem import AngleProblem, starts
from spa_fo.gap.searched import to_x
from spa_fo.gap.settings import SETTINGS
from spa_fo.gap.together import each
from spa_fo.gap.whitening import Factor
from spa_fo.plant.effects.library import LIBRARY, at_port, ordered

Floats = NDArray[np.float64]
Ids = tuple[str, ...]

_SINGLES, _HOSTS, _BESIDE = 8, 3, 3  # fitted alone; that get others beside them; so many others
_BEST_STARTS = 2
_ROUGH, _ROUGH_TRIED = 0.5, 12  # nats and points of a search that only ranks starts
_FIRST, _ENOUGH, _MOST_TRIED = 0.1, 0.01, 40
_FARTHEST = 4.0  # times the size that an effect is screened with
_WORTH_WEIGHING = 60.0  # nats behind the best
_LINE_SEARCH = np.log(400.0)  # price of a search over frequencies and amplitudes


@dataclass(frozen=True)
class Fitted:
    """An explanation fitted to the angles.

    Attributes
    ----------
    ids : tuple of str
        Its effects.
    changed : bool
        Whether an unknown sensor curve was taken for that of later calibrations too.
    z : array
        Searched coefficients and parameters.
    effects : array
        Parameters of all effects that are simulated, NaN where absent.
    predicted_deg, shared_deg : (n,) arrays
        At the grid's samples: of the simulation, and with the curve's error and the zeros.
    curve_deg : (knots,) array
        Error of the sensor's curve, and its own errors, 1 sigma.
    curve_sigma_deg : (knots,) array
        Its error, 1 sigma.
    zeros_deg : (trials,) array
        Zero of the sensor by trial.
    variances : (groups,) array
        Of the nuisances.
    covariance : array
        Of `z`.
    moved_deg : dict
        RMS by which each effect moves the angle.
    logs : dict
        Log evidence by share that is missed, at the best level of the noise.
    level : float
        That level.
    quick : float
        Log evidence at the level and share of the search.
    decrement, tried, rejected : float, int, int
        What the last search left, and the points that it took.
    line : (float, float) or None
        Frequency (Hz) and amplitude (deg) of an interference.
    trend_nats, trend_deg : float
        Log evidence for gain and rest angle that go with the trials' order beside the explanation,
        and their RMS.
    """

    ids: Ids
    changed: bool
    z: Floats
    effects: Floats
    predicted_deg: Floats
    shared_deg: Floats
    curve_deg: Floats
    curve_sigma_deg: Floats
    zeros_deg: Floats
    variances: Floats
    covariance: Floats
    moved_deg: dict[str, float]
    logs: Floats
    level: float
    quick: float
    decrement: float
    tried: int
    rejected: int

    line: tuple[float, float] | None = None
    trend_nats: float = 0.0
    trend_deg: float = 0.0

    @property
    def x(self) -> Floats:
        """Coefficients alpha2, alpha1, a1, a0, b0."""
        return to_x(self.z[:5])


@dataclass(frozen=True)
class Explanations:
    """All fits of the angle, and the interference that was found.

    Attributes
    ----------
    bench : Bench
        What was fitted.
    fits : dict
        By effects.
    line : Line
        Of the averaged samples.
    excluded : tuple of str
        Effects that the library was to lack. The plain model identified again is fitted all the
        same: what it does better is then unknown.
    """

    bench: Bench
    fits: dict[Ids, Fitted]
    line: Line
    excluded: Ids = ()

    @property
    def plain(self) -> Fitted:
        """The plain model."""
        return self.fits[()]


def fit(
    bench: Bench,
    ids: Ids,
    points: Sequence[Floats],
    plain: Fitted | None = None,
    share: float = SETTINGS.search_share,
    most: int = _MOST_TRIED,
) -> Fitted:
    """Fit one explanation from the best of some points.

    The nuisances' variances are held in a search, found anew after it, and the search goes on.
    `plain` is the plain model's fit, which says what a shift of the parameters moves.
    """
    variants = [False]
    if at_port("curve", ids) and bench.evidence.drift_deg.size:
        variants = [False, True]
    fits = [_fit(bench, ids, points, plain, share, most, changed) for changed in variants]
    return max(fits, key=lambda f: f.quick)


def _fit(
    bench: Bench,
    ids: Ids,
    points: Sequence[Floats],
    plain: Fitted | None,
    share: float,
    most: int,
    changed: bool,
) -> Fitted:
    problem = AngleProblem(bench, ids, changed)
    factor = bench.whitening.factor(1.0, share)
    variances = bench.scales**2
    if len(points) > 1:
        rough = [
            problem.search(z, factor, problem.spread(variances), _ROUGH, _ROUGH_TRIED)
            for z in points
        ]
        points = [min(rough, key=lambda m: m.at.value).z]
    first = problem.search(points[0], factor, problem.spread(variances), _FIRST, most)
    _, solution, _ = problem.weigh(problem.linear(first.z), factor, variances)
    variances = solution.variances
    found = problem.search(first.z, factor, problem.spread(variances), _ENOUGH, most)
    linear = problem.linear(found.z)
    quick, solution, _ = problem.weigh(linear, factor, variances)
    b = solution.coefficients[-problem.size :]
    predicted, _ = problem.predict(linear.z)
    zeros = np.zeros(len(bench.evidence.grid.trials))
    if problem.walk.size:
        zeros = b[problem.walk[0]] * (bench.evidence.grid.orders - 1.0)
        zeros = zeros + np.cumsum(b[problem.steps])
    curve = b[problem.curve]
    shared = predicted + zeros[bench.evidence.grid.sample_trial]
    if at_port("curve", ids):
        shared = shared + curve_columns(predicted) @ curve
    whole = solution.covariance()
    at = whole.shape[0] - problem.size + problem.curve
    fitted = Fitted(
        ids=ids,
        changed=changed,
        z=linear.z,
        effects=problem.effects(linear.z),
        predicted_deg=predicted,
        shared_deg=shared,
        curve_deg=curve,
        curve_sigma_deg=np.sqrt(np.diag(whole)[at]),
        zeros_deg=zeros,
        variances=solution.variances,
        covariance=problem.posterior(linear, factor, solution.variances),
        moved_deg={},
        logs=np.full(len(SHARES), -np.inf),
        level=1.0,
        quick=quick,
        decrement=found.decrement,
        tried=first.tried + found.tried,
        rejected=first.rejected + found.rejected,
    )
    line = None
    if problem.line:
        line = problem.line, float(np.sqrt(2.0 * solution.variances[LINE]))
    return replace(fitted, moved_deg=_moved(problem, fitted, plain), line=line)


def _moved(problem: AngleProblem, fitted: Fitted, plain: Fitted | None) -> dict[str, float]:
    """RMS by which each effect moves the angle, deg."""
    evidence, found = problem.evidence, {}
    y = fitted.predicted_deg
    for name in fitted.ids:
        port = LIBRARY[name].port
        if port == "line":
            found[name] = float(np.sqrt(fitted.variances[LINE]))
            continue
        if port == "coefficients":
            before = problem.bench.centre if plain is None else plain.z[:5]
            change = y - problem.predict(np.concatenate([before, fitted.z[5:]]))[0]
        elif port == "curve":
            change = curve_columns(y) @ fitted.curve_deg
        elif port == "zeros":
            change = fitted.zeros_deg[evidence.grid.sample_trial]
        else:
            less = fitted.effects.copy()
            less[LIBRARY[name].slots] = np.nan
            chain = problem.chain
            if evidence.fixture is not None:
                chain = chain.seated(evidence.fixture.simulate(less)[1])
            change = y - chain.run(fitted.x, less)[0]
        found[name] = float(np.sqrt(np.average(change**2, weights=evidence.grid.counts)))
    return found


def weighed(bench: Bench, fitted: Fitted) -> Fitted:
    """Weigh a fit at every share that it may miss, each at its best level of the noise."""
    problem = AngleProblem(bench, fitted.ids, fitted.changed)
    linear = problem.linear(fitted.z)
    logs = np.empty(len(SHARES))
    at = LEVELS.index(1.0)
    levels = []
    for k, share in enumerate(SHARES):

        def log(i: int, share: float = share) -> float:
            factor = bench.whitening.factor(LEVELS[i], share)
            value, _, _ = problem.weigh(linear, factor, fitted.variances, rounds=3)
            return value + level_prior(bench, LEVELS[i])

        logs[k], at = _climb(log, at)
        levels.append(LEVELS[at])
    best = int(np.argmax(logs))
    nats, size = _trend(bench, fitted, bench.whitening.factor(levels[best], SHARES[best]))
    return replace(fitted, logs=logs, level=levels[best], trend_nats=nats, trend_deg=size)


def _trend(bench: Bench, fitted: Fitted, factor: Factor) -> tuple[float, float]:
    """Weigh what goes with the trials' order: nats, and its RMS over the rows, deg."""
    with_it, without = (
        AngleProblem(bench, fitted.ids, fitted.changed, trend=trend) for trend in (True, False)
    )
    linear = with_it.linear(fitted.z)
    bare = replace(linear, columns=np.delete(linear.columns, with_it.trends, axis=1))
    more, solution, _ = with_it.weigh(linear, factor, fitted.variances, rounds=3)
    less, _, _ = without.weigh(bare, factor, fitted.variances, rounds=3)
    b = solution.coefficients[-with_it.size :]
    moved = linear.columns[: with_it.rows.size, with_it.trends] @ b[with_it.trends]
    return more - less, float(np.sqrt(np.mean(moved**2)))


def _climb(log: object, at: int) -> tuple[float, int]:
    """Go up from a place in `LEVELS` to the nearest top."""
    assert callable(log)
    best, start = float(log(at)), at
    for side in (1, -1):
        while 0 <= at + side < len(LEVELS):
            value = float(log(at + side))
            if value <= best:
                break
            best, at = value, at + side
        if at != start:
            break
    return best, at


@dataclass(frozen=True)
class Shown:
    """What a score test shows of an effect from one start: nats, and the point it begins at."""

    name: str
    gain: float
    z: Floats


def screen(bench: Bench, base: Fitted, names: Sequence[str]) -> list[Shown]:
    """Weigh effects beside a fitted explanation by a score test, best first.

    Parameters
    ----------
    bench : Bench
        The campaign.
    base : Fitted
        The explanation.
    names : sequence of str
        Effects; those of the explanation are left out.
    """
    problem = AngleProblem(bench, base.ids, base.changed)
    factor = bench.whitening.factor(1.0, SETTINGS.search_share)
    linear = problem.linear(base.z)
    own = problem.white(factor, np.hstack([linear.columns, linear.slopes @ problem.root]))
    left = problem.white(factor, linear.left)
    precision = np.append(1.0 / problem.spread(base.variances), np.ones(problem.parameters))
    matrix = own.T @ own
    matrix[np.diag_indices_from(matrix)] += precision
    root = np.linalg.cholesky(matrix)
    half = solve_triangular(root, own.T, lower=True)
    away = solve_triangular(problem.root, problem.centre - base.z, lower=True)
    pull = np.append(np.zeros(precision.size - away.size), away)
    taken = half @ left + solve_triangular(root, pull, lower=True)
    y, fixed = problem.predict(base.z)
    drifts = np.zeros(bench.evidence.drift_deg.size)
    shown = []
    for name in names:
        if name in base.ids:
            continue
        wide = AngleProblem(bench, ordered((*base.ids, name)), base.changed)
        slots = LIBRARY[name].slots
        mine = np.array([slots.start <= slot.place < slots.stop for slot in wide.slots])
        signed = LIBRARY[name].parameters[0].low < 0.0
        for point in starts(AngleProblem(bench, (name,)), base.z[:5]):
            z = np.empty(wide.parameters)
            z[:5], z[5:][~mine], z[5:][mine] = base.z[:5], base.z[5:], point[5:]
            there, fixed_there = wide.predict(z)
            change = np.concatenate([problem.rows.merged(there - y), fixed_there - fixed, drifts])
            column = problem.white(factor, change)
            shadow = half @ column
            seen = float(column @ column - shadow @ shadow) + 1.0
            score = float(column @ left - shadow @ taken)
            size = float(np.clip(score / seen, -_FARTHEST if signed else 0.0, _FARTHEST))
            shown.append(Shown(name, size * score - 0.5 * size**2 * seen, z))
    return sorted(shown, key=lambda s: -s.gain)


def _points(shown: Sequence[Shown], name: str) -> list[Floats]:
    return [s.z for s in shown if s.name == name][:_BEST_STARTS]


def _first(shown: Sequence[Shown], count: int) -> list[str]:
    return list(dict.fromkeys(s.name for s in shown))[:count]


def explain(bench: Bench, excluded: Sequence[str] = ()) -> Explanations:
    """Fit every explanation that may win.

    Parameters
    ----------
    bench : Bench
        The campaign; how large its gap is need not be known.
    excluded : sequence of str
        Effects that the library is to lack.
    """
    bench = _gap_known(bench)
    plain = fit(bench, (), bench.starts)
    linear, chained = _to_try(bench, excluded)
    again = at_port("coefficients", excluded)
    shown = screen(bench, plain, chained)
    alone = [((n,), [plain.z]) for n in linear]
    alone += [((n,), _points(shown, n)) for n in _first(shown, _SINGLES)]
    if again is not None and not bench.own:
        alone.append(((again,), [plain.z]))
    fits = {(): plain} | {f.ids: f for f in each(lambda a: fit(bench, a[0], a[1], plain), alone)}
    allowed = [f for f in fits.values() if f.ids and f.ids != (again,)]
    hosts = sorted(allowed, key=lambda f: -f.quick)[:_HOSTS]
    beside: dict[Ids, list[Floats]] = {}
    for host, more in zip(hosts, each(lambda h: screen(bench, h, chained), hosts), strict=True):
        for name in _first(more, _BESIDE):
            beside.setdefault(ordered((*host.ids, name)), _points(more, name)[:1])
        for name in linear:
            beside.setdefault(ordered((*host.ids, name)), [host.z])
    beside = {ids: points for ids, points in beside.items() if len(ids) == 2}
    pairs = each(lambda a: fit(bench, a[0], a[1], plain), list(beside.items()))
    fits |= {f.ids: f for f in pairs}
    bench, fits, line = _with_line(bench, fits, excluded)
    best = max(f.quick for f in fits.values())
    near = [f for f in fits.values() if f.quick > best - _WORTH_WEIGHING or not f.ids]
    for f in each(lambda f: weighed(bench, f), near):
        fits[f.ids] = f
    return Explanations(bench, fits, line, tuple(excluded))


def _gap_known(bench: Bench) -> Bench:
    """Say how large the gap is, and factor what all searches need."""
    y = plain_deg(bench)
    if bench.own:
        y = fit(bench, (), bench.starts, share=0.0).predicted_deg
    bench = bench.with_gap(bench.evidence.grid.angle_deg - y, y)
    for share in (SETTINGS.search_share, *SHARES):
        bench.whitening.factor(1.0, share)
    return bench


def _to_try(bench: Bench, excluded: Sequence[str]) -> tuple[list[str], list[str]]:
    """List the effects that are columns or covariances, and those that are simulated."""
    linear, chained = [], []
    for name in LIBRARY:
        effect = LIBRARY[name]
        known = effect.stage == "drive" and bench.chain.is_pressure
        if name in excluded or known or effect.port == "line":
            continue
        if effect.port == "chain":
            chained.append(name)
        elif not (effect.port == "coefficients" and bench.own):
            linear.append(name)
    return linear, chained


def _with_line(
    bench: Bench, fits: dict[Ids, Fitted], excluded: Sequence[str]
) -> tuple[Bench, dict[Ids, Fitted], Line]:
    """Look for an interference beside the best explanation, and fit it beside others."""
    name = at_port("line")
    if name is None or name in excluded:
        return bench, fits, NONE
    allowed = [f for f in fits.values() if not set(f.ids) & set(excluded)]
    best = weighed(bench, max(allowed, key=lambda f: f.quick))
    share = SHARES[int(np.argmax(best.logs))]
    problem = AngleProblem(bench, best.ids, best.changed)
    factor = bench.whitening.factor(best.level, min(share, SHARES[3]))
    linear, n = problem.linear(best.z), problem.rows.size
    white = bench.whitening.white(factor, np.hstack([linear.columns[:n], linear.slopes[:n]]))
    left = bench.whitening.white(factor, linear.left[:n])
    line = slow_line(problem.rows, bench.whitening, factor, left, np.linalg.qr(white)[0].T)
    if line.gain < SETTINGS.line_nats:
        return bench, fits, NONE
    scales = bench.scales.copy()
    scales[LINE] = line.amplitude_deg / np.sqrt(2.0)
    bench = replace(bench, line=line.frequency_hz, scales=scales)
    hosts = [f for f in allowed if len(f.ids) < 2 or f.ids == best.ids]
    waved = each(
        lambda f: fit(bench, ordered((*f.ids, name)), [f.z], fits[()]),
        hosts,
    )
    more = {f.ids: replace(f, quick=f.quick - _LINE_SEARCH) for f in waved}
    return bench, fits | more, line


def price(fitted: Fitted) -> float:
    """Say what a search over frequencies costs an explanation, nats."""
    return float(_LINE_SEARCH) if at_port("line", fitted.ids) else 0.0
