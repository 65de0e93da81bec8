"""Fractional-order identification of soft pneumatic actuators from raw serial logs.

`Campaign`, `Model`, `FitResult`, `Diagnosis`, `Comparison` load, fit, predict, diagnose, compare,
export, plot and print themselves; `step_response`, `simulate` and `mittag_leffler` are the
mathematics. All of them load on first use, so that importing the package stays quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from spa_fo.errors import BadInput

if TYPE_CHECKING:
    from spa_fo.api import Campaign, Comparison, Diagnosis, FitResult, Model
    from spa_fo.fractional import mittag_leffler, simulate, step_response

__version__ = "0.2.0"

__all__ = [
    "BadInput",
    "Campaign",
    "Comparison",
    "Diagnosis",
    "FitResult",
    "Model",
    "__version__",
    "mittag_leffler",
    "simulate",
    "step_response",
]

_HOMES = {
    "Campaign": "spa_fo.api",
    "Comparison": "spa_fo.api",
    "Diagnosis": "spa_fo.api",
    "FitResult": "spa_fo.api",
    "Model": "spa_fo.api",
    "mittag_leffler": "spa_fo.fractional",
    "simulate": "spa_fo.fractional",
    "step_response": "spa_fo.fractional",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
