"""A board with no board on the table: the host's protocol answered sample by sample.

`docs/board_protocol.md` says what it is to do. There is no port and no clock here: bytes go in,
time goes by in samples, bytes come out. `pty_server` gives it both.
"""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass
from functools import reduce
from operator import xor
from typing import Literal, Protocol

import numpy as np

from spa_fo.virtual_rig.arrays import Array
from spa_fo.virtual_rig.bench import Bench, Specimen
from spa_fo.virtual_rig.clock import WRAP, BoardClock
from spa_fo.virtual_rig.converter import Counts
from spa_fo.virtual_rig.wire import CALIBRATION_COLUMNS, TRIAL_COLUMNS, banner, data_line

BASE_RATE_HZ = 1000
"""The bench's rate; a board samples at a whole fraction of it."""
RATE_HZ = 50
WATCHDOG_S = 0.5

_QUEUE = 32  # set-points that may wait
_LINE_BYTES = 40
_COMMENT_BYTES = 80
_OVER = 1.2  # times the limit: a measured pressure that trips the board
_OVER_SAMPLES = 3
_DECIMAL = re.compile(r"\d{1,6}(\.\d{1,2})?")
_ANGLE = re.compile(r"-?\d{1,3}(\.\d)?")
_WHOLE = re.compile(r"\d{1,9}")

State = Literal["idle", "trial", "calibration"]


class Plant(Protocol):
    """What the board's converters see; a sample is 1/`BASE_RATE_HZ` long."""

    @property
    def now_s(self) -> float:
        """Time now, s."""

    def begin_trial(self) -> None:
        """Draw what makes no two trials alike."""

    def drive(self, command_kpa: Array) -> tuple[Counts, Counts]:
        """Run one sample for each command; pressure and flex counts before each took effect."""

    def bend(self, angle_deg: Array) -> Counts:
        """Hold the sensor in the fixture, one angle a sample; flex counts."""

    def rest(self, seconds: float) -> None:
        """Let the vented actuator lie."""


class BenchPlant:
    """The simulated specimen on the bench."""

    def __init__(self, specimen: Specimen, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._bench = Bench(specimen, BASE_RATE_HZ, 0.0)

    @property
    def now_s(self) -> float:
        """Time now, s."""
        return self._bench.now_s

    def begin_trial(self) -> None:
        """Draw this trial's gain, rest offset, rate factor and slip."""
        self._bench.begin_trial(self._rng)

    def drive(self, command_kpa: Array) -> tuple[Counts, Counts]:
        """Run one sample for each command; pressure and flex counts before each took effect."""
        _, pressure, flex = self._bench.drive(command_kpa, self._rng)
        return pressure, flex

    def bend(self, angle_deg: Array) -> Counts:
        """Hold the sensor in the fixture, one angle a sample; flex counts."""
        return self._bench.hold_in_fixture(angle_deg, self._rng)[1]

    def rest(self, seconds: float) -> None:
        """Let the vented actuator lie."""
        self._bench.rest(self._bench.now_s + seconds)


def pressure_counts(pressure_kpa: float) -> int:
    """Convert by the usual sensor (0.5 to 4.5 V for 0 to 551.6 kPa, 10 bits over 5 V)."""
    return round((0.5 + 4.0 * pressure_kpa / 551.6) / 5.0 * 1023)


@dataclass(frozen=True)
class Setpoint:
    """A command that waits for its sample."""

    seq: int
    command_kpa: float


class VirtualBoard:
    """The board's program.

    Parameters
    ----------
    plant : Plant
        What it drives and reads.
    limit_kpa : float
        Set-points above are refused, measured pressures above 1.2 times that trip it.
    clock : BoardClock, optional
        Its crystal.
    line_end : bytes
        LF or CRLF.
    speed : float
        How fast its time goes, for the host to know; 1 in real time.
    seed : int
        Of the lateness of its interrupt.
    """

    def __init__(
        self,
        plant: Plant,
        limit_kpa: float = 100.0,
        clock: BoardClock | None = None,
        line_end: bytes = b"\r\n",
        speed: float = 1.0,
        seed: int = 1,
    ) -> None:
        self._plant = plant
        self._limit_kpa = limit_kpa
        self._over_counts = pressure_counts(_OVER * limit_kpa)
        self._line_end = line_end
        self._speed = speed
        self._rng = np.random.default_rng(seed)
        self._clock = clock or BoardClock(plant.now_s)
        self._heard = b""
        self.runs = 0
        """Trials and calibrations begun since it was made."""
        self.heard = 0
        """Whole, undamaged lines of the host."""
        self._state: State = "idle"
        self._rate_hz = RATE_HZ
        self._seq = 0
        self._queue: deque[Setpoint] = deque()
        self._command_kpa = 0.0
        self._angle_deg: float | None = None
        self._tripped = False
        self._over = 0

    # --- what the server asks ------------------------------------------------------------------

    @property
    def state(self) -> State:
        """What it is doing."""
        return self._state

    @property
    def seq(self) -> int:
        """Number of the next sample."""
        return self._seq

    @property
    def rate_hz(self) -> int:
        """Sampling rate."""
        return self._rate_hz

    @property
    def sampling(self) -> bool:
        """Whether time goes by in samples."""
        return self._state == "trial" or (
            self._state == "calibration" and self._angle_deg is not None
        )

    def reset(self) -> bytes:
        """Press the button: returns what it says once it is up again."""
        self._clock = self._clock.reset_at(self._plant.now_s)
        self._heard = b""
        self._become_idle()
        return self._greeting()

    def wrap_in(self, seconds: float) -> None:
        """Set the clock so that micros() wraps `seconds` from now."""
        error = 1.0 + self._clock.error_ppm * 1e-6
        powered_s = self._plant.now_s + seconds - WRAP * 1e-6 / error
        self._clock = BoardClock(powered_s, self._clock.error_ppm, self._clock.jitter_us)

    def rest(self, seconds: float) -> None:
        """Let time go by while it does not sample."""
        self._plant.rest(seconds)

    def receive(self, data: bytes) -> bytes:
        """Hear bytes of the host; returns the answers."""
        *lines, self._heard = (self._heard + data).split(b"\n")
        answers = [self._obey(line.removesuffix(b"\r")) for line in lines]
        # The board has no room for an endless line: what is too long is kept as too long.
        self._heard = self._heard[: _LINE_BYTES + 2]
        return b"".join(answers)

    def silence(self, seconds: float) -> bytes:
        """Say how long the host has been silent; the watchdog's comment, if it trips."""
        waiting = self._command_kpa != 0.0 or bool(self._queue)
        if self._state == "trial" and waiting and seconds > WATCHDOG_S:
            return self._trip("watchdog")
        return b""

    def advance(self, samples: int) -> bytes:
        """Let `samples` sample periods go by; returns the lines."""
        if not self.sampling:
            return b""
        if self._state == "calibration":
            return self._calibrate(samples)
        out = []
        while samples > 0:
            command = self._due()
            stretch = samples
            if self._queue:
                stretch = min(samples, self._queue[0].seq - self._seq)
            out.append(self._drive(command, stretch))
            samples -= stretch
        return b"".join(out)

    # --- commands ------------------------------------------------------------------------------

    def _obey(self, line: bytes) -> bytes:
        if line == b"vent":
            return self._vent()
        body, star, digits = line.rpartition(b"*")
        if len(line) > _LINE_BYTES or not star or digits != b"%02X" % reduce(xor, body, 0):
            return self._comment("damaged command")
        self.heard += 1
        words = body.decode("ascii", errors="replace").split(" ")
        why = self._command(words[0], words[1:])
        if isinstance(why, str):
            return self._comment(f"refused {why}: {' '.join(words)}")
        return why

    def _command(self, word: str, arguments: list[str]) -> bytes | str:
        """Obey, and return the answer; or return why not."""
        match word, arguments:
            case "ping", []:
                return b""
            case "vent", []:
                return self._vent()
            case "hello", []:
                self._become_idle()
                return self._greeting()
            case "stop", []:
                samples = self._seq
                self._become_idle()
                return self._comment(f"stopped samples={samples}")
            case (("run" | "cal"), [] | [_]):
                return self._begin("trial" if word == "run" else "calibration", arguments)
            case "set", [_] | [_, _]:
                return self._set(*arguments)
            case "angle", [degrees]:
                return self._bend(degrees)
            case "pause", []:
                if self._state != "calibration":
                    return "state"
                self._angle_deg = None
                return b""
            case (
                ("ping" | "vent" | "hello" | "stop" | "run" | "cal" | "set" | "angle" | "pause"),
                _,
            ):
                return "argument"
        return "unknown"

    def _begin(self, state: State, arguments: list[str]) -> bytes | str:
        if self._state != "idle":
            return "state"
        rate = arguments[0] if arguments else str(RATE_HZ)
        if not _WHOLE.fullmatch(rate) or int(rate) == 0 or BASE_RATE_HZ % int(rate):
            return "argument"
        self._become_idle()
        self._state, self._rate_hz = state, int(rate)
        self.runs += 1
        if state == "trial":
            self._plant.begin_trial()
        columns = TRIAL_COLUMNS if state == "trial" else CALIBRATION_COLUMNS
        return self._banner(columns, self._rate_hz)

    def _set(self, kpa: str, seq: str | None = None) -> bytes | str:
        if self._state != "trial" or self._tripped:
            return "state"
        if not _DECIMAL.fullmatch(kpa) or (seq is not None and not _WHOLE.fullmatch(seq)):
            return "argument"
        if float(kpa) > self._limit_kpa:
            return "limit"
        if seq is None:
            self._queue.clear()
        elif self._queue and int(seq) < self._queue[-1].seq:
            return "argument"
        elif len(self._queue) == _QUEUE:
            return "full"
        self._queue.append(Setpoint(int(seq or 0), float(kpa)))
        return b""

    def _bend(self, degrees: str) -> bytes | str:
        if self._state != "calibration":
            return "state"
        if not _ANGLE.fullmatch(degrees) or abs(float(degrees)) > 360.0:
            return "argument"
        self._angle_deg = float(degrees)
        return b""

    def _vent(self) -> bytes:
        self._command_kpa = 0.0
        self._queue.clear()
        return b""

    def _trip(self, why: str) -> bytes:
        self._vent()
        self._tripped = True
        return self._comment(f"trip {why}")

    def _become_idle(self) -> None:
        self._vent()
        self._state, self._rate_hz, self._seq = "idle", RATE_HZ, 0
        self._angle_deg = None
        self._tripped, self._over = False, 0

    # --- samples -------------------------------------------------------------------------------

    def _due(self) -> float:
        """Take the set-points whose sample has come; returns the command."""
        while self._queue and self._queue[0].seq <= self._seq:
            self._command_kpa = self._queue.popleft().command_kpa
        return self._command_kpa

    def _drive(self, command_kpa: float, samples: int) -> bytes:
        stamps = self._stamps(samples)
        every = BASE_RATE_HZ // self._rate_hz
        pressure, flex = self._plant.drive(np.full(samples * every, command_kpa))
        pressure, flex = pressure[::every], flex[::every]
        said = f"{command_kpa:.2f}"
        rows = [
            self._row(seq, stamp, said, p, angle)
            for seq, (stamp, p, angle) in enumerate(
                zip(stamps, pressure.tolist(), flex.tolist(), strict=True), start=self._seq
            )
        ]
        self._seq += samples
        for count in pressure.tolist():
            self._over = self._over + 1 if count > self._over_counts else 0
        if self._over >= _OVER_SAMPLES and not self._tripped:
            rows.append(self._trip("pressure"))
        return b"".join(rows)

    def _calibrate(self, samples: int) -> bytes:
        assert self._angle_deg is not None
        stamps = self._stamps(samples)
        every = BASE_RATE_HZ // self._rate_hz
        flex = self._plant.bend(np.full(samples * every, self._angle_deg))[::every]
        said = f"{self._angle_deg:.1f}"
        rows = [
            self._row(seq, stamp, said, count)
            for seq, (stamp, count) in enumerate(
                zip(stamps, flex.tolist(), strict=True), start=self._seq
            )
        ]
        self._seq += samples
        return b"".join(rows)

    def _stamps(self, samples: int) -> list[int]:
        times = self._plant.now_s + np.arange(samples) / self._rate_hz
        stamps: list[int] = self._clock.micros(times, self._rng).tolist()
        return stamps

    # --- lines ---------------------------------------------------------------------------------

    def _row(self, *values: object) -> bytes:
        return data_line(*values) + self._line_end

    def _banner(self, columns: str, rate_hz: int) -> bytes:
        return banner(columns, rate_hz, "virtual") + self._line_end

    def _greeting(self) -> bytes:
        ready = (
            f"ready limit_kpa={self._limit_kpa:g} watchdog_ms={WATCHDOG_S * 1000:.0f} "
            f"max_rate_hz={BASE_RATE_HZ} queue={_QUEUE}"
        )
        if self._speed != 1.0:
            ready += f" speed={self._speed:g}"
        return self._banner(TRIAL_COLUMNS, RATE_HZ) + self._comment(ready)

    def _comment(self, text: str) -> bytes:
        printable = "".join(c if " " <= c <= "~" else "?" for c in text)
        return f"# {printable}".encode("ascii")[:_COMMENT_BYTES] + self._line_end
