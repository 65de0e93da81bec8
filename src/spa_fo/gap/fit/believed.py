"""What a pressure sensor surely shows of what a fit of the drive misses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from spa_fo.arrays import Floats
from spa_fo.gap.data.evidence import Evidence
from spa_fo.gap.fit.pressure import blur, row_cells

_BLUR = 0.5  # of the change of pressure about a cell: when exactly it changed is not known
_LATE = 0.15  # part of it that all rows have alike: assumed, so that a perfect drive has no gap
_ROOM = 2.0  # deviations of the pressure's noise within which the model is believed
WINDOWS = (65, 17, 5, 1)  # cells over which the measured pressure is averaged, slow ones first


def rooms_of(evidence: Evidence, step_kpa: float) -> list[Floats]:
    """Say by how much means of the measured pressure err, (cells,) for each of `WINDOWS`, kPa.

    A converter's step averages out where the reading goes through many, noise over the rows. When
    each was read does in part: some of it is one lateness, which shifts a ramp's means alike.
    """
    grid = evidence.grid
    assert grid.pressure_kpa is not None
    way, change = blur(evidence)
    moved = np.diff(grid.pressure_kpa, prepend=grid.pressure_kpa[:1]) != 0.0
    rooms = []
    for window in WINDOWS:
        rows = np.maximum(_counts(grid.cell_starts, window) / row_cells(evidence), 1.0)
        steps = np.maximum(_means(moved.astype(np.float64), grid.cell_starts, window) * rows, 1.0)
        blurred = _BLUR * np.sqrt(np.maximum(_means(change**2, grid.cell_starts, window), 0.0))
        late = _LATE * _BLUR * np.abs(_means(way, grid.cell_starts, window))
        noise = (_ROOM * evidence.pressure_noise_kpa + blurred) / np.sqrt(rows)
        rooms.append(0.5 * step_kpa / steps + noise + late)
    return rooms


def _means(values: Floats, starts: NDArray[np.int64], window: int) -> Floats:
    """Average what stands on the cells over windows about each, within its trial."""
    sums = _summed(values, starts, window)
    return sums / _counts(starts, window)


def _counts(starts: NDArray[np.int64], window: int) -> Floats:
    """Say how many cells of its trial are in the window about each."""
    return _summed(np.ones(int(starts[-1])), starts, window)


def _summed(values: Floats, starts: NDArray[np.int64], window: int) -> Floats:
    parts = np.split(values, starts[1:-1])
    means = [uniform_filter1d(part, window, mode="constant") for part in parts]
    return window * np.concatenate(means)


def surely_shown(missed_kpa: Floats, starts: NDArray[np.int64], rooms_kpa: list[Floats]) -> Floats:
    """Give what a sensor surely shows of what a fit misses, (cells,): slow parts, then quick ones.

    What a mean over a window shows beyond its room is no error of the sensor.
    """
    shown = np.zeros(missed_kpa.size)
    for window, room in zip(WINDOWS, rooms_kpa, strict=True):
        mean = _means(missed_kpa - shown, starts, window)
        shown += mean - np.clip(mean, -room, room)
    return shown
