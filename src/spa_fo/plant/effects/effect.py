"""What an effect is: one object that says all that the project knows of it.

Everything else asks these objects; only the stages' kernels and the writers of exports know an
effect by its name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

Stage = Literal["drive", "actuator", "sensor", "acquisition"]
_SERIES: dict[Stage, tuple[str, ...]] = {
    "drive": ("pressure_kpa", "time_s"),
    "actuator": ("pressure_kpa", "angle_deg", "time_s"),
    "sensor": ("angle_deg", "time_s"),
    "acquisition": ("reading_deg", "time_s"),
}
STAGES: tuple[Stage, ...] = tuple(_SERIES)
Port = Literal["chain", "coefficients", "curve", "zeros", "line"]
Filter = Literal["", "delay", "lag", "creep"]
Shown = Literal["release", "levels", "hold", "order"]
PASSING = ("delay", "lag")
"""Filters that leave nothing behind once an angle has settled."""

RARER = 0.2
"""Odds of what single rigs show against what the literature finds on most of them."""

USUAL_DEG, USUAL_KPA = 60.0, 60.0
"""Largest angle and pressure of a rig that what is plausible of parameters is written for."""
USUAL_RISE_S = 1.1
"""Time in which most of a step is made there: the paper's two actuators take 1.0 and 1.2 s."""
_IN_TIME = {"s": 1.0, "1/s": -1.0, "kPa/s": -1.0}
"""Powers of a slow rig's time scale that what is plausible goes with, by unit."""
ANY = (-np.inf, np.inf)
"""Where a parameter is searched as far as its bounds let it be."""
_UNTOLD = 0.01  # of its spread is left of what nothing tells. Assumed.
_GOES_WITH = {
    "deg": (1.0, 0.0),
    "deg per trial": (1.0, 0.0),
    "kPa": (0.0, 1.0),
    "kPa/s": (0.0, 1.0),
}


@dataclass(frozen=True)
class Reach:
    """Largest angle and pressure of a rig, as multiples of `USUAL_DEG` and `USUAL_KPA`.

    `read_deg` is the largest angle that the same sensor has read before, where a reference says it;
    `time` the time in which the rig makes most of a step, as a multiple of `USUAL_RISE_S`, where it
    is slower. `hours` is how long the campaign lasted, `repeats` whether any trial repeats another.
    """

    angle: float = 1.0
    pressure: float = 1.0
    read_deg: float = 0.0
    time: float = 1.0
    hours: float = 1.0
    repeats: bool = True


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes
    ----------
    name, unit : str
        As written to model files.
    centre, spread : float
        What is plausible: a normal distribution, of the logarithm where `log`.
    low, high : float
        Bounds that physics sets.
    log : bool
        Whether the logarithm is searched: for times and shapes. Amplitudes are searched as they
        are, zero being no effect.
    starts : tuple of float
        Where searches begin.
    means : str
        What it is, for the pages.
    goes_with : (float, float), optional
        Powers of a rig's largest angle and pressure that what is plausible goes with; by default
        as the unit says: degrees with the angle, kPa with the pressure.
    beyond_read : bool
        Whether it is an angle that nothing before can have been read beyond.
    searched : (float, float), optional
        Between what it is searched, as plausible goes: beyond it does what something else is.
    is_addition : bool
        Whether it came to its effect later: model files that lack it mean 0.
    is_delay : bool
        Whether it is a pure delay: a search sees no further than how fast what it delays changes.
    two_forms : bool
        Whether its two starts are two forms of the effect, and no search leads from one to the
        other.
    by_campaign : bool
        Whether it is a rate that is plausible as a multiple of one over a campaign's time.
    by_repeats : bool
        Whether only repeats tell it: without them it stays where it is plausible.
    """

    name: str
    unit: str
    centre: float
    spread: float
    low: float
    high: float
    log: bool = False
    starts: tuple[float, ...] = ()
    means: str = ""
    goes_with: tuple[float, float] | None = None
    beyond_read: bool = False
    is_delay: bool = False
    searched: tuple[float, float] = ANY
    is_addition: bool = False
    two_forms: bool = False
    by_campaign: bool = False
    by_repeats: bool = False

    @property
    def is_moment(self) -> bool:
        """Whether it, `since`, says when something begins, as a share of the campaign."""
        return self.name == "since"

    def at(self, reach: Reach) -> Parameter:
        """Return what is plausible of it on a rig of another reach.

        Its bounds stay, but for what was read before, and how far it is searched.
        """
        angle, pressure = self.goes_with or _GOES_WITH.get(self.unit, (0.0, 0.0))
        time = _IN_TIME.get(self.unit, 0.0)
        factor = float(reach.angle**angle * reach.pressure**pressure * reach.time**time)
        factor /= reach.hours if self.by_campaign else 1.0
        known = _UNTOLD if self.by_repeats and not reach.repeats else 1.0
        least, most = (factor * bound for bound in self.searched)
        least = max(least, reach.read_deg) if self.beyond_read else least
        low = min(max(self.low, least), self.high)
        high = min(max(most, low), self.high)

        def scaled(value: float) -> float:
            return min(max(factor * value, low), high)

        return replace(
            self,
            low=low,
            high=high,
            centre=scaled(self.centre),
            spread=(self.spread if self.log else factor * self.spread) * known,
            starts=tuple(map(scaled, self.starts)),
        )


@dataclass(frozen=True)
class Check:
    """Something to do at the bench, and what it would tell."""

    do: str
    why: str


@dataclass(frozen=True)
class Effect:
    """One effect.

    Attributes
    ----------
    id : str
        As answers and model files have it.
    stage : {"drive", "actuator", "sensor", "acquisition"}
        What it belongs to.
    parameters : tuple of Parameter
        In the order of the vector of all parameters.
    name, means, remedy : str
        What people call it, what happens on the rig, and what to do about it there.
    port : str
        How an identification meets it: as parameters of the simulated chain, as other
        coefficients, as an error of the sensor's curve, as every trial's zero, or as a spectral
        line.
    place : str
        Where in the chain a free-form law would do the same (`spa_fo.plant.law.PLACES`); empty
        where none does.
    filter : str
        Which linear filter it is, if it is one. The same filter at two places is one and the same
        to whoever sees only what goes in and what comes out.
    in_fixture : bool
        Whether the calibration's dwells show it.
    in_trials_alone : bool
        Whether they may as well not, as what logs them need not be what logs a trial.
    in_later : bool
        Whether later calibrations may show it as trials do, as it may have come since the first:
        of what they read at an angle, whatever came before.
    shown_in : tuple of str
        Evidence that it shows in: a release, several levels, a hold, a mixed order of the trials.
    check : Check, optional
        What shows it, whatever else it may be.
    equivalents : mapping
        Effects that it is taken for, and what tells them apart.
    neutral : mapping
        Parameters with which it does nothing, where that is not zero amplitudes.
    coefficients : mapping
        What it makes of the coefficients, one by one, in words.
    act : callable, optional
        What it does to the series at its stage, where no kernel of the chain knows it
        (`spa_fo.plant.effects.own`).
    half_loop : callable, optional
        Of a loop of the reading whose branch nobody knows when a trial begins: half of what the two
        branches differ by, (n,), over the angles that follow, (n,), and the parameters.
    is_sum : bool
        Whether it is the sum of what each of its parameters makes by itself: any of them may be all
        that shows.
    carries_on : bool
        Whether a drive's goes on from where the trial before it left it.
    sees_angle : bool
        Whether `act` on an actuator is given the angle too: then the load that fits the angle is
        searched, which takes several simulations for one.
    odds : float
        How probable it is beforehand, against one that most rigs show.
    source : Path or str
        The file that it comes from, for messages.
    first : int
        Where its parameters begin in the vector of all; the library's to say.
    """

    id: str
    stage: Stage
    parameters: tuple[Parameter, ...] = ()
    name: str = ""
    means: str = "an effect that was added to the library"
    remedy: str = "keep it in the model"
    port: Port = "chain"
    place: str = ""
    filter: Filter = ""
    in_fixture: bool = False
    in_trials_alone: bool = False
    in_later: bool = False
    shown_in: tuple[Shown, ...] = ()
    check: Check | None = None
    equivalents: Mapping[str, Check] = field(default_factory=dict)
    neutral: Mapping[str, float] = field(default_factory=dict)
    coefficients: Mapping[str, str] = field(default_factory=dict)
    act: Callable[..., Any] | None = None
    half_loop: Callable[..., Any] | None = None
    is_sum: bool = False
    carries_on: bool = False
    sees_angle: bool = True
    odds: float = 1.0
    source: Path | str = "library"
    first: int = -1

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.id.replace("_", " "))

    @property
    def slots(self) -> slice:
        """Its place in the vector of all parameters."""
        return slice(self.first, self.first + len(self.parameters))

    @property
    def series(self) -> tuple[str, ...]:
        """What `act` is given ahead of the parameters; it returns the first of them."""
        names = _SERIES[self.stage]
        if self.stage == "actuator" and not self.sees_angle:
            return tuple(name for name in names if name != "angle_deg")
        return names

    @property
    def moment(self) -> int | None:
        """Which parameter says when it begins, if any."""
        return next((k for k, each in enumerate(self.parameters) if each.is_moment), None)

    @property
    def meanings(self) -> Mapping[str, str]:
        """What its parameters are, by name."""
        return {p.name: p.means for p in self.parameters} | dict(self.coefficients)


def amplitude(
    name: str,
    unit: str,
    means: str = "",
    *,
    spread: float,
    high: float,
    start: float,
    further: tuple[float, ...] = (),
    low: float = 0.0,
    goes_with: tuple[float, float] | None = None,
    searched: tuple[float, float] = ANY,
) -> Parameter:
    """Make a parameter that is zero where there is no effect; `further` are other starts."""
    return Parameter(
        *(name, unit, 0.0, spread, low, high),
        starts=(start, *further),
        means=means,
        goes_with=goes_with,
        searched=searched,
    )


def shape(
    name: str,
    unit: str,
    means: str = "",
    *,
    centre: float,
    factor: float,
    low: float,
    high: float,
    starts: tuple[float, ...] = (),
    beyond_read: bool = False,
    searched: tuple[float, float] = ANY,
) -> Parameter:
    """Make a positive parameter, such as a time, that is mostly within a factor of its centre."""
    return Parameter(
        name=name,
        unit=unit,
        centre=centre,
        spread=float(np.log(factor)),
        low=low,
        high=high,
        log=True,
        starts=starts or (centre,),
        means=means,
        beyond_read=beyond_read,
        searched=searched,
    )


def share(
    name: str,
    means: str = "",
    *,
    centre: float = 0.3,
    spread: float = 0.3,
    high: float = 1.0,
    starts: tuple[float, ...] = (),
    is_addition: bool = False,
    by_repeats: bool = False,
) -> Parameter:
    """Make a parameter that is a part of something; a fit begins at its centre unless said."""
    return Parameter(
        *(name, "1", centre, spread, 0.0, high),
        starts=starts or (centre,),
        means=means,
        is_addition=is_addition,
        by_repeats=by_repeats,
    )


def lateness(name: str, means: str = "", *, is_delay: bool = False) -> Parameter:
    """Make a time by which something is late."""
    starts = 0.03, 0.12, 0.4
    return Parameter(name, "s", 0.0, 0.12, 0.0, 10.0, starts=starts, means=means, is_delay=is_delay)
