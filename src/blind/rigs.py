"""The rigs that make cases, by name; each is asked as CASE.md says and shares nothing else."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

RIGS: Mapping[str, str] = {"virtual_rig": "blind.first_rig", "second_rig": "blind.second_rig"}
"""Name of each rig, and its package; the diagnosis learns on the first and is judged on both."""


class Rig(Protocol):
    """What a rig's package offers."""

    NAME: str
    EFFECTS: tuple[str, ...]
    FOREIGN: Mapping[str, tuple[str, ...]]

    def write_case(self, document: Mapping[str, Any], folder: Path) -> dict[str, Any]:
        """Write the campaigns of a case and give the truth about it."""


def further_of(rig: Rig) -> tuple[str, ...]:
    """List the effects of the library beyond the contract's that a rig can make, if any."""
    return tuple(getattr(rig, "FURTHER", ()))


def rig_named(name: str) -> Rig:
    """Load a rig's package.

    Raises
    ------
    KeyError
        There is no such rig.
    """
    return cast(Rig, import_module(RIGS[name]))
