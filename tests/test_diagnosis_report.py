from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from spa_fo.errors import BadInput
from spa_fo.gap.diagnosis import (
    Cause,
    Diagnosis,
    Gap,
    LawFound,
    Likeness,
    Shrink,
    Step,
    Traces,
    Where,
)
from spa_fo.plant import Model, TransferFunction
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.report.causes import percent
from spa_fo.report.diagnosis import document, verdict, write_report
from spa_fo.report.diagnosis_figures import before_after_figure, gap_figure, ladder_figure
from spa_fo.report.effect_words import parameter_words, phrase, words_of
from spa_fo.report.experiments import rms
from spa_fo.report.glossary import typical
from spa_fo.report.headline import headline, opening
from spa_fo.report.interactive_page import interactive_page
from spa_fo.report.law_figure import laws_figure
from spa_fo.report.sections import step_line
from spa_fo.report.stages_figure import has_stages, stages_figure

PLAIN = Model("bench", "rubber", TransferFunction(1.4, 1.2, 0.8, 1.6, 0.9), 30.0)
STAGES = {"drive": 0.1, "actuator": 0.83, "sensor": 0.07, "acquisition": 0.0}
NOWHERE = Where(dict.fromkeys(STAGES, 0.0), {}, {}, {}, {}, {})
CREEP = Cause(
    ("creep",),
    0.83,
    {
        "creep": {
            "per_decade": {"value": 0.0349, "ci95": [0.0336, 0.0362]},
            "decades": {"value": 1.03, "ci95": None},
        }
    },
    {},
    held_out_rmse_deg=0.62,
)
PAIR = Cause(
    ("line_lag", "sensor_slip"),
    0.1,
    {
        "line_lag": {"time_constant_s": {"value": 0.15, "ci95": [0.14, 0.16]}},
        "sensor_slip": {"walk_deg": {"value": 0.2, "ci95": [0.1, 0.3]}},
    },
    {},
    held_out_rmse_deg=0.81,
)
NONE, UNKNOWN = Cause(("none",), 0.05, {}, {}, 2.1), Cause(("unknown",), 0.02, {}, {})
SHRINK = Shrink("one trial of each experiment", 2.1, 0.62, 1.7, 0.58, 0.5, 0.95, (0.9, 0.98))


def traces(pressure: bool = True, calibration: bool = True) -> Traces:
    """Two experiments of two trials each, the second of each held out."""
    time = np.linspace(0.0, 10.0, 40)
    command = np.where(time > 1.0, 30.0, 0.0)
    plain = 30.0 * (1.0 - np.exp(-np.maximum(time - 1.0, 0.0)))
    measured = plain * (1.0 + 0.01 * time)
    windows = np.arange(16.0)
    drive = 0.98 * np.tile(command, 4)
    return Traces(
        experiment=("step_30", "step_30", "hold_45", "hold_45"),
        label=("step_30/1", "step_30/2", "hold_45/1", "hold_45/2"),
        trial=np.repeat(np.arange(4), time.size),
        time_s=np.tile(time, 4),
        command_kpa=np.tile(command, 4),
        measured_deg=np.tile(measured, 4),
        plain_deg=np.tile(plain, 4),
        explained_deg=np.tile(measured - 0.1, 4),
        refit_deg=np.tile(1.05 * plain, 4),
        pressure_kpa=drive if pressure else None,
        drive_kpa=drive if pressure else None,
        held_out=np.array([False, True, False, True]),
        fixture_angle_deg=10.0 * windows if calibration else np.zeros(0),
        fixture_deg=0.1 * np.sin(windows) if calibration else np.zeros(0),
        fixture_explained_deg=0.1 * np.sin(windows) if calibration else np.zeros(0),
    )


def diagnosis(**changes: Any) -> Diagnosis:
    """One cause, everything measured."""
    whole = Diagnosis(
        campaign="bench",
        material="rubber",
        provenance="synthetic",
        seed=7,
        excluded=(),
        gap=Gap(2.14, 0.5, True, 1e-12),
        where=Where(
            STAGES,
            {"rise": 0.2, "hold": 0.8},
            {"5-15 deg": 0.4, "below 5 deg": 0.6},
            {"bending": 1.0},
            {"first third": 0.3, "second third": 0.3, "last third": 0.4},
            {"below 0.1 Hz": 0.9, "0.1-0.3 Hz": 0.1},
        ),
        causes=(CREEP, PAIR, NONE, UNKNOWN),
        kind="cause",
        sets=(("creep",),),
        next_experiment=None,
        held_out_on="one trial of each experiment: 2 trials",
        shrink=SHRINK,
        offers=("4 trials: step, hold",),
        misses=(),
        findings=("nothing else stands out",),
        baselines={"smallest_bic": ["gravity_load"], "commonest": []},
        traces=traces(),
        model=PLAIN,
    )
    return replace(whole, **changes)


NO_GAP = diagnosis(
    gap=Gap(0.52, 0.5, False, 0.43),
    where=NOWHERE,
    causes=(replace(NONE, probability=0.98), replace(CREEP, probability=0.01), UNKNOWN),
    kind="no_gap",
    sets=(),
    shrink=None,
    misses=("a long hold: creep shows there", "measured pressure"),
    next_steps=(Step("record a long hold", "creep shows there"),),
)
AMBIGUOUS = diagnosis(
    causes=(
        replace(CREEP, probability=0.51),
        Cause(("sensor_creep",), 0.42, {"sensor_creep": {}}, {}, 0.63),
        NONE,
        UNKNOWN,
    ),
    kind="ambiguous",
    sets=(("creep",), ("sensor_creep",)),
    next_experiment="Calibrate with dwells of 60 s: the film alone creeps there.",
    next_steps=(
        Step(
            "calibrate with dwells of 60 s",
            "the film alone creeps there",
            (("creep",), ("sensor_creep",)),
        ),
    ),
)
UNEXPLAINED = diagnosis(
    causes=(replace(UNKNOWN, probability=0.97), replace(CREEP, probability=0.02), NONE),
    kind="unknown",
    sets=(),
    shrink=None,
    where=replace(NOWHERE, phase={"hold": 1.0}),
    traces=traces(pressure=False, calibration=False),
)
_OVER = np.linspace(0.0, 40.0, 30)
BALLOON = LawFound(
    place="input_map",
    stage="actuator",
    probability=0.87,
    fraction_closed=0.93,
    log_evidence=55.0,
    resembles=(Likeness("power", 0.96, {"exponent": 1.31}, 0.01 * _OVER**1.3 - 0.03 * _OVER),),
    beside=(),
    over=_OVER,
    value=0.01 * _OVER**1.3 - 0.03 * _OVER,
    low=0.01 * _OVER**1.3 - 0.03 * _OVER - 0.1,
    high=0.01 * _OVER**1.3 - 0.03 * _OVER + 0.1,
    carried=True,
)
SPECTRUM = replace(
    BALLOON,
    place="relaxation",
    probability=0.08,
    fraction_closed=-0.4,
    resembles=(Likeness("one time", 0.9, {"time_s": 3.0}, np.ones(4)),),
    over=np.geomspace(0.3, 30.0, 4),
    value=np.ones(4),
    low=np.zeros(4),
    high=2.0 * np.ones(4),
    carried=False,
)
LAWFUL = replace(UNEXPLAINED, laws=(BALLOON, SPECTRUM))
PARTLY = diagnosis(
    causes=(replace(UNKNOWN, probability=0.9), CREEP, NONE), kind="unknown", sets=(("creep",),)
)
EVERY = (diagnosis(), NO_GAP, AMBIGUOUS, UNEXPLAINED, PARTLY, LAWFUL)


def sections(page: str) -> dict[str, str]:
    parts = re.split(r"^## (.*)$", page, flags=re.MULTILINE)
    return {title: body.strip() for title, body in zip(parts[1::2], parts[2::2], strict=True)}


def rows(table: str) -> dict[str, list[str]]:
    """Return the cells behind the first of each row of the Markdown tables in a text."""
    lines = [line for line in table.splitlines() if line.startswith("|")]
    cells = [[cell.strip(" *") for cell in line.strip("|").split("|")] for line in lines]
    return {row[0]: row[1:] for row in cells}


@pytest.mark.parametrize("each", EVERY, ids=lambda d: f"{d.kind}-{len(d.sets)}-{len(d.laws)}")
def test_the_verdict_is_two_sentences_with_both_errors(each: Diagnosis) -> None:
    text = verdict(each)
    assert len(re.findall(r"\.(?:\s|$)", text)) == 2
    assert f"{each.gap.rmse_deg:.2f}°" in text
    assert f"{each.gap.noise_floor_deg:.2f}°" in text
    assert each.campaign in text


def test_a_cause_is_named_with_its_stage_probability_and_shrink() -> None:
    text = verdict(diagnosis())
    assert "**creep of the material**" in text
    assert "83 % of that gap arises in the actuator" in text
    assert "probability of 83 %" in text
    assert "from 2.10° to 0.62°" in text
    assert "closes 95 % of the gap (95 % interval 90 % to 98 %)" in text
    assert "no gap: 5 % probable" in text


def test_a_gap_below_the_scatter_is_said_to_repeat() -> None:
    text = verdict(diagnosis(gap=Gap(0.86, 1.63, True, 0.03)))
    assert "is 0.86°, the same in every trial, though repeated trials differ by 1.63°" in text


def test_no_gap_blames_nothing() -> None:
    text = document(NO_GAP)
    assert "no gap" in sections(text)["The verdict"]
    assert "no gap: 98 % probable" in sections(text)["The verdict"]
    assert "creep of the material" not in sections(text)["The verdict"]
    assert "Use the model as it is." in sections(text)["What to do next"]
    assert "**Record a long hold**: creep shows there." in sections(text)["What to do next"]
    assert sections(text)["How far it shrinks"] == "There is no gap to close."


def test_no_gap_says_what_accounts_for_an_error_beyond_the_noise_floor() -> None:
    beyond, within = (replace(NO_GAP, gap=Gap(error, 0.5, False, 0.43)) for error in (0.9, 0.4))
    errors = "errors of the given model and of the sensor's curve"
    assert (
        f"1.8 times what repeated trials differ by (0.50°), but no more than that and {errors}"
        in document(beyond)
    )
    assert f"which the noise floor with {errors} accounts for" in verdict(beyond)
    assert "which is no more than repeated trials differ by (0.50°)" in document(within)
    assert errors not in document(within)


def test_an_ambiguous_verdict_names_every_set_and_what_would_decide() -> None:
    page = sections(document(AMBIGUOUS))
    assert (
        "**creep of the material** (51 %) and **creep of the sensor** (42 %)"
        in (page["The verdict"])
    )
    assert "The cause is" not in page["The verdict"]
    (step,) = [line for line in page["What to do next"].splitlines() if "Calibrate" in line]
    assert step.startswith("- **Calibrate with dwells of 60 s**: the film alone creeps there. ")
    assert step.endswith("It tells creep of the material from creep of the sensor.")


@pytest.mark.parametrize("turned", [1, -1])
def test_a_step_says_whether_an_effect_has_a_part(turned: int) -> None:
    apart = (("leak",), ("leak", "creep"))[::turned]
    line = step_line(Step("weigh it", "it may be heavy", apart))
    assert line == (
        "**Weigh it**: it may be heavy. It tells whether creep of the material contributes."
    )


def test_unknown_trusts_no_name() -> None:
    page = sections(document(UNEXPLAINED))
    assert "**unknown**" in page["The verdict"]
    assert "97 % probable" in page["The verdict"]
    assert "no part of it is explained" in page["The verdict"]
    assert "augmented" not in page["What to do next"]
    assert "Nothing is explained" in page["How far it shrinks"]


def test_the_opening_of_unknown_says_what_a_part_resembles_and_not_that_nothing_does() -> None:
    wrong, following = opening(PARTLY.to_dict())
    assert "its cause is not known" in wrong
    assert "a part resembles creep of the material" in wrong
    assert "no effect" not in wrong
    assert following.startswith("With what it resembles in the model")
    assert "no effect of the library explains it" in opening(UNEXPLAINED.to_dict())[0]


def test_unknown_says_what_part_is_explained() -> None:
    page = sections(document(PARTLY))
    assert "**unknown**" in page["The verdict"]
    assert "**creep of the material** explains a part" in page["The verdict"]
    assert "augmented_model.json" in page["What to do next"]


@pytest.mark.parametrize("each", EVERY, ids=lambda d: f"{d.kind}-{len(d.sets)}-{len(d.laws)}")
def test_the_probabilities_of_the_table_are_those_given(each: Diagnosis) -> None:
    table = rows(sections(document(each))["Which cause"])
    for cause in each.causes:
        assert table[phrase(cause.set, " + ")][0] == percent(cause.probability)


def test_causes_left_out_of_the_table_are_added_up() -> None:
    tiny = [Cause((name,), 0.004, {}, {}) for name in ("leak", "dead_time", "stiffening")]
    table = rows(sections(document(diagnosis(causes=(CREEP, *tiny, NONE, UNKNOWN))))["Which cause"])
    assert "leak" not in table
    assert table["others together"][0] == percent(1.0 - 0.83 - 0.05 - 0.02)


def parameters(page: str) -> dict[tuple[str, str], list[str]]:
    lines = [line for line in sections(page)["The parameters"].splitlines() if " | " in line]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {(row[0], row[1]): row[2:6] for row in cells}


def test_parameters_stand_one_a_row_with_interval_unit_and_typical_size() -> None:
    page = document(diagnosis())
    table = parameters(page)
    creep = "creep of the material"
    assert table[creep, "per decade"] == ["0.0349", "0.0336 to 0.0362", "", "up to 0.05"]
    assert table[creep, "decades"] == ["1.03", "", "", "0.56 to 1.8"]
    assert table["pneumatic lag of the line", "time constant"][:3] == ["0.15", "0.14 to 0.16", "s"]
    assert table["slip of the sensor", "walk"] == [
        *("0.2", "0.1 to 0.3", "° per trial", "−0.3 to 0.3"),
    ]
    causes = rows(sections(page)["Which cause"])
    assert causes[creep] == ["83 %", "likely", "0.62"]
    assert max(len(re.findall(r"\d+\.\d+", cell)) for row in causes.values() for cell in row) <= 1


@pytest.mark.parametrize(("lag_s", "alike"), [(0.159, True), (0.161, False)])
def test_what_an_explanation_above_has_alike_is_not_laid_out_again(lag_s, alike) -> None:
    lag = {"line_lag": {"time_constant_s": {"value": lag_s, "ci95": [lag_s - 0.02, lag_s + 0.02]}}}
    other = replace(CREEP, set=("creep", "line_lag"), parameters={**CREEP.parameters, **lag})
    said = sections(document(diagnosis(causes=(PAIR, other, NONE, UNKNOWN))))["The parameters"]
    below = said.split("**creep of the material + pneumatic lag of the line**")[1]
    assert "creep of the material | per decade" in below
    assert ("pneumatic lag of the line | time constant" in below) != alike
    note = "As first given above, every value in the interval there: pneumatic lag of the line."
    assert (note in below) == alike


def test_large_and_negative_numbers_are_written_out() -> None:
    values = {"rise_kpa_s": {"value": 1389.6, "ci95": [-461.2, 4190.0]}}
    cause = Cause(("slew_limit",), 0.83, {"slew_limit": values}, {})
    table = parameters(document(diagnosis(causes=(cause, NONE, UNKNOWN))))
    assert table["slew limit of the drive", "rise"][:3] == ["1390", "−461 to 4190", "kPa/s"]


def test_every_parameter_of_the_library_has_a_meaning_and_a_typical_size() -> None:
    for effect in LIBRARY.values():
        assert effect.parameters or effect.coefficients
        for parameter in effect.parameters:
            assert parameter.means
            assert re.fullmatch(r"(up to )?[−\d.]+( to [−\d.]+)?", typical(parameter))


def test_the_shrink_stands_beside_refit_ceiling_and_floor() -> None:
    table = rows(sections(document(diagnosis()))["How far it shrinks"])
    found = {name: cells[0] for name, cells in table.items()}
    assert found["plain model"] == "2.10"
    assert found["plain model, refitted"] == "1.70"
    assert found["augmented model"] == "0.62"
    assert found["refitted model plus mean residual (no physics)"] == "0.58"
    assert found["noise floor"] == "0.50"


def test_without_a_ceiling_it_is_not_listed() -> None:
    page = document(diagnosis(shrink=replace(SHRINK, ceiling_rmse_deg=None)))
    assert "refitted + mean residual" not in page


def test_where_lists_the_largest_shares_first() -> None:
    table = rows(sections(document(diagnosis()))["Where"])
    assert table["stage"] == ["actuator 83 %, drive 10 %, sensor 7 %"]
    assert table["amplitude"] == ["below 5° 60 %, 5-15° 40 %"]


def test_where_the_stage_is_not_known_every_page_says_so_and_why() -> None:
    where = replace(diagnosis().where, stage=None, not_known="no pressure was <logged>")
    one = diagnosis(kind="unknown", sets=(), shrink=None, where=where)
    assert "and where it arises is not known (no pressure was <logged>). The cause" in verdict(one)
    table = rows(sections(document(one))["Where"])
    assert table["stage"] == ["not known: no pressure was <logged>"]
    assert table["amplitude"] == ["below 5° 60 %, 5-15° 40 %"]
    page = interactive_page(one)
    said = '<h3>by stage</h3><p class="note">not known: no pressure was &lt;logged&gt;</p>'
    assert said in page
    assert "by amplitude" in page
    titles = [axes.get_title(loc="left") for axes in gap_figure(one).axes]
    assert "stage" not in titles
    assert "amplitude" in titles
    assert one.to_dict()["where"]["stage"] is None


def test_where_the_stage_is_assumed_every_page_says_so_and_why() -> None:
    where = replace(diagnosis().where, assumed="assumed: no <calibration> was logged")
    one = diagnosis(kind="unknown", sets=(), shrink=None, where=where)
    arises = "83 % of that gap arises in the actuator (pressure to angle)"
    assert f"{arises} (assumed: no <calibration> was logged). The cause" in verdict(one)
    table = rows(sections(document(one))["Where"])
    shares = "actuator 83 %, drive 10 %, sensor 7 %"
    assert table["stage"] == [f"{shares} (assumed: no <calibration> was logged)"]
    said = '<p class="note">assumed: no &lt;calibration&gt; was logged</p></div>\n<div><h3>by '
    page = interactive_page(one)
    assert said in page
    assert page.count("&lt;calibration&gt;") == 1
    assert one.to_dict()["where"]["assumed"] == "assumed: no <calibration> was logged"
    assert diagnosis().to_dict()["where"]["assumed"] is None


def test_the_page_says_which_trials_the_errors_are_of_where_nothing_is_explained() -> None:
    page = document(diagnosis(kind="unknown", sets=(), shrink=None, held_out_on="the last 4 of 14"))
    assert "Held out: the last 4 of 14." in page.split("## Which cause")[1].split("##")[0]


def test_the_page_says_what_the_data_are_and_what_was_withheld() -> None:
    page = document(diagnosis(provenance="measured", excluded=("creep", "leak")))
    assert page.splitlines()[2].startswith("**Measured data.** rubber, seed 7")
    assert "Taken out of the library for this diagnosis: creep of the material, leak." in page


def test_evidence_findings_and_baselines_are_told() -> None:
    page = sections(document(replace(NO_GAP, offers=("4 trials: step, hold",))))
    assert "- 4 trials: step, hold." in page["Evidence"]
    assert "It lacks a long hold and measured pressure." in page["Evidence"]
    assert "- Nothing else stands out." in page["Findings"]
    assert "smallest BIC: gravity; commonest effect: no effect." in page["Findings"]


def test_every_effect_of_the_library_has_words() -> None:
    bare = words_of("no_longer_known")
    assert bare.name == "no longer known"
    assert len({effect.name for effect in LIBRARY.values()}) == len(LIBRARY)
    for effect in LIBRARY.values():
        assert effect.means != bare.means
        assert effect.remedy != bare.remedy
        for parameter in effect.parameters:
            words, unit = parameter_words(effect.id, parameter.name)
            assert "_" not in words + unit
    assert parameter_words("leak", "rate_per_s") == ("rate", "1/s")
    assert parameter_words("slew_limit", "rise_kpa_s") == ("rise", "kPa/s")
    assert parameter_words("parameter_shift", "a1") == ("a1 ×", "")


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0 %"),
        (0.001, "< 1 %"),
        (0.83, "83 %"),
        (0.999, "> 99 %"),
        (1.0, "100 %"),
        (-0.2, "−20 %"),
    ],
)
def test_percent_never_rounds_to_certainty(share: float, text: str) -> None:
    assert percent(share) == text


def test_rms_weighs_by_time() -> None:
    t = np.concatenate([np.linspace(0.0, 1.0, 101), [1.001, 9.0]])
    values = np.where(t <= 1.0, 2.0, 0.0)
    assert rms(t, values) == pytest.approx(2.0 / 3.0, rel=1e-3)
    assert rms(np.array([1.0]), np.array([-3.0])) == 3.0


def title_of(figure: Figure, start: str) -> str:
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    return next(title for title in titles if title.startswith(start))


def labels_of(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_held_out_trial_is_shown_and_marked() -> None:
    figure = before_after_figure(diagnosis())
    assert title_of(figure, "step 30") == "step 30, trial 2 of 2, held out"
    assert labels_of(figure) == [
        "measured",
        "plain model",
        "plain model, refitted",
        "augmented model",
        "noise floor",
    ]
    fitted = replace(traces(), held_out=np.zeros(4, dtype=bool))
    figure = before_after_figure(diagnosis(traces=fitted))
    assert title_of(figure, "step 30") == "step 30, trial 2 of 2"


def test_before_and_after_stand_over_the_residual() -> None:
    t = traces()
    own = t.trial == 1
    before = rms(t.time_s[own], t.measured_deg[own] - t.plain_deg[own])
    titles = [axes.get_title(loc="left") for axes in before_after_figure(diagnosis()).axes]
    assert titles.count(f"RMS {before:.2f}° → 0.10°") == 2


def test_without_an_explanation_only_the_plain_model_is_drawn() -> None:
    assert labels_of(before_after_figure(NO_GAP)) == ["measured", "plain model", "noise floor"]


def test_shares_stand_in_the_order_of_their_bins() -> None:
    figure = gap_figure(diagnosis())
    axes = next(axes for axes in figure.axes if axes.get_title(loc="left") == "amplitude")
    assert [label.get_text() for label in axes.get_yticklabels()] == ["below 5°", "5-15°"]
    assert [bar.get_width() for bar in axes.patches] == pytest.approx([60.0, 40.0])
    assert not [axes for axes in gap_figure(NO_GAP).axes if axes.get_title(loc="left") == "stage"]


def test_the_gap_is_the_mean_over_trials_as_far_as_each_goes() -> None:
    t = traces()
    keep = ~((t.trial == 0) & (t.time_s > 5.0))
    columns = ("trial", "time_s", "command_kpa", "measured_deg", "plain_deg")
    cut = replace(t, pressure_kpa=None, **{name: getattr(t, name)[keep] for name in columns})
    axes = gap_figure(diagnosis(traces=cut)).axes[0]
    mean = axes.collections[-1].get_offsets()
    own = t.trial == 1
    assert np.asarray(mean[:, 0]) == pytest.approx(t.time_s[own])
    assert np.asarray(mean[:, 1]) == pytest.approx(t.measured_deg[own] - t.plain_deg[own])


def test_a_pressure_that_drives_the_model_is_not_drawn_against_itself() -> None:
    measured = traces(calibration=False)
    driven = replace(measured, command_kpa=np.full_like(measured.command_kpa, np.nan))
    assert has_stages(measured)
    assert not has_stages(driven)
    for given, label in ((measured, "command (kPa)"), (driven, "pressure (kPa)")):
        figure = gap_figure(diagnosis(traces=given))
        assert label in [axes.get_ylabel() for axes in figure.axes]


def test_where_no_trial_was_held_out_nothing_says_so() -> None:
    fitted = replace(traces(), held_out=np.zeros(4, dtype=bool))
    one = diagnosis(traces=fitted)
    assert "all trials" in ladder_figure(one).axes[0].get_xlabel()
    assert "held-out" not in verdict(one)
    answer = headline(one.to_dict())[1]
    assert "on the fitted trials: 2.10°" in answer
    assert "; held out: 2.10°" in headline(diagnosis().to_dict())[1]


def test_the_ladder_has_a_rung_for_everything_that_was_tried() -> None:
    error, probability = ladder_figure(diagnosis()).axes
    rungs = {
        label.get_text().replace("\n", " "): bar.get_width()
        for label, bar in zip(error.get_yticklabels(), error.patches, strict=True)
    }
    assert rungs == {
        "plain model": 2.1,
        "plain model, refitted": 1.7,
        "creep of the material": 0.62,
        "pneumatic lag of the line + slip of the sensor": 0.81,
        "a cause that the library lacks": 0.0,
        "refitted + mean residual": 0.58,
    }
    assert [bar.get_width() for bar in probability.patches] == [0.05, 0.83, 0.1, 0.02]
    assert "0.50°" in error.get_xlabel()


def test_the_ladder_never_mixes_trials() -> None:
    error, _ = ladder_figure(NO_GAP).axes
    assert "held-out trials" in error.get_xlabel()
    assert [bar.get_width() for bar in error.patches] == [2.1, 0.62, 0.0]
    bare = replace(NO_GAP, causes=(Cause(("none",), 0.9, {}, {}), CREEP, UNKNOWN))
    error, _ = ladder_figure(bare).axes
    assert "all trials" in error.get_xlabel()
    assert [bar.get_width() for bar in error.patches] == [0.52, 0.0, 0.0]


def test_the_plain_model_stands_on_the_ladder_with_the_error_of_its_own_rung() -> None:
    none = replace(NONE, held_out_rmse_deg=1.9)
    causes = (replace(CREEP, probability=0.1), none, replace(UNKNOWN, probability=0.9))
    error, _ = ladder_figure(diagnosis(kind="unknown", causes=causes)).axes
    labels = [label.get_text() for label in error.get_yticklabels()]
    assert {"plain model, refitted", "refitted + mean residual"} <= set(labels)
    assert error.patches[labels.index("plain model")].get_width() == 1.9


def test_stages_draw_what_was_measured() -> None:
    both = [axes.get_title(loc="left") for axes in stages_figure(diagnosis()).axes]
    assert {"drive: step 30", "drive: hold 45"} <= set(both)
    assert any(title.startswith("sensor:") for title in both)
    alone = stages_figure(diagnosis(traces=traces(pressure=False)))
    titles = [axes.get_title(loc="left") for axes in alone.axes]
    assert not any(title.startswith("drive") for title in titles)
    assert not has_stages(traces(pressure=False, calibration=False))


def test_the_files_are_written_and_show_something(tmp_path: Path) -> None:
    files = write_report(diagnosis(), tmp_path)
    machines = {"diagnosis.json", "augmented_model.json"}
    assert {path.name for path in files} | machines == {path.name for path in tmp_path.iterdir()}
    page = (tmp_path / "diagnosis.md").read_text(encoding="utf-8")
    pictures = re.findall(r"\]\((\w+\.png)\)", page)
    assert sorted(pictures) == [
        *("before_after.png", "gap.png", "ladder.png", "opening.png", "stages.png")
    ]
    for name in pictures:
        assert imread(tmp_path / name)[..., :3].std() > 0.02
        assert (tmp_path / name).with_suffix(".pdf").read_bytes().startswith(b"%PDF")


def test_a_diagnosis_that_cannot_be_written_leaves_the_earlier_one_alone(tmp_path: Path) -> None:
    write_report(UNEXPLAINED, tmp_path)
    (tmp_path / "diagnosis.json").unlink()
    (tmp_path / "diagnosis.json").mkdir()  # stands for the last file that fails
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    with pytest.raises(BadInput, match=r"diagnosis\.json: cannot be written: it is not a file"):
        write_report(diagnosis(), tmp_path)
    after = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    assert after == before


def test_a_missing_law_is_told_and_drawn() -> None:
    told = sections(document(LAWFUL, ("laws",)))["The missing law"]
    table = rows(told)
    assert table["what load a pressure makes"][1:] == [
        "87 %",
        "93 %",
        "power (exponent 1.31), 96 %",
    ]
    assert table["how stress relaxes"][2] == "0 %"
    assert "The augmented model carries the law of **what load a pressure makes**" in told
    assert "(laws.png)" in told
    assert "93 % of the gap closes" in opening(LAWFUL.to_dict())[1]
    figure = laws_figure(LAWFUL)
    first, second = figure.axes
    assert first.get_xlabel() == "pressure (kPa)"
    legend = first.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == [
        "free-form law",
        "power (exponent 1.31)",
    ]
    assert second.get_xscale() == "log"


def test_a_page_carries_the_picture_of_its_laws_and_loses_it(tmp_path: Path) -> None:
    write_report(LAWFUL, tmp_path)
    assert (tmp_path / "laws.png").stat().st_size > 5000
    page = (tmp_path / "diagnosis.html").read_text()
    assert "data:image/png;base64," in page
    assert "The missing law" in page
    entry = json.loads((tmp_path / "diagnosis.json").read_text())["laws"][0]
    assert entry["resembles"] == [
        {"form": "power", "explains": 0.96, "parameters": {"exponent": 1.31}}
    ]
    assert entry["in_model"]
    write_report(UNEXPLAINED, tmp_path)
    assert not (tmp_path / "laws.png").exists()


def test_figures_of_an_earlier_diagnosis_do_not_stay(tmp_path: Path) -> None:
    (tmp_path / "stages.png").write_bytes(b"old")
    write_report(UNEXPLAINED, tmp_path)
    assert not (tmp_path / "stages.png").exists()
    assert "stages.png" not in (tmp_path / "diagnosis.md").read_text(encoding="utf-8")


def test_a_folder_that_cannot_be_made_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(BadInput, match="cannot be written"):
        write_report(NO_GAP, tmp_path / "file")
