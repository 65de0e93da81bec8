"""A channel that repeats one value while what moves it moves: at its rail, or frozen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.rig.campaign import Campaign
from spa_fo.rig.trial import Trial

_LEAST_S, _LEAST = 1.0, 10  # of one value, in seconds and in samples
_MOVES = 0.2  # of its range in the trial, by what moves the channel in that time
_SHOWN = 3  # trials named in one line


def stuck(campaign: Campaign, trials: Sequence[Trial]) -> Iterator[str]:
    """Say which channels stand still while what moves them does not, a line each.

    Parameters
    ----------
    campaign : Campaign
        What campaign.yaml says.
    trials : sequence of Trial
        Its trials.
    """
    if campaign.has_angle:
        moved = [(t, t.angle_deg, _mover(t)) for t in trials]
        yield from _of("angle", "deg", "what bends it", moved)
    if campaign.command_is_pressure:
        pressed = [(t, t.pressure_kpa, t.command_kpa) for t in trials if t.pressure_kpa is not None]
        yield from _of("pressure", "kPa", "the command", pressed)


def _mover(trial: Trial) -> Floats | None:
    return trial.command_kpa if trial.pressure_kpa is None else trial.pressure_kpa


def _of(
    name: str,
    unit: str,
    mover_name: str,
    channels: Sequence[tuple[Trial, Floats | None, Floats | None]],
) -> Iterator[str]:
    known = [(t, y, u) for t, y, u in channels if y is not None and u is not None]
    if not known:
        return
    ends = min(float(y.min()) for _, y, _ in known), max(float(y.max()) for _, y, _ in known)
    found: dict[str, list[tuple[Trial, float, float]]] = {}
    for trial, y, u in known:
        longest = _longest(trial.t_s, y, u)
        if longest is not None:
            value, lasts_s = longest
            kind = ("its smallest", "its largest")[ends.index(value)] if value in ends else ""
            found.setdefault(kind, []).append((trial, value, lasts_s))
    for kind, cases in found.items():
        _, value, lasts_s = cases[0]
        if kind:
            yield (
                f"the {name} reads {value:.4g} {unit}, {kind}, for {lasts_s:.3g} s while "
                f"{mover_name} moves, in {_named(cases)}: at its rail or against a stop"
            )
        else:
            yield (
                f"the {name} stands at {value:.4g} {unit} for {lasts_s:.3g} s while "
                f"{mover_name} moves, in {_named(cases)}: frozen, or not read anew"
            )


def _longest(t_s: Floats, y: Floats, u: Floats) -> tuple[float, float] | None:
    """Find the longest time of one value in which `u` moves: the value and how long, s."""
    edges = np.flatnonzero(np.diff(y) != 0.0) + 1
    begins, ends = np.append(0, edges), np.append(edges, y.size)
    least, best = _MOVES * float(np.ptp(u)), None
    if not least > 0.0 or begins.size == 1:
        return None  # nothing moves, or the channel not at all
    for begin, end in zip(begins, ends, strict=True):
        lasts_s = float(t_s[end - 1] - t_s[begin])
        if end - begin < _LEAST or lasts_s < max(_LEAST_S, 0.0 if best is None else best[1]):
            continue
        # From the start on it has not begun to move yet.
        if begin > 0 and np.ptp(u[begin:end]) > least:
            best = float(y[begin]), lasts_s
    return best


def _named(cases: Sequence[tuple[Trial, float, float]]) -> str:
    names = ", ".join(trial.label for trial, _, _ in cases[:_SHOWN])
    return names + (f" and {len(cases) - _SHOWN} more" if len(cases) > _SHOWN else "")
