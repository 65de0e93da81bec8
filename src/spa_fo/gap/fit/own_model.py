"""Whether a given model was fitted to the very campaign that it is held against.

A model's file may not say so. But least squares leave nothing that its own coefficients could take
any more: what is left of the campaign is orthogonal to the tangents of the model.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.evidence import Evidence, angle_chain
from spa_fo.gap.data.searched import HIGHEST, LOWEST, to_x, to_z
from spa_fo.plant.effects.library import absent

Floats = NDArray[np.float64]

_STEP = 1e-3
_TAKEN = 0.005
"""Share of the squares that coefficients may still take of what their own fit left.

Learned: at most 0.002 of it where somebody else's least squares had made the model, and more in all
but one of 222 campaigns whose model was another's.
"""


def fitted_to(evidence: Evidence, x: Floats) -> bool:
    """Say whether coefficients, (5,), are those of least squares on this campaign."""
    return still_taken(evidence, x) < _TAKEN


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
