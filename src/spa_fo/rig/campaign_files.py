"""The two YAML files of a campaign that is being recorded, and how a new one begins.

``campaign.yaml`` is the campaign's; ``recording.yaml`` the recorder's own memory: the clock, each
experiment's profile, how every log came about. Nothing else reads it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from spa_fo.atomic import write_bytes, write_text
from spa_fo.errors import BadInput
from spa_fo.rig import checksums
from spa_fo.validation import load_yaml, package_schema, validate

SCHEMA = "spa-fo/recording/1"


@dataclass(frozen=True)
class Setup:
    """What a new campaign.yaml says.

    Attributes
    ----------
    material : str
        The actuator's.
    reference_kpa : float
        Pressure that is u = 1.
    volts, kpa : (float, float)
        Two points of the pressure sensor's line.
    vref_mv, adc_max : float, int
        Of the board's converter.
    kind, source, note : str
        Where the data come from; `kind` is ``measured`` or ``synthetic``.
    """

    material: str
    reference_kpa: float
    volts: tuple[float, float] = (0.5, 4.5)
    kpa: tuple[float, float] = (0.0, 551.6)
    vref_mv: float = 5000
    adc_max: int = 1023
    kind: str = "measured"
    source: str = ""
    note: str = ""


def begin_campaign(folder: Path, setup: Setup, continues: Path | None, now: datetime) -> None:
    """Write the campaign.yaml of a campaign without trials, and its recording.yaml.

    Parameters
    ----------
    folder : Path
        The campaign's; its name is the campaign's.
    setup : Setup
        What is measured, and with what.
    continues : Path or None
        Folder of the earlier campaign with the same actuator: order, clock and the earliest
        calibration go on from it.
    now : datetime
        For its provenance.

    Raises
    ------
    BadInput
        The earlier campaign was not recorded here.
    """
    document: dict[str, Any] = {
        "schema": "spa-fo/campaign/1",
        "name": folder.resolve().name,
        "material": setup.material,
    }
    memory = _empty_memory()
    calibrations: list[dict[str, Any]] = []
    if continues is not None:
        earlier = read_document(continues / "campaign.yaml")
        past = read_memory(continues / "recording.yaml")
        if past["clock"] is None:
            raise BadInput(
                continues / "recording.yaml",
                "does not know when its trials were; expected a campaign that was recorded",
            )
        document["continues"] = earlier["name"]
        memory["clock"] = past["clock"]
        memory["orders_before"] = max(
            trial["order"] for item in earlier["experiments"] for trial in item["trials"]
        )
        calibrations = _copied_calibration(folder, continues, earlier)
    document |= {
        "provenance": {
            "kind": setup.kind,
            "source": setup.source or f"spa-fo record, {now.date().isoformat()}",
            "note": setup.note,
        },
        "log": {"format": "spa-rig"},
        "pressure_sensor": {
            "volts": list(setup.volts),
            "kpa": list(setup.kpa),
            "vref_mv": setup.vref_mv,
            "adc_max": setup.adc_max,
        },
        "input": {"reference_kpa": setup.reference_kpa},
    }
    if calibrations:
        document["calibration"] = calibrations
    document["experiments"] = []
    write_memory(folder / "recording.yaml", memory)
    write_document(folder / "campaign.yaml", document)


def _copied_calibration(
    folder: Path, continues: Path, earlier: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Take over the earliest calibration, through which all angles are read."""
    known = sorted(earlier.get("calibration", []), key=lambda item: item["started_s"])
    if not known:
        return []
    file = "calibration/earliest.log"
    write_bytes(folder / file, (continues / known[0]["file"]).read_bytes())
    checksums.add(folder, file)
    return [{"file": file, "started_s": known[0]["started_s"]}]


def read_document(path: Path) -> dict[str, Any]:
    """Read campaign.yaml; while it is being recorded it may still be without an experiment.

    Raises
    ------
    BadInput
        It does not hold to its schema, or its logs are not of format spa-rig.
    """
    document = load_yaml(path)
    schema = package_schema("spa_fo.rig", "campaign.schema.yaml")
    properties = dict(schema["properties"])
    properties["experiments"] = {**properties["experiments"], "minItems": 0}
    validate(document, {**schema, "properties": properties}, path)
    if document["log"]["format"] != "spa-rig":
        raise BadInput(path, "is not spa-rig; expected a campaign of such a board", "log.format")
    return dict(document)


def write_document(path: Path, document: Mapping[str, Any]) -> None:
    """Write campaign.yaml; of the comments, those above the first key are kept."""
    write_text(path, _leading_comments(path) + _yaml(document))


def read_memory(path: Path) -> dict[str, Any]:
    """Read recording.yaml; an empty memory where there is none."""
    if not path.is_file():
        return _empty_memory()
    memory = load_yaml(path)
    if not isinstance(memory, dict) or memory.get("schema") != SCHEMA:
        raise BadInput(path, f"expected schema: {SCHEMA}")
    return {**_empty_memory(), **memory}


def write_memory(path: Path, memory: Mapping[str, Any]) -> None:
    """Write recording.yaml."""
    write_text(path, _yaml(memory))


def _empty_memory() -> dict[str, Any]:
    return {"schema": SCHEMA, "clock": None, "profiles": {}, "logs": []}


def _leading_comments(path: Path) -> str:
    """Keep what a person wrote above the first key."""
    if not path.is_file():
        return ""
    kept = []
    for line in path.read_text(encoding="utf-8-sig").splitlines(keepends=True):
        if line.strip() and not line.startswith("#"):
            break
        kept.append(line)
    return "".join(kept)


def _yaml(document: Mapping[str, Any]) -> str:
    return str(
        yaml.safe_dump(
            dict(document), sort_keys=False, default_flow_style=None, allow_unicode=True, width=100
        )
    )
