"""``spa-fo rig serve``: the virtual board until Ctrl-C."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Sequence
from pathlib import Path

from spa_fo.errors import BadInput
from spa_fo.virtual_rig.actuators import PLANS
from spa_fo.virtual_rig.board import BenchPlant, VirtualBoard
from spa_fo.virtual_rig.faults import Faults, FaultyPlant, parse_faults
from spa_fo.virtual_rig.pty_server import PtyServer, link_to


def serve(
    specimen: str,
    speed: float,
    faults: Sequence[str],
    baud: int,
    limit_kpa: float,
    link: Path | None,
    seed: int,
) -> None:
    """Open a pseudo-terminal, say its name on stdout, and serve it until a signal.

    Raises
    ------
    BadInput
        There is no such specimen, fault or baud rate, or the link cannot be made.
    """
    if specimen not in PLANS:
        raise BadInput("--specimen", f"expected one of {', '.join(PLANS)}, found {specimen!r}")
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    with virtual_rig(specimen, speed, parse_faults(faults), baud, limit_kpa, seed) as server:
        try:
            if link is not None:
                link_to(server.port, link)
            print(link or server.port, flush=True)
            server.serve(stop)
        finally:
            if link is not None:
                with contextlib.suppress(OSError):
                    link.unlink()


def virtual_rig(
    specimen: str = "dragon_skin_20",
    speed: float = 1.0,
    faults: Faults | None = None,
    baud: int = 500_000,
    limit_kpa: float = 100.0,
    seed: int = 1,
) -> PtyServer:
    """Put a specimen on the bench, a board beside it, and a cable into the board."""
    plant = FaultyPlant(BenchPlant(PLANS[specimen].specimen, seed))
    board = VirtualBoard(plant, limit_kpa, speed=speed, seed=seed)
    return PtyServer(board, plant, faults, baud, speed, seed)
