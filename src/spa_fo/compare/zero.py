"""How unsure the zero of each log is, where it is the log's own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spa_fo.identify.whole_log import input_of
from spa_fo.plant import Model
from spa_fo.rig import CampaignData, Trial
from spa_fo.rig.first_change import before_first_change


def at_rest_deg(data: CampaignData, plain: Model) -> float:
    """Return what the first commands bend by, at most: a log that begins so has no known zero."""
    zeroed = data.campaign.logs_are_zeroed
    return max(_bent_at_rest(trial, plain) for trial in data.trials) if zeroed else 0.0


def moving_deg(campaigns: Sequence[CampaignData]) -> float:
    """Return how far the angle goes, at most, while the zero of a log is taken."""
    zeroed = [t for data in campaigns if data.campaign.logs_are_zeroed for t in data.trials]
    return max(map(_moved_before, zeroed), default=0.0)


def _bent_at_rest(trial: Trial, plain: Model) -> float:
    """Return about what the first command bends: a log that begins under it has no known zero."""
    drive = input_of(trial, plain.signal)
    assert drive is not None
    share = abs(float(drive[0])) / max(float(np.max(np.abs(drive))), 1e-9)
    return share * float(np.max(np.abs(trial.angle_deg)))


def _moved_before(trial: Trial) -> float:
    """Return how far the angle goes before the input changes: its mean there is no sure zero."""
    before = trial.angle_deg[: before_first_change(trial)]
    fifth = before.size // 5
    return abs(float(before[-fifth:].mean() - before[:fifth].mean())) if fifth else 0.0
