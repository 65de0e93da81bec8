"""What a person sees while a log grows: one line on stderr, with live values."""

from __future__ import annotations

import sys
import time
from typing import TextIO

from spa_fo.rig.calibration import Calibration
from spa_fo.rig.campaign import PressureSensor
from spa_fo.rig.live_stream import Row

_EVERY_S = 0.1
_WIDTH = 24


class LiveView:
    """A progress bar with the last row's values; silent where stderr is no terminal.

    Parameters
    ----------
    title : str
        What is recorded.
    samples : int
        How many samples it takes.
    rate_hz : float
        Sampling rate.
    sensor : PressureSensor, optional
        Turns counts into kPa.
    curve : Calibration, optional
        Turns counts into degrees.
    out : TextIO, optional
        Where to; stderr by default.
    """

    def __init__(
        self,
        title: str,
        samples: int,
        rate_hz: float,
        sensor: PressureSensor | None = None,
        curve: Calibration | None = None,
        out: TextIO | None = None,
    ) -> None:
        self._title, self._samples, self._rate_hz = title, samples, rate_hz
        self._sensor, self._curve = sensor, curve
        self._out = out or sys.stderr
        self._live = self._out.isatty()
        self._drawn_at = 0.0
        self._rows = 0

    def __call__(self, row: Row) -> None:
        """Take a row; draw at most ten times a second."""
        self._rows += 1
        now = time.monotonic()
        if self._live and now - self._drawn_at >= _EVERY_S:
            self._drawn_at = now
            self._out.write(f"\r{self.line(row)}\x1b[K")
            self._out.flush()

    def restart(self) -> None:
        """Begin the bar anew."""
        self._rows = 0

    def line(self, row: Row) -> str:
        """Compose the line for a row."""
        done = min(1.0, self._rows / self._samples)
        bar = "#" * round(done * _WIDTH)
        seconds = f"{self._rows / self._rate_hz:.1f}/{self._samples / self._rate_hz:.1f} s"
        return f"{self._title} [{bar:<{_WIDTH}}] {seconds}  {'  '.join(self._values(row))}"

    def close(self) -> None:
        """Clear the line."""
        if self._live:
            self._out.write("\r\x1b[K")
            self._out.flush()

    def _values(self, row: Row) -> list[str]:
        values = []
        if "cmd_kpa" in row.fields:
            values.append(f"command {row.fields['cmd_kpa']:.1f} kPa")
        if "angle_deg" in row.fields:
            values.append(f"fixture {row.fields['angle_deg']:g} deg")
        if "p_adc" in row.fields:
            counts = row.fields["p_adc"]
            pressure = f"{counts:.0f}"
            if self._sensor is not None:
                pressure = f"{float(self._sensor.pressure_kpa(counts)):.1f} kPa"
            values.append(f"pressure {pressure}")
        if "flex_adc" in row.fields:
            counts = row.fields["flex_adc"]
            angle = f" = {float(self._curve.angle_deg(counts)):.1f} deg" if self._curve else ""
            values.append(f"flex {counts:.0f}{angle}")
        return values
