"""The serial line to a board: bytes, commands with their checksum, and the greeting.

`docs/board_protocol.md` is what both ends hold to.
"""

from __future__ import annotations

import os
import select
import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import serial
from serial.tools import list_ports

from spa_fo.errors import BadInput
from spa_fo.rig.wire import Banner, checksum, is_banner, parse_banner

BAUD = 500_000
_READ_S = 0.02
_READ_BYTES = 16  # shorter than any line: a kill between reading and writing loses one at most
_HEARD_BYTES = 8192
_HELLO_AFTER_S = 3.0
_HELLO_EVERY_S = 1.0
_READY_S = 10.0


class PortLost(Exception):
    """The port is gone: unplugged, or switched off."""


@dataclass(frozen=True)
class BoardInfo:
    """What a board says of itself after a reset.

    Attributes
    ----------
    banner : Banner
        Of a trial at its usual rate.
    limit_kpa : float
        Largest command it takes.
    max_rate_hz : float
        Fastest sampling.
    queue : int
        Set-points it can keep waiting.
    speed : float
        Board seconds a second: 1 but for an accelerated virtual board.
    """

    banner: Banner
    limit_kpa: float
    max_rate_hz: float
    queue: int
    speed: float = 1.0


@dataclass(frozen=True)
class Port:
    """A serial port of this computer."""

    path: str
    what: str


def ports() -> list[Port]:
    """List the serial ports that have something plugged in, boards by their USB names."""
    return [
        Port(port.device, port.description if port.description != "n/a" else "")
        for port in sorted(list_ports.comports(), key=lambda port: port.device)
        if port.vid is not None or not port.device.startswith("/dev/ttyS")
    ]


class BoardLink:
    """An open port.

    Parameters
    ----------
    port : str
        Its path, such as ``/dev/ttyACM0``.
    baud : int
        The board's rate.
    hello_after_s : float
        How long to wait for the greeting of a board that resets when the port is opened.

    Raises
    ------
    BadInput
        The port cannot be opened.
    """

    def __init__(self, port: str, baud: int = BAUD, hello_after_s: float = _HELLO_AFTER_S) -> None:
        self.port = port
        self._hello_after_s = hello_after_s
        try:
            self._serial = serial.Serial(port, baud, timeout=0, write_timeout=1.0, exclusive=True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise BadInput(port, _why_not(error)) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the port; a board that still drives is vented by its watchdog."""
        self._serial.close()

    def read(self) -> bytes:
        """Return what has come, at most 16 bytes, or nothing after 20 ms.

        Raises
        ------
        PortLost
            The port is gone.
        """
        try:
            ready, _, _ = select.select([self._serial.fileno()], [], [], _READ_S)
            if not ready:
                return b""
            data = os.read(self._serial.fileno(), _READ_BYTES)
        except BlockingIOError:
            return b""
        except (serial.SerialException, OSError, ValueError) as error:
            raise PortLost(str(error)) from error
        if not data:
            raise PortLost("it is ready but holds nothing")
        return data

    def send(self, *commands: str) -> None:
        """Send commands, each with its checksum.

        Raises
        ------
        PortLost
            The port is gone, or takes nothing for a second.
        """
        lines = [b"%s*%02X\n" % (body, checksum(body)) for body in map(str.encode, commands)]
        try:
            self._serial.write(b"".join(lines))
        except (serial.SerialException, OSError) as error:
            raise PortLost(str(error)) from error

    def wait_ready(self, timeout_s: float = _READY_S) -> BoardInfo:
        """Wait for the banner and the ``# ready`` line of a board that has just been reset.

        Raises
        ------
        BadInput
            They do not come; the text says what came instead.
        """
        begun = time.monotonic()
        hello_at = begun + self._hello_after_s
        heard = b""
        while (now := time.monotonic()) < begun + timeout_s:
            if now >= hello_at:
                self._try("hello")
                hello_at = now + _HELLO_EVERY_S
            try:
                heard += self.read()
            except PortLost as error:
                raise BadInput(
                    self.port, f"was lost while waiting for the board: {error}"
                ) from None
            info = greeting(heard)
            if info is not None:
                return info
            heard = heard[-_HEARD_BYTES:]
        raise BadInput(self.port, f"no board within {timeout_s:g} s: {_silence(heard)}")

    def _try(self, command: str) -> None:
        try:
            self.send(command)
        except PortLost as error:
            raise BadInput(self.port, f"was lost while waiting for the board: {error}") from None


def greeting(heard: bytes) -> BoardInfo | None:
    """Find the last whole greeting in what was heard: a banner, and ``# ready`` behind it."""
    lines = [line.removesuffix(b"\r") for line in heard.split(b"\n")[:-1]]
    banner: Banner | None = None
    info: BoardInfo | None = None
    for line in lines:
        if is_banner(line):
            try:
                banner = parse_banner(line)
            except ValueError:
                banner = None
        elif banner is not None and line.startswith(b"# ready"):
            info = _info(banner, settings(line)) or info
    return info


def settings(comment: bytes) -> dict[str, str]:
    """Read the ``key=value`` words of a comment."""
    words = comment.decode("ascii", errors="replace").split()
    return dict(word.split("=", 1) for word in words if "=" in word)


def _info(banner: Banner, said: Mapping[str, str]) -> BoardInfo | None:
    try:
        info = BoardInfo(
            banner,
            float(said["limit_kpa"]),
            float(said["max_rate_hz"]),
            int(said["queue"]),
            float(said.get("speed", "1")),
        )
    except (KeyError, ValueError):
        return None
    return info if info.limit_kpa > 0.0 and info.queue > 0 and info.speed > 0.0 else None


def _silence(heard: bytes) -> str:
    """Say in words what came instead of a greeting."""
    if not heard:
        return (
            "nothing came; expected a banner after the reset (is it the right port, is the sketch "
            "of firmware/ on the board, does the cable carry data?)"
        )
    strange = sum(byte > 126 or (byte < 32 and byte not in b"\r\n\t") for byte in heard)
    if strange > 0.1 * len(heard):
        return (
            f"{len(heard)} bytes came, but they are no text; expected a banner (another baud "
            "rate? see --baud)"
        )
    return "text came, but no banner with '# ready'; expected the sketch of firmware/ on the board"


def _why_not(error: Exception) -> str:
    text = str(getattr(error, "strerror", None) or error)
    if "Permission" in text or "Permission" in str(error):
        return "cannot be opened: permission denied; expected a member of the group dialout"
    if "exclusively lock" in str(error):
        return "cannot be opened: another program has it open"
    if "No such file" in str(error):
        return "is not there; expected a serial port (spa-fo ports lists them)"
    return f"cannot be opened: {text}"
