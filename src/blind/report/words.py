"""How the pages, tables and figures of the blind benchmark call things."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

KIND_NAMES = {
    "closed": "effect in the library",
    "further": "effect beyond the contract's",
    "no_effect": "no effect",
    "withheld": "effect withheld",
    "alien": "foreign effect",
    "pair": "pair of effects",
    "several": "three to five effects",
}
PROTOCOL_NAMES = {"rich": "rich protocols", "other": "other protocols"}
REACHED = {True: "yes", False: "no", None: None}


def rig_name(rig: str) -> str:
    """Write a rig's name as words."""
    return rig.replace("_", " ")


def figure(value: float | None) -> str:
    """Write a number of a table."""
    return "–" if value is None else f"{value:.3f}"


def ends(estimate: Mapping[str, Any]) -> str:
    """Write an interval of a table."""
    return "–" if estimate["n"] == 0 else f"{estimate['low']:.3f} to {estimate['high']:.3f}"


def percent(share: float) -> str:
    """Write a share in a sentence; with a decimal where it is small."""
    return f"{100 * share:.1f} %" if 0 < share < 0.1 else f"{100 * share:.0f} %"


def interval(estimate: Mapping[str, Any]) -> str:
    """Write an interval in a sentence."""
    return f"{100 * estimate['low']:.0f} to {100 * estimate['high']:.0f} %"


def rows(titles: tuple[str, ...], alignment: str, cells: list[list[str]]) -> str:
    """Write a Markdown table; `alignment` has one of ``l`` and ``r`` a column."""
    sides = {"l": ":--", "r": "--:"}
    lines = [titles, tuple(sides[side] for side in alignment), *map(tuple, cells)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
