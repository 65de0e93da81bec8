"""Which explanations of the angle are worth a fit: screened, fitted, weighed.

Every effect is weighed first by a score test beside a fitted explanation (`screening`). Only the
best are fitted; so are pairs, of what shows beside the best single effects, and a third effect
where the best pair is worth it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numba
import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.data.searched import to_x
from spa_fo.gap.fit.bench import LINE, SHARES, Bench, plain_deg
from spa_fo.gap.noise.interference import NONE, WORTH_A_FIT, Line, slow_line
from spa_fo.gap.prior import further_price
from spa_fo.gap.search.fitted import (
    LINE_SEARCH,
    Fitted,
    begun,
    fit,
    problem_of,
    settled,
    weighed,
    without_others,
)
from spa_fo.gap.search.screening import (
    Shown,
    beforehand,
    by_promise,
    first_of,
    points_of,
    screen,
)
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.minimise import HOPE
from spa_fo.plant.effects.library import LIBRARY, Ids, absent, at_port, beside, ordered, rare
from spa_fo.together import Team, each, team

_SINGLES, _HOSTS, _BESIDE = 8, 3, 3  # fitted alone; that get others beside them; so many others
WORTH_WEIGHING = 60.0  # nats behind the best
_LEVEL_OFF = 1.9  # from twice or half as much noise on a search begins anew. Assumed


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


def _worth(fitted: Fitted) -> float:
    return fitted.quick + beforehand(fitted.ids)


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
    alone = [((n,), [plain.z]) for n in linear]
    with team(bench) as ours:
        (shown,) = _screened(ours, [(plain, chained)])
        promising = dict.fromkeys([*first_of(shown, _SINGLES), *_by_order(chained)])
        alone += [((n,), points_of(shown, n)) for n in promising]
        if again is not None and not bench.own:
            alone.append(((again,), [plain.z]))
        fits = {(): plain} | _fits(ours, alone, plain, plain)
        allowed = [f for f in fits.values() if f.ids and f.ids != (again,)]
        hosts = sorted(allowed, key=lambda f: -_worth(f))[:_HOSTS]
        level = _level_beside(bench, hosts)
        if level == bench.level:
            pairs = _beside(ours, hosts, chained, linear, plain)
            pairs |= _exchanged(ours, hosts, pairs, plain)
            fits |= pairs
            top = max(pairs.values(), key=_worth, default=plain)
            if hosts and SETTINGS.temper * (_worth(top) - _worth(hosts[0])) > further_price():
                fits |= _three(ours, top, chained, linear, fits, plain)
    if level != bench.level:
        return explain(replace(bench, level=level), excluded)
    bench, fits, line = _with_line(bench, fits, excluded)
    best = max(f.quick for f in fits.values())
    near = [f for f in fits.values() if f.quick > best - WORTH_WEIGHING or not f.ids]
    near = [f for f in near if not np.isfinite(f.logs).all()]
    known = each(lambda f: _tried(weighed, bench, f), near)
    return Explanations(bench, fits | _by_ids(known), line, tuple(excluded))


def _tried(function: Callable[..., Fitted], *arguments: Any, **options: Any) -> Fitted | None:
    """Fit or weigh; None where an explanation moves the angle beyond all measure.

    It is left out then: it does not end a diagnosis in which others do well.
    """
    with suppress(np.linalg.LinAlgError):
        return function(*arguments, **options)
    return None


def _by_ids(fits: Iterable[Fitted | None]) -> dict[Ids, Fitted]:
    return {f.ids: f for f in fits if f is not None}


def _level_beside(bench: Bench, singles: Sequence[Fitted]) -> float:
    """Say at which level of the noise to search on: as the best fit so far leaves it.

    Where nothing repeats it may be far from what was expected, and what is best beside one level
    is not beside another. Beside a reference it is known.
    """
    if bench.level != 1.0 or bench.noise.compared or not singles:
        return bench.level
    level = weighed(bench, singles[0]).level
    return level if abs(np.log(level)) > np.log(_LEVEL_OFF) else bench.level


def _beside(
    ours: Team,
    hosts: Sequence[Fitted],
    chained: Sequence[str],
    linear: Sequence[str],
    plain: Fitted,
) -> dict[Ids, Fitted]:
    """Fit one effect more beside each host: those that a score test shows, and the linear ones."""
    more: dict[Ids, list[Floats]] = {}
    shown = _screened(ours, [(host, beside(host.ids, chained)) for host in hosts])
    for host, seen in zip(hosts, shown, strict=True):
        # What goes with the trials' order may hide in their scatter beside a host, too.
        for name in dict.fromkeys([*first_of(seen, _BESIDE), *_by_order(one.name for one in seen)]):
            more.setdefault(ordered((*host.ids, name)), points_of(seen, name)[:1])
        for name in linear:
            if name not in host.ids:
                more.setdefault(ordered((*host.ids, name)), [host.z])
    best = max(hosts, key=lambda f: f.quick, default=plain)
    return _fits(ours, list(more.items()), plain, best)


def _exchanged(
    ours: Team, hosts: Sequence[Fitted], pairs: dict[Ids, Fitted], plain: Fitted
) -> dict[Ids, Fitted]:
    """Fit what makes the best pair beside the other hosts: one that is alike may do as well there.

    Beside a host that misses something a score test may show what makes up for that first.
    """
    pair = max(pairs.values(), key=_worth, default=plain)
    others = [host for host in hosts if not set(host.ids) & set(pair.ids)]
    more: dict[Ids, list[Floats]] = {}
    for host in others:
        searched = _searched_of(pair) | _searched_of(host)
        for name in beside(host.ids, pair.ids):
            ids = ordered((*host.ids, name))
            if ids not in pairs:
                more[ids] = [np.concatenate([host.z[:5], *(searched[n] for n in ids)])]
    return _fits(ours, list(more.items()), plain, pair)


def _searched_of(fitted: Fitted) -> dict[str, Floats]:
    """Give what is searched of each effect of a fit."""
    return {name: without_others(fitted, (name,))[5:] for name in fitted.ids}


def _by_order(names: Iterable[str]) -> list[str]:
    """List effects that go with the trials' order: no score test shows what repeats say of it."""
    return [n for n in names if "order" in LIBRARY[n].shown_in and not rare(n)]


def _screened(ours: Team, wanted: Sequence[tuple[Fitted, Sequence[str]]]) -> list[list[Shown]]:
    """Weigh effects beside each host, shared out evenly; the most probable first."""
    parts = numba.get_num_threads()
    jobs = [(host, names[k::parts]) for host, names in wanted for k in range(parts)]
    shown = ours(screen, jobs)
    return [by_promise(chain(*shown[k : k + parts])) for k in range(0, len(jobs), parts)]


def _fits(
    ours: Team,
    wanted: Sequence[tuple[Ids, list[Floats]]],
    plain: Fitted,
    best: Fitted,
) -> dict[Ids, Fitted]:
    """Fit explanations roughly, and to their end those that may still be worth weighing.

    Parameters
    ----------
    ours : Team
        Of the campaign's bench.
    wanted : sequence of (ids, points)
        Explanations, and where to begin.
    plain : Fitted
        The plain model's fit.
    best : Fitted
        The best fit so far.
    """
    begin, end = partial(_tried, begun), partial(_tried, settled)
    rough = _by_ids(ours(begin, [(ids, points, plain) for ids, points in wanted]))
    least = max([best.quick, *(f.quick for f in rough.values())]) - WORTH_WEIGHING
    worth = [f for f in rough.values() if f.quick + HOPE * f.decrement > least]
    ended = ours(partial(end, least=least), [(f, plain) for f in worth])
    return rough | _by_ids(ended)


def _three(
    ours: Team,
    pair: Fitted,
    chained: Sequence[str],
    linear: Sequence[str],
    fits: dict[Ids, Fitted],
    plain: Fitted,
) -> dict[Ids, Fitted]:
    """Fit a third effect beside a pair, no rare one, and the other pairs of what does best."""
    found = _beside(ours, [pair], [n for n in chained if not rare(n)], linear, plain)
    best = max(found.values(), key=_worth, default=pair)
    if SETTINGS.temper * (_worth(best) - _worth(pair)) > further_price():
        fewer = [tuple(n for n in best.ids if n != name) for name in best.ids]
        missing = [(ids, [without_others(best, ids)]) for ids in fewer if ids not in fits]
        found |= _fits(ours, missing, plain, best)
    return found


def _gap_known(bench: Bench) -> Bench:
    """Say how large the gap is, and factor what all searches need."""
    y = plain_deg(bench)
    if bench.own:
        # What has bent with a gap misses no more of it than what is given does.
        again = fit(bench, (), bench.starts, share=0.0).predicted_deg
        y = min((again, bench.chain.run(to_x(bench.given), absent())[0]), key=bench.missed_deg)
    bench = bench.with_gap(bench.evidence.grid.angle_deg - y, y)
    for share in (SETTINGS.search_share, *SHARES):
        bench.whitening.factor(bench.level, share)
    return bench


def _to_try(bench: Bench, excluded: Sequence[str]) -> tuple[list[str], list[str]]:
    """List the effects that are columns or covariances, and those that are simulated."""
    linear, chained = [], []
    for name in LIBRARY:
        effect = LIBRARY[name]
        known = effect.stage == "drive" and bench.chain.is_pressure
        taken_off = effect.port == "zeros" and bench.evidence.data.campaign.logs_are_zeroed
        if name in excluded or known or taken_off or effect.port == "line":
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
    best = weighed(bench, max(allowed, key=_worth))
    share = SHARES[int(np.argmax(best.logs))]
    problem = problem_of(bench, best)
    factor = bench.whitening.factor(best.level, min(share, SHARES[3]))
    linear, n = problem.linear(best.z), problem.rows.size
    white = bench.whitening.white(factor, np.hstack([linear.columns[:n], linear.slopes[:n]]))
    left = bench.whitening.white(factor, linear.left[:n])
    line = slow_line(problem.rows, bench.whitening, factor, left, np.linalg.qr(white)[0].T)
    if line.gain < WORTH_A_FIT:
        return bench, fits, NONE
    scales = bench.scales.copy()
    scales[LINE] = line.amplitude_deg / np.sqrt(2.0)
    bench = replace(bench, line=line.frequency_hz, scales=scales)
    hosts = [f for f in allowed if len(f.ids) < 2 or f.ids == best.ids]
    waved = each(
        lambda f: _tried(fit, bench, ordered((*f.ids, name)), [f.z], fits[()]),
        hosts,
    )
    more = {ids: replace(f, quick=f.quick - LINE_SEARCH) for ids, f in _by_ids(waved).items()}
    return bench, fits | more, line
