"""Case documents of the blind benchmark (src/blind/CASE.md) for tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spa_fo.rig import CampaignData, read_campaign, read_trials

QUIET = {
    "noise": {
        "colour": "exponential",
        "coloured_deg": 0.05,
        "correlation_s": 0.5,
        "white_deg": 0.2,
    },
    "converter": {"bits": 12},
    "scatter": {"gain": 0.005, "time_scale": 0.005, "rest_deg": 0.15},
    "fixture": {"error_deg": 0.0},
    "calibration": {"kind": "before", "dwell_s": 3.0, "angles": 7, "directions": 2},
    "sampling": {"rate_hz": 50.0, "jitter": 0.0, "missing": 0.0, "damaged": 0.0005},
    "pressure": {"measured": True, "resolution_kpa": 0.2, "lag_s": 0.001},
}


def document(
    *effects: str, size: float = 4.0, kind: str | None = None, seed: int = 11, **changes: Any
) -> dict[str, Any]:
    """Ask for a small case in friendly surroundings.

    `changes` are of the document's own keys; those of ``surroundings`` may be given beside them,
    each merged into what stands there.
    """
    plain: dict[str, Any] = {
        "schema": "spa-fo/blind-case/1",
        "name": "case_0001",
        "seed": seed,
        "kind": kind or ("no_effect", "closed", "pair")[len(effects)],
        "effects": list(effects),
        "sizes": [size] * len(effects),
        "protocol": {"name": "up_steps", "repeats": 2, "order": "interleaved"},
        "model": {"kind": "off", "off": 0.0},
        "surroundings": {name: dict(values) for name, values in QUIET.items()},
    }
    for key, value in changes.items():
        home = plain["surroundings"] if key in QUIET else plain
        home[key] = {**home[key], **value} if isinstance(value, Mapping) else value
    return plain


def read(folder: Path) -> CampaignData:
    """Read a campaign as a diagnosis does."""
    return read_trials(read_campaign(folder))
