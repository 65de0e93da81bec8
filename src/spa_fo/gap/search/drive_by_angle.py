"""What the angle says of the drive.

The pressure alone cannot tell a drive that lags by a few hundredths of a second from a pressure
sensor that does; the angle can. Explanations of the pressure that come near the best are each given
to the angle, and what the angle makes of it is added to their evidence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spa_fo.gap.data.evidence import angle_chain
from spa_fo.gap.data.searched import to_x
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.prior import log_prior
from spa_fo.gap.search.drive import Drive, DriveFit, drive_of
from spa_fo.gap.search.explanations import Explanations
from spa_fo.gap.search.fitted import Fitted, begun, price, settled, weighed
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.minimise import HOPE
from spa_fo.together import each

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
    near = [f for f in ranked if _worth(f) > _worth(ranked[0]) - _NEAR]
    near = [f for place, f in enumerate(near) if place < _MOST or not f.ids]
    alike = {drive.best.ids, *(one.ids for one in near if _alike(drive, one))}
    others = {one.ids: _driven(found.bench, one) for one in near if one.ids not in alike}
    if not others:
        return drive
    allowed = [f for f in found.fits.values() if f.ids and not set(f.ids) & set(found.excluded)]
    allowed = [f for f in allowed if np.isfinite(f.logs).all()]
    carried = [found.plain, *sorted(allowed, key=lambda f: -_value(f))[:_CARRIED]]
    pairs = [(ids, angle) for ids in others for angle in carried]
    rough = each(lambda p: begun(others[p[0]], p[1].ids, [p[1].z], found.plain), pairs)
    tried = [(ids, fitted) for (ids, _), fitted in zip(pairs, rough, strict=True)]
    tops = {own: max(_promise(f) for ids, f in tried if ids == own) for own in others}
    tried = [(ids, f) for ids, f in tried if _promise(f) > tops[ids] - _NEAR]

    def ended(bench: Bench, fitted: Fitted) -> float:
        return _value(weighed(bench, settled(bench, fitted, found.plain)))

    values = each(lambda p: ended(others[p[0]], p[1]), tried)
    said = dict.fromkeys(alike, max(_value(angle) for angle in carried))
    for (ids, _), value in zip(tried, values, strict=True):
        said[ids] = max(said.get(ids, -np.inf), value)
    top, least = max(said.values()), min(said.values())
    fits = {
        ids: replace(f, evidence=f.evidence + said.get(ids, least) - top)
        for ids, f in drive.fits.items()
    }
    return drive_of(found.bench.evidence, fits, drive.given, drive.wander)


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


def _driven(bench: Bench, one: DriveFit) -> Bench:
    """Let an explanation of the pressure drive the model."""
    return replace(bench, chain=angle_chain(bench.evidence, to_x(bench.centre), one.believed_kpa))
