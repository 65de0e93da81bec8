"""Where the gap lies: by phase of the response, amplitude, direction, trial and frequency."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.data.evidence import Evidence

Floats = NDArray[np.float64]
Strings = NDArray[np.str_]

_EARLY_S = 1.0  # after a jump of the input
_AMPLITUDES = (-180.0, 5.0, 15.0, 30.0, 45.0, 60.0, 360.0)
_STILL = 1.5  # deg/s
_DEGREES = ("below 5 deg", "5-15 deg", "15-30 deg", "30-45 deg", "45-60 deg", "above 60 deg")
_ORDER = (
    *("rest", "rise", "hold", "ramp", "fall", "released"),
    *_DEGREES,
    *("bending", "still", "relaxing"),
    *("first third", "second third", "last third"),
)
_BANDS_HZ = (0.0, 0.1, 0.3, 1.0, 1e9)


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
    square = (gap_deg**2 - evidence.variance) * evidence.grid.counts
    return {
        "phase": _by(_phase(evidence), square),
        "amplitude": _by(_amplitude(predicted_deg), square),
        "direction": _by(_direction(evidence, predicted_deg), square),
        "trial": _by(_order(evidence), square),
        "frequency": _frequency(evidence, gap_deg),
    }


def _by(label: Strings, square: Floats) -> dict[str, float]:
    present = set(label.tolist())
    names = [name for name in _ORDER if name in present]
    sums = {name: max(float(square[label == name].sum()), 0.0) for name in names}
    total = sum(sums.values())
    return {name: (value / total if total > 0 else 0.0) for name, value in sums.items()}


def _phase(evidence: Evidence) -> Strings:
    grid = evidence.grid
    cells = grid.command_kpa if grid.command_kpa is not None else grid.pressure_kpa
    assert cells is not None
    label = np.full(grid.time_s.size, "ramp", dtype="<U12")
    largest = float(np.abs(cells).max())
    for trial, rows in enumerate(evidence.rows):
        own = cells[grid.cell_starts[trial] : grid.cell_starts[trial + 1]]
        change = np.diff(own, prepend=0.0)
        jumps = np.flatnonzero(np.abs(change) > 0.02 * largest)
        slope = np.abs(np.gradient(own)) > 1e-4 * largest
        for row in rows:
            time = grid.time_s[row]
            cell = min(int(time / 0.02), own.size - 1)
            before = jumps[jumps <= cell]
            if before.size == 0:
                label[row] = "ramp" if slope[: cell + 1].any() else "rest"
            elif time - 0.02 * before[-1] < _EARLY_S:
                label[row] = "rise" if change[before[-1]] > 0 else "fall"
            elif slope[cell]:
                label[row] = "ramp"
            else:
                label[row] = "hold" if own[cell] > 0.02 * largest else "released"
    return label


def _amplitude(predicted: Floats) -> Strings:
    at = np.digitize(predicted, _AMPLITUDES[1:-1])
    return np.array([_DEGREES[i] for i in at])


def _direction(evidence: Evidence, predicted: Floats) -> Strings:
    label = np.full(predicted.size, "still", dtype="<U8")
    rate = evidence.grid.slopes(predicted)
    label[rate > _STILL] = "bending"
    label[rate < -_STILL] = "relaxing"
    return label


def _order(evidence: Evidence) -> Strings:
    count = len(evidence.grid.trials)
    third = np.minimum(3 * np.arange(count) // max(count, 1), 2)
    names = np.array(["first third", "second third", "last third"])
    return names[third[evidence.grid.sample_trial]]


def _frequency(evidence: Evidence, gap: Floats) -> dict[str, float]:
    power = np.zeros(len(_BANDS_HZ) - 1)
    for rows in evidence.rows:
        time = evidence.grid.time_s[rows]
        uniform = np.arange(time[0], time[-1], 0.1)
        if uniform.size < 16:
            continue
        value = np.interp(uniform, time, gap[rows])
        spectrum = np.abs(np.fft.rfft(value)) ** 2
        spectrum[1:] *= 2.0
        frequency = np.fft.rfftfreq(uniform.size, 0.1)
        power += np.histogram(frequency, _BANDS_HZ, weights=spectrum / uniform.size)[0]
    names = ("below 0.1 Hz", "0.1-0.3 Hz", "0.3-1 Hz", "above 1 Hz")
    total = float(power.sum())
    return {n: float(p / total) if total > 0 else 0.0 for n, p in zip(names, power, strict=True)}
