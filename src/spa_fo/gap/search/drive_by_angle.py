"""What the angle says of the drive.

The pressure alone cannot tell a drive that lags by a few hundredths of a second from a pressure
sensor that does; the angle can. Explanations of the pressure that come near the best are each given
to the angle, as they fit the pressure best and with a sensor that does not lag, and what the angle
makes of it is added to their evidence.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from spa_fo.gap.data.evidence import angle_chain
from spa_fo.gap.data.searched import to_x
from spa_fo.gap.fit.bench import Bench
from spa_fo.gap.prior import log_prior
from spa_fo.gap.search.drive import NEAR, Drive, DriveFit, drive_of, near_best, worth
from spa_fo.gap.search.explanations import Explanations
from spa_fo.gap.search.fitted import Fitted, begun, price, settled, weighed
from spa_fo.gap.settings import SETTINGS
from spa_fo.numeric.minimise import HOPE
from spa_fo.together import each

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
    near = near_best(drive.fits)
    near += [f.prompt for f in near if f.prompt is not None]
    alike = [place for place, one in enumerate(near) if _alike(drive, one)]
    others = {k: _driven(found.bench, one) for k, one in enumerate(near) if k not in alike}
    if not others:
        return drive
    allowed = [f for f in found.fits.values() if f.ids and not set(f.ids) & set(found.excluded)]
    allowed = [f for f in allowed if np.isfinite(f.logs).all()]
    carried = [found.plain, *sorted(allowed, key=lambda f: -_value(f))[:_CARRIED]]
    pairs = [(place, angle) for place in others for angle in carried]
    rough = each(lambda p: begun(others[p[0]], p[1].ids, [p[1].z], found.plain), pairs)
    tried = [(place, fitted) for (place, _), fitted in zip(pairs, rough, strict=True)]
    tops = {own: max(_promise(f) for place, f in tried if place == own) for own in others}
    tried = [(place, f) for place, f in tried if _promise(f) > tops[place] - NEAR]

    def ended(bench: Bench, fitted: Fitted) -> float:
        return _value(weighed(bench, settled(bench, fitted, found.plain)))

    values = each(lambda p: ended(others[p[0]], p[1]), tried)
    said = dict.fromkeys(alike, max(_value(angle) for angle in carried))
    for (place, _), value in zip(tried, values, strict=True):
        said[place] = max(said.get(place, -np.inf), value)
    top, least = max(said.values()), min(said.values())
    known = [replace(f, evidence=f.evidence + said[k] - top) for k, f in enumerate(near)]
    fits = {n: replace(f, evidence=f.evidence + least - top) for n, f in drive.fits.items()}
    fits |= {f.ids: f for f in sorted(known, key=worth)}  # of two ways the better one
    return drive_of(found.bench.evidence, fits, drive.given, drive.wander)


def _alike(drive: Drive, one: DriveFit) -> bool:
    """Say whether no angle tells an explanation of the pressure from the best one."""
    best = drive.best.cells_kpa
    return bool(np.sum((one.cells_kpa - best) ** 2) <= _SAME**2 * np.sum(best**2))


def _value(fitted: Fitted) -> float:
    return float(fitted.logs.max()) - price(fitted) + log_prior(fitted.ids) / SETTINGS.temper


def _promise(rough: Fitted) -> float:
    """Say what a rough fit may be worth once it has come to its end."""
    worth = log_prior(rough.ids) / SETTINGS.temper - price(rough)
    return rough.quick + HOPE * rough.decrement + worth


def _driven(bench: Bench, one: DriveFit) -> Bench:
    """Let an explanation of the pressure drive the model."""
    return replace(bench, chain=angle_chain(bench.evidence, to_x(bench.centre), one.believed_kpa))
