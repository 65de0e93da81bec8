"""The campaign folder while it is being recorded: it is valid after a kill at any moment.

What belongs to a log is written in this order, each file whole or not at all:

1. ``trial_03.recording``: what the log will be. Beside it an unlisted ``trial_03.log`` is no fault.
2. ``trial_03.log``: opened as a new file, never over another, every byte as it comes.
3. ``SHA256SUMS``, then ``campaign.yaml``, then ``recording.yaml``.
4. ``trial_03.recording`` is removed.

Whoever opens the folder next finishes what a killed recorder left, from whatever step.
``recording.yaml`` is the recorder's own memory: the clock of the campaign, each experiment's
profile, and how every log came about. Nothing else reads it.
"""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from spa_fo.atomic import TEMPORARY, write_text
from spa_fo.errors import BadInput
from spa_fo.rig import checksums
from spa_fo.rig.admission import why_not
from spa_fo.rig.campaign import Protocol
from spa_fo.rig.campaign_entry import (
    CALIBRATION,
    length_s,
    remember,
    seconds_since,
    trials_of,
    with_calibration,
    with_trial,
)
from spa_fo.rig.campaign_files import (
    Setup,
    begin_campaign,
    read_document,
    read_memory,
    write_document,
    write_memory,
)
from spa_fo.rig.recorded_log import Begun, Kept

JOURNAL = checksums.RECORDING
"""Suffix of the file that says what a log beside it will be."""
"""Experiment of the trials of another that were cut short: the actuator was loaded all the same."""
KILLED = "the recorder was killed"


class RecordingFolder:
    """A campaign folder open for recording; one recorder at a time.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    setup : Setup, optional
        Needed for a new campaign.
    continues : Path, optional
        Folder of the campaign with the same actuator that a new one goes on from.
    now : datetime
        For the clock of the campaign.

    Attributes
    ----------
    recovered : list of Kept
        What a killed recorder had left, and what was made of it.

    Raises
    ------
    BadInput
        Another recorder is at work here, there is no campaign and no `setup`, or campaign.yaml is
        not what it should be.
    """

    def __init__(
        self,
        folder: Path,
        setup: Setup | None = None,
        continues: Path | None = None,
        now: datetime | None = None,
    ) -> None:
        self.folder = folder
        self._lock: int | None = None
        if setup is None and not (folder / "campaign.yaml").is_file():
            raise BadInput(
                folder / "campaign.yaml",
                "is not there; expected a campaign, or --material to begin one",
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            raise BadInput(folder, "another recorder is at work here") from None
        except OSError as error:
            self.close()
            raise BadInput(folder, f"cannot be used: {error.strerror}") from error
        try:
            self._open(setup, continues, now or _now())
        except BaseException:
            self.close()
            raise

    def _open(self, setup: Setup | None, continues: Path | None, now: datetime) -> None:
        for stale in self.folder.rglob(f"{TEMPORARY}*"):
            stale.unlink()
        if self._campaign_file.is_file():
            if continues is not None:
                raise BadInput(
                    self._campaign_file, "is there already; --continues begins a new one"
                )
        else:
            assert setup is not None
            begin_campaign(self.folder, setup, continues, now)
        self.campaign = read_document(self._campaign_file)
        self.memory = read_memory(self._memory_file)
        self.recovered = [self._recover(path) for path in sorted(self.folder.rglob(f"*{JOURNAL}"))]

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
        """Let another recorder in."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @property
    def _campaign_file(self) -> Path:
        return self.folder / "campaign.yaml"

    @property
    def _memory_file(self) -> Path:
        return self.folder / "recording.yaml"

    # --- what is there ---------------------------------------------------------------------------

    def profile(self, experiment: str) -> dict[str, Any] | None:
        """Return what `begin_trial` was last told of this experiment's profile."""
        found = self.memory["profiles"].get(experiment)
        return dict(found) if found is not None else None

    def experiment(self, name: str) -> Mapping[str, Any] | None:
        """Return an experiment's entry in campaign.yaml, or None."""
        return next((item for item in self.campaign["experiments"] if item["name"] == name), None)

    def trials(self, experiment: str) -> int:
        """Count the trials of an experiment."""
        entry = self.experiment(experiment)
        return len(entry["trials"]) if entry else 0

    def campaign_s(self, now: datetime, speed: float = 1.0) -> float | None:
        """Tell the campaign time (s); None where no trial has begun it."""
        clock = self.memory["clock"]
        if clock is None:
            if any(item["trials"] for item in self.campaign["experiments"]):
                raise BadInput(
                    self._memory_file,
                    "does not know when the campaign's trials were; expected --started-s",
                )
            return None
        return float(clock["campaign_s"]) + seconds_since(clock["utc"], now) * speed

    # --- a log begins ----------------------------------------------------------------------------

    def begin_trial(
        self,
        experiment: str,
        protocol: Protocol,
        setpoint_deg: float | None,
        profile: Mapping[str, Any],
        speed: float = 1.0,
        started_s: float | None = None,
        now: datetime | None = None,
    ) -> Begun:
        """Open the log of an experiment's next trial.

        Raises
        ------
        BadInput
            The experiment has another protocol or setpoint, or the trial would begin before the
            last one ended.
        """
        self._check_experiment(experiment, protocol, setpoint_deg)
        now = now or _now()
        if started_s is None:
            started_s = self.campaign_s(now, speed)
        last = max((t["started_s"] for t in trials_of(self.campaign)), default=-float("inf"))
        started_s = 0.0 if started_s is None else round(started_s, 2)
        if started_s <= last:
            raise BadInput(
                self._campaign_file,
                f"this trial would start at {started_s:g} s of campaign time, not after the last "
                f"one at {last:g} s; expected a clock that was not set back, or --started-s",
            )
        return self._begin(
            self._free_name(experiment, "trial"),
            {
                "kind": "trial",
                "experiment": experiment,
                "protocol": protocol,
                "setpoint_deg": setpoint_deg,
                "profile": dict(profile),
                "speed": speed,
            },
            started_s,
            now,
        )

    def begin_calibration(
        self,
        speed: float = 1.0,
        started_s: float | None = None,
        now: datetime | None = None,
    ) -> Begun:
        """Open the log of the next calibration; before the first trial its time is still open."""
        now = now or _now()
        if started_s is None:
            started_s = self.campaign_s(now, speed)
        return self._begin(
            self._free_name(CALIBRATION, "cal"),
            {"kind": CALIBRATION, "speed": speed, "before_first": started_s is None},
            0.0 if started_s is None else round(started_s, 2),
            now,
        )

    def _begin(self, file: str, entry: dict[str, Any], started_s: float, now: datetime) -> Begun:
        path = self.folder / file
        entry |= {"file": file, "started_s": started_s, "utc": now.isoformat()}
        self._note(path, entry)
        try:
            fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)
        except OSError as error:
            path.with_suffix(JOURNAL).unlink(missing_ok=True)
            raise BadInput(path, f"cannot be written: {error.strerror}") from error
        return Begun(file, started_s, fd)

    def _note(self, path: Path, entry: Mapping[str, Any]) -> None:
        write_text(path.with_suffix(JOURNAL), json.dumps(entry, indent=1) + "\n")

    def _free_name(self, folder: str, stem: str) -> str:
        """Find a number that no file and no line of campaign.yaml has."""
        taken = {Path(t["file"]).as_posix() for t in trials_of(self.campaign)}
        taken |= {Path(c["file"]).as_posix() for c in self.campaign.get(CALIBRATION, [])}
        number = 1
        while True:
            name = f"{folder}/{stem}_{number:02d}.log"
            journal = (self.folder / name).with_suffix(JOURNAL)
            if name not in taken and not (self.folder / name).exists() and not journal.exists():
                return name
            number += 1

    def _check_experiment(self, name: str, protocol: Protocol, setpoint_deg: float | None) -> None:
        entry = self.experiment(name)
        if entry is None:
            return
        for key, old, new in (
            ("protocol", entry["protocol"], protocol),
            ("setpoint_deg", entry.get("setpoint_deg"), setpoint_deg),
        ):
            if old != new:
                raise BadInput(
                    self._campaign_file,
                    f"experiment '{name}' has {key} {old}, not {new}; expected the same, or "
                    "another name",
                    "experiments",
                )

    # --- a log ends ------------------------------------------------------------------------------

    def finish(
        self,
        begun: Begun,
        lasted_s: float,
        aborted: str | None,
        facts: Mapping[str, Any] | None = None,
        now: datetime | None = None,
    ) -> Kept:
        """Close a log and take it into the campaign.

        Parameters
        ----------
        begun : Begun
            The log.
        lasted_s : float
            Its length by the board's clock, s.
        aborted : str or None
            Why it is not complete.
        facts : mapping, optional
            What recording.yaml says of it besides.

        Returns
        -------
        Kept
            Where it is. An aborted trial becomes one of the experiment ``<name>_aborted``, of
            protocol free; a log that would spoil the campaign (no samples, a dead sensor) is kept
            and listed in SHA256SUMS, but campaign.yaml does not name it.
        """
        os.fsync(begun.fd)
        os.close(begun.fd)
        journal = (self.folder / begun.file).with_suffix(JOURNAL)
        entry = json.loads(journal.read_text(encoding="utf-8"))
        entry |= {
            "lasted_s": round(lasted_s, 2),
            "aborted": aborted,
            "ended_utc": (now or _now()).isoformat(),
            "facts": dict(facts or {}),
        }
        self._note(self.folder / begun.file, entry)
        return self._take_in(entry)

    def _recover(self, journal: Path) -> Kept:
        """Finish what a killed recorder left."""
        try:
            entry = json.loads(journal.read_text(encoding="utf-8"))
            log = self.folder / entry["file"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise BadInput(journal, "cannot be read; expected what a recorder left") from error
        if log.exists() and "ended_utc" not in entry:
            entry |= {
                "lasted_s": length_s(log),
                "aborted": KILLED,
                "ended_utc": datetime.fromtimestamp(log.stat().st_mtime, UTC).isoformat(),
                "facts": {},
            }
        kept = self._take_in(entry)
        return Kept(kept.file, kept.place, kept.why or KILLED)

    def _take_in(self, entry: dict[str, Any]) -> Kept:
        """Take a finished log into SHA256SUMS, campaign.yaml and recording.yaml; idempotent."""
        file = entry["file"]
        path = self.folder / file
        journal = path.with_suffix(JOURNAL)
        if not path.exists() or path.stat().st_size == 0:
            path.unlink(missing_ok=True)
            journal.unlink(missing_ok=True)
            return Kept("", "", "nothing came")
        checksums.add(self.folder, file)
        place, why = self._name(entry)
        remember(self.memory, entry, place, why)
        write_memory(self._memory_file, self.memory)
        journal.unlink(missing_ok=True)
        return Kept(file, place, why)

    def _name(self, entry: Mapping[str, Any]) -> tuple[str, str]:
        """Add a log to campaign.yaml; returns where, and why not where it was meant for."""
        for item in self.campaign["experiments"]:
            if any(trial["file"] == entry["file"] for trial in item["trials"]):
                return item["name"], str(entry["aborted"] or "")
        if any(item["file"] == entry["file"] for item in self.campaign.get(CALIBRATION, [])):
            return CALIBRATION, ""
        aborted = entry["aborted"]
        if entry["kind"] == CALIBRATION:
            if aborted:
                return "", f"a calibration that is not complete ({aborted})"
            changed, place = with_calibration(self.campaign, entry), CALIBRATION
        else:
            changed, place = with_trial(self.campaign, self.memory, entry)
        fault = why_not(changed, self.folder, entry["file"])
        if fault is not None:
            return "", fault
        self._write_campaign(changed)
        return place, str(aborted or "")

    # --- files -----------------------------------------------------------------------------------

    def _write_campaign(self, document: dict[str, Any]) -> None:
        write_document(self._campaign_file, document)
        self.campaign = document


def _now() -> datetime:
    return datetime.now(UTC)
