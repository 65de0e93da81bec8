"""One style for every figure, and the only place that saves one."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from textwrap import fill
from typing import TypeVar, cast

from matplotlib import style
from matplotlib.figure import Figure

from spa_fo.atomic import replacing

ONE_COLUMN_IN = 3.5
TWO_COLUMNS_IN = 7.16

# Okabe and Ito's palette, safe for the colour-blind (https://jfly.uni-koeln.de/color/).
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY = "#999999"

_STYLE = Path(__file__).with_name("spa_fo.mplstyle")
_CHARACTERS_AN_INCH = 21  # of the line that says where data come from


Draw = TypeVar("Draw", bound=Callable[..., Figure])


def styled(draw: Draw) -> Draw:
    """Make a function that draws a figure do so in the project's style."""

    @functools.wraps(draw)
    def draw_in_style(*arguments: object, **options: object) -> Figure:
        with style.context(_STYLE):
            return draw(*arguments, **options)

    return cast("Draw", draw_in_style)


def new_figure(width_in: float, height_in: float, mosaic: Sequence[Sequence[str]]) -> Figure:
    """Make a figure with its axes named by `mosaic`; for functions that are `styled`.

    Parameters
    ----------
    width_in, height_in : float
        Size in inches; `ONE_COLUMN_IN` or `TWO_COLUMNS_IN` wide.
    mosaic : sequence of sequences of str
        As for `matplotlib.figure.Figure.subplot_mosaic`; the axes carry the names as labels.

    Returns
    -------
    matplotlib.figure.Figure
        Without pyplot, so that nothing global is touched.
    """
    figure = Figure(figsize=(width_in, height_in))
    for label, axes in figure.subplot_mosaic([list(row) for row in mosaic]).items():
        axes.set_label(label)
    return figure


def mark_provenance(figure: Figure, provenance: str) -> None:
    """Write the provenance of its data below a figure."""
    lines = fill(provenance, int(_CHARACTERS_AN_INCH * figure.get_figwidth()))
    figure.supxlabel(lines, fontsize=6, color="#555555", x=0.01, ha="left")


def save_figure(figure: Figure, stem: Path | str, provenance: str) -> tuple[Path, Path]:
    """Write ``stem.pdf`` and ``stem.png`` with the provenance below the picture.

    The same figure gives the same bytes: no dates, no program versions in the files.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    mark_provenance(figure, provenance)
    with style.context(_STYLE):
        paths = Path(f"{stem}.pdf"), Path(f"{stem}.png")
        for path, metadata in zip(
            paths, ({"CreationDate": None, "Producer": None}, {"Software": None}), strict=True
        ):
            with replacing(path) as temporary:
                figure.savefig(temporary, metadata=metadata)
            # Laid out once: the same picture in both files, and in less time.
            figure.set_layout_engine("none")
    return paths
