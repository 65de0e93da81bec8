"""What tells two explanations apart where no pressure profile does: a table of rules."""

from __future__ import annotations

from collections.abc import Sequence

from spa_fo.plant.effects.library import IDS, LIBRARY

_MOST = 2  # remedies for one pair


def _at(*stages: str) -> frozenset[str]:
    return frozenset(name for name in IDS if LIBRARY[name].stage in stages)


_ALL = frozenset(IDS)
_DRIVE, _ACTUATOR, _SENSOR = _at("drive"), _at("actuator"), _at("sensor")
_TAP = "log the pressure with a tap in the line, close to the actuator"

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


_RULES: tuple[tuple[frozenset[str], frozenset[str], str], ...] = (
    (
        frozenset({"mains_pickup"}),
        _ALL,
        "record the flex channel at rest for a minute, pump off and pump on: interference shows "
        "without any motion",
    ),
    (
        frozenset({"creep"}),
        frozenset({"sensor_creep"}),
        "calibrate again with dwells of ten minutes at large angles: against a fixture only the "
        "sensor's own creep drifts",
    ),
    (
        frozenset({"hysteresis"}),
        frozenset({"sensor_hysteresis"}),
        "calibrate again up and down in small steps: a loop against a fixture is the sensor's",
    ),
    (
        frozenset({"sensor_lag"}),
        frozenset({"channel_latency"}),
        "log several times as fast and let the sensor snap back from a known angle: a delay keeps "
        "the edge, a lag rounds it",
    ),
    (_DRIVE, _ALL, _TAP),
    (
        frozenset({"gravity_load"}),
        _ALL,
        "mount the actuator in another orientation and repeat a step: only the weight's moment "
        "turns with it",
    ),
    (
        frozenset({"sensor_slip"}),
        _ALL,
        "calibrate again after the last trial and note the reading at rest before each: a slip "
        "stays in the zero",
    ),
    (
        frozenset({"thermal_drift"}),
        _ALL,
        "repeat one step every quarter of an hour for some hours: a drift goes on with the clock, "
        "whatever the loads",
    ),
    (
        frozenset({"mullins_softening"}),
        _ALL,
        "take a fresh specimen through the same first loads: only virgin material softens",
    ),
    (
        frozenset({"contact_stop"}),
        _ALL,
        "clear the space round the actuator and repeat the largest step",
    ),
    (
        _SENSOR,
        _ACTUATOR,
        "check the reading against an outside reference while the actuator moves, such as a "
        "camera: what it does not show is the sensor's",
    ),
    (
        frozenset({"parameter_shift"}),
        _ALL,
        "repeat a step with the specimen that the model was identified on: a shift stays with the "
        "specimen",
    ),
)
_ELSE = "record the angle by a second way, such as a camera, beside the sensor"


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
    only = (set(one) - set(other), set(other) - set(one))
    found = []
    for left, right, words in _RULES:
        if words == _TAP and tapped:
            continue
        # What one explanation lacks altogether is told from nothing.
        if any(a & left and (b & right or not b) for a, b in (only, only[::-1])):
            found.append(words)
    return tuple(found[:_MOST]) or (_ELSE,)
