"""Whether a given model was fitted to the very campaign that it is held against.

A model's file may not say so. But least squares leave nothing that its own coefficients could take
any more: what is left of the campaign is orthogonal to the tangents of the model.
"""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence, angle_chain
from spa_fo.gap.data.searched import HIGHEST, LOWEST, to_x, to_z
from spa_fo.plant.effects.library import absent

_STEP = 1e-3
_TAKEN = 0.005
"""Share of the squares that coefficients may still take of what their own fit left.

Learned: at most 0.002 of it where somebody else's least squares had made the model, and more in all
but one of 222 campaigns whose model was another's.
"""


_BENT = 0.1
"""Odds beforehand that a model of this campaign's name was fitted to a part of it.

Learned in part: 35 of 672 models of four other hands were, all of one hand. That is 0.05 by models
and 0.25 by hands; in between it is assumed.
"""


def is_own(taken: float) -> bool:
    """Say whether coefficients that could still take this share are those of least squares."""
    return taken < _TAKEN


def bent_odds(taken: float) -> float:
    """Give the odds that a model was fitted to part of a campaign, by what it could still take.

    Learned: of 297 fits to a trial, an experiment or half the experiments of 101 opened campaigns
    the share has nearly the density 2(1 - t), as given their models had nearly 2t.
    """
    return _BENT * (1.0 - taken) / max(taken, _TAKEN)


def still_taken(evidence: Evidence, x: Floats) -> float:
    """Give the share of the squared gap that coefficients take when they are freed, linearised.

    What is at its limit stays there.
    """
    z, grid = to_z(x), evidence.grid

    def predicted(at: Floats) -> Floats:
        own = to_x(at)
        return angle_chain(evidence, own, None).run(own, absent())[0]

    plain = predicted(z)
    tangents = []
    for k in np.flatnonzero((z > LOWEST) & (z < HIGHEST)):
        moved = z.copy()
        moved[k] += _STEP
        tangents.append((predicted(moved) - plain) / _STEP)
    weight = np.sqrt(grid.counts)
    columns, left = weight[:, None] * np.array(tangents).T, weight * (grid.angle_deg - plain)
    taken = columns @ np.linalg.lstsq(columns, left, rcond=1e-9)[0]
    return float(taken @ taken / max(float(left @ left), 1e-12))
