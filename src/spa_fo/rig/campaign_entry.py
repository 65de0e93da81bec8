"""What a recorded log adds to campaign.yaml and to recording.yaml, as documents.

Nothing is written here: `spa_fo.rig.recording` does that, in the order that a kill cannot spoil.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from spa_fo.rig.wire import LineParser, parse_banner

ABORTED = "_aborted"
CALIBRATION = "calibration"

Document = Mapping[str, Any]


def with_calibration(campaign: Document, entry: Document) -> dict[str, Any]:
    """Return campaign.yaml with a calibration added."""
    item = {"file": entry["file"], "started_s": entry["started_s"]}
    if entry["before_first"]:
        item["started_s"] = 0.0  # until the first trial begins the campaign's time
    calibrations = [*campaign.get(CALIBRATION, []), item]
    ordered = {key: value for key, value in campaign.items() if key != "experiments"}
    return {**ordered, CALIBRATION: calibrations, "experiments": campaign["experiments"]}


def with_trial(campaign: Document, memory: Document, entry: Document) -> tuple[dict[str, Any], str]:
    """Return campaign.yaml with a trial added, and the experiment that it is one of."""
    name, protocol, setpoint = (
        entry["experiment"],
        entry["protocol"],
        entry["setpoint_deg"],
    )
    if entry["aborted"]:
        name, protocol, setpoint = name + ABORTED, "free", None
    order = 1 + max(
        (trial["order"] for trial in trials_of(campaign)),
        default=memory.get("orders_before", 0),
    )
    trial = {"file": entry["file"], "order": order, "started_s": entry["started_s"]}
    experiments = [dict(item) for item in campaign["experiments"]]
    for item in experiments:
        if item["name"] == name:
            item["trials"] = [*item["trials"], trial]
            break
    else:
        experiments.append(
            {"name": name, "setpoint_deg": setpoint, "protocol": protocol, "trials": [trial]}
        )
    changed = {**campaign, "experiments": experiments}
    if memory["clock"] is None and CALIBRATION in changed:
        changed[CALIBRATION] = [_dated(memory, item, entry) for item in changed[CALIBRATION]]
    return changed, name


def remember(memory: dict[str, Any], entry: Document, place: str, why: str) -> None:
    """Add to recording.yaml where a log came, and why not where it was meant for."""
    if all(log["file"] != entry["file"] for log in memory["logs"]):
        log = {
            "file": entry["file"],
            "started_utc": entry["utc"],
            "lasted_s": entry["lasted_s"],
            "in": place or "not in campaign.yaml",
        }
        if why:
            log["why"] = why
        if entry.get("before_first"):
            log["before_first"] = True
        memory["logs"].append({**log, **entry["facts"]})
    if entry["kind"] == "trial":
        memory["profiles"][entry["experiment"]] = entry["profile"]
        if place:
            memory["clock"] = {
                "utc": entry["ended_utc"],
                "campaign_s": round(entry["started_s"] + entry["lasted_s"], 2),
            }


def trials_of(campaign: Document) -> list[dict[str, Any]]:
    """List the trials of all experiments."""
    return [trial for item in campaign["experiments"] for trial in item["trials"]]


def length_s(log: Path) -> float:
    """Tell how long a log lasted, s: its valid lines over the banner's rate."""
    lines = [line.removesuffix(b"\r") for line in log.read_bytes().split(b"\n")]
    try:
        banner = parse_banner(lines[0])
    except ValueError:
        return 0.0
    parser = LineParser(banner.columns)
    return round(sum(parser.parse(line) is not None for line in lines) / banner.rate_hz, 2)


def seconds_since(since: str, now: datetime) -> float:
    """Return the seconds from a time in ISO 8601 to another."""
    return (now - datetime.fromisoformat(since)).total_seconds()


def _dated(memory: Document, item: Document, first: Document) -> dict[str, Any]:
    """Give a calibration before the first trial its campaign time."""
    log = next((log for log in memory["logs"] if log["file"] == item["file"]), None)
    if log is None or not log.get("before_first"):
        return dict(item)
    before_s = seconds_since(log["started_utc"], datetime.fromisoformat(first["utc"]))
    return {**item, "started_s": round(first["started_s"] - before_s * first["speed"], 2)}
