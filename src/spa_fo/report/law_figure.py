"""The figure and the words of the laws that have no name."""

from __future__ import annotations

from textwrap import fill

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spa_fo.gap.diagnosis import Diagnosis, LawFound
from spa_fo.gap.places.resemblance import likeness_words
from spa_fo.plant.law import PLACES
from spa_fo.report.causes import percent
from spa_fo.report.effect_words import STAGE_WORDS, phrase
from spa_fo.report.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    TWO_COLUMNS_IN,
    VERMILION,
    new_figure,
    styled,
)

_MOST = 3  # laws that are drawn
_TITLE_WIDTH = 26  # characters that a panel has room for
_LOOKS = ((ORANGE, "--"), (BLUE, ":"), (BLACK, "-."))


@styled
def laws_figure(diagnosis: Diagnosis) -> Figure:
    """Draw the most probable laws over what was visited, each with a band that holds 95 %.

    Parameters
    ----------
    diagnosis : Diagnosis
        With laws.

    Returns
    -------
    matplotlib.figure.Figure
    """
    drawn = diagnosis.laws[:_MOST]
    figure = new_figure(TWO_COLUMNS_IN, 2.6, [[law.place for law in drawn]])
    for axes, law in zip(figure.axes, drawn, strict=True):
        _draw(axes, law)
    return figure


def _draw(axes: Axes, law: LawFound) -> None:
    place = PLACES[law.place]
    axes.axhline(0.0, color=BLACK, linestyle="-", linewidth=0.5)
    axes.fill_between(law.over, law.low, law.high, color=GREY, alpha=0.35, linewidth=0)
    marker = "o" if law.over.size < 12 else ""
    axes.plot(
        law.over, law.value, color=VERMILION, linestyle="-", marker=marker, label="free-form law"
    )
    if law.place == "relaxation":
        axes.set_xscale("log")
    else:
        for like, (colour, line) in zip(law.resembles, _LOOKS, strict=False):
            label = likeness_words(like, place)
            axes.plot(law.over, like.values, color=colour, linestyle=line, label=label)
    axes.set_xlabel(_unit(place.over, place.over_unit))
    axes.set_ylabel(_unit(place.gives, place.unit))
    words = fill(place.words, _TITLE_WIDTH)
    axes.set_title(f"{words}\n{percent(law.probability)} probable", loc="left")
    axes.legend(loc="best", fontsize=6)


def _unit(words: str, unit: str) -> str:
    return f"{words} ({unit})" if unit else words


def law_table(diagnosis: Diagnosis) -> list[str]:
    """Lay the laws out in a table, with what it means; nothing where there are none."""
    if not diagnosis.laws:
        return []
    rows = [
        (
            PLACES[law.place].words,
            STAGE_WORDS.get(law.stage, law.stage),
            percent(law.probability),
            percent(max(law.fraction_closed, 0.0)),
            likenesses_words(law),
        )
        for law in diagnosis.laws
    ]
    head = ("missing law", "stage", "probability", "gap closed, held out", "resembles")
    lines = [" | ".join(head), ":--|:--|--:|--:|:--", *(" | ".join(row) for row in rows)]
    table = "\n".join(f"|{line}|" if line.startswith(":") else f"| {line} |" for line in lines)
    carried = [PLACES[law.place].words for law in diagnosis.laws if law.carried]
    beside = diagnosis.laws[0].beside
    by = f" beside {phrase(beside)}" if beside else ""
    return [
        "No effect of the library explains the gap, so a smooth free-form law was fitted at every "
        f"place of the chain{by}. Its linear part belongs to gain and coefficients and is taken "
        "out. Probabilities are among the places, for a single law.",
        table,
        *(f"The augmented model carries the law of **{words}**." for words in carried),
    ]


def likenesses_words(law: LawFound) -> str:
    """Name the forms that a law resembles, with how much of its curve each gives."""
    place = PLACES[law.place]
    said = [f"{likeness_words(like, place)}, {percent(like.explains)}" for like in law.resembles]
    return "; ".join(said) or "none of the forms"
