"""A series of trials, or of calibration dwells, recorded with a person in front of it."""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import FrameType
from typing import Any

from spa_fo.rig.admission import reading
from spa_fo.rig.board_link import BoardInfo, BoardLink
from spa_fo.rig.command_profile import CommandProfile
from spa_fo.rig.live_view import LiveView
from spa_fo.rig.recorded_log import Kept
from spa_fo.rig.recorder import Outcome, record_calibration, record_trial
from spa_fo.rig.recording import RecordingFolder

INTERRUPTED = 130
STOPPED = "stopped by the operator"


@dataclass(frozen=True)
class Series:
    """What `record_series` is to record.

    Attributes
    ----------
    experiment : str
        Its name.
    setpoint_deg : float or None
        The angle it aims at.
    profile : CommandProfile
        What is commanded.
    options : mapping
        How the profile was asked for, for the next trials of this experiment.
    trials : int
        How many.
    rest_s : float
        Between two trials, s of campaign time.
    rate_hz : int
        Sampling rate.
    started_s : float, optional
        Campaign time of the first one; from the clock by default.
    """

    experiment: str
    setpoint_deg: float | None
    profile: CommandProfile
    options: Mapping[str, Any]
    trials: int = 1
    rest_s: float = 60.0
    rate_hz: int = 50
    started_s: float | None = None


class Interruption:
    """Ctrl-C and SIGTERM: at once, but a trial ends vented and valid first."""

    def __init__(self) -> None:
        self.why: str | None = None
        self._gentle = False

    def __call__(self) -> str | None:
        """Say why to stop, or None."""
        return self.why

    @contextlib.contextmanager
    def heeded(self) -> Iterator[None]:
        """Catch the signals; the exit code of an interrupted program is 130."""

        def note(number: int, frame: FrameType | None) -> None:
            again, self.why = self.why is not None, STOPPED
            if again or not self._gentle:
                raise KeyboardInterrupt

        signals = (signal.SIGINT, signal.SIGTERM)
        before = [signal.signal(number, note) for number in signals]
        try:
            yield
        except KeyboardInterrupt:
            raise SystemExit(INTERRUPTED) from None
        finally:
            for number, handler in zip(signals, before, strict=True):
                signal.signal(number, handler)

    @contextlib.contextmanager
    def gently(self, gentle: bool = True) -> Iterator[None]:
        """Only note the first signal; a second one ends the program at once all the same."""
        before, self._gentle = self._gentle, gentle
        try:
            yield
        finally:
            self._gentle = before

    def ask(self, question: str) -> None:
        """Wait for Enter, or until there is a reason to stop."""
        try:
            with self.gently(False):
                input(question)
        except KeyboardInterrupt:
            pass
        except EOFError:
            self.why = "nobody is there to press Enter (see --settle)"


Tell = Callable[[str], object]


def record_series(
    link: BoardLink,
    info: BoardInfo,
    folder: RecordingFolder,
    series: Series,
    stop: Callable[[], str | None] = lambda: None,
    tell: Tell = lambda text: None,
) -> list[Kept]:
    """Record the trials of one experiment, with rests between them.

    Returns
    -------
    list of Kept
        What became of each log. It is shorter than asked for where a trial was aborted: the series
        ends there.
    """
    kept: list[Kept] = []
    sensor, curve = reading(folder.campaign, folder.folder)
    for trial in range(series.trials):
        if trial > 0 and _rested(series.rest_s / info.speed, stop, tell) is not None:
            break
        begun = folder.begin_trial(
            series.experiment,
            series.profile.protocol,
            series.setpoint_deg,
            series.options,
            info.speed,
            series.started_s if trial == 0 else None,
        )
        samples = series.profile.samples(series.rate_hz)
        title = f"{series.experiment} {trial + 1}/{series.trials}"
        view = LiveView(title, samples, series.rate_hz, sensor, curve)
        outcome = Outcome("an error in the recorder")
        try:
            outcome = record_trial(
                link, info, series.profile, series.rate_hz, begun.write, stop, view
            )
        except BaseException:
            # Whatever it was, the actuator must not stay under pressure.
            with contextlib.suppress(Exception):
                link.send("vent", "stop")
            raise
        finally:
            view.close()
        kept.append(
            folder.finish(
                begun, _lasted_s(outcome, series.rate_hz), outcome.aborted, facts(outcome)
            )
        )
        tell(account(kept[-1], outcome))
        if outcome.aborted is not None or not kept[-1].place:
            break
    return kept


def record_dwells(
    link: BoardLink,
    info: BoardInfo,
    folder: RecordingFolder,
    angles_deg: Iterator[float] | Sequence[float],
    dwell_s: float,
    rate_hz: int = 50,
    started_s: float | None = None,
    stop: Callable[[], str | None] = lambda: None,
    tell: Tell = lambda text: None,
) -> Kept:
    """Record a calibration: a dwell at each angle."""
    begun = folder.begin_calibration(info.speed, started_s)
    samples = max(1, round(dwell_s * rate_hz))
    view = LiveView("calibration", samples, rate_hz)

    def each() -> Iterator[float]:
        for angle in angles_deg:
            view.restart()
            yield angle

    try:
        outcome = record_calibration(
            link, each(), dwell_s, rate_hz, begun.write, stop, view, info.speed
        )
    finally:
        view.close()
    kept = folder.finish(begun, _lasted_s(outcome, rate_hz), outcome.aborted, facts(outcome))
    tell(account(kept, outcome))
    return kept


def facts(outcome: Outcome) -> dict[str, Any]:
    """List what recording.yaml keeps of an outcome."""
    found: dict[str, Any] = {"rows": outcome.rows}
    if outcome.taken is not None:
        found["samples"] = outcome.taken
    if outcome.damaged:
        found["damaged_lines"] = outcome.damaged
    if outcome.notes:
        found["notes"] = outcome.notes[:20]
    return found


def account(kept: Kept, outcome: Outcome) -> str:
    """Say in a line what became of a log."""
    if not kept.file:
        return f"nothing was recorded: {outcome.aborted or kept.why}"
    text = f"{kept.file}: {outcome.rows} samples"
    if outcome.lost:
        text += f", {outcome.lost} lost"
    if outcome.damaged:
        text += f", {outcome.damaged} damaged lines"
    if outcome.aborted:
        text += f"; aborted: {outcome.aborted}"
    if not kept.place:
        return f"{text}; kept, but not in campaign.yaml: {kept.why}"
    if outcome.aborted:
        text += f" (in campaign.yaml as {kept.place})"
    return "; ".join([text, *outcome.notes[:3]])


def _lasted_s(outcome: Outcome, rate_hz: float) -> float:
    return (outcome.taken if outcome.taken is not None else outcome.rows) / rate_hz


def _rested(seconds: float, stop: Callable[[], str | None], tell: Tell) -> str | None:
    """Let the actuator rest; returns why not to go on, if so."""
    if seconds >= 5.0:
        tell(f"the actuator rests for {seconds:.0f} s")
    until = time.monotonic() + seconds
    while (left := until - time.monotonic()) > 0.0 and stop() is None:
        time.sleep(min(left, 0.1))
    return stop()
