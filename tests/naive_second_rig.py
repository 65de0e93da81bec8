"""Plain answers that the second rig is held against, and the documents it is asked by."""

from __future__ import annotations

from typing import Any

import mpmath


def step_response(core: Any, t_s: float) -> float:
    """Invert G(s)/s numerically."""

    def transform(s: Any) -> Any:
        return core.b0 / (s * (s**core.alpha2 + core.a1 * s**core.alpha1 + core.a0))

    return float(mpmath.invertlaplace(transform, t_s, method="talbot"))


def document(**changes: Any) -> dict[str, Any]:
    """Make a case document: a short, quiet one unless told otherwise."""
    surroundings: dict[str, Any] = {
        "noise": {
            "colour": "exponential",
            "coloured_deg": 0.25,
            "correlation_s": 0.8,
            "white_deg": 0.05,
        },
        "converter": {"bits": 12},
        "scatter": {"gain": 0.01, "time_scale": 0.01, "rest_deg": 0.2},
        "fixture": {"error_deg": 0.2},
        "calibration": {
            "kind": "before_and_after",
            "dwell_s": 3.0,
            "angles": 7,
            "directions": 2,
        },
        "sampling": {"rate_hz": 50.0, "jitter": 0.05, "missing": 0.002, "damaged": 0.001},
        "pressure": {"measured": True, "resolution_kpa": 0.2, "lag_s": 0.002},
    }
    asked: dict[str, Any] = {
        "schema": "spa-fo/blind-case/1",
        "name": "case_0001",
        "seed": 1,
        "kind": "no_effect",
        "effects": [],
        "sizes": [],
        "protocol": {"name": "releases", "repeats": 2, "order": "interleaved"},
        "model": {"kind": "own", "off": 0.004},
        "surroundings": surroundings,
    }
    for key, value in changes.items():
        place = asked if key in asked else surroundings
        place[key] = {**place[key], **value} if isinstance(value, dict) else value
    return asked
