"""One trial's samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from spa_fo.arrays import Bools, Floats
from spa_fo.rig.campaign import Protocol


@dataclass(frozen=True)
class Trial:
    """One trial: its valid samples, all arrays of shape (n,), no NaN anywhere.

    Where the command is no pressure (`Campaign.command_is_pressure`), `command_kpa` holds it as
    logged. `trial` is the 1-based place in the experiment's list, `order` that in the campaign,
    `started_s` campaign time; `t_s` runs from the trial's first sample. Gauge pressures in kPa,
    None where the log holds none; angles in degrees; `flex_adc` None where the log holds angles.
    `after_reset` marks samples whose time is an estimate, `outside_calibration` those whose flex
    count lies beyond the calibrated range. Where `zero_until_s` is above 0, each log has a zero of
    its own: what the reading was on average before that time, s.
    """

    experiment: str
    trial: int
    protocol: Protocol
    setpoint_deg: float | None
    order: int
    started_s: float
    t_s: Floats
    command_kpa: Floats | None
    pressure_kpa: Floats | None
    flex_adc: Floats | None
    angle_deg: Floats
    after_reset: Bools
    outside_calibration: Bools
    zero_until_s: float = 0.0

    @property
    def label(self) -> str:
        """For messages and figures: ``step_30 trial 2``."""
        return f"{self.experiment} trial {self.trial}"

    def zeroed(self, angle_deg: Floats) -> Floats:
        """Take its own zero off angles at its samples, if it has one."""
        before = self.t_s < self.zero_until_s
        return np.asarray(angle_deg - angle_deg[before].mean()) if before.any() else angle_deg
