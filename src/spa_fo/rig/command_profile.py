"""Commanded pressures over a trial, as set-points that are held."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from spa_fo.errors import BadInput
from spa_fo.rig.campaign import Protocol

COLUMNS = "t_s,cmd_kpa"
_RAMP_HZ = 50.0  # how often a ramp is commanded anew


@dataclass(frozen=True)
class CommandProfile:
    """A commanded pressure: each set-point is held until the next.

    Parameters
    ----------
    protocol : str
        The campaign's word for it.
    duration_s : float
        Length of the trial, s.
    setpoints : tuple of (float, float)
        Time (s, rising) and gauge pressure (kPa); 0 kPa before the first.
    """

    protocol: Protocol
    duration_s: float
    setpoints: tuple[tuple[float, float], ...]

    @property
    def largest_kpa(self) -> float:
        """The largest command."""
        return max((kpa for _, kpa in self.setpoints), default=0.0)

    def samples(self, rate_hz: float) -> int:
        """Count the samples of a trial."""
        return max(1, round(self.duration_s * rate_hz))

    def by_sample(self, rate_hz: float) -> list[tuple[int, float]]:
        """List (sample, kPa) where the command changes, samples rising, kPa to two decimals."""
        changes: list[tuple[int, float]] = []
        held = 0.0
        for time_s, kpa in self.setpoints:
            sample, kpa = math.ceil(time_s * rate_hz - 1e-6), round(kpa, 2)
            if changes and changes[-1][0] == sample:
                changes.pop()
                held = changes[-1][1] if changes else 0.0
            if kpa != held:
                changes.append((sample, kpa))
                held = kpa
        return changes


def plateaus(
    protocol: Protocol,
    levels_kpa: Sequence[float],
    rest_s: float,
    dwell_s: float,
    release_s: float,
) -> CommandProfile:
    """Rest, each level for `dwell_s`, vented for `release_s`: step, staircase, hold."""
    setpoints = [(rest_s + i * dwell_s, level) for i, level in enumerate(levels_kpa)]
    end_s = rest_s + len(levels_kpa) * dwell_s
    if release_s > 0.0:
        setpoints.append((end_s, 0.0))
    return CommandProfile(protocol, end_s + release_s, tuple(setpoints))


def triangle(
    peak_kpa: float, cycles: int, rest_s: float, ramp_s: float, release_s: float
) -> CommandProfile:
    """Rest, `cycles` ramps up and down, rest."""
    end_s = rest_s + 2 * cycles * ramp_s
    setpoints = []
    for k in range(math.ceil((end_s - rest_s) * _RAMP_HZ)):
        phase = k / _RAMP_HZ / ramp_s % 2.0
        setpoints.append((rest_s + k / _RAMP_HZ, peak_kpa * min(phase, 2.0 - phase)))
    return CommandProfile("triangle", end_s + release_s, (*setpoints, (end_s, 0.0)))


def read_profile(path: Path | str, protocol: Protocol = "free") -> CommandProfile:
    """Read a profile file: lines that begin with ``# ``, a header ``t_s,cmd_kpa``, rows.

    Each command is held until the next time; the last one for as long as the one before it.
    `spa-fo plan` writes such files.

    Raises
    ------
    BadInput
        The file cannot be read or is no profile; the text names the line.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(path, f"cannot be read ({error}); expected a profile") from error
    numbered = [(n, line) for n, line in enumerate(lines, start=1) if not line.startswith("#")]
    numbered = [(n, line) for n, line in numbered if line.strip()]
    if not numbered or numbered[0][1].replace(" ", "") != COLUMNS:
        raise BadInput(path, f'expected a header "{COLUMNS}"')
    setpoints: list[tuple[float, float]] = []
    for number, line in numbered[1:]:
        try:
            time_s, kpa = (float(field) for field in line.split(","))
        except ValueError:
            raise BadInput(
                path, f"expected two numbers, found {line!r}", f"line {number}"
            ) from None
        if not (math.isfinite(time_s) and math.isfinite(kpa)) or time_s < 0.0 or kpa < 0.0:
            raise BadInput(path, "expected finite numbers from 0", f"line {number}")
        if setpoints and time_s <= setpoints[-1][0]:
            raise BadInput(path, "expected times that rise", f"line {number}")
        setpoints.append((time_s, kpa))
    if len(setpoints) < 2:
        raise BadInput(path, "expected at least two rows")
    (before_s, _), (last_s, _) = setpoints[-2:]
    return CommandProfile(protocol, 2.0 * last_s - before_s, tuple(setpoints))
