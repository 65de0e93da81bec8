"""Where the gap lies: by phase of the response, amplitude, direction, trial and frequency."""

from __future__ import annotations

import numpy as np

from spa_fo.arrays import Floats, Integers
from spa_fo.gap.data.evidence import Evidence
from spa_fo.plant.memory import FINEST_STEP_S

_EARLY_S = 1.0  # after a jump of the input
_JUMP, _SLOPE = 0.02, 1e-4  # of the largest input, from one cell to the next
_STILL = 1.5  # deg/s
_UNIFORM_S = 0.1  # spacing of the residual whose spectrum is taken
_FEWEST = 16  # values that have a spectrum
_PHASES = ("rest", "rise", "hold", "ramp", "fall", "released")
_AMPLITUDES = (5.0, 15.0, 30.0, 45.0, 60.0)
_DEGREES = ("below 5 deg", "5-15 deg", "15-30 deg", "30-45 deg", "45-60 deg", "above 60 deg")
_DIRECTIONS = ("bending", "still", "relaxing")
_THIRDS = ("first third", "second third", "last third")
_BANDS_HZ = {
    "below 0.1 Hz": (0.0, 0.1),
    "0.1-0.3 Hz": (0.1, 0.3),
    "0.3-1 Hz": (0.3, 1.0),
    "above 1 Hz": (1.0, np.inf),
}


def shares(
    evidence: Evidence, gap_deg: Floats, predicted_deg: Floats
) -> dict[str, dict[str, float]]:
    """Share out the squared gap, what noise alone would make of it taken off.

    Parameters
    ----------
    evidence : Evidence
        The campaign.
    gap_deg : (n,) array
        Measured less predicted by the plain model.
    predicted_deg : (n,) array
        By the plain model: it says amplitude and direction.

    Returns
    -------
    dict
        ``phase``, ``amplitude``, ``direction``, ``trial``, ``frequency``: bin -> share.
    """
    grid = evidence.grid
    square = (gap_deg**2 - evidence.variance) * grid.counts
    rate = grid.slopes(predicted_deg)
    labels = {
        "phase": (_PHASES, _phase(evidence)),
        "amplitude": (_DEGREES, np.digitize(predicted_deg, _AMPLITUDES)),
        "direction": (_DIRECTIONS, np.digitize(-rate, (-_STILL, _STILL))),
        "trial": (_THIRDS, 3 * grid.sample_trial // len(grid.trials)),
    }
    found = {}
    for kind, (names, label) in labels.items():
        sums = np.bincount(label, square, len(names)).tolist()
        found[kind] = _normalised({names[k]: sums[k] for k in np.unique(label).tolist()})
    return {**found, "frequency": _frequency(evidence, gap_deg)}


def _normalised(sums: dict[str, float]) -> dict[str, float]:
    positive = {name: max(value, 0.0) for name, value in sums.items()}
    total = sum(positive.values()) or 1.0
    return {name: value / total for name, value in positive.items()}


def _phase(evidence: Evidence) -> Integers:
    """Find the phase of each averaged sample, a place in `_PHASES`, by its trial's input."""
    grid = evidence.grid
    cells = grid.command_kpa if grid.command_kpa is not None else grid.pressure_kpa
    assert cells is not None
    found = np.empty(grid.time_s.size, dtype=np.int64)
    largest = float(np.abs(cells).max())
    for trial, rows in enumerate(evidence.rows):
        own = cells[grid.cell_starts[trial] : grid.cell_starts[trial + 1]]
        change = np.diff(own, prepend=0.0)
        jumps = np.flatnonzero(np.abs(change) > _JUMP * largest)
        sloped = np.abs(np.gradient(own)) > _SLOPE * largest
        time = grid.time_s[rows]
        cell = np.minimum((time / FINEST_STEP_S).astype(np.int64), own.size - 1)
        so_far = np.searchsorted(jumps, cell, side="right")
        upward = np.append(0.0, change[jumps])[so_far] > 0.0
        early = time - np.append(-np.inf, FINEST_STEP_S * jumps)[so_far] < _EARLY_S
        phases = {
            "rest": (so_far == 0) & ~np.logical_or.accumulate(sloped)[cell],
            "rise": early & upward,
            "fall": early,
            "ramp": sloped[cell] | (so_far == 0),
            "hold": own[cell] > _JUMP * largest,
            "released": np.ones(cell.size, dtype=bool),
        }
        found[rows] = np.select([*phases.values()], [_PHASES.index(name) for name in phases])
    return found


def _frequency(evidence: Evidence, gap: Floats) -> dict[str, float]:
    power = dict.fromkeys(_BANDS_HZ, 0.0)
    for rows in evidence.rows:
        time = evidence.grid.time_s[rows]
        uniform = np.arange(time[0], time[-1], _UNIFORM_S)
        if uniform.size < _FEWEST:
            continue
        spectrum = np.abs(np.fft.rfft(np.interp(uniform, time, gap[rows]))) ** 2 / uniform.size
        spectrum[1:] *= 2.0
        frequency = np.fft.rfftfreq(uniform.size, _UNIFORM_S)
        for name, (low, high) in _BANDS_HZ.items():
            power[name] += float(spectrum[(frequency >= low) & (frequency < high)].sum())
    return _normalised(power)
