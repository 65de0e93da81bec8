"""The maps of where a gap lies, and what is said where a map is not known."""

from __future__ import annotations

from collections.abc import Mapping

from spa_fo.gap.diagnosis import Where
from spa_fo.report.effect_words import MAP_WORDS


def share_maps(where: Where) -> dict[str, Mapping[str, float]]:
    """Return the maps that hold a share, by name; the others have nothing to show."""
    maps = {name: getattr(where, name) for name in MAP_WORDS}
    return {name: shares for name, shares in maps.items() if shares and any(shares.values())}


def stage_note(where: Where) -> str | None:
    """Say why the stage is not known, or what is assumed of it; None where it is known."""
    if where.stage is not None:
        return where.assumed
    return f"not known: {where.not_known}" if where.not_known else "not known"
