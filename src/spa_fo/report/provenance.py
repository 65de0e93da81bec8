"""The line that stands on every figure and table: where its data come from."""

from __future__ import annotations

from collections.abc import Sequence

from spa_fo.rig import Provenance


def provenance_line(provenance: Provenance) -> str:
    """Say whether data are measured or synthetic, and from where.

    Parameters
    ----------
    provenance : Provenance
        Of a campaign.

    Returns
    -------
    str
        One line: kind, source and note.
    """
    parts = (f"{provenance.kind} data", provenance.source, provenance.note)
    return "; ".join(part for part in parts if part)


def joint_provenance_line(labels: Sequence[str], lines: Sequence[str]) -> str:
    """Join the lines of several materials: once where they agree, by name where they do not."""
    if len(set(lines)) == 1:
        return lines[0]
    return " | ".join(f"{label}: {line}" for label, line in zip(labels, lines, strict=True))
