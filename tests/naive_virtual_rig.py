"""Plain slow twins of the virtual rig's kernels, and the contract's line format by the letter."""

from __future__ import annotations

import math
import re

import numpy as np


def play(signal, width):
    out, position = [], 0.0
    for value in signal:
        if position > value:
            position = value
        if position < value - width:
            position = value - width
        out.append(position)
    return np.array(out)


def slew(signal, rate, approach, step):
    out, pressure = [], 0.0
    for value in signal:
        pressure = pressure + step * rate * math.tanh((value - pressure) / (rate * approach))
        out.append(pressure)
    return np.array(out)


def droop(signal, fraction, recovery, step):
    out, before, missing = [], 0.0, 0.0
    for value in signal:
        missing *= math.exp(-step / recovery)
        if value > before:
            missing += fraction * (value - before)
        missing = min(missing, max(value, 0.0))
        before = value
        out.append(value - missing)
    return np.array(out)


def leak(signal, rate, step):
    out, lost = [], 0.0
    for value in signal:
        lost += step * rate * max(value - lost, 0.0)
        lost = min(lost, max(value, 0.0))
        out.append(value - lost)
    return np.array(out)


def play_stack(signal, widths):
    """Mean of symmetric plays, each from 0."""
    out = np.zeros(len(signal))
    for width in widths:
        position = 0.0
        for i, value in enumerate(signal):
            if value - position > width / 2:
                position = value - width / 2
            if position - value > width / 2:
                position = value + width / 2
            out[i] += position / len(widths)
    return out


def fractional_actuator(load, step, orders, coefficients, moment):
    """Grünwald-Letnikov: sum c_i D^order_i x + moment(x) = load, implicit, at rest before 0.

    `moment(x, x_before)` may be nonlinear; solved by bisection. First order in `step`, O(n²).
    """
    weights = []
    for order in orders:
        w = np.ones(len(load) + 1)
        for k in range(1, len(w)):
            w[k] = w[k - 1] * (1.0 - (order + 1.0) / k)
        weights.append(w / step**order)
    kernel = sum(c * w for c, w in zip(coefficients, weights, strict=True))
    x = np.zeros(len(load) + 1)
    for n in range(1, len(x)):
        past = float(np.dot(kernel[1 : n + 1], x[n - 1 :: -1][:n]))
        low, high = x[n - 1] - 0.2, x[n - 1] + 0.2
        for _ in range(60):
            middle = 0.5 * (low + high)
            if kernel[0] * middle + past + moment(middle, x[n - 1]) > load[n - 1]:
                high = middle
            else:
                low = middle
        x[n] = 0.5 * (low + high)
    return x[1:]


ROW = re.compile(rb"(\d+),(\d+),(\d+\.\d+),(\d+)(?:,(\d+))?\*([0-9A-F]{2})")


def is_row(line: bytes) -> bool:
    """Whether a line (no end) is a valid data row: its columns, `*`, XOR of what is before."""
    match = ROW.fullmatch(line)
    if match is None:
        return False
    total = 0
    for byte in line[:-3]:
        total ^= byte
    return total == int(match[6], 16)


def rows(log: bytes) -> list[list[float]]:
    """Every valid row of a log."""
    found = []
    for line in log.splitlines():
        if is_row(line):
            match = ROW.fullmatch(line)
            found.append([float(group) for group in match.groups()[:5] if group is not None])
    return found
