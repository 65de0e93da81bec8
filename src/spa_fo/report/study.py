"""Many campaigns in one table, and what each opens with; those of the largest gap first."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterator, Mapping, Sequence
from math import sqrt
from typing import Any

import pandas as pd

from spa_fo.report.effect_words import phrase, words_of
from spa_fo.report.headline import first_step, opening, probability
from spa_fo.report.html_page import html_of
from spa_fo.report.published import (
    MeasuredMaterial,
    PublishedMaterial,
    identified,
    joint_provenance,
)
from spa_fo.report.tables import Table, markdown_body

MOST_OPENINGS = 6
"""Campaigns that open with a picture each; of more, those of the largest gap, below the table."""
PAGE = "diagnosis/diagnosis.html"
_VERDICTS = {"no_gap": "no gap", "cause": "cause", "ambiguous": "ambiguous", "unknown": "unknown"}
_ORDER = "the largest gap above the noise floor first"


def worst_first(materials: Sequence[PublishedMaterial]) -> list[PublishedMaterial]:
    """Sort by the error of the plain model above the noise floor, largest first."""
    return sorted(materials, key=lambda material: -_excess(material.diagnosis["gap"]))


def campaign_table(materials: Sequence[PublishedMaterial]) -> Table:
    """Make a table of all diagnoses, one a row, the largest gap first.

    Parameters
    ----------
    materials : sequence of PublishedMaterial
        In any order.
    """
    return Table(
        pd.DataFrame([_row(material) for material in worst_first(materials)]),
        f"Every campaign and why its model is wrong, {_ORDER}",
        joint_provenance(materials),
        {
            **dict.fromkeys(("RMSE (°)", "noise floor (°)"), ".2f"),
            **dict.fromkeys(("probability", "gap closed"), ".2f"),
        },
    )


def openings_html(materials: Sequence[MeasuredMaterial]) -> str:
    """Write what the report begins with: two sentences and a picture each; of many, a table first.

    A material that is only compared has its two sentences behind those.

    Parameters
    ----------
    materials : sequence of PublishedMaterial
        In the order of config.yaml.

    Returns
    -------
    str
        HTML, the pictures in it.
    """
    compared = "".join(_change_html(*each) for each in _only_compared(materials))
    return _diagnosed_html(identified(materials)) + compared


def _diagnosed_html(materials: Sequence[PublishedMaterial]) -> str:
    if len(materials) <= MOST_OPENINGS:
        return "".join(_opening_html(material) for material in materials)
    table = campaign_table(materials)
    shown = worst_first(materials)[:MOST_OPENINGS]
    return (
        f"<p><b>{html.escape(table.caption)}</b></p>\n{html_of(markdown_body(table))}\n"
        f"<p>The {len(shown)} of the largest gap:</p>\n"
        f"{''.join(_opening_html(material) for material in shown)}"
    )


def openings_markdown(materials: Sequence[MeasuredMaterial]) -> Iterator[str]:
    """Write the same as Markdown, beside the results."""
    yield "## In short"
    yield from _diagnosed_markdown(identified(materials))
    for material, answer in _only_compared(materials):
        yield f"**{material.label}** ({material.campaign.provenance.kind} data). {answer}"


def _only_compared(
    materials: Sequence[MeasuredMaterial],
) -> Iterator[tuple[MeasuredMaterial, str]]:
    """Yield the materials that were compared and not diagnosed, with what changed."""
    for material in materials:
        if material.changed is not None and not isinstance(material, PublishedMaterial):
            yield material, " ".join(material.changed["answer"])


def _diagnosed_markdown(materials: Sequence[PublishedMaterial]) -> Iterator[str]:
    if len(materials) > MOST_OPENINGS:
        yield f"Of {len(materials)} campaigns, {_ORDER}; all of them: `tables/campaigns.csv`."
    shown = materials if len(materials) <= MOST_OPENINGS else worst_first(materials)
    for material in shown[:MOST_OPENINGS]:
        kind = material.campaign.provenance.kind
        yield f"**{material.label}** ({kind} data). {' '.join(opening(material.diagnosis))}"
        yield f"![{material.label}]({material.name}/diagnosis/opening.png)"
        yield f"Interactive: [{PAGE}]({material.name}/{PAGE})."


def _change_html(material: MeasuredMaterial, answer: str) -> str:
    return (
        f'<div class="opening"><p><b>{html.escape(material.label)}</b> '
        f"({material.campaign.provenance.kind} data). {html.escape(answer)}</p></div>\n"
    )


def _opening_html(material: PublishedMaterial) -> str:
    sentences = " ".join(html.escape(sentence) for sentence in opening(material.diagnosis))
    label, place = html.escape(material.label), html.escape(f"{material.name}/{PAGE}")
    picture = base64.b64encode(material.opening_png).decode()
    return (
        f'<div class="opening"><p><b>{label}</b> ({material.campaign.provenance.kind} data). '
        f"{sentences}</p>\n"
        f'<img alt="{label}: measured, the models, and their residuals" '
        f'src="data:image/png;base64,{picture}">\n'
        f'<p>Interactive, beside this report: <a href="{place}">{place}</a></p></div>\n'
    )


def _excess(gap: Mapping[str, Any]) -> float:
    return sqrt(max(gap["rmse_deg"] ** 2 - gap["noise_floor_deg"] ** 2, 0.0))


def _row(material: PublishedMaterial) -> dict[str, object]:
    document = material.diagnosis
    verdict, shrink = document["verdict"], document["shrink"]
    kind, sets = verdict["kind"], verdict["sets"]
    judged = {"no_gap": ["none"], "unknown": ["unknown"]}.get(kind) or sets[0]
    return {
        "campaign": material.name,
        "RMSE (°)": document["gap"]["rmse_deg"],
        "noise floor (°)": document["gap"]["noise_floor_deg"],
        "verdict": _VERDICTS[kind],
        "cause": " or ".join(phrase(ids, " + ") for ids in sets) or "–",
        "probability": probability(document, judged),
        "gap closed": None if shrink is None else shrink["fraction_closed"],
        "next step": _next_step(document),
    }


def _next_step(document: Mapping[str, Any]) -> str:
    kind, sets = document["verdict"]["kind"], document["verdict"]["sets"]
    if kind == "no_gap":
        return "use the model as it is"
    if kind == "cause":
        return words_of(sets[0][0]).remedy
    return first_step(document)
