"""What is a fair answer when the true effect is missing from the library.

Written before any diagnosis was run. An identifier is fair where it is the same physics at another
place that the signals of a campaign cannot tell apart, or the same place by another name; beside
these only `unknown` is right.
"""

from __future__ import annotations

from collections.abc import Mapping

# Two linear filters in series are one to whoever sees only what goes in and what comes out: a drive
# and a reading that lag, or are late, are told apart by the pressure between them alone.
IN_SERIES = frozenset({"dead_time", "line_lag", "sensor_lag", "channel_latency"})

# Effects that no signal of a campaign, or hardly any, separates once one of them is at work.
CONFOUNDED: tuple[frozenset[str], ...] = (
    frozenset({"creep", "sensor_creep"}),
    frozenset({"hysteresis", "sensor_hysteresis"}),
    frozenset({"sensor_lag", "channel_latency"}),
    frozenset({"dead_time", "line_lag"}),
    frozenset({"stiffening", "gravity_load", "sensor_nonlinearity"}),
    frozenset({"stiffening", "contact_stop"}),
    frozenset({"sensor_nonlinearity", "sensor_saturation"}),
    frozenset({"contact_stop", "sensor_saturation"}),
)

REASONS: Mapping[str, str] = {
    "creep": "strain and reading drift alike under load; only the fixture tells them apart",
    "sensor_creep": "strain and reading drift alike under load; only the fixture tells them apart",
    "hysteresis": "the loop of the angle and of the reading look alike",
    "sensor_hysteresis": "the loop of the angle and of the reading look alike",
    "sensor_lag": "a short lag and a short delay of the reading look alike",
    "channel_latency": "a short lag and a short delay of the reading look alike",
    "dead_time": "a chain of lags is a delay",
    "line_lag": "a chain of lags is a delay",
    "stiffening": "another static curve from pressure to reading",
    "gravity_load": "another static curve from pressure to reading",
    "sensor_nonlinearity": "another static curve from pressure to reading",
    "contact_stop": "a static curve that flattens at large angles",
    "sensor_saturation": "a static curve that flattens at large angles",
}


def confounded(one: str, other: str) -> bool:
    """Say whether two effects are too much alike to be asked for together."""
    return any({one, other} <= group for group in CONFOUNDED)


def equivalents(effect: str, pressure: bool = True) -> tuple[str, ...]:
    """List the other effects of the library that are a fair name for this one.

    `pressure` says whether the pressure was measured.
    """
    groups = CONFOUNDED if pressure else (*CONFOUNDED, IN_SERIES)
    alike = {other for group in groups if effect in group for other in group}
    return tuple(sorted(alike - {effect}))
