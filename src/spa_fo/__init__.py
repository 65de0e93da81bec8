"""Fractional-order identification of soft pneumatic actuators from raw serial logs.

The mathematical functions load on first use, so that importing the package stays quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spa_fo.fractional import mittag_leffler, simulate, step_response

__version__ = "0.2.0"

__all__ = ["__version__", "mittag_leffler", "simulate", "step_response"]


def __getattr__(name: str) -> Any:
    if name in ("mittag_leffler", "simulate", "step_response"):
        return getattr(importlib.import_module("spa_fo.fractional"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
