"""The package's objects for a Python session: load, fit, predict, diagnose, export, plot, print.

Each is frozen, prints itself as text and, in a notebook, as HTML, and draws itself as matplotlib
figures. The commands are made of them. Whatever is wrong with a file raises
`spa_fo.errors.BadInput`, one clear line. Each loads on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spa_fo.api.campaign import Campaign
    from spa_fo.api.comparison import Comparison
    from spa_fo.api.diagnosis import Diagnosis
    from spa_fo.api.exported import ExportedModel
    from spa_fo.api.fit import FitResult
    from spa_fo.api.model import Model
    from spa_fo.api.plan import Plan
    from spa_fo.api.prediction import Prediction

__all__ = [
    "Campaign",
    "Comparison",
    "Diagnosis",
    "ExportedModel",
    "FitResult",
    "Model",
    "Plan",
    "Prediction",
]

_HOMES = {
    "Campaign": "campaign",
    "Comparison": "comparison",
    "Diagnosis": "diagnosis",
    "ExportedModel": "exported",
    "FitResult": "fit",
    "Model": "model",
    "Plan": "plan",
    "Prediction": "prediction",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"spa_fo.api.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
