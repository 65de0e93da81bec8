"""Faults of a board and its cable, to order."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from spa_fo.errors import BadInput
from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.board import Plant
from spa_fo.virtual_rig.converter import Counts

SHARES = ("flipped", "cut", "doubled", "glued", "lost")
"""Damage to a share of the data lines, each by its own chance."""
EVENTS = (
    "stall",
    "reset",
    "unplug",
    "wrap",
    "pressure-stuck",
    "pressure-railed",
    "flex-stuck",
    "flex-railed",
)
"""What happens at a time."""

Channel = Literal["pressure", "flex"]
_FULL = 1023
_STALL_S = 1.0

_SHARE = re.compile(r"(?P<kind>[a-z]+)=(?P<share>0?\.\d+|[01])")
_NUMBER = r"\d+(?:\.\d+)?"
_EVENT = re.compile(
    rf"(?P<kind>[a-z-]+)@(?P<at>{_NUMBER})(?:\+(?P<lasts>{_NUMBER}))?(?:#(?P<run>\d+))?"
)


@dataclass(frozen=True)
class Event:
    """Something that happens once a run.

    Parameters
    ----------
    kind : str
        One of `EVENTS`.
    at_s : float
        Seconds from the run's first sample, by the board's clock.
    lasts_s : float
        How long a stall lasts, s.
    run : int or None
        The run it happens in, 1-based, calibrations counted; None for each.
    """

    kind: str
    at_s: float
    lasts_s: float = _STALL_S
    run: int | None = None


@dataclass(frozen=True)
class Faults:
    """Shares of damaged lines by kind, and events."""

    shares: tuple[tuple[str, float], ...] = ()
    events: tuple[Event, ...] = ()

    def due(self, run: int, before_s: float, now_s: float) -> list[Event]:
        """List what happens in a run after `before_s` and up to `now_s`."""
        return [
            event
            for event in self.events
            if event.run in (None, run) and before_s < event.at_s <= now_s
        ]

    def damaged(self, line: bytes, rng: np.random.Generator) -> bytes:
        """Pass one data line, with its end, over the cable."""
        for kind, share in self.shares:
            if rng.random() < share:
                return _damage(kind, line, rng)
        return line


def parse_faults(orders: Sequence[str]) -> Faults:
    """Read orders such as ``cut=0.01``, ``reset@5``, ``stall@3+2`` and ``unplug@4#2``.

    Parameters
    ----------
    orders : sequence of str
        ``KIND=SHARE`` of the data lines, or ``KIND@SECONDS`` of each run, with ``+SECONDS`` for
        how long a stall lasts and ``#N`` for the N-th run only.

    Raises
    ------
    BadInput
        An order is neither.
    """
    shares, events = [], []
    for order in orders:
        share, event = _SHARE.fullmatch(order), _EVENT.fullmatch(order)
        if share and share["kind"] in SHARES:
            shares.append((share["kind"], float(share["share"])))
        elif event and event["kind"] in EVENTS:
            events.append(
                Event(
                    event["kind"],
                    float(event["at"]),
                    float(event["lasts"] or _STALL_S),
                    int(event["run"]) if event["run"] else None,
                )
            )
        else:
            raise BadInput(
                "--fault",
                f"expected KIND=SHARE ({', '.join(SHARES)}) or KIND@SECONDS ({', '.join(EVENTS)}), "
                f"found {order!r}",
            )
    return Faults(tuple(shares), tuple(events))


def garbled(data: bytes, rng: np.random.Generator) -> bytes:
    """Give what arrives where the two ends do not agree on the baud rate."""
    return rng.integers(0, 256, size=len(data), dtype=np.uint8).tobytes()


def _damage(kind: str, line: bytes, rng: np.random.Generator) -> bytes:
    body = line.rstrip(b"\r\n")
    end = line[len(body) :]
    at = int(rng.integers(len(body)))
    match kind:
        case "flipped":
            flipped = body[at] ^ (1 << int(rng.integers(8)))
            return body[:at] + bytes([flipped]) + body[at + 1 :] + end
        case "cut":
            return body[: max(at, 1)] + end
        case "doubled":
            return body[: at + 1] + body[at:] + end
        case "glued":
            return body
    return b""


class FaultyPlant:
    """A plant whose channels may stop telling the truth."""

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self._constant: dict[str, int | None] = {}

    def stick(self, channel: Channel) -> None:
        """Let a channel repeat its next reading for good."""
        self._constant[channel] = None

    def rail(self, channel: Channel) -> None:
        """Let a channel read full scale for good: its ground wire is off."""
        self._constant[channel] = _FULL

    def mend(self) -> None:
        """Let all channels tell the truth again."""
        self._constant.clear()

    @property
    def now_s(self) -> float:
        """Time now, s."""
        return self._plant.now_s

    def begin_trial(self) -> None:
        """Draw what makes no two trials alike."""
        self._plant.begin_trial()

    def drive(self, command_kpa: Array) -> tuple[Counts, Counts]:
        """Run one sample for each command; what is read of pressure and flex."""
        pressure, flex = self._plant.drive(command_kpa)
        return self._read("pressure", pressure), self._read("flex", flex)

    def bend(self, angle_deg: Array) -> Counts:
        """Hold the sensor in the fixture; what is read of flex."""
        return self._read("flex", self._plant.bend(angle_deg))

    def rest(self, seconds: float) -> None:
        """Let the vented actuator lie."""
        self._plant.rest(seconds)

    def _read(self, channel: Channel, counts: Counts) -> Counts:
        if channel not in self._constant:
            return counts
        held = self._constant[channel]
        if held is None:
            held = self._constant[channel] = int(counts[0])
        return np.full_like(counts, held)
