"""The maps of where a gap lies, and what is said where a map is not known."""

from __future__ import annotations

from collections.abc import Mapping

from spa_fo.gap.diagnosis import Where
from spa_fo.report.effect_words import MAP_WORDS


def share_maps(where: Where) -> dict[str, Mapping[str, float]]:
    """Return the maps that hold a share, by name; the others have nothing to show."""
    maps = {name: getattr(where, name) for name in MAP_WORDS}
    return {name: shares for name, shares in maps.items() if shares and any(shares.values())}


def not_known(where: Where) -> str | None:
    """Say that the stage is not known, and why; None where it is known."""
    if where.stage is not None:
        return None
    return f"not known: {where.not_known}" if where.not_known else "not known"
