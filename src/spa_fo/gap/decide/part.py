"""One explanation of the angle or of the pressure, weighed: what it is named for, and how right.

An explanation is right where it leaves a small share of the gap, and stands in for something else
where it leaves more. With L(s) the evidence where it misses a share s,

    right:    prior · max_s L(s)^T e^{-s/s_r} / Σ_s e^{-s/s_r},
    unknown:  odds · prior of one effect, or of two · Σ_s L(s)^T / n,

the first over all shares, those too small to matter counting as none; the second over those that
matter. No gap is the plain model, or what repeats being too small to matter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.fit.bench import SHARES
from spa_fo.gap.prior import log_prior
from spa_fo.gap.search.drive import DriveFit
from spa_fo.gap.search.explanations import WORTH_WEIGHING
from spa_fo.gap.search.fitted import Fitted
from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY, Ids

_SHARES = np.array(SHARES)
# Times what others have to move. Learned: a hum that is no cause moved the angle by 0.52 noise
# floors at most, one that is by 0.79 at least, on nine opened rigs.
_OF_NOISE = 2.0


def stands_in(ids: Ids = ()) -> float:
    """How probable it is beforehand that a set stands in for one unknown effect.

    One unknown effect is as probable as a known one, however rare what stands in for it is; but of
    what may do so there are more pairs than single effects, and what two explain may be two.
    """
    return log_prior(tuple(LIBRARY)[: 1 if len(ids) < 2 else 2])


def with_one_more(ids: Ids) -> float:
    """How probable a set is beforehand with one unknown effect beside it."""
    so_many, one_more = (log_prior(tuple(LIBRARY)[: len(ids) + more]) for more in (0, 1))
    return log_prior(ids) + one_more - so_many


@dataclass(frozen=True)
class Part:
    """What the angle, or the pressure, says of one explanation; logarithms but for the sizes."""

    named: Ids
    right: float  # that it is right
    unknown: Floats  # that it stands in for something else, by share
    fit: Fitted | DriveFit
    moved_deg: Mapping[str, float]  # by each effect that is named
    left_deg: float


@dataclass(frozen=True)
class Sizes:
    """What sizes of an explanation are held against, deg."""

    all_deg: float  # what all its effects do
    gap_deg: float
    left_deg: float  # of the gap, which repeats and is not explained
    floor_deg: float  # the noise floor
    least_deg: float  # by which an effect moves the angle that may be named
    small_deg: float  # what is left of a right form, if that is no evidence of anything
    right_share: float  # scale of what is left of one, of the gap


def missed_of(gap_deg: float, left_deg: float) -> Floats:
    """Say how much is missed at each share, deg: at any but none no less than is left."""
    least = np.where(_SHARES > 0.0, min(left_deg, gap_deg), 0.0)
    return np.asarray(np.maximum(_SHARES * gap_deg, least))


def missing_none(right_share: float) -> float:
    """How probable it is beforehand that a right form misses nothing of the gap; a logarithm."""
    return -float(np.log(np.sum(np.exp(-_SHARES / right_share))))


def weighed(
    ids: Ids,
    logs: Floats,
    missed: Floats,
    small_deg: float,
    right_share: float,
    repeats: bool = True,
) -> tuple[float, Floats]:
    """Weigh an explanation as right, and as standing in for something else, by share.

    Without repeats what is left cannot be told from coloured noise: it speaks against no set, and
    for no gap; but a gap that a set explains in part is there, and may as well be something else's.
    """
    s = SETTINGS
    nothing = missed <= small_deg
    small = nothing | (not repeats)
    penalty = np.where(small, 0.0, missed / max(missed[-1], 1e-9) / right_share)
    right = float(np.max(s.temper * logs - penalty)) + missing_none(right_share) + log_prior(ids)
    odds = s.unknown if repeats else 1.0  # even, where nothing tells
    unknown = s.temper * logs + stands_in(ids) + np.log(odds / _SHARES.size)
    return right, np.where(nothing if ids else small, -np.inf, unknown)


def parts_of(
    fit: Fitted | DriveFit,
    logs: Floats,
    moved: Mapping[str, float],
    apart: Callable[[Ids], float],
    worth: Callable[[Ids], float],
    sizes: Sizes,
    repeats: bool = True,
) -> list[Part]:
    """Weigh one fit by what it is named for; none where no effect of it moves the angle.

    `apart` says by how much the fit of some of its effects alone differs, deg: infinite where there
    is none; `worth` what that is worth, nats. An effect is named where it moves the angle and where
    the others do not do as well without it. Where several do, each has a part, as far behind the
    best as by itself.
    """
    s, ids, moving = SETTINGS, fit.ids, _that_move(moved, sizes.least_deg)
    least = max(s.needed * sizes.floor_deg, s.of_all * sizes.all_deg)
    parts = []
    every = _enough(moving, apart, worth, least, float(logs.max()) - WORTH_WEIGHING)
    for named in every if moving or not ids else []:
        # What moves too little to be named makes up for the form of what is: it has no price
        # beforehand, and is missed by that form.
        priced, helped = named, apart(named)
        if not np.isfinite(helped):
            priced, helped = ids, 0.0
        missed = missed_of(sizes.gap_deg, max(sizes.left_deg, helped))
        behind = worth(every[0]) - worth(named) if len(every) > 1 else 0.0
        small_deg = sizes.small_deg if priced else s.no_gap * sizes.floor_deg
        logs_here = logs - behind
        right, unknown = weighed(priced, logs_here, missed, small_deg, sizes.right_share, repeats)
        left = float(missed[int(np.argmax(logs))])
        parts.append(Part(named, right, unknown, fit, {n: moved[n] for n in named}, left))
    return parts


def _enough(
    named: Ids,
    apart: Callable[[Ids], float],
    worth: Callable[[Ids], float],
    least_deg: float,
    least_nats: float,
) -> list[Ids]:
    """Take the fewest of a set's effects that do as well as all of it, the best such few first.

    They, and all others returned, are worth more than `least_nats` and apart by less than
    `least_deg`.
    """
    for size in range(1, len(named)):
        every = sorted(combinations(named, size), key=lambda one: (-worth(one), apart(one)))
        if worth(every[0]) > least_nats and apart(every[0]) < least_deg:
            return [m for m in every if worth(m) > least_nats and apart(m) < least_deg]
    return [named]


def _that_move(moved: Mapping[str, float], least_deg: float) -> Ids:
    of_all = SETTINGS.of_all * max(moved.values(), default=0.0)
    return tuple(n for n in moved if moved[n] >= max(least_of(n, least_deg), of_all))


def least_of(name: str, least_deg: float) -> float:
    """Say by how much an effect counts where most do from `least_deg` on, deg."""
    # An interference is in what repeats differ by, and many a quiet bench has some.
    return least_deg * (_OF_NOISE if LIBRARY[name].port == "line" else 1.0)
