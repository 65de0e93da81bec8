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
from spa_fo.gap.search.drive import Drive, DriveFit, true_pressure
from spa_fo.gap.search.explanations import Explanations
from spa_fo.gap.search.fitted import Fitted, fit, price, weighed
from spa_fo.gap.search.prior import log_prior
from spa_fo.gap.settings import SETTINGS
from spa_fo.gap.together import each

_NEAR = 60.0  # nats behind the best explanation of the pressure, which an angle may make up for
_MOST = 4  # explanations of the pressure, the best among them
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
    if len(near) < 2:
        return drive
    allowed = [f for f in found.fits.values() if f.ids and not set(f.ids) & set(found.excluded)]
    allowed = [f for f in allowed if np.isfinite(f.logs).all()]
    carried = [found.plain, *sorted(allowed, key=lambda f: -_value(f))[:_CARRIED]]
    pairs = [(one, angle) for one in near for angle in carried]
    values = each(lambda pair: _together(drive, found, *pair), pairs)
    total = {one.ids: -np.inf for one in near}
    for (one, _), value in zip(pairs, values, strict=True):
        total[one.ids] = max(total[one.ids], value)
    top, least = max(total.values()), min(total.values())
    fits = {
        ids: replace(f, evidence=f.evidence + total.get(ids, least) - top)
        for ids, f in drive.fits.items()
    }
    return drive.of(found.bench.evidence, fits)


def _worth(fitted: DriveFit) -> float:
    return float(fitted.evidence.max()) + log_prior(fitted.ids) / SETTINGS.temper


def _value(fitted: Fitted) -> float:
    return float(fitted.logs.max()) - price(fitted) + log_prior(fitted.ids) / SETTINGS.temper


def _together(drive: Drive, found: Explanations, one: DriveFit, angle: Fitted) -> float:
    """Log evidence of an explanation of the angle that is driven by one of the pressure."""
    bench = found.bench
    if one.ids == drive.best.ids:
        return _value(angle)
    kpa = true_pressure(bench.evidence, one, drive.room_kpa)
    bench = replace(bench, chain=angle_chain(bench.evidence, to_x(bench.centre), kpa))
    return _value(weighed(bench, fit(bench, angle.ids, [angle.z], found.plain)))
