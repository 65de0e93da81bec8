"""The virtual board on a pseudo-terminal: what a recorder opens instead of /dev/ttyACM0."""

from __future__ import annotations

import errno
import fcntl
import os
import select
import struct
import termios
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path

import numpy as np

from spa_fo.errors import BadInput
from spa_fo.virtual_rig.board import VirtualBoard
from spa_fo.virtual_rig.faults import Event, Faults, FaultyPlant, garbled

BAUD = 500_000
_BOOT_S = 0.1  # a bootloader takes longer; the host must have emptied its buffer by then
_TX_BYTES = 4096  # lines that the host does not take are lost beyond this
_IDLE_S = 0.05  # how often it looks whether somebody opened the port
_AHEAD = 3  # samples at a time, when the board's time is faster than the wall's
_FINEST_S = 0.002


class PtyServer:
    """Connects a virtual board with a pseudo-terminal, in real or accelerated time.

    Opening the port resets the board, as on a MEGA. Accelerated, the board's time stands still
    while the host has not read what was sent, so that a slow host sees the same board.

    Parameters
    ----------
    board : VirtualBoard
        The board; made with the same `speed`.
    plant : FaultyPlant
        What it reads.
    faults : Faults
        Ordered faults.
    baud : int
        The board's; a host at another one hears noise.
    speed : float
        Board seconds a second.
    seed : int
        Of the faults.
    reset_on_open : bool
        Whether opening the port resets the board.
    sent : callable, optional
        Told every byte that goes over the wire.
    """

    def __init__(
        self,
        board: VirtualBoard,
        plant: FaultyPlant,
        faults: Faults | None = None,
        baud: int = BAUD,
        speed: float = 1.0,
        seed: int = 1,
        reset_on_open: bool = True,
        sent: Callable[[bytes], object] | None = None,
    ) -> None:
        speed_constant = getattr(termios, f"B{baud}", None)
        if speed_constant is None:
            raise BadInput("--baud", f"expected a standard rate, such as {BAUD}, found {baud}")
        self._board, self._plant, self._faults = board, plant, faults or Faults()
        self._baud, self._speed = speed_constant, speed
        self._rng = np.random.default_rng(seed)
        self._reset_on_open = reset_on_open
        self._sent = sent
        self._tx = bytearray()
        self._open = False
        self._unplugged = False
        self._up_at = self._last = self._heard_at = self._stalled_until = time.monotonic()
        self._heard = 0
        self._ran_s = 0.0
        self._run = 0
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        """The path to open."""
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)

    def close(self) -> None:
        """Pull the cable."""
        if not self._unplugged:
            self._unplugged = True
            os.close(self._master)

    def __enter__(self) -> PtyServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def serve(self, stop: threading.Event) -> None:
        """Serve until `stop` is set or the cable is pulled."""
        while not stop.is_set() and not self._unplugged:
            self.turn()

    def turn(self) -> None:
        """Wait a moment, hear the host, let the time that went by go by, and send."""
        self._notice_host()
        now = time.monotonic()
        if now < self._up_at:
            return
        data = self._read() if self._open else b""
        if not self._board.sampling:
            self._rest(now)
        if data:
            self._say(self._board.receive(data))
        if self._board.heard != self._heard:
            self._heard, self._heard_at = self._board.heard, now
        self._say(self._board.silence(now - self._heard_at))
        if self._board.sampling:
            self._sample(now)
        self._write(now)

    # --- time ----------------------------------------------------------------------------------

    def _rest(self, now: float) -> None:
        self._board.rest((now - self._last) * self._speed)
        self._last = now

    def _sample(self, now: float) -> None:
        rate = self._board.rate_hz
        samples = int((now - self._last) * self._speed * rate)
        if samples == 0:
            return
        if self._speed == 1.0:
            self._last += samples / rate
        else:
            self._last = now
            samples = 0 if self._tx or self._unread() else min(samples, _AHEAD)
        for _ in range(samples):
            if not self._board.sampling or self._unplugged:
                break
            self._damage(self._board.advance(1))
            self._happen(1.0 / rate)

    def _happen(self, seconds: float) -> None:
        """Let the events of one sample period happen."""
        before = self._ran_s
        if self._run != self._board.runs:
            self._run, self._ran_s, before = self._board.runs, 0.0, -1.0
            self._plant.mend()
        self._ran_s += seconds
        for event in self._faults.due(self._run, before, self._ran_s):
            self._strike(event)

    def _strike(self, event: Event) -> None:
        match event.kind:
            case "stall":
                self._stalled_until = time.monotonic() + event.lasts_s / self._speed
            case "reset":
                self._reset()
            case "unplug":
                self._write(time.monotonic())
                self.close()
            case "wrap":
                self._board.wrap_in(0.0)
            case "pressure-stuck":
                self._plant.stick("pressure")
            case "pressure-railed":
                self._plant.rail("pressure")
            case "flex-stuck":
                self._plant.stick("flex")
            case "flex-railed":
                self._plant.rail("flex")

    # --- the wire ------------------------------------------------------------------------------

    def _notice_host(self) -> None:
        """Wait for the host or the next sample; see whether somebody opened or closed the port."""
        wait_s = _IDLE_S
        if self._board.sampling:
            wait_s = max(_FINEST_S, 0.5 / (self._board.rate_hz * self._speed))
        if self._speed != 1.0 and self._board.sampling:
            wait_s = 0.0005
        events = self._poll.poll(wait_s * 1000.0)
        hung_up = any(event & select.POLLHUP for _, event in events)
        if hung_up:
            if self._open:
                self._open = False
                self._tx.clear()
            time.sleep(min(wait_s, 0.01))
        elif not self._open:
            self._open = True
            if self._reset_on_open:
                self._reset()

    def _reset(self) -> None:
        self._tx.clear()
        self._up_at = self._last = time.monotonic() + _BOOT_S
        self._say(self._board.reset())

    def _read(self) -> bytes:
        try:
            data = os.read(self._master, 4096)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EIO):
                return b""
            raise
        return data if self._same_baud() else garbled(data, self._rng)

    def _same_baud(self) -> bool:
        return bool(termios.tcgetattr(self._master)[4] == self._baud)

    def _damage(self, lines: bytes) -> None:
        """Queue data lines, some of them damaged; whole ones are lost where there is no room."""
        if not self._open:
            return
        for line in lines.splitlines(keepends=True):
            if len(self._tx) + len(line) > _TX_BYTES:
                self._write(time.monotonic())
            if len(self._tx) + len(line) <= _TX_BYTES:
                comment = line.startswith(b"# ")
                self._tx += line if comment else self._faults.damaged(line, self._rng)

    def _say(self, comments: bytes) -> None:
        if self._open:
            self._tx += comments

    def _write(self, now: float) -> None:
        if not self._tx or not self._open or self._unplugged or now < self._stalled_until:
            return
        data = bytes(self._tx) if self._same_baud() else garbled(bytes(self._tx), self._rng)
        try:
            count = os.write(self._master, data)
        except BlockingIOError:
            return
        except OSError:
            count = len(data)  # the host is gone
        if self._sent:
            self._sent(data[:count])
        del self._tx[:count]

    def _unread(self) -> int:
        """Bytes that the host has not read yet."""
        try:
            slave = os.open(self.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError:
            return 0
        try:
            count = fcntl.ioctl(slave, termios.FIONREAD, struct.pack("i", 0))
            return int(struct.unpack("i", count)[0])
        finally:
            os.close(slave)


def link_to(port: str, link: Path) -> None:
    """Make `link` a name of the port that stays the same.

    Raises
    ------
    BadInput
        Something that is no symbolic link has this name.
    """
    if link.exists() and not link.is_symlink():
        raise BadInput(link, "is a file; expected a new name, or a link to replace")
    try:
        link.unlink(missing_ok=True)
        link.symlink_to(port)
    except OSError as error:
        raise BadInput(link, f"cannot be made: {error.strerror}") from error
