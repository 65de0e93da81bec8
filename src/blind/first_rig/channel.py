"""What a log holds of the angle: counts of the flex channel, or the angle itself in steps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from blind.first_rig.reading_effects import Reader
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.converter import Converter
from spa_fo.virtual_rig.flex_sensor import DividerCurve

_SPAN_DEG = (-15.0, 105.0)  # of a converter that logs the angle directly


@dataclass(frozen=True)
class Channel:
    """The sensor's curve and the converter behind it.

    Parameters
    ----------
    curve : DividerCurve
        The flex sensor's.
    converter : Converter
        Its resolution.
    direct : bool
        Whether the log holds the angle itself: then the board knows the curve.
    """

    curve: DividerCurve
    converter: Converter
    direct: bool

    @cached_property
    def _table(self) -> tuple[Array, Array]:
        angle = np.linspace(-40.0, 140.0, 18_001)
        return self.curve.volts(angle), angle

    def felt_deg(self, volts: Array) -> Array:
        """Angle that the sensor feels."""
        return np.asarray(np.interp(volts, *self._table))

    @property
    def step_deg(self) -> float:
        """Step of an angle that is logged directly."""
        return (_SPAN_DEG[1] - _SPAN_DEG[0]) / self.converter.maximum

    def exact(self, volts: Array, reader: Reader | None) -> Array:
        """Voltage of what is read without noise and converter."""
        if reader is None:
            return volts
        return self.curve.volts(reader(self.felt_deg(volts), np.zeros_like(volts)))

    def logged(self, volts: Array, noise_deg: Array, reader: Reader | None = None) -> Array:
        """Convert, noise added to the angle felt: counts, or degrees."""
        felt = self.felt_deg(volts)
        angle = felt + noise_deg if reader is None else reader(felt, noise_deg)
        if self.direct:
            return np.clip(np.rint(angle / self.step_deg) * self.step_deg, *_SPAN_DEG)
        counts = np.rint(self.curve.volts(angle) / self.converter.volts_per_count)
        return np.clip(counts, 0, self.converter.maximum)
