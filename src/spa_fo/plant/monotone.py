"""A monotone cubic through a few points that are drawn anew for every trial of a search."""

from __future__ import annotations

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats

_STEEPEST = 3.0  # times the first chord, of an end where the curve turns round


@njit
def monotone_slopes(x: Floats, y: Floats) -> Floats:
    """Slopes of a monotone cubic at its points, (n,), n > 1; as of SciPy's `PchipInterpolator`.

    Of that a call takes 0.3 ms, most of it for checks. Inside it is the harmonic mean of the chords
    (Fritsch and Butland 1984, doi:10.1137/0905021), at an end that of a parabola.
    """
    h, slopes = np.diff(x), np.zeros(x.size)
    chord = np.diff(y) / h
    for i in range(1, x.size - 1):
        if chord[i - 1] * chord[i] > 0.0:
            before, after = h[i - 1] + 2.0 * h[i], 2.0 * h[i - 1] + h[i]
            # SciPy weighs the chord before by the longer way after, and the other way round.
            slopes[i] = (before + after) / (before / chord[i - 1] + after / chord[i])
    last = x.size - 1
    if last == 1:
        return np.full(2, chord[0])
    slopes[0] = _at_end(h[0], h[1], chord[0], chord[1])
    slopes[last] = _at_end(h[last - 1], h[last - 2], chord[last - 1], chord[last - 2])
    return slopes


@njit
def _at_end(near: float, far: float, chord: float, following: float) -> float:
    slope = ((2.0 * near + far) * chord - near * following) / (near + far)
    if slope * chord <= 0.0:
        return 0.0
    if chord * following <= 0.0 and abs(slope) > _STEEPEST * abs(chord):
        return _STEEPEST * chord
    return slope


@njit
def monotone_at(x: Floats, y: Floats, slopes: Floats, at: Floats) -> Floats:
    """Draw the cubic at some places, (k,); beyond its ends it goes straight on."""
    out, last, j = np.empty(at.size), x.size - 1, 0
    for i in range(at.size):
        where = min(max(at[i], x[0]), x[last])
        while j > 0 and where < x[j]:  # places mostly lie near one another
            j -= 1
        while j < last - 1 and where >= x[j + 1]:
            j += 1
        width = x[j + 1] - x[j]
        s, rise = (where - x[j]) / width, y[j + 1] - y[j]
        bent = (1.0 - s) * (width * slopes[j] - rise) - s * (width * slopes[j + 1] - rise)
        end = slopes[0] if at[i] < where else slopes[last]
        out[i] = y[j] + s * rise + s * (1.0 - s) * bent + end * (at[i] - where)
    return out
