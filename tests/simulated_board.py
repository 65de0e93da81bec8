"""The firmware on a simulated ATmega2560: built once, run by scripts, or on a pseudo-terminal."""

from __future__ import annotations

import atexit
import functools
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

FIRMWARE = Path(__file__).resolve().parent.parent / "firmware"


@dataclass(frozen=True)
class Built:
    """The program for the board, and the board."""

    elf: Path
    simboard: Path

    def address(self, symbol: str) -> str:
        """Where a variable lies in the board's memory."""
        table = _output(["avr-nm", str(self.elf)])
        return next(line.split()[0] for line in table.splitlines() if line.endswith(f" {symbol}"))


@dataclass(frozen=True)
class Run:
    """What the board sent, and (ms, set-point, valve) at every change of its pins."""

    sent: bytes
    pins: tuple[tuple[int, int, int], ...]

    @property
    def lines(self) -> list[str]:
        """All lines but a last one without end."""
        return self.sent.decode("ascii").split("\n")[:-1]

    @property
    def comments(self) -> list[str]:
        """Lines that are no data, without the greeting."""
        return [line for line in self.lines if line.startswith("#")][2:]

    @property
    def rows(self) -> list[list[str]]:
        """Columns of the data lines, checksums cut off."""
        return [line.split("*")[0].split(",") for line in self.lines if not line.startswith("#")]

    def log(self, which: int = 0) -> bytes:
        """Everything from the banner of the `which`-th trial or calibration on."""
        parts = self.sent.split(b"# spa-rig ")
        return b"# spa-rig " + parts[2 + which]


def why_not() -> str:
    """Say what is missing to build and run the firmware; empty if nothing is."""
    for tool, package in (("avr-gcc", "gcc-avr"), ("avr-nm", "binutils-avr"), ("make", "make")):
        if shutil.which(tool) is None:
            return f"needs {tool} (Debian: {package})"
    probes = (
        (["avr-gcc", "-mmcu=atmega2560"], "avr/io.h", "avr-libc"),
        (["cc"], "simavr/sim_avr.h", "libsimavr-dev"),
        (["cc"], "libelf.h", "libelf-dev"),
    )
    for compiler, header, package in probes:
        command = [*compiler, "-E", "-include", header, "-x", "c", "/dev/null"]
        if (
            shutil.which(command[0]) is None
            or subprocess.run(command, capture_output=True).returncode
        ):
            return f"needs {header} (Debian: {package})"
    return ""


@functools.cache
def build(defines: str = "") -> Built:
    """Build the firmware and the simulated board into a folder of their own."""
    folder = Path(tempfile.mkdtemp(prefix="spa-fo-firmware-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    _output(["make", "-C", str(FIRMWARE), f"BUILD={folder}", f"DEFINES={defines}", "all", "sim"])
    return Built(folder / "firmware.elf", folder / "simboard")


def command(text: str) -> bytes:
    """Return a command as it goes over the wire."""
    value = 0
    for byte in text.encode():
        value ^= byte
    return f"{text}*{value:02X}\n".encode()


Event = str | bytes | float | tuple[str, ...]


def play(
    events: Sequence[tuple[int, Event]],
    end_ms: int,
    options: Sequence[str] = (),
    defines: str = "",
) -> Run:
    """Run the board through a script.

    Parameters
    ----------
    events : sequence of (int, str or bytes or float or tuple)
        By time (ms): a command, bytes as they are, a pressure (kPa) that the sensor sees from then
        on, whatever is commanded, or the words of a line of the script.
    end_ms : int
        When to stop.
    options : sequence of str
        More options of `simboard`.
    defines : str
        What the firmware is built with, such as ``-DBAUD=125000UL``.
    """
    built = build(defines)
    with tempfile.TemporaryDirectory(prefix="spa-fo-script-") as folder:
        script, pins = Path(folder) / "script", Path(folder) / "pins"
        lines = [f"{ms} {_event(event)}" for ms, event in sorted(events, key=lambda item: item[0])]
        script.write_text("\n".join([*lines, f"{end_ms} end"]) + "\n")
        done = subprocess.run(
            [built.simboard, built.elf, "--script", script, "--pins", pins, *options],
            capture_output=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, done.stderr.decode()
        changes = [tuple(map(int, line.split(","))) for line in pins.read_text().splitlines()]
    return Run(done.stdout, tuple((ms, duty, valve) for ms, duty, valve in changes))


def _event(event: Event) -> str:
    if isinstance(event, tuple):
        return " ".join(event)
    if isinstance(event, float):
        return f"over {event}"
    data = command(event) if isinstance(event, str) else event
    return f"send {data.hex()}"


def _output(arguments: list[str]) -> str:
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
