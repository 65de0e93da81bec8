"""The workflow's configuration: checked against its schema, defaults filled in."""

from __future__ import annotations

import copy
import fnmatch
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spa_fo.errors import BadInput
from spa_fo.validation import load_yaml, suggestion, validate

_PATTERN = re.compile(r"[*?[]")
_WITHOUT_ANGLE = {"campaign", "reference"}  # keys that mean something then


def read_config(
    document: Mapping[str, Any], source: Path | str, schema_file: Path | str
) -> dict[str, Any]:
    """Check a configuration and fill in what it leaves out.

    Parameters
    ----------
    document : Mapping
        The configuration, as read from YAML.
    source : Path or str
        The file it came from, for the message.
    schema_file : Path or str
        The JSON schema in YAML; its ``default`` values are the defaults.

    Returns
    -------
    dict
        A new document with every key that has a default.

    Raises
    ------
    BadInput
        The first violation, in one line; an unknown key is answered with the nearest known one.
    """
    schema = load_yaml(schema_file)
    # A material with nothing to say, `my_arm:`, is read as null.
    plain = _without_empty_materials(document)
    validate(plain, schema, source)
    _check_bounds(plain, source)
    config = _with_defaults(plain, schema)
    assert isinstance(config, dict)
    return config


def match_materials(
    materials: Mapping[str, Mapping[str, Any]], raw: Path | str, source: Path | str
) -> dict[str, dict[str, Any]]:
    """Replace every entry whose name is a pattern by one for each campaign folder that it matches.

    Parameters
    ----------
    materials : Mapping
        Entries of the configuration; names may hold ``*``, ``?`` and ``[...]``.
    raw : Path or str
        The folder of the campaigns' folders.
    source : Path or str
        The configuration's file, for the message.

    Returns
    -------
    dict
        Entries by plain name, a pattern's in alphabetical order in its place. An entry with the
        plain name goes before any pattern, an earlier pattern before a later one.

    Raises
    ------
    BadInput
        A pattern matches no folder that holds a campaign.yaml, or a reference is no other material.
    """
    campaigns = sorted(path.parent.name for path in Path(raw).glob("*/campaign.yaml"))
    matched: dict[str, dict[str, Any]] = {}
    for name, entry in materials.items():
        if not _PATTERN.search(name):
            matched[name] = dict(entry)
            continue
        names = fnmatch.filter(campaigns, name)
        if not names:
            raise BadInput(source, f"matches no campaign's folder in {raw}", f"materials.{name}")
        for one in names:
            if one not in materials:
                matched.setdefault(one, dict(entry))
    _check_references(matched, source)
    return matched


def _check_references(materials: Mapping[str, Mapping[str, Any]], source: Path | str) -> None:
    """Refuse a reference that is no other material."""
    for name, entry in materials.items():
        reference = entry.get("reference")
        if reference is not None and (reference == name or reference not in materials):
            others = [other for other in materials if other != name]
            raise BadInput(
                source,
                f"is '{reference}'{suggestion(reference, others)}",
                f"materials.{name}.reference",
            )


def has_angle(folder: Path | str) -> bool:
    """Say whether the logs of a campaign hold an angle, by its campaign.yaml alone.

    Parameters
    ----------
    folder : Path or str
        The campaign's.

    Returns
    -------
    bool
        True where the description cannot be used: the step that needs it says what is wrong.
    """
    # Every job reads the configuration, and few ask this.
    from spa_fo.rig import read_description

    try:
        return read_description(folder, angle=False).has_angle
    except BadInput:
        return True


def check_compared(
    materials: Mapping[str, Mapping[str, Any]], folders: Mapping[str, Path], source: Path | str
) -> None:
    """Refuse a campaign without an angle that is not compared: nothing else can be done with it.

    Parameters
    ----------
    materials : Mapping
        Entries of the configuration by plain name.
    folders : Mapping
        The campaign's folder of each material whose logs hold no angle.
    source : Path or str
        The configuration's file, for the message.

    Raises
    ------
    BadInput
        Such a material neither names a reference nor is one, or has a key of the identification.
    """
    references = {entry.get("reference") for entry in materials.values()}
    for name, folder in folders.items():
        if "reference" not in materials[name] and name not in references:
            raise BadInput(
                source,
                f"is missing; {folder}/campaign.yaml names no column 'angle' or 'flex_adc', so it "
                "can only be compared; expected another entry, an earlier campaign of the actuator",
                f"materials.{name}.reference",
            )
        for key in sorted(materials[name].keys() - _WITHOUT_ANGLE):
            raise BadInput(
                source,
                f"belongs to a campaign with an angle; {folder}/campaign.yaml names none",
                f"materials.{name}.{key}",
            )


def _without_empty_materials(document: Mapping[str, Any]) -> dict[str, Any]:
    plain: dict[str, Any] = copy.deepcopy(dict(document))
    materials = plain.get("materials")
    if isinstance(materials, dict):
        plain["materials"] = {
            key: {} if value is None else value for key, value in materials.items()
        }
    return plain


def _check_bounds(config: Mapping[str, Any], source: Path | str) -> None:
    """Refuse reversed bounds, which a schema cannot."""
    for material, entry in config["materials"].items():
        for name, (low, high) in entry.get("bounds", {}).items():
            if low > high:
                raise BadInput(
                    source,
                    f"is [{low:g}, {high:g}]: reversed; expected the lower bound first",
                    f"materials.{material}.bounds.{name}",
                )


def _with_defaults(value: Any, schema: Mapping[str, Any]) -> Any:
    if not isinstance(value, dict):
        return value
    filled = dict(value)
    for key, entry in schema.get("properties", {}).items():
        if key not in filled and "default" in entry:
            filled[key] = copy.deepcopy(entry["default"])
        if key in filled:
            filled[key] = _with_defaults(filled[key], entry)
    others = schema.get("additionalProperties")
    if isinstance(others, Mapping):
        for key in set(filled) - set(schema.get("properties", {})):
            filled[key] = _with_defaults(filled[key], others)
    return filled
