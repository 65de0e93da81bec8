"""A virtual board for tests: a plant that needs no compiling, and a served pseudo-terminal."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from spa_fo.virtual_rig.board import BASE_RATE_HZ, VirtualBoard
from spa_fo.virtual_rig.faults import FaultyPlant, parse_faults
from spa_fo.virtual_rig.pty_server import PtyServer


class LagPlant:
    """Pressure lags by 50 ms, the angle (1 deg a kPa) by 100 ms; counts rise with both."""

    def __init__(self, noise_counts: float = 0.5, seed: int = 1) -> None:
        self.now_s = 0.0
        self.rested_s = 0.0
        self.pressure_kpa = self.angle_deg = 0.0
        self.trials = 0
        self._noise = noise_counts
        self._rng = np.random.default_rng(seed)

    def begin_trial(self) -> None:
        self.trials += 1

    def drive(self, command_kpa):
        decay = np.exp(-np.array([1.0 / 0.05, 1.0 / 0.1]) / BASE_RATE_HZ)
        pressures, angles = np.empty(command_kpa.size), np.empty(command_kpa.size)
        for i, command in enumerate(command_kpa.tolist()):
            pressures[i], angles[i] = self.pressure_kpa, self.angle_deg
            self.pressure_kpa = command + (self.pressure_kpa - command) * decay[0]
            self.angle_deg = self.pressure_kpa + (self.angle_deg - self.pressure_kpa) * decay[1]
        self.now_s += command_kpa.size / BASE_RATE_HZ
        volts = 0.5 + 4.0 * pressures / 551.6
        return self._counts(volts / 5.0 * 1023), self.flex(angles)

    def bend(self, angle_deg):
        self.now_s += angle_deg.size / BASE_RATE_HZ
        return self.flex(angle_deg)

    def rest(self, seconds: float) -> None:
        self.now_s += seconds
        self.rested_s += seconds
        self.pressure_kpa = self.angle_deg = 0.0

    def flex(self, angle_deg):
        return self._counts(250.0 + 3.0 * np.asarray(angle_deg))

    def _counts(self, ideal):
        noisy = ideal + self._noise * self._rng.standard_normal(ideal.shape)
        return np.clip(np.rint(noisy), 0, 1023).astype(np.int64)


@dataclass
class Served:
    """A served board, and all it sent."""

    server: PtyServer
    board: VirtualBoard
    plant: LagPlant
    sent: bytearray

    @property
    def port(self) -> str:
        return self.server.port


def make(*faults: str, speed: float = 40.0, seed: int = 1, **options) -> Served:
    """Make a board on a pseudo-terminal; nobody serves it yet."""
    lag = LagPlant(seed=seed)
    plant = FaultyPlant(lag)
    board = VirtualBoard(plant, speed=speed, seed=seed)
    sent = bytearray()
    server = PtyServer(
        board, plant, parse_faults(faults), speed=speed, seed=seed, sent=sent.extend, **options
    )
    return Served(server, board, lag, sent)


@contextmanager
def serving(*faults: str, **options) -> Iterator[Served]:
    """Serve a board from a thread."""
    served = make(*faults, **options)
    stop = threading.Event()
    thread = threading.Thread(target=served.server.serve, args=(stop,), daemon=True)
    thread.start()
    try:
        yield served
    finally:
        stop.set()
        thread.join(5.0)
        served.server.close()


def serve_in_child(speed: float, record: int, reset_on_open: bool = True) -> tuple[int, str]:
    """Serve a board from a child process, its bytes into the file `record`; pid and port."""
    lag = LagPlant()
    plant = FaultyPlant(lag)
    board = VirtualBoard(plant, speed=speed)
    server = PtyServer(
        board,
        plant,
        speed=speed,
        reset_on_open=reset_on_open,
        sent=lambda data: os.write(record, data),
    )
    pid = os.fork()
    if pid == 0:
        try:
            server.serve(threading.Event())
        finally:
            os._exit(0)
    return pid, server.port


def said(body: str) -> bytes:
    """Return a command as it goes over the wire."""
    value = 0
    for byte in body.encode():
        value ^= byte
    return b"%s*%02X\n" % (body.encode(), value)
