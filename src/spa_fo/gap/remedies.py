"""What tells two explanations apart, beside a pressure profile: a table of remedies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from spa_fo.plant.effects.library import IDS, LIBRARY

_MOST = 2  # remedies for one pair


def _at(*stages: str) -> frozenset[str]:
    return frozenset(name for name in IDS if LIBRARY[name].stage in stages)


_ALL = frozenset(IDS)
_DRIVE, _ACTUATOR, _SENSOR = _at("drive"), _at("actuator"), _at("sensor")
_BY_TIME = frozenset({"thermal_drift", "mullins_softening", "sensor_slip"})

_TWINS = (
    frozenset({"creep", "sensor_creep"}),
    frozenset({"line_lag", "sensor_lag"}),
    frozenset({"dead_time", "channel_latency"}),
)


def twins(one: Sequence[str], other: Sequence[str], tapped: bool) -> bool:
    """Say whether two explanations are the same linear filter at two places in the chain.

    Filters in series change places without a trace. What a simulation shows of the difference is
    due to the forms that the library gives them, not to physics.

    Parameters
    ----------
    one, other : sequence of str
        Their effects.
    tapped : bool
        Whether the pressure is measured, which tells the drive from the rest.
    """
    differ = frozenset(one) ^ frozenset(other)
    return differ in _TWINS and not (tapped and differ & _DRIVE)


@dataclass(frozen=True)
class Remedy:
    """Something to do at the bench that tells effects of one kind from those of another.

    Attributes
    ----------
    one, other : frozenset of str
        The effects.
    do, why : str
        What to do, and what it would tell.
    lacks : str
        Evidence that a campaign must lack for it to bring anything, by its name in
        `spa_fo.gap.findings.MISSING`; empty where it always does.
    protocol : bool
        Whether it asks for another command only, which a planned profile may replace.
    """

    one: frozenset[str]
    other: frozenset[str]
    do: str
    why: str
    lacks: str = ""
    protocol: bool = False

    def parts(self, left: Sequence[str], right: Sequence[str]) -> bool:
        """Say whether it tells two explanations apart; of one in the other, the rest counts."""
        only = (set(left) - set(right), set(right) - set(left))
        # What one explanation lacks altogether is told from nothing.
        return any(a & self.one and (b & self.other or not b) for a, b in (only, only[::-1]))


def _protocol(effects: frozenset[str], do: str, why: str, lacks: str) -> Remedy:
    return Remedy(effects, _ALL - effects, do, why, lacks, protocol=True)


REMEDIES: tuple[Remedy, ...] = (
    Remedy(
        frozenset({"mains_pickup"}),
        _ALL,
        "record the flex channel at rest for a minute, pump off and pump on",
        "interference shows without any motion",
    ),
    Remedy(
        frozenset({"creep"}),
        frozenset({"sensor_creep"}),
        "calibrate again with dwells of ten minutes at large angles",
        "against a fixture only the sensor's own creep drifts",
    ),
    Remedy(
        frozenset({"hysteresis"}),
        frozenset({"sensor_hysteresis"}),
        "calibrate again up and down in small steps",
        "a loop against a fixture is the sensor's",
    ),
    Remedy(
        frozenset({"sensor_lag"}),
        frozenset({"channel_latency"}),
        "log several times as fast and let the sensor snap back from a known angle",
        "a delay keeps the edge, a lag rounds it",
    ),
    Remedy(
        _DRIVE,
        _ALL,
        "log the pressure with a tap in the line, close to the actuator",
        "what the drive makes of the command shows there, without the actuator and the sensor",
        lacks="pressure",
    ),
    Remedy(
        _DRIVE,
        _ALL - _DRIVE,
        "log the command beside the pressure",
        "without it nothing is known of the drive",
        lacks="command",
    ),
    Remedy(
        frozenset({"gravity_load"}),
        _ALL,
        "mount the actuator in another orientation and repeat a step",
        "only the weight's moment turns with it",
    ),
    Remedy(
        frozenset({"sensor_slip"}),
        _ALL,
        "note the reading at rest before each trial, and calibrate again after the last",
        "a slip stays in the zero",
    ),
    Remedy(
        frozenset({"thermal_drift"}),
        _ALL,
        "repeat one step every quarter of an hour for some hours",
        "a drift goes on with the clock, whatever the loads",
    ),
    Remedy(
        frozenset({"mullins_softening"}),
        _ALL,
        "take a fresh specimen through the same first loads",
        "only virgin material softens",
    ),
    Remedy(
        frozenset({"contact_stop"}),
        _ALL,
        "clear the space round the actuator and repeat the largest step",
        "what it touched is gone then",
    ),
    Remedy(
        _SENSOR,
        _ALL - _SENSOR,
        "record a calibration of the sensor against known angles, up and down",
        "in the fixture nothing but the sensor can lag, creep or loop",
        lacks="calibration",
    ),
    Remedy(
        _SENSOR - {"sensor_lag"},
        _ALL - _SENSOR,
        "calibrate the sensor once more, after the last trial",
        "what has changed between two calibrations is the sensor's",
        lacks="later calibration",
    ),
    Remedy(
        _SENSOR,
        _ACTUATOR,
        "check the reading against an outside reference while the actuator moves, such as a camera",
        "what it does not show is the sensor's",
    ),
    Remedy(
        frozenset({"parameter_shift"}),
        _ALL,
        "repeat a step with the specimen that the model was identified on",
        "a shift stays with the specimen",
    ),
    _protocol(
        frozenset({"hysteresis", "sensor_hysteresis", "drive_backlash", "creep", "sensor_creep"}),
        "record the release after each step too",
        "play, loops and creep leave something behind there",
        "release",
    ),
    _protocol(
        frozenset({"stiffening", "contact_stop", "gravity_load", "drive_backlash", "hysteresis"})
        | {"sensor_nonlinearity", "sensor_saturation", "sensor_hysteresis"},
        "record a staircase or a triangle up and down",
        "what goes with the angle or its direction shows level by level",
        "levels",
    ),
    _protocol(
        frozenset({"creep", "sensor_creep", "leak", "supply_droop", "mullins_softening"}),
        "record a hold of a minute and the recovery from it",
        "what goes on while the command stands still shows alone there",
        "hold",
    ),
    Remedy(
        _BY_TIME,
        _ALL - _BY_TIME,
        "mix the order of the experiments",
        "in blocks a drift looks like a dependence on the amplitude",
        lacks="order",
    ),
)
"""Those that fit a pair of effects best stand first."""

CAMERA = Remedy(
    _ALL,
    _ALL,
    "record the angle by a second way, such as a camera, beside the sensor",
    "it shows whether the gap is in the motion or in the reading of it",
)
"""Where nothing else is known to help."""


def remedies(one: Sequence[str], other: Sequence[str], tapped: bool) -> tuple[str, ...]:
    """Say what to do about two explanations that no pressure profile separates.

    Parameters
    ----------
    one, other : sequence of str
        Their effects.
    tapped : bool
        Whether the pressure is measured already.

    Returns
    -------
    tuple of str
        At least one, most telling first.
    """
    found = [
        f"{remedy.do}: {remedy.why}"
        for remedy in REMEDIES
        if not remedy.protocol and remedy.lacks in ("", "" if tapped else "pressure")
        if remedy.parts(one, other)
    ]
    return tuple(found[:_MOST]) or (f"{CAMERA.do}: {CAMERA.why}",)
