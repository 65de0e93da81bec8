"""Figures by name, with the provenance of their data on them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from spa_fo.errors import BadInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def chosen(draw: Mapping[str, Callable[[], Figure]], name: str, provenance: str) -> Figure:
    """Draw the figure of that name and write the provenance below it.

    Raises
    ------
    BadInput
        There is none of that name.
    """
    if name not in draw:
        raise BadInput("plot", f"expected one of {', '.join(draw)}, found '{name}'")
    return marked(draw[name](), provenance)


def marked(figure: Figure, provenance: str) -> Figure:
    """Write the provenance below a figure, as `spa_fo.report.style.save_figure` does."""
    from spa_fo.report.style import mark_provenance

    mark_provenance(figure, provenance)
    _let_notebooks_draw()
    return figure


def stem_of(path: Path | str) -> Path:
    """Return a path without .png or .pdf, since both are written."""
    path = Path(path)
    return path.with_suffix("") if path.suffix in (".png", ".pdf") else path


def _let_notebooks_draw() -> None:
    """Tell IPython how to show a figure that pyplot does not know of."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    if shell is not None:
        from IPython.core.pylabtools import select_figure_formats

        select_figure_formats(shell, {"png"})  # type: ignore[no-untyped-call]
