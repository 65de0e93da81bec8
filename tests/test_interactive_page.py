"""The page of a diagnosis to zoom into: what it says, that it stands alone, and in a browser."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plotly import graph_objects as go

from browser import CHROMIUM, DESKTOP, PHONE, Page, address, browser
from pages import Addresses, words
from spa_fo.gap.diagnosis import Cause, Diagnosis, Gap, Traces
from spa_fo.report.causes import likelihood
from spa_fo.report.experiments import worst
from spa_fo.report.headline import opening
from spa_fo.report.interactive_figures import MOST_EXPERIMENTS, figure_of, figures
from spa_fo.report.interactive_page import interactive_page
from spa_fo.report.verdict_words import verdict
from test_diagnosis_report import AMBIGUOUS, EVERY, NO_GAP, UNEXPLAINED, diagnosis, traces

MEGABYTE = 1e6


def long_traces(experiments: int, samples: int) -> Traces:
    """Many experiments, one trial each; the last is missed most, with a spike in it."""
    time = np.linspace(0.0, 60.0, samples)
    names = tuple(f"step_{place}" for place in range(experiments))
    grows = np.repeat(np.linspace(1.0, 2.0, experiments), samples)
    plain = np.tile(20.0 * np.sin(time), experiments)
    measured = plain + grows
    measured[-samples // 3] += 9.0
    command = np.full(plain.size, 30.0)
    return replace(
        traces(pressure=False, calibration=False),
        **{"experiment": names, "label": names, "held_out": np.zeros(experiments, dtype=bool)},
        **{"trial": np.repeat(np.arange(experiments), samples), "command_kpa": command},
        **{"time_s": np.tile(time, experiments), "measured_deg": measured, "plain_deg": plain},
        **{"explained_deg": measured - 0.1, "refit_deg": plain},
    )


def text_of(page: str) -> str:
    return words(re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL))


# --- two sentences ------------------------------------------------------------------------------


@pytest.mark.parametrize("each", EVERY, ids=lambda d: f"{d.kind}-{len(d.sets)}")
def test_the_opening_is_two_sentences_without_names_of_the_program(each: Diagnosis) -> None:
    for sentence in opening(each.to_dict()):
        assert len(re.findall(r"\.(?:\s|$)", sentence)) == 1
        assert "_" not in sentence
        assert sentence[0].isupper()


def test_the_opening_says_what_is_wrong_how_sure_and_what_it_brings() -> None:
    wrong, following = opening(diagnosis().to_dict())
    assert wrong == (
        "The RMS error of the model is 2.14°, 4.3 times what repeated trials differ by (0.50°), "
        "because of creep of the material (likely, 83 %): the angle keeps growing slowly under "
        "held load and comes back at rest."
    )
    assert "from 2.10° to 0.62°, which closes 95 % of the gap; what to do: keep it" in following


def test_the_opening_of_an_open_question_names_the_next_step() -> None:
    wrong, following = opening(AMBIGUOUS.to_dict())
    assert "creep of the material (about as likely as not, 51 %) or creep of the sensor" in wrong
    assert following.endswith("next, calibrate with dwells of 60 s.")
    assert "Nothing is explained so far" in opening(UNEXPLAINED.to_dict())[1]
    assert "to look closer, record a long hold" in opening(NO_GAP.to_dict())[1]


def test_an_open_question_names_what_is_in_all_of_its_sets_once() -> None:
    sets = (("creep", "line_lag"), ("creep", "line_lag", "sensor_slip"), ("creep", "sensor_slip"))
    causes = tuple(Cause(ids, p, {}, {}) for ids, p in zip(sets, (0.5, 0.3, 0.2), strict=True))
    wrong = opening(replace(AMBIGUOUS, causes=causes, sets=sets).to_dict())[0]
    assert wrong.endswith(
        "creep of the material and pneumatic lag of the line together (about as likely as not, "
        "50 %), the same with slip of the sensor (30 %) or creep of the material and slip of the "
        "sensor together (20 %)."
    )


def test_a_floor_without_repeats_is_not_said_to_be_of_repeats() -> None:
    alone = replace(UNEXPLAINED, gap=replace(UNEXPLAINED.gap, repeats=False))
    assert "what repeated trials would be expected to differ by" in opening(alone.to_dict())[0]
    assert "would be expected to differ by 0.50°" in verdict(alone)
    assert "what repeated trials differ by" in opening(UNEXPLAINED.to_dict())[0]
    assert "differ by 0.50°" in verdict(UNEXPLAINED)


def test_a_gap_below_the_scatter_is_said_to_come_every_time() -> None:
    wrong, _ = opening(diagnosis(gap=Gap(0.86, 1.63, True, 0.03)).to_dict())
    assert "0.86°, the same in every trial, though repeated trials differ by 1.63°" in wrong


@pytest.mark.parametrize(
    ("probability", "said"),
    [(1.0, "virtually certain"), (0.9, "very likely"), (0.5, "about as likely as not"), (0, "exc")],
)
def test_probabilities_have_words(probability: float, said: str) -> None:
    assert likelihood(probability).startswith(said)


# --- figures ------------------------------------------------------------------------------------


def curve(figure: go.Figure, name: str) -> go.Scatter:
    return next(trace for trace in figure.data if trace.name == name)


def test_the_experiment_of_the_largest_gap_comes_first() -> None:
    many = diagnosis(traces=long_traces(4, 50))
    assert list(figures(many)) == ["step 3", "step 0", "step 1", "step 2"]


def test_a_figure_holds_the_curves_of_the_trial_that_is_shown() -> None:
    given = diagnosis()
    e = worst(given.traces)
    own = given.traces.trial == e.shown
    figure = figure_of(given, e)
    for name, values in (
        ("measured", given.traces.measured_deg),
        ("plain model", given.traces.plain_deg),
        ("augmented model", given.traces.explained_deg),
        ("command", given.traces.command_kpa),
    ):
        assert np.asarray(curve(figure, name).y) == pytest.approx(values[own], rel=1e-6)
    missed = given.traces.measured_deg - given.traces.plain_deg
    shown = np.asarray(curve(figure, "residual of the plain model").y)
    assert shown == pytest.approx(missed[own], abs=1e-5)
    (band,) = figure.layout.shapes
    assert (band.y0, band.y1) == (-0.5, 0.5)
    assert "synthetic data; bench" in figure.layout.xaxis.title.text


def test_without_an_explanation_only_the_plain_model_is_drawn() -> None:
    names = {trace.name for trace in figure_of(NO_GAP, worst(NO_GAP.traces)).data}
    assert not any("augmented" in name for name in names)


def test_thinned_traces_keep_their_spikes_and_their_ends() -> None:
    long = diagnosis(traces=long_traces(1, 5000))
    figure = figure_of(long, worst(long.traces), points=100)
    missed = curve(figure, "residual of the plain model")
    assert len(missed.x) <= 100
    assert max(missed.y) == pytest.approx(10.0, abs=1e-4)
    assert (missed.x[0], missed.x[-1]) == (0.0, 60.0)


# --- the page -----------------------------------------------------------------------------------


@pytest.mark.parametrize("each", EVERY, ids=lambda d: f"{d.kind}-{len(d.sets)}")
def test_the_page_stands_alone_and_opens_with_the_two_sentences(each: Diagnosis) -> None:
    page = interactive_page(each)
    assert Addresses(page).loaded == []
    assert len(page.encode()) < 5 * MEGABYTE
    shown = text_of(page)
    first, second = opening(each.to_dict())
    assert shown.index("synthetic data") < shown.index(words(first)) < shown.index(words(second))
    for step in each.next_steps:
        assert step.why in shown


def test_a_page_of_many_long_experiments_stays_small() -> None:
    page = interactive_page(diagnosis(traces=long_traces(20, 3000)))
    assert page.count("<option>") == MOST_EXPERIMENTS
    assert len(page.encode()) < 5 * MEGABYTE


def test_names_of_a_campaign_are_no_markup() -> None:
    page = interactive_page(diagnosis(campaign="</script><b>arm", material="<i>rubber"))
    assert "<b>arm" not in page
    assert "<i>rubber" not in page
    match = re.search(r'id="figures">(.*?)</script>', page, re.DOTALL)
    assert match
    assert set(json.loads(match[1])) == {"step 30", "hold 45"}


def test_the_same_diagnosis_gives_the_same_bytes() -> None:
    assert interactive_page(diagnosis()) == interactive_page(diagnosis())


@pytest.fixture(scope="module")
def opened() -> Iterator[Page]:
    if CHROMIUM is None:
        pytest.skip("needs chromium (make browser)")
    with browser() as page:
        yield page


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_a_browser_draws_it_and_the_experiment_can_be_chosen(
    opened: Page, tmp_path: Path, size: tuple[int, int]
) -> None:
    path = tmp_path / "diagnosis.html"
    path.write_text(interactive_page(diagnosis()), encoding="utf-8")
    opened.open(address(path), size)
    drawn = "document.querySelectorAll('#picture .scatterlayer .trace').length"
    assert opened.run(drawn) >= 5
    assert opened.run("document.querySelector('#picture').data[0].name") == "measured"
    assert opened.run("document.documentElement.scrollWidth") <= size[0]
    title = "document.querySelector('#picture').layout.xaxis.title.text"
    first = opened.run(title)
    opened.run(
        "(chosen.selectedIndex = 1, chosen.dispatchEvent(new Event('change')), null)",
    )
    opened.settle()
    assert opened.run(title) != first
    assert opened.errors == []
    assert {request.split(":")[0] for request in opened.requests} <= {"file", "data", "blob"}
