"""Drive a board through a trial or a calibration and write every byte as it comes.

Time is counted in the board's samples: each set-point is sent ahead with the number of the sample
it belongs to, so that a step falls on the same sample in every trial, however late the host is.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol

from spa_fo.rig.board_link import BoardInfo, PortLost, settings
from spa_fo.rig.command_profile import CommandProfile
from spa_fo.rig.live_stream import LiveStream, Progress, Remark, Row
from spa_fo.rig.set_points import Pacer, decimal
from spa_fo.rig.wire import Banner, is_banner, parse_banner

LOOKAHEAD_S = 0.3  # of board time that set-points are sent ahead
_PING_S = 0.1
_SILENCE_S = 3.0  # without progress: the board is stuck
_STOP_S = 2.0
_QUIET = (0.05, 3.0)  # s, and samples more, without a row: the pause has been heard
_AGAIN_S = 0.5  # a command whose effect is not seen is sent again
_DISOBEDIENT_S = 0.1  # a command that differs from the profile for so long is sent again
_REPAIRS = 5

Stop = Callable[[], str | None]
"""Asked all the time: why to end the trial now, or None to go on."""
Sink = Callable[[bytes], object]
"""Where the bytes go."""


class Link(Protocol):
    """What the recorder needs of `BoardLink`."""

    def read(self) -> bytes:
        """Return what has come; nothing after a moment."""

    def send(self, *commands: str) -> None:
        """Send commands."""


@dataclass
class Outcome:
    """How a recording ended.

    Attributes
    ----------
    aborted : str or None
        Why it is not complete; None where it is.
    rows, damaged : int
        Valid data lines and damaged lines that came.
    taken : int or None
        Samples that the board says it took; None where it said nothing.
    notes : list of str
        What else happened.
    """

    aborted: str | None = None
    rows: int = 0
    damaged: int = 0
    taken: int | None = None
    notes: list[str] = field(default_factory=list)

    @property
    def lost(self) -> int | None:
        """Samples taken that are no valid row, where the board said how many it took."""
        return None if self.taken is None else self.taken - self.rows


class _Recording:
    """One run of the board: the bytes into the sink, the account, and the ways out."""

    def __init__(
        self, link: Link, sink: Sink, rate_hz: float, stop: Stop, speed: float = 1.0
    ) -> None:
        self._link, self._sink, self._stop = link, sink, stop
        self.period_s = 1.0 / rate_hz / speed
        self._ping_at = 0.0
        self._moved_at = time.monotonic()
        self._stream: LiveStream | None = None
        self._before = b""
        self._stopped = self._reset = False
        self.progress = Progress()
        self.outcome = Outcome()
        self._silence_s = _SILENCE_S + 2.0 * self.period_s

    def begin(self, command: str) -> None:
        """Start sampling and wait for the banner; it is the first line of the log."""
        self.send(command)
        begun = said = time.monotonic()
        while self._stream is None and self.outcome.aborted is None:
            self._hear(self._link.read())
            now = time.monotonic()
            if now - begun > self._silence_s:
                self.abort(f"the board did not answer '{command}'")
            elif now - said > _AGAIN_S:
                self.send("stop", command)  # one of the lines was damaged, its or ours
                said = now
            why = self._stop()
            if why is not None:
                self.abort(why)
        self.moved()

    def moved(self) -> None:
        """Note that the board got on."""
        self._moved_at = time.monotonic()

    def send(self, *commands: str) -> None:
        """Send commands; they also keep the board awake."""
        if commands:
            self._link.send(*commands)
            self._ping_at = time.monotonic() + _PING_S

    def turn(self) -> list[Row]:
        """Hear what has come, keep the board awake, notice what ends the recording."""
        rows = self._hear(self._link.read())
        now = time.monotonic()
        if now >= self._ping_at:
            self.send("ping")
        if now - self._moved_at > self._silence_s:
            self.abort(f"no new samples for {_SILENCE_S:g} s")
        why = self._stop()
        if why is not None:
            self.abort(why)
        return rows

    def abort(self, why: str) -> None:
        """End the recording; the first reason counts."""
        self.outcome.aborted = self.outcome.aborted or why

    def finish(self) -> Outcome:
        """Vent, stop, and read on until the board has said that it stopped."""
        until = time.monotonic() + _STOP_S
        again = 0.0
        try:
            while not self._stopped and (now := time.monotonic()) < until:
                if now >= again:
                    self.send(*(["vent"] if self.outcome.aborted else []), "stop")
                    again = now + _AGAIN_S
                self._hear(self._link.read())
        except PortLost as error:
            self.abort(f"the port was lost ({error})")
        if self._stream is not None:
            self.outcome.rows, self.outcome.damaged = self._stream.rows, self._stream.damaged
        if not self._stopped and self.outcome.aborted is None:
            self.outcome.notes.append("the board did not confirm that it stopped")
        return self.outcome

    def _hear(self, data: bytes) -> list[Row]:
        if self._stream is None:
            data = self._from_banner(data)
        if not data or self._stream is None:
            return []
        self._sink(data)
        rows = []
        for heard in self._stream.feed(data):
            if isinstance(heard, Row):
                rows.append(heard)
            else:
                self._remark(heard)
        return rows

    def _from_banner(self, data: bytes) -> bytes:
        """Leave out what was on the line before the banner; returns the bytes from it on."""
        self._before += data
        *lines, rest = self._before.split(b"\n")
        for i, line in enumerate(lines):
            banner = _banner(line.removesuffix(b"\r"))
            if banner is not None:
                kept = b"\n".join([*lines[i:], rest])
                self._stream = LiveStream(banner.columns, banner.adc_max)
                self._before = b""
                # The banner itself is no news to the stream.
                self._sink(line + b"\n")
                return kept[len(line) + 1 :]
            if line.startswith((b"# refused", b"# trip")):
                self.outcome.notes.append(line.decode("ascii", errors="replace").strip("# \r"))
        self._before = rest[-4096:]
        return b""

    def _remark(self, remark: Remark) -> None:
        line = remark.line
        said = line.decode("ascii").removeprefix("# ")
        if remark.greets:
            self._reset = True
            self.abort("the board reset itself")
        elif line.startswith(b"# stopped"):
            self._stopped = True
            taken = settings(line).get("samples", "")
            if taken.isdecimal() and not self._reset:
                self.outcome.taken = int(taken)
        elif line.startswith(b"# trip"):
            self.abort(f"the board vented: {said}")
        elif line.startswith(b"# refused limit"):
            self.abort(f"the board: {said}")
        else:
            self.outcome.notes.append(said)


def record_trial(
    link: Link,
    info: BoardInfo,
    profile: CommandProfile,
    rate_hz: int,
    sink: Sink,
    stop: Stop = lambda: None,
    show: Callable[[Row], object] = lambda row: None,
) -> Outcome:
    """Run one trial.

    Parameters
    ----------
    link : Link
        To a board that is idle.
    info : BoardInfo
        What it said of itself.
    profile : CommandProfile
        What to command.
    rate_hz : int
        Sampling rate.
    sink : callable
        Takes the log's bytes, from the banner on, as they come.
    stop : callable
        Asked all the time: why to end now, or None.
    show : callable
        Told every row that came.

    Returns
    -------
    Outcome
        Complete, or why not. The board is vented and idle, or out of reach: then its watchdog
        vents it.
    """
    samples = profile.samples(rate_hz)
    pacer = Pacer(
        profile.by_sample(rate_hz),
        lookahead=math.ceil(LOOKAHEAD_S * rate_hz),
        queue=max(1, info.queue - 8),
        patience=max(5, math.ceil(_DISOBEDIENT_S * rate_hz)),
    )
    recording = _Recording(link, sink, rate_hz, stop, info.speed)
    outcome = recording.outcome
    try:
        recording.begin(f"run {rate_hz}")
        while outcome.aborted is None and recording.progress.seq < samples - 1:
            recording.send(*pacer.commands(recording.progress.seq))
            for row in recording.turn():
                if recording.progress.see(row.seq):
                    recording.moved()
                    recording.send(*pacer.see(row.seq, row.fields.get("cmd_kpa", 0.0)))
                show(row)
            if pacer.repairs > _REPAIRS:
                recording.abort("the board does not do what it is told")
    except PortLost as error:
        recording.abort(f"the port was lost ({error})")
    recording.finish()
    if pacer.repairs:
        outcome.notes.append(f"commands were sent again {pacer.repairs} times")
    return outcome


def record_calibration(
    link: Link,
    angles_deg: Iterable[float],
    dwell_s: float,
    rate_hz: int,
    sink: Sink,
    stop: Stop = lambda: None,
    show: Callable[[Row], object] = lambda row: None,
    speed: float = 1.0,
) -> Outcome:
    """Log a dwell at each known angle.

    Parameters
    ----------
    link : Link
        To a board that is idle.
    angles_deg : iterable of float
        Known angles (deg, to one decimal); each is asked for when the fixture is to be moved
        there, and given when it stands still.
    dwell_s : float
        Length of a dwell, s.
    rate_hz, sink, stop, show, speed
        As for `record_trial`.
    """
    recording = _Recording(link, sink, rate_hz, stop, speed)
    outcome = recording.outcome
    dwell = max(1, round(dwell_s * rate_hz))
    try:
        recording.begin(f"cal {rate_hz}")
        for angle in angles_deg:
            _dwell(recording, decimal(angle, 1), dwell, show)
            if outcome.aborted is not None:
                break
        why = stop()
        if why is not None:
            recording.abort(why)
    except PortLost as error:
        recording.abort(f"the port was lost ({error})")
    return recording.finish()


def _dwell(recording: _Recording, angle: str, samples: int, show: Callable[[Row], object]) -> None:
    """Log `samples` samples at one angle, and pause."""
    recording.moved()
    recording.send(f"angle {angle}")
    again = time.monotonic() + _AGAIN_S
    seen = 0
    while seen < samples and recording.outcome.aborted is None:
        for row in recording.turn():
            if recording.progress.see(row.seq):
                recording.moved()
            if row.fields.get("angle_deg") == float(angle):
                seen += 1
            show(row)
        if seen == 0 and time.monotonic() > again:
            recording.send(f"angle {angle}")
            again = time.monotonic() + _AGAIN_S
    _pause(recording, show)


def _pause(recording: _Recording, show: Callable[[Row], object]) -> None:
    """Stop sampling; nothing may be logged while the fixture moves."""
    recording.send("pause")
    quiet_s = _QUIET[0] + _QUIET[1] * recording.period_s
    quiet_at = again = time.monotonic() + quiet_s
    while (now := time.monotonic()) < quiet_at and recording.outcome.aborted is None:
        rows = recording.turn()
        for row in rows:
            recording.progress.see(row.seq)
            show(row)
        if rows:
            quiet_at = now + quiet_s
        if now > again:
            recording.send("pause")
            again = now + quiet_s


def _banner(line: bytes) -> Banner | None:
    if not is_banner(line):
        return None
    try:
        return parse_banner(line)
    except ValueError:
        return None
