"""The page of a diagnosis that one zooms into: a single HTML file that asks for nothing else.

It carries plotly's whole JavaScript (4.8 MB; the package ships no smaller bundle), and of every
trace what a screen shows.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from plotly.offline import get_plotlyjs

from spa_fo.gap.diagnosis import Diagnosis
from spa_fo.report.causes import percent
from spa_fo.report.effect_words import MAP_WORDS, STAGE_WORDS, bin_words, phrase
from spa_fo.report.glossary import listed, meanings
from spa_fo.report.headline import opening
from spa_fo.report.html_page import STYLE, html_of
from spa_fo.report.interactive_figures import figures
from spa_fo.report.law_figure import law_table
from spa_fo.report.sections import (
    bullets,
    cause_table,
    evidence_part,
    findings_part,
    next_steps,
    parameter_tables,
    shrink_words,
)
from spa_fo.report.share_maps import share_maps, stage_note
from spa_fo.report.verdict_words import judged

_HERE = Path(__file__).parent
_LADDER = (
    "An explanation has to beat the refitted plain model; the noise floor is the scatter of "
    "repeated trials, and no model can stay below it."
)


def interactive_page(diagnosis: Diagnosis, laws_png: bytes | None = None) -> str:
    """Lay a diagnosis out as a page.

    Parameters
    ----------
    diagnosis : Diagnosis
        Of any kind.
    laws_png : bytes, optional
        The picture of its laws, where it has any.

    Returns
    -------
    str
        HTML.
    """
    drawn = figures(diagnosis)
    parts = [f"{json.dumps(title)}: {figure.to_json()}" for title, figure in drawn.items()]
    # No text of a campaign may end the script.
    curves = f"{{{', '.join(parts)}}}".replace("<", "\\u003c")
    title = html.escape(f"Diagnosis of {diagnosis.campaign}")
    style = f"{STYLE}{_asset('diagnosis_page.css')}"
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{title}</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f"{''.join(_body(diagnosis, list(drawn), laws_png))}"
        f'<script type="application/json" id="figures">{curves}</script>\n'
        f"<script>{get_plotlyjs()}</script>\n"
        f"<script>{_asset('diagnosis_page.js')}</script>\n</body>\n</html>\n"
    )


def _asset(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def _body(diagnosis: Diagnosis, titles: Sequence[str], laws_png: bytes | None) -> Iterator[str]:
    yield from _opening(diagnosis, titles)
    yield from _section("What to do next", [*bullets(next_steps(diagnosis))])
    yield _headed("How far it closes", _ladder(diagnosis))
    yield from _section(
        "Which cause", [cause_table(diagnosis), f"Held out: {diagnosis.held_out_on}."]
    )
    if diagnosis.laws:
        said = html_of("\n\n".join(law_table(diagnosis)))
        yield _headed("The missing law", f"{said}{_picture(laws_png)}")
    where = list(_where(diagnosis))
    if where:
        yield _headed("Where the gap is", f'<div class="maps">{"".join(where)}</div>')
    words = "".join(
        f"<dt>{html.escape(name)}</dt><dd>{html.escape(means)}</dd>\n"
        for name, means in meanings(listed(diagnosis))
    )
    tables = html_of("\n\n".join(parameter_tables(diagnosis)))
    if words:
        yield _headed("The effects and their parameters", f"<dl>{words}</dl>\n{tables}{_TYPICAL}")
    yield from _section("Findings", bullets(findings_part(diagnosis)))
    yield from _section("Evidence", list(evidence_part(diagnosis)))


_TYPICAL = (
    '<p class="note">Typical size: the prior, which holds two thirds of all actuators. '
    "Intervals are conditional on the explanation.</p>\n"
)


def _opening(diagnosis: Diagnosis, titles: Sequence[str]) -> Iterator[str]:
    yield f"<h1>{html.escape(diagnosis.campaign)}: why model and actuator disagree</h1>\n"
    left_out = ", ".join(phrase((each,)) for each in diagnosis.excluded)
    note = f"; taken out of the library: {left_out}" if left_out else ""
    yield (
        f'<p><span class="data {diagnosis.provenance}">{diagnosis.provenance} data</span> '
        f"{html.escape(diagnosis.material)}{html.escape(note)}</p>\n"
    )
    for sentence in opening(diagnosis.to_dict()):
        yield f'<p class="opening">{html.escape(sentence)}</p>\n'
    options = "".join(f"<option>{html.escape(title)}</option>" for title in titles)
    yield f'<p><label>Experiment <select id="experiment">{options}</select></label> '
    yield (
        '<span class="note">first the one with the largest residual; drag to zoom, double '
        "click to zoom out, click on a name to hide or show it</span></p>\n"
        '<div id="picture"></div>\n'
    )


def _picture(png: bytes | None) -> str:
    """Put a picture into the page itself."""
    if png is None:
        return ""
    data = base64.b64encode(png).decode("ascii")
    return f'<p><img alt="free-form laws with bands" src="data:image/png;base64,{data}"></p>'


def _headed(title: str, body: str) -> str:
    return f"<h2>{html.escape(title)}</h2>\n{body}\n"


def _section(title: str, paragraphs: Sequence[str]) -> Iterator[str]:
    yield _headed(title, html_of("\n\n".join(paragraphs)))


def _ladder(diagnosis: Diagnosis) -> str:
    """Draw the error from the plain model down to the noise floor."""
    shrink, gap = diagnosis.shrink, diagnosis.gap
    if shrink is None:
        on, floor = "all trials", gap.noise_floor_deg
        rungs = {"plain model": ("plain", gap.rmse_deg)}
    else:
        on, floor = judged(diagnosis), shrink.noise_floor_deg
        rungs = {
            "plain model": ("plain", shrink.before_rmse_deg),
            "plain model, refitted": ("refit", shrink.refit_only_rmse_deg),
            "augmented model": ("explained", shrink.after_rmse_deg),
        }
    rungs["noise floor"] = ("floor", floor)
    said = html_of(shrink_words(diagnosis))
    note = f"RMS error on {on}, in degrees. {_LADDER}"
    return (
        f"{said}\n"
        f"{_bars({name: (kind, size, f'{size:.2f}°') for name, (kind, size) in rungs.items()})}"
        f'<p class="note">{note}</p>'
    )


def _where(diagnosis: Diagnosis) -> Iterator[str]:
    """Draw the shares of the gap, a map each."""
    note = stage_note(diagnosis.where)
    said = f'<p class="note">{html.escape(note)}</p>' if note else ""
    if said and diagnosis.where.stage is None:
        yield f"<div><h3>by {MAP_WORDS['stage']}</h3>{said}</div>\n"
    for name, shares in share_maps(diagnosis.where).items():
        bars = {
            STAGE_WORDS.get(bin_name, bin_words(bin_name)): ("plain", share, percent(share))
            for bin_name, share in sorted(shares.items(), key=lambda item: -item[1])
        }
        beside = said if name == "stage" else ""
        yield f"<div><h3>by {MAP_WORDS[name]}</h3>{_bars(bars)}{beside}</div>\n"


def _bars(rows: Mapping[str, tuple[str, float, str]]) -> str:
    """Draw bars: a look, a size and its words by name."""
    longest = max(size for _, size, _ in rows.values()) or 1.0
    cells = "".join(
        f'<span>{html.escape(name)}</span><span class="bar {look}">'
        f'<i style="width: {75.0 * max(size, 0.0) / longest:.1f}%"></i>{words}</span>\n'
        for name, (look, size, words) in rows.items()
    )
    return f'<div class="bars">\n{cells}</div>\n'
