"""The fit of one explanation to the angles, and what it is worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import product

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.data.searched import to_x
from spa_fo.gap.fit.bench import LEVELS, LINE, SHARES, Bench, level_prior
from spa_fo.gap.fit.problem import MOSTLY, AngleProblem, Calibrated
from spa_fo.gap.fit.repeated import repeats_say, rest_of
from spa_fo.gap.noise.whitening import Factor
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.minimise import Minimum
from spa_fo.numeric.mixed import Solution
from spa_fo.plant.branches import Branches
from spa_fo.plant.effects.library import LIBRARY, Ids, at_port
from spa_fo.plant.sensor_curve import curve_columns

_ROUGH, _ROUGH_TRIED = 0.5, 12  # nats and points of a search that only ranks
_ENOUGH, _MOST_TRIED = 0.01, 40
_FIRST_SHARE = 1  # where the search for the best share and level begins
LINE_SEARCH = np.log(400.0)  # price of a search over frequencies and amplitudes


@dataclass(frozen=True)
class Fitted:
    """An explanation fitted to the angles.

    Attributes
    ----------
    ids : tuple of str
        Its effects.
    calibrated : Calibrated
        What calibrations show of its effects.
    z, slopes : array, (rows, parameters) array
        Searched coefficients and parameters, and slopes of the prediction over them.
    effects : array
        Parameters of all effects that are simulated, NaN where absent.
    predicted_deg, shared_deg : (n,) arrays
        At the grid's samples: of the simulation, and with what the fit tells besides: the curve's
        error, the zeros, and the branches.
    curve_deg : (knots,) array
        Error of the sensor's curve at its knots.
    curve_stretch : float
        These, as multiples of `CURVE_KNOTS_DEG`.
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
    logs : (shares,) array
        Log evidence by share that is missed, at one level of the noise, before it is tempered; what
        repeats say is in it with what tempering will take of it.
    level : float
        That level: the best for the share of largest evidence.
    quick : float
        Log evidence at the level and share of the search.
    decrement, tried, rejected : float, int, int
        What the last search left, and the points that it took.
    delay_s, delays_deg : float
        Of how long a delay trials' own are parts, that of clocks among it, and the RMS by which
        they move the angle.
    branches : dict
        Those that trials began on, by loop of the sensor.
    line : (float, float) or None
        Frequency (Hz) and amplitude (deg) of an interference.
    trend_nats, trend_deg : float
        Log evidence for gain and rest angle that go with the trials' order beside the explanation,
        and their RMS.
    left_deg : float
        RMS of the residual beyond noise.
    """

    ids: Ids
    calibrated: Calibrated
    z: Floats
    slopes: Floats
    effects: Floats
    predicted_deg: Floats
    shared_deg: Floats
    curve_deg: Floats
    curve_stretch: float
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

    delay_s: float = 0.0
    delays_deg: float = 0.0
    branches: Branches = field(default_factory=dict)
    line: tuple[float, float] | None = None
    trend_nats: float = 0.0
    trend_deg: float = 0.0
    left_deg: float = 0.0

    @property
    def x(self) -> Floats:
        """Coefficients alpha2, alpha1, a1, a0, b0."""
        return to_x(self.z[:5])


def fit(
    bench: Bench,
    ids: Ids,
    points: Sequence[Floats],
    plain: Fitted | None = None,
    share: float = SETTINGS.search_share,
) -> Fitted:
    """Fit one explanation from the best of some points.

    `plain` is the plain model's fit, which says what a shift of the parameters moves.
    """
    return settled(bench, begun(bench, ids, points, plain, share), plain, share)


def begun(
    bench: Bench,
    ids: Ids,
    points: Sequence[Floats],
    plain: Fitted | None = None,
    share: float = SETTINGS.search_share,
) -> Fitted:
    """Fit one explanation roughly: to tell whether it is worth more, and where to go on."""
    factor = bench.whitening.factor(bench.level, share)
    fits = []
    for calibrated in variants(bench, ids):
        problem = AngleProblem(bench, ids, calibrated)
        variances = problem.scales**2
        spread = problem.spread(variances)
        found = _roughly(problem, points, factor, spread)
        fitted = _fitted(problem, found, factor, variances, plain)
        # What a step would gain with the variances found, which may open another way.
        here = problem.search(fitted.z, factor, problem.spread(fitted.variances), _ROUGH, 0)
        fits.append(replace(fitted, decrement=here.decrement))
    return max(fits, key=lambda f: f.quick)


def _roughly(
    problem: AngleProblem, points: Sequence[Floats], factor: Factor, spread: Floats
) -> Minimum:
    """Search from some points and take the best end."""
    found = []
    for z in points:
        with suppress(np.linalg.LinAlgError):  # a motion beyond all measure
            found.append(problem.search(z, factor, spread, _ROUGH, _ROUGH_TRIED))
    if not found:
        raise np.linalg.LinAlgError("every start moves the angle beyond all measure")
    return min(found, key=lambda m: m.at.value)


def variants(bench: Bench, ids: Sequence[str], calibrated: Calibrated = MOSTLY) -> list[Calibrated]:
    """List what calibrations may show of effects, beside what they show of others."""
    evidence = bench.evidence
    since = at_port("curve", ids) is not None or any(LIBRARY[n].in_later for n in ids)
    alone = any(LIBRARY[n].in_trials_alone for n in ids)
    later = (False, True) if since and evidence.drift_deg.size else (calibrated.later,)
    apart = (False, True) if alone and evidence.fixture is not None else (calibrated.apart,)
    return [Calibrated(*each) for each in product(later, apart)]


def settled(
    bench: Bench,
    rough: Fitted,
    plain: Fitted | None = None,
    share: float = SETTINGS.search_share,
    least: float = -np.inf,
) -> Fitted:
    """Go on with a rough fit to its end, with the nuisances' variances that it has found.

    It is given up where it has no hope of a log evidence of `least`.
    """
    problem = problem_of(bench, rough)
    factor, spread = bench.whitening.factor(bench.level, share), problem.spread(rough.variances)
    found = problem.search(rough.z, factor, spread, _ENOUGH, _MOST_TRIED, least - rough.quick)
    tried, rejected = rough.tried + found.tried, rough.rejected + found.rejected
    found = replace(found, tried=tried, rejected=rejected)
    return _fitted(problem, found, factor, rough.variances, plain)


def problem_of(bench: Bench, fitted: Fitted, trend: bool = False) -> AngleProblem:
    """Make the problem again that was fitted, on the same bench; its slopes there are known."""
    problem = AngleProblem(bench, fitted.ids, fitted.calibrated, trend)
    problem.once("slopes", fitted.z, lambda: fitted.slopes)
    return problem


def _fitted(
    problem: AngleProblem, found: Minimum, factor: Factor, variances: Floats, plain: Fitted | None
) -> Fitted:
    """Weigh the end of a search, with the nuisances that are most probable there."""
    bench, ids = problem.bench, problem.ids
    linear = problem.linear(found.z)
    quick, solution, _ = problem.weigh(linear, factor, variances)
    b = solution.coefficients[-problem.size :]
    predicted, _ = problem.predict(linear.z)
    zeros = np.zeros(len(bench.evidence.grid.trials))
    if problem.walk.size:
        zeros = b[problem.walk[0]] * (bench.evidence.grid.orders - 1.0)
        zeros = zeros + np.cumsum(b[problem.steps])
    curve = b[problem.curve]
    branches, delays = problem.branches(b), linear.columns[:, problem.delays] @ b[problem.delays]
    shared = predicted + zeros[bench.evidence.grid.sample_trial] + problem.begun(linear.z, branches)
    if at_port("curve", ids):
        shared = shared + curve_columns(predicted, bench.evidence.curve_stretch) @ curve
    whole = solution.covariance()
    at = whole.shape[0] - problem.size + problem.curve
    fitted = Fitted(
        ids=ids,
        calibrated=problem.calibrated,
        z=linear.z,
        slopes=linear.slopes,
        effects=problem.effects(linear.z),
        predicted_deg=predicted,
        shared_deg=shared,
        curve_deg=curve,
        curve_stretch=bench.evidence.curve_stretch,
        curve_sigma_deg=np.sqrt(np.diag(whole)[at]),
        zeros_deg=zeros,
        variances=solution.variances,
        covariance=problem.posterior(linear, factor, solution.variances),
        moved_deg={},
        logs=np.full(len(SHARES), -np.inf),
        level=bench.level,
        quick=quick + _by_repeats(problem, solution),
        decrement=found.decrement,
        tried=found.tried,
        rejected=found.rejected,
        delay_s=problem.delay_s(linear.z),
        delays_deg=float(np.linalg.norm(delays) / np.sqrt(problem.rows.size)),
        branches=branches,
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
            change = curve_columns(y, evidence.curve_stretch) @ fitted.curve_deg
        elif port == "zeros":
            change = fitted.zeros_deg[evidence.grid.sample_trial]
        else:
            less = fitted.effects.copy()
            less[LIBRARY[name].slots] = np.nan
            chain = problem.chain.mounted(problem.in_fixture(less)[1])
            change = y - chain.run(fitted.x, less)[0]
        found[name] = float(np.sqrt(np.average(change**2, weights=evidence.grid.counts)))
    return found


def weighed(bench: Bench, fitted: Fitted) -> Fitted:
    """Weigh a fit at every share that it may miss, at the best level of the noise."""
    problem = problem_of(bench, fitted)
    linear = problem.linear(fitted.z)

    @cache
    def log(share: int, level: int) -> float:
        factor = bench.whitening.factor(LEVELS[level], SHARES[share])
        value, _, _ = problem.weigh(linear, factor, fitted.variances, rounds=3)
        return value + level_prior(bench, LEVELS[level])

    best, at = _FIRST_SHARE, LEVELS.index(fitted.level)
    for _ in SHARES:
        at = _climb(partial(log, best), at)
        logs = np.array([log(share, at) for share in range(len(SHARES))])
        if int(np.argmax(logs)) == best:
            break
        best = int(np.argmax(logs))
    factor = bench.whitening.factor(LEVELS[at], SHARES[best])
    _, solution, top = problem.weigh(linear, factor, fitted.variances, rounds=3)
    remaining = problem.remaining(linear, solution, top)
    left_deg = bench.whitening.beyond_noise(remaining[: problem.rows.size], LEVELS[at])
    nats, size = _trend(bench, fitted, factor)
    return replace(
        fitted,
        logs=logs + _by_repeats(problem, solution),
        level=LEVELS[at],
        trend_nats=nats,
        trend_deg=size,
        left_deg=left_deg,
    )


def _by_repeats(problem: AngleProblem, solution: Solution) -> float:
    """Give the rest of what repeats say, nats before tempering; the fit's evidence has a part."""
    nats = repeats_say(problem, solution)
    if at_port("zeros", problem.ids) is not None:
        nats += problem.bench.noise.moving_nats
    return rest_of(nats)


def _trend(bench: Bench, fitted: Fitted, factor: Factor) -> tuple[float, float]:
    """Weigh what goes with the trials' order: nats, and its RMS over the rows, deg."""
    with_it, without = (problem_of(bench, fitted, trend) for trend in (True, False))
    linear = with_it.linear(fitted.z)
    bare = replace(linear, columns=np.delete(linear.columns, with_it.trends, axis=1))
    more, solution, _ = with_it.weigh(linear, factor, fitted.variances, rounds=3)
    less, other, _ = without.weigh(bare, factor, fitted.variances, rounds=3)
    more += _by_repeats(with_it, solution)
    less += _by_repeats(without, other)
    b = solution.coefficients[-with_it.size :]
    moved = linear.columns[: with_it.rows.size, with_it.trends] @ b[with_it.trends]
    return more - less, float(np.sqrt(np.mean(moved**2)))


def _climb(log: Callable[[int], float], at: int) -> int:
    """Go up from a place in `LEVELS` to the nearest top."""
    start = at
    for side in (1, -1):
        while 0 <= at + side < len(LEVELS) and log(at + side) > log(at):
            at += side
        if at != start:
            break
    return at


def without_others(angle: Fitted, ids: Ids) -> Floats:
    """Take what is searched of some effects out of a fit that holds them among others."""
    kept, at = [angle.z[:5]], 5
    for name in angle.ids:
        if LIBRARY[name].port != "chain":
            continue
        end = at + len(LIBRARY[name].parameters)
        if name in ids:
            kept.append(angle.z[at:end])
        at = end
    return np.concatenate(kept)


def price(fitted: Fitted) -> float:
    """Say what a search over frequencies costs an explanation, nats."""
    return float(LINE_SEARCH) if at_port("line", fitted.ids) else 0.0
