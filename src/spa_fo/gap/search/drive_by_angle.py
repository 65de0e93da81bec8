"""What the angle says of the drive, where the pressure alone cannot tell.

A drive that lags by a few hundredths of a second and a pressure sensor that does are alike in the
pressure; the angle tells them apart. Explanations of the pressure that come near the best are each
given to the angle, and what the angle makes of it is added to their evidence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spa_fo.gap.data.evidence import angle_chain
from spa_fo.gap.data.searched import to_x
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.prior import log_prior
from spa_fo.gap.search.drive import Drive, DriveFit, true_pressure
from spa_fo.gap.search.explanations import Explanations
from spa_fo.gap.search.fitted import HOPE, Fitted, begun, price, settled, weighed
from spa_fo.gap.settings import SETTINGS
from spa_fo.gap.together import each

_NEAR = 60.0  # nats behind the best explanation of the pressure, which an angle may make up for
_MOST = 4  # explanations of the pressure, the best among them
_SAME = 1e-3  # of a pressure: another one that differs by less is the same
_CARRIED = 3  # explanations of the angle that are tried with each, beside the plain model


def joined(drive: Drive, found: Explanations) -> Drive:
    """Add to each explanation of the pressure what the angle says of it.

    Parameters
    ----------
    drive : Drive
        What the pressure says.
    found : Explanations
        Fits of the angle, driven by its best explanation.

    Returns
    -------
    Drive
        The same where none came near the best. Those that did not are given what the angle says of
        the least likely.
    """
    ranked = sorted(drive.fits.values(), key=lambda f: -_worth(f))
    near = [f for f in ranked[:_MOST] if _worth(f) > _worth(ranked[0]) - _NEAR]
    nothing = drive.fits[()]
    if nothing not in near and _worth(nothing) > _worth(ranked[0]) - _NEAR:
        near.append(nothing)
    allowed = [f for f in found.fits.values() if f.ids and not set(f.ids) & set(found.excluded)]
    allowed = [f for f in allowed if np.isfinite(f.logs).all()]
    carried = [found.plain, *sorted(allowed, key=lambda f: -_value(f))[:_CARRIED]]
    alike = {drive.best.ids, *(one.ids for one in near if _alike(drive, one))}
    others = [one for one in near if one.ids not in alike]
    if not others:
        return drive
    benches = [_driven(drive, found, one) for one in others]
    pairs = [(k, angle) for k in range(len(others)) for angle in carried]
    rough = each(lambda p: begun(benches[p[0]], p[1].ids, [p[1].z], found.plain), pairs)
    tried = [(k, fitted) for (k, _), fitted in zip(pairs, rough, strict=True)]
    tops = [max(_promise(f) for at, f in tried if at == k) for k in range(len(others))]
    worth = [(k, f) for k, f in tried if _promise(f) > tops[k] - _NEAR]
    values = each(
        lambda p: _value(weighed(benches[p[0]], settled(benches[p[0]], p[1], found.plain))), worth
    )
    total = {one.ids: -np.inf for one in near}
    total |= dict.fromkeys(alike, max(_value(angle) for angle in carried))
    for (k, _), value in zip(worth, values, strict=True):
        total[others[k].ids] = max(total[others[k].ids], value)
    top, least = max(total.values()), min(total.values())
    fits = {
        ids: replace(f, evidence=f.evidence + total.get(ids, least) - top)
        for ids, f in drive.fits.items()
    }
    return drive.of(found.bench.evidence, fits)


def _alike(drive: Drive, one: DriveFit) -> bool:
    """Say whether no angle tells an explanation of the pressure from the best one."""
    best = drive.best.cells_kpa
    return bool(np.sum((one.cells_kpa - best) ** 2) <= _SAME**2 * np.sum(best**2))


def _worth(fitted: DriveFit) -> float:
    return float(fitted.evidence.max()) + log_prior(fitted.ids) / SETTINGS.temper


def _value(fitted: Fitted) -> float:
    return float(fitted.logs.max()) - price(fitted) + log_prior(fitted.ids) / SETTINGS.temper


def _promise(rough: Fitted) -> float:
    """Say what a rough fit may be worth once it has come to its end."""
    worth = log_prior(rough.ids) / SETTINGS.temper - price(rough)
    return rough.quick + HOPE * rough.decrement + worth


def _driven(drive: Drive, found: Explanations, one: DriveFit) -> Bench:
    """Let an explanation of the pressure drive the model."""
    bench = found.bench
    kpa = true_pressure(bench.evidence, one, drive.room_kpa)
    return replace(bench, chain=angle_chain(bench.evidence, to_x(bench.centre), kpa))
