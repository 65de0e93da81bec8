"""How probable a set of effects is before anything is measured."""

from __future__ import annotations

import numpy as np

from spa_fo.gap.settings import SETTINGS
from spa_fo.plant.effects.library import LIBRARY, Ids, at_port, log_odds


def log_prior(ids: Ids) -> float:
    """Logarithm of a set's probability beforehand: small sets first, then what is usual."""
    s = SETTINGS
    if not ids:
        return float(np.log(s.none))
    odds = np.array([effect.odds for effect in LIBRARY.values()])
    if len(ids) == 1:
        return float(np.log(s.single / odds.sum())) + log_odds(ids)
    pairs = 0.5 * (odds.sum() ** 2 - np.sum(odds**2))
    further = -(len(ids) - 2) * further_price()
    beside = np.log(s.shift_beside) if at_port("coefficients", ids) else 0.0
    return float(np.log(s.pair / pairs) + further + beside) + log_odds(ids)


def further_price() -> float:
    """Say what one effect more costs a set beforehand, nats."""
    odds = sum(effect.odds for effect in LIBRARY.values())
    return float(np.log(SETTINGS.single * odds / SETTINGS.pair))
