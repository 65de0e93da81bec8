"""What the recorder is put through, at any size: fuzzed streams, kills, a long fast run.

python tests/recorder_shows.py fuzz 10000
python tests/recorder_shows.py kills 1000
python tests/recorder_shows.py endurance 600
"""

from __future__ import annotations

import fcntl
import os
import random
import signal
import struct
import sys
import tempfile
import termios
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spa_fo.errors import BadInput
from spa_fo.rig import read_campaign
from spa_fo.rig.board_link import BoardInfo, BoardLink, PortLost
from spa_fo.rig.campaign_files import Setup
from spa_fo.rig.command_profile import plateaus, triangle
from spa_fo.rig.live_stream import LiveStream, Row
from spa_fo.rig.record_series import Series, record_series
from spa_fo.rig.recorder import record_trial
from spa_fo.rig.recording import RecordingFolder
from spa_fo.rig.spa_rig_log import parse_spa_rig_log, read_spa_rig_log
from spa_fo.rig.wire import parse_banner
from spa_fo.virtual_rig.board import VirtualBoard
from virtual_bench import LagPlant, said, serve_in_child

BANNER = (
    b"# spa-rig 1 board=virtual adc_bits=10 vref_mv=5000 rate_hz=50 "
    b"columns=seq,t_us,cmd_kpa,p_adc,flex_adc\r\n"
)
COLUMNS = ("seq", "t_us", "cmd_kpa", "p_adc", "flex_adc")
INFO = BoardInfo(parse_banner(BANNER[:-2]), 100.0, 1000.0, 32)
PROFILE = plateaus("step_release", [30.0], rest_s=0.3, dwell_s=0.6, release_s=0.3)


def board(seed: int = 1) -> VirtualBoard:
    return VirtualBoard(LagPlant(seed=seed), seed=seed)


def stream(samples: int, seed: int = 1) -> bytes:
    """The bytes of one run with a step."""
    it = board(seed)
    out = it.receive(said("run") + said("set 30 20"))
    return out + it.advance(samples) + it.receive(said("stop"))


# --- fuzzed streams -------------------------------------------------------------------------------

DAMAGES = ("flip", "replace", "drop", "double", "cut", "lose", "glue", "burst", "banner", "again")


@dataclass
class Fuzzed:
    """What came of fuzzed streams."""

    streams: int = 0
    damages: int = 0
    rows: int = 0
    wrong_rows: int = 0
    refused: int = 0
    longest_s: float = 0.0


class Tape:
    """A link that plays a stream in pieces of any size and then is unplugged."""

    def __init__(self, data: bytes, rng: np.random.Generator) -> None:
        self._data, self._rng = data, rng

    def send(self, *commands: str) -> None:
        pass

    def read(self) -> bytes:
        if not self._data:
            raise PortLost("end of the tape")
        size = int(self._rng.integers(0, 200))
        piece, self._data = self._data[:size], self._data[size:]
        return piece


OVERRUN = ("overrun",)
"""Bytes lost from the middle of one line to the middle of the next: the format's weak spot."""


def fuzz(streams: int, seed: int = 1, kinds: tuple[str, ...] = DAMAGES) -> Fuzzed:
    """Damage streams at random, play each to recorder, live stream and parser."""
    result = Fuzzed()
    rng = np.random.default_rng(seed)
    clean = [stream(60, seed=k) for k in range(20)]
    for _ in range(streams):
        sent = clean[int(rng.integers(len(clean)))]
        data, damages = _damaged(sent, rng, kinds)
        begun = time.monotonic()
        _play(sent, data, rng, result)
        result.longest_s = max(result.longest_s, time.monotonic() - begun)
        result.streams += 1
        result.damages += damages
    return result


def _play(sent: bytes, data: bytes, rng: np.random.Generator, result: Fuzzed) -> None:
    truth = {
        tuple(float(field) for field in line.split(b"*")[0].split(b","))
        for line in sent.splitlines()
        if b"*" in line
    }
    live = LiveStream(COLUMNS, 1023)
    rows = [item for item in live.feed(data) if isinstance(item, Row)]
    result.rows += len(rows)
    result.wrong_rows += sum((row.seq, *row.fields.values()) not in truth for row in rows)
    log = bytearray()
    record_trial(Tape(data, rng), INFO, PROFILE, 50, log.extend)
    assert bytes(log) in data
    try:
        parsed = parse_spa_rig_log(data, "fuzzed")
    except BadInput:
        result.refused += 1
        return
    kept = zip(
        parsed.seq.tolist(), *(parsed.columns[name].tolist() for name in COLUMNS[2:]), strict=True
    )
    known = {(row[0], *row[2:]) for row in truth}
    result.wrong_rows += sum(row not in known for row in kept)


_TORN = b"<torn>"


def _damaged(sent: bytes, rng: np.random.Generator, kinds: tuple[str, ...]) -> tuple[bytes, int]:
    """Damage up to half of the lines, each at most once; perhaps cut the end off."""
    lines = sent.splitlines(keepends=True)
    share = rng.uniform(0.0, 0.5)
    out, count = [], 0
    for i, line in enumerate(lines):
        if rng.random() < share * (0.05 if i == 0 else 1.0):
            line = _hit(line, str(rng.choice(kinds)), rng)
            count += 1
        if out and out[-1].endswith(_TORN):
            out[-1], line = out[-1][: -len(_TORN)], line[int(rng.integers(1, len(line))) :]
        out.append(line)
    data = b"".join(out)
    if rng.random() < 0.3:
        data = data[: int(rng.integers(1, len(data)))]
    return data, count


def _hit(line: bytes, kind: str, rng: np.random.Generator) -> bytes:
    body = line.rstrip(b"\r\n")
    end = line[len(body) :]
    at = int(rng.integers(len(body)))
    match kind:
        case "flip":
            changed = body[at] ^ (1 << int(rng.integers(8)))
            return body[:at] + bytes([changed]) + body[at + 1 :] + end
        case "replace":
            return body[:at] + rng.bytes(1) + body[at + 1 :] + end
        case "drop":
            return body[:at] + body[at + 1 :] + end
        case "double":
            return body[: at + 1] + body[at:] + end
        case "cut":
            return body[: max(at, 1)] + end
        case "lose":
            return b""
        case "glue":
            return body
        case "burst":
            return body[:at] + rng.bytes(int(rng.integers(6, 60))) + body[at:] + end
        case "overrun":
            return body[: max(at, 1)] + _TORN
        case "banner":
            return BANNER + line
    return line + line


# --- kills ----------------------------------------------------------------------------------------


@dataclass
class Kills:
    """What killed recorders left behind."""

    kills: int = 0
    logs: int = 0
    complete: int = 0
    invalid: int = 0
    wrong_bytes: int = 0
    lost_lines: int = 0
    lost_most: int = 0


_TRIAL_S = 1.2
_LATEST_KILL_S = 0.35
_KILLS_A_FOLDER = 25


def kills(count: int, folder: Path, seed: int = 1) -> Kills:
    """Kill recorders at random moments; look at every byte they left.

    A second reader of the port takes what the killed recorder had not read yet: what is on disk
    and that together must be what the board sent. What is missing between them, the recorder had
    read and not written.
    """
    result = Kills()
    rng = random.Random(seed)
    with tempfile.TemporaryFile() as record:
        child, port = serve_in_child(20.0, record.fileno(), reset_on_open=False)
        spare = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            while result.kills < count:
                place = folder / f"campaign_{result.kills // _KILLS_A_FOLDER:03d}"
                batch = min(_KILLS_A_FOLDER, count - result.kills)
                _kill_in(place, batch, port, spare, record.fileno(), rng, result)
        finally:
            os.kill(child, signal.SIGTERM)
            os.waitpid(child, 0)
            os.close(spare)
    return result


def _kill_in(
    place: Path, count: int, port: str, spare: int, record: int, rng: random.Random, result: Kills
) -> None:
    _child(_record, place, port, 1)  # so that there is a campaign
    seen = {path: path.read_bytes() for path in place.rglob("*.log")}
    for _ in range(count):
        _unread(spare)
        before = os.fstat(record).st_size
        pid = os.fork()
        if pid == 0:
            _run_and_exit(_record, place, port, 3)
        time.sleep(rng.uniform(0.0, _LATEST_KILL_S))
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        left = _unread(spare)
        result.kills += 1
        try:
            read_campaign(place)
        except BadInput:
            result.invalid += 1
        time.sleep(0.02)
        sent = os.pread(record, 10_000_000, before)
        for path in sorted(place.rglob("*.log")):
            data = path.read_bytes()
            if path in seen:
                result.wrong_bytes += seen[path] != data
            elif data:
                seen[path] = data
                result.logs += 1
                _compare(data, left, sent, result)
    with RecordingFolder(place) as recovered:
        assert not list(place.rglob("*.recording"))
        assert all(path.read_bytes() == data for path, data in seen.items())
        named = [file for _, _, file in read_campaign(place).trial_files()]
        assert len(named) + _set_aside(recovered) == len(list(place.rglob("*.log")))


def _set_aside(folder: RecordingFolder) -> int:
    return sum(log["in"] == "not in campaign.yaml" for log in folder.memory["logs"])


def _compare(data: bytes, left: bytes, sent: bytes, result: Kills) -> None:
    """Hold a log against what was sent: it is a piece of it, and what follows was not read."""
    at = sent.rfind(data)  # a banner alone is also that of the greeting
    if at < 0:
        result.wrong_bytes += 1
        return
    if b"# stopped" in data:
        result.complete += 1
        return
    follows = sent[at + len(data) :]
    if not left:
        lost = 0
    else:
        gap = follows.find(left)
        lost = follows[:gap].count(b"\n") if gap >= 0 else 0
        result.wrong_bytes += gap < 0
    result.lost_lines += lost
    result.lost_most = max(result.lost_most, lost)


def _record(place: Path, port: str, trials: int) -> None:
    series = Series("step_30", 30.0, PROFILE, {"protocol": "step_release"}, trials, rest_s=0.0)
    with BoardLink(port, hello_after_s=0.01) as link:
        info = link.wait_ready(5.0)
        setup = Setup("test rubber", 30.0, kind="synthetic")
        with RecordingFolder(place, setup) as folder:
            record_series(link, info, folder, series)


def _child(function, *arguments) -> None:
    pid = os.fork()
    if pid == 0:
        _run_and_exit(function, *arguments)
    _, status = os.waitpid(pid, 0)
    assert status == 0


def _run_and_exit(function, *arguments) -> None:
    code = 1
    try:
        function(*arguments)
        code = 0
    finally:
        os._exit(code)


def _unread(port: int) -> bytes:
    """Take what lies in the port now."""
    size = struct.unpack("i", fcntl.ioctl(port, termios.FIONREAD, struct.pack("i", 0)))[0]
    return os.read(port, size) if size else b""


# --- a long fast run ------------------------------------------------------------------------------


@dataclass
class Endured:
    """What a long run at 1 kHz lost."""

    samples: int
    lost: int
    damaged: int
    same_bytes: bool
    late_commands: int


def endurance(seconds: float, folder: Path, rate_hz: int = 1000) -> Endured:
    """Record triangles at 1 kHz in real time."""
    cycles = max(1, int(seconds / 4.0))
    profile = triangle(40.0, cycles, rest_s=0.5, ramp_s=(seconds - 1.0) / cycles / 2, release_s=0.5)
    series = Series("triangles", None, profile, {"protocol": "triangle"}, rate_hz=rate_hz)
    with tempfile.TemporaryFile() as record:
        child, port = serve_in_child(1.0, record.fileno())
        try:
            with BoardLink(port) as link:
                info = link.wait_ready()
                with RecordingFolder(folder, Setup("test rubber", 30.0)) as campaign:
                    (kept,) = record_series(link, info, campaign, series)
        finally:
            os.kill(child, signal.SIGTERM)
            os.waitpid(child, 0)
        sent = os.pread(record.fileno(), os.fstat(record.fileno()).st_size, 0)
    data = (folder / kept.file).read_bytes()
    log = read_spa_rig_log(folder / kept.file)
    expected = np.zeros(int(log.seq[-1]) + 1)
    for sample, kpa in profile.by_sample(rate_hz):
        expected[sample:] = kpa
    return Endured(
        samples=log.seq.size,
        lost=log.report.missing_samples + (0 if not kept.why else log.seq.size),
        damaged=log.report.damaged_lines,
        same_bytes=data in sent,
        late_commands=int(
            np.count_nonzero(np.abs(log.columns["cmd_kpa"] - expected[log.seq]) > 0.006)
        ),
    )


def main(arguments: list[str]) -> int:
    shows = ("fuzz", "overruns", "kills", "endurance")
    if len(arguments) != 2 or arguments[0] not in shows:
        print(__doc__)
        return 2
    what, size = arguments[0], float(arguments[1])
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as scratch:
        if what == "fuzz":
            print(fuzz(int(size)))
        elif what == "overruns":
            print(fuzz(int(size), kinds=OVERRUN))
        elif what == "kills":
            print(kills(int(size), Path(scratch)))
        else:
            print(endurance(size, Path(scratch)))
    print(f"{time.monotonic() - begun:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
