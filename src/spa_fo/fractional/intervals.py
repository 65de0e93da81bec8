"""A sampled input as a sequence of intervals, each with a jump at its start and a ramp in it."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo.fractional.step import check_times

Hold = Literal["linear", "zero"]
Array = NDArray[np.float64]


def check_samples(t: ArrayLike, u: ArrayLike) -> tuple[Array, Array]:
    """Return sample times and values as arrays, or refuse them with ValueError."""
    times = np.asarray(t, dtype=np.float64)
    values = np.asarray(u, dtype=np.float64)
    if times.ndim != 1 or times.shape != values.shape:
        raise ValueError(
            f"t and u must be one-dimensional and of one length, got {times.shape}, {values.shape}"
        )
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(values))):
        raise ValueError("t and u must be finite")
    backward = np.diff(times) < 0.0
    if np.any(backward):
        first = int(np.flatnonzero(backward)[0]) + 1
        raise ValueError(f"times must not decrease, but t[{first}] < t[{first - 1}]")
    return times, values


def step_intervals(t: ArrayLike) -> tuple[Array, Array, Array]:
    """Intervals of a unit step at time 0, seen at sorted times t >= 0."""
    times = check_times(t)
    if times.ndim != 1 or np.any(np.diff(times) < 0.0):
        raise ValueError("times must be one-dimensional and sorted")
    dt = np.diff(times, prepend=0.0)
    return dt, _carry_jumps(dt, np.eye(1, times.size)[0]), np.zeros(times.size)


def input_intervals(t: ArrayLike, u: ArrayLike, hold: str) -> tuple[Array, Array, Array]:
    """Split a sampled input into intervals that end at each sample time.

    Parameters
    ----------
    t, u : array_like, shape (n,)
        Sample times in s, not decreasing, and values; the input is 0 before t[0]. Samples that
        share a time are a jump at that time, from the first value to the last.
    hold : {"linear", "zero"}
        Between samples: straight lines, or each value held until the next sample.

    Returns
    -------
    dt, jump, ramp : ndarray, shape (n,)
        Length of the interval that ends at t[j], the jump of u at its start, and the rise of u
        in it. An empty interval carries neither: its jump moves on to the next.
    """
    times, values = check_samples(t, u)
    dt = np.diff(times, prepend=times[:1])
    rise = np.diff(values, prepend=0.0)
    if hold == "linear":
        moving = dt > 0.0
        ramp = np.where(moving, rise, 0.0)
        late = np.where(moving, 0.0, rise)
    elif hold == "zero":
        ramp = np.zeros(times.size)
        late = rise
    else:
        raise ValueError(f'hold must be "linear" or "zero", got {hold!r}')
    jump = np.zeros(times.size)
    jump[1:] = late[:-1]
    return dt, _carry_jumps(dt, jump), ramp


def _carry_jumps(dt: Array, jump: Array) -> Array:
    """Move the jumps of empty intervals to the next interval that is not empty."""
    if dt.size == 0:
        return jump
    if np.all(dt[np.flatnonzero(jump)] > 0.0):
        return jump
    total = np.cumsum(jump)
    used = np.flatnonzero(dt > 0.0)
    carried = np.zeros(dt.size)
    carried[used] = np.diff(total[used], prepend=0.0)
    return carried
