"""What was read, what was left out, and why: one entry a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

_FIRST = 5  # line numbers kept per reason


@dataclass(frozen=True)
class Damage:
    """How many lines were left out for one reason, and the numbers (1-based) of the first ones."""

    count: int
    first_lines: tuple[int, ...]


@dataclass(frozen=True)
class FileReport:
    """The account of one log: valid + damaged + duplicates + comments + banners == lines.

    `gaps` are places where seq jumps, `missing_samples` what it jumped over (damaged lines
    included); `pauses` places where the clock ran on without samples; `resets` restarts of the
    board, of which `resets_without_banner` were seen by the clock alone; `outside_calibration`
    valid rows whose flex count lies beyond the calibrated range.
    """

    file: str
    lines: int
    valid: int
    damaged: Mapping[str, Damage]
    duplicates: int = 0
    comments: int = 0
    banners: int = 0
    gaps: int = 0
    missing_samples: int = 0
    pauses: int = 0
    wraps: int = 0
    resets: int = 0
    resets_without_banner: int = 0
    outside_calibration: int = 0
    notes: tuple[str, ...] = ()

    @property
    def damaged_lines(self) -> int:
        """Damaged lines of all reasons together."""
        return sum(item.count for item in self.damaged.values())

    def why(self) -> str:
        """Say the reasons in words, the most frequent first: ``3 checksum (lines 4, 7, 9)``."""
        items = sorted(self.damaged.items(), key=lambda item: (-item[1].count, item[0]))
        return ", ".join(f"{item.count} {reason} ({_lines(item)})" for reason, item in items)


@dataclass(frozen=True)
class ParseReport:
    """The account of a campaign, a `FileReport` a file, and warnings that concern several."""

    campaign: str
    files: tuple[FileReport, ...]
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain dicts, lists and numbers, ready for JSON."""
        files = []
        for file in self.files:
            entry = asdict(file)
            entry["damaged"] = {
                reason: {"count": item.count, "first_lines": list(item.first_lines)}
                for reason, item in sorted(file.damaged.items())
            }
            entry["notes"] = list(file.notes)
            files.append(entry)
        return {"campaign": self.campaign, "files": files, "warnings": list(self.warnings)}

    def to_markdown(self) -> str:
        """Return a table, one line a file, followed by notes and warnings."""
        rows = [_cells(file) for file in self.files]
        head = list(rows[0]) if rows else ["file"]
        rule = ["---" if name in ("file", "damaged") else "---:" for name in head]
        body = [[cell.replace("|", "\\|") for cell in row.values()] for row in rows]
        table = [f"| {' | '.join(cells)} |" for cells in (head, rule, *body)]
        notes = [f"- {file.file}: {note}" for file in self.files for note in file.notes]
        notes += [f"- {warning}" for warning in self.warnings]
        return "\n".join([*table, *([""] if notes else []), *notes]) + "\n"


def _cells(file: FileReport) -> dict[str, str]:
    return {
        "file": file.file,
        "lines": f"{file.lines}",
        "valid": f"{file.valid}",
        "damaged": file.why() or "none",
        "gaps (samples)": f"{file.gaps} ({file.missing_samples})",
        "duplicates": f"{file.duplicates}",
        "pauses": f"{file.pauses}",
        "wraps": f"{file.wraps}",
        "resets (without banner)": f"{file.resets} ({file.resets_without_banner})",
        "outside calibration": f"{file.outside_calibration}",
    }


@dataclass
class Tally:
    """Collects damage while a file is read; the only mutable thing here."""

    lines_by_reason: dict[str, list[int]] = field(default_factory=dict)

    def add(self, reason: str, line: int) -> None:
        """Count `line` (1-based) as damaged by `reason`."""
        self.lines_by_reason.setdefault(reason, []).append(line)

    def damage(self) -> dict[str, Damage]:
        """Return the counts so far."""
        return {
            reason: Damage(len(lines), tuple(sorted(lines)[:_FIRST]))
            for reason, lines in self.lines_by_reason.items()
        }


def _lines(item: Damage) -> str:
    more = ", ..." if item.count > len(item.first_lines) else ""
    word = "line" if item.count == 1 else "lines"
    return f"{word} {', '.join(map(str, item.first_lines))}{more}"
