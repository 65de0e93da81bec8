"""What a command that is no pressure makes of the pressure: a curve of levels, and how fast.

A pump's PWM, a valve's duty or volts lead to a pressure L(c) where c is held, and there with a rate
k(c), another one where the pressure falls:

    dp/dt = k(c) (L(c) - p),    times `venting` where L(c) < p,    c as commanded `delay_s` before
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spa_fo._jit import njit
from spa_fo.arrays import Floats
from spa_fo.errors import BadInput
from spa_fo.plant.memory import FINEST_STEP_S
from spa_fo.plant.model_file import Model
from spa_fo.rig import CampaignData, Trial
from spa_fo.rig.first_change import before_first_change

KEY = "nominal_drive"
"""Key of a model file that holds it: its `command` is then no pressure."""
_FIRST_ROWS = 5  # of a log, that say under which pressure it begins
_HOLDS = 1e-9  # share of the way to its level that a pressure which holds goes in a step
_LISTS = ("command", "level_kpa", "rate_per_s")
_NUMBERS = ("venting", "delay_s")


@dataclass(frozen=True)
class NominalDrive:
    """A drive without any effect.

    Attributes
    ----------
    command : (k,) array
        Knots, in the command's own unit, rising.
    level_kpa : (k,) array
        Pressure that holding each leads to, never falling; straight between and beyond them.
    rate_per_s : (k,) array
        How fast it goes there; as at the last knot beyond.
    venting : float
        Factor of the rate where the pressure falls.
    delay_s : float
        How late all of it comes.
    """

    command: Floats
    level_kpa: Floats
    rate_per_s: Floats
    venting: float = 1.0
    delay_s: float = 0.0

    def levels(self, command: Floats) -> Floats:
        """Return the pressure (kPa) that each command leads to, same shape."""
        found = np.interp(command, self.command, self.level_kpa)
        slopes = np.diff(self.level_kpa) / np.diff(self.command)
        below = np.minimum(command - self.command[0], 0.0)
        above = np.maximum(command - self.command[-1], 0.0)
        return np.asarray(found + slopes[0] * below + slopes[-1] * above)

    def rates(self, command: Floats) -> Floats:
        """Return how fast (1/s) each command leads there, same shape."""
        return np.asarray(np.interp(command, self.command, self.rate_per_s))

    def cells(self, t_s: Floats, command: Floats, begins_kpa: float | None = None) -> Floats:
        """Return the nominal pressure, means over cells of the finest step from 0 on, kPa.

        Parameters
        ----------
        t_s, command : (n,) arrays
            As logged, each command held until the next row.
        begins_kpa : float, optional
            Pressure at the beginning; that of the first command by default.
        """
        edges = FINEST_STEP_S * np.arange(np.ceil(t_s[-1] / FINEST_STEP_S) + 2) - self.delay_s
        levels, rates = (_held(t_s, of(command), edges) for of in (self.levels, self.rates))
        begins = float(levels[0]) if begins_kpa is None else begins_kpa
        return follow(levels, rates, self.venting, begins)

    def at(self, t_s: Floats, command: Floats, begins_kpa: float | None = None) -> Floats:
        """Return the nominal pressure at the rows themselves, (n,), kPa; see `cells`."""
        cells = self.cells(t_s, command, begins_kpa)
        middle = FINEST_STEP_S * (np.arange(cells.size) + 0.5)
        return np.asarray(np.interp(t_s, middle, cells))

    def at_rows(self, trial: Trial) -> Floats:
        """Return the nominal pressure of a trial at its rows, (n,), kPa."""
        assert trial.command_kpa is not None
        return self.at(trial.t_s, trial.command_kpa, begins_kpa(trial))

    def commanded(self, trial: Trial) -> Floats:
        """Return what stands for a trial's commanded pressure: means from row to row, (n,), kPa."""
        assert trial.command_kpa is not None
        cells = self.cells(trial.t_s, trial.command_kpa, begins_kpa(trial))
        edges = FINEST_STEP_S * np.arange(cells.size + 1)
        area = np.concatenate([[0.0], np.cumsum(cells) * FINEST_STEP_S])
        at = np.append(trial.t_s, trial.t_s[-1] + FINEST_STEP_S)
        return np.asarray(np.diff(np.interp(at, edges, area)) / np.diff(at))

    def applied(self, data: CampaignData) -> CampaignData:
        """Let the nominal pressure stand where a command stands that is no pressure."""
        if data.campaign.command_is_pressure:
            return data
        columns = dict(data.campaign.log.columns or {})
        columns["command"] = replace(columns["command"], unit="kPa")
        log = replace(data.campaign.log, columns=columns)
        trials = tuple(replace(t, command_kpa=self.commanded(t)) for t in data.trials)
        return replace(data, campaign=replace(data.campaign, log=log), trials=trials)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        lists = {name: getattr(self, name).tolist() for name in _LISTS}
        return {**lists, **{name: getattr(self, name) for name in _NUMBERS}}

    @classmethod
    def from_dict(cls, entry: Any, source: object = "model") -> NominalDrive:
        """Read what `to_dict` wrote.

        Raises
        ------
        BadInput
            A key is missing or holds something else; `source` is the file that it names.
        """
        if not isinstance(entry, Mapping):
            raise BadInput(str(source), "expected an object", KEY)
        lists = [_numbers(entry, name, source) for name in _LISTS]
        numbers = [float(_numbers(entry, name, source, alone=True)[0]) for name in _NUMBERS]
        knots = lists[0]
        if knots.size < 2 or any(one.size != knots.size for one in lists):
            raise BadInput(str(source), "expected as many numbers each, two at least", KEY)
        if not (np.all(np.diff(knots) > 0.0) and np.all(np.diff(lists[1]) >= 0.0)):
            raise BadInput(str(source), "expected commands that rise, and levels with them", KEY)
        if not (np.all(lists[2] >= 0.0) and min(numbers) >= 0.0):
            raise BadInput(str(source), "expected rates, venting and delay of 0 or more", KEY)
        return cls(lists[0], lists[1], lists[2], numbers[0], numbers[1])


def drive_of(model: Model, source: object = "model") -> NominalDrive | None:
    """Return the nominal drive that a model holds, if any.

    Raises
    ------
    BadInput
        It is not what `NominalDrive.to_dict` writes.
    """
    return NominalDrive.from_dict(model.extra[KEY], source) if KEY in model.extra else None


def driven_by(model: Model, drive: NominalDrive) -> Model:
    """Say what drives a model that was found from nominal and measured pressure.

    The command through the nominal drive where it holds an effect of the drive, else the measured
    pressure.
    """
    if not any(effect["stage"] == "drive" for effect in model.effects):
        return replace(model, signal="pressure")
    extra = {**model.extra, KEY: drive.to_dict()}
    return replace(model, signal="command", extra=extra)


def begins_kpa(trial: Trial) -> float | None:
    """Return the pressure under which a trial begins; None where it was not measured."""
    if trial.pressure_kpa is None:
        return None
    rows = min(max(before_first_change(trial), 1), _FIRST_ROWS)
    return float(trial.pressure_kpa[:rows].mean())


def _held(t_s: Floats, values: Floats, edges_s: Floats) -> Floats:
    """Average what holds from row to row over cells; before the first row it was as there."""
    early = max(0.0, t_s[0] - edges_s[0]) + FINEST_STEP_S
    last = max(0.0, edges_s[-1] - t_s[-1]) + FINEST_STEP_S
    at = np.concatenate([[t_s[0] - early], t_s, [t_s[-1] + last]])
    area = np.concatenate([[0.0], np.cumsum(np.append(values[0], values) * np.diff(at))])
    return np.asarray(np.diff(np.interp(edges_s, at, area)) / np.diff(edges_s))


def _numbers(entry: Mapping[str, Any], name: str, source: object, *, alone: bool = False) -> Floats:
    """Read finite numbers: a list of them, or one alone."""
    value = entry.get(name)
    found = [value] if alone else value
    if not isinstance(found, list) or not all(
        isinstance(one, int | float) and not isinstance(one, bool) and np.isfinite(one)
        for one in found
    ):
        what = "a number" if alone else "a list of numbers"
        raise BadInput(str(source), f"expected {what}", f"{KEY}.{name}")
    return np.array(found, dtype=np.float64)


@njit
def follow(levels: Floats, rates: Floats, venting: float, begins: float) -> Floats:
    """Let a pressure follow its level, (cells,); means over the cells.

    Parameters
    ----------
    levels, rates : (cells,) arrays
        Where it goes, kPa, and how fast, 1/s.
    venting : float
        Factor of the rate where it falls.
    begins : float
        Pressure at the beginning, kPa.
    """
    mean = np.empty_like(levels)
    p = begins
    for i in range(levels.size):
        share = FINEST_STEP_S * rates[i] * (venting if levels[i] < p else 1.0)
        away = p - levels[i]
        keep = np.exp(-share)
        mean[i] = levels[i] + away * ((1.0 - keep) / share if share > _HOLDS else 1.0)
        p = levels[i] + away * keep
    return mean
