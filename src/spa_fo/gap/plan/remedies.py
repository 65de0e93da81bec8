"""What tells two explanations apart, beside a pressure profile.

Nothing is listed here by an effect's name: every effect says what shows it, what it is taken for,
and in which evidence it shows (`spa_fo.plant.effects.effect.Effect`), and its stage says the rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from spa_fo.plant.effects.effect import PASSING, Check, Effect, Shown
from spa_fo.plant.effects.library import LIBRARY, same_filter

_MOST = 2  # remedies for one pair

_TAP = Check(
    "log the pressure with a tap in the line, close to the actuator",
    "what the drive makes of the command shows there, without the actuator and the sensor",
)
_COMMAND = Check("log the command beside the pressure", "without it nothing is known of the drive")
_CALIBRATION = Check(
    "record a calibration of the sensor against known angles, up and down",
    "in the fixture nothing but the sensor can lag, creep or loop",
)
_LATER_CALIBRATION = Check(
    "calibrate the sensor once more, after the last trial",
    "what has changed between two calibrations is the sensor's",
)
_REFERENCE = Check(
    "check the reading against an outside reference while the actuator moves, such as a camera",
    "what it does not show is the sensor's",
)
_PROTOCOLS: dict[Shown, Check] = {
    "release": Check(
        "record the release after each step too",
        "play, loops and creep leave something behind there",
    ),
    "levels": Check(
        "record a staircase or a triangle up and down",
        "what goes with the angle or its direction shows level by level",
    ),
    "hold": Check(
        "record a hold of a minute and the recovery from it",
        "what goes on while the command stands still shows alone there",
    ),
}
_ORDER = Check(
    "mix the order of the experiments",
    "in blocks a drift looks like a dependence on the amplitude",
)
CAMERA = Check(
    "record the angle by a second way, such as a camera, beside the sensor",
    "it shows whether the gap is in the motion or in the reading of it",
)
"""Where nothing else is known to help."""


@dataclass(frozen=True)
class Remedy:
    """Something to do at the bench that tells effects of one kind from those of another.

    `lacks` names evidence (of `spa_fo.gap.answer.findings.MISSING`) that a campaign must lack for
    it to bring anything; `protocol` says that it asks for another command only, which a planned
    profile may replace.
    """

    check: Check
    one: frozenset[str]
    other: frozenset[str]
    lacks: str = ""
    protocol: bool = False

    def parts(self, left: Sequence[str], right: Sequence[str]) -> bool:
        """Say whether it tells two explanations apart; of one in the other, the rest counts."""
        only = (set(left) - set(right), set(right) - set(left))
        # What one explanation lacks altogether is told from nothing.
        return any(a & self.one and (b & self.other or not b) for a, b in (only, only[::-1]))


def known_remedies() -> Iterator[Remedy]:
    """List what can be done at the bench; what fits a pair of effects best comes first."""
    every = frozenset(LIBRARY)
    drive = _where(lambda e: e.stage == "drive")
    actuator = _where(lambda e: e.stage == "actuator")
    sensor = _where(lambda e: e.stage == "sensor")
    settles = sensor & _where(lambda e: e.filter not in PASSING)
    for effect in LIBRARY.values():
        for other, check in effect.equivalents.items():
            yield Remedy(check, frozenset({effect.id}), frozenset({other}))
    yield from _checks(lambda e: e.stage == "acquisition")
    yield Remedy(_TAP, drive, every, "pressure")
    yield Remedy(_COMMAND, drive, every - drive, "command")
    yield from _checks(lambda e: e.stage != "acquisition" and e.port != "coefficients")
    yield Remedy(_CALIBRATION, sensor, every - sensor, "calibration")
    yield Remedy(_LATER_CALIBRATION, settles, every - sensor, "later calibration")
    yield Remedy(_REFERENCE, sensor, actuator)
    yield from _checks(lambda e: e.port == "coefficients")
    for shown, check in _PROTOCOLS.items():
        ids = _shown_in(shown)
        yield Remedy(check, ids, every - ids, shown, protocol=True)
    drifting = _shown_in("order")
    yield Remedy(_ORDER, drifting, every - drifting, "order")


def _where(holds: Callable[[Effect], bool]) -> frozenset[str]:
    return frozenset(name for name, effect in LIBRARY.items() if holds(effect))


def _shown_in(evidence: Shown) -> frozenset[str]:
    return _where(lambda effect: evidence in effect.shown_in)


def _checks(holds: Callable[[Effect], bool]) -> Iterator[Remedy]:
    """Give what shows single effects, whatever else they may be."""
    for effect in LIBRARY.values():
        if effect.check is not None and holds(effect):
            yield Remedy(effect.check, frozenset({effect.id}), frozenset(LIBRARY))


def remedies(one: Sequence[str], other: Sequence[str], tapped: bool) -> list[str]:
    """Say what parts two explanations that no pressure profile separates, most telling first.

    `tapped` says whether the pressure is measured already.
    """
    needed = ("",) if tapped else ("", "pressure")
    found = [
        f"{remedy.check.do}: {remedy.check.why}"
        for remedy in known_remedies()
        if not remedy.protocol and remedy.lacks in needed and remedy.parts(one, other)
    ]
    return found[:_MOST] or [f"{CAMERA.do}: {CAMERA.why}"]


def twins(one: Sequence[str], other: Sequence[str], tapped: bool) -> bool:
    """Say whether two explanations differ by the place of one linear filter alone; `same_filter`.

    What a simulation shows of the difference is due to the forms that the library gives them, not
    to physics.
    """
    differ = sorted(frozenset(one) ^ frozenset(other))
    return len(differ) == 2 and same_filter(differ[0], differ[1], tapped)
