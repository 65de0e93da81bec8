"""Figures and tables of more than was thought of: many panels, many campaigns, long lines."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from spa_fo.report.ablation import _curve_panel
from spa_fo.report.figures import Curve, StepPanel, step_figure
from spa_fo.report.published import PublishedMaterial, told_apart
from spa_fo.report.style import ONE_COLUMN_IN, TWO_COLUMNS_IN, mark_provenance


def panel(number: int, trials: int = 3) -> StepPanel:
    t = np.linspace(0.0, 10.0, 50)
    curve = Curve("model", t, 30.0 * t / 10.0, 1.2)
    return StepPanel(f"rubber, step {number}", 30.0, t, np.tile(3.0 * t, (trials, 1)), (curve,))


@pytest.mark.parametrize("count", [1, 2, 3, 8, 30])
def test_panels_are_wide_enough_however_many(count: int) -> None:
    figure = step_figure([panel(i) for i in range(count)])
    figure.draw_without_rendering()
    assert len(figure.axes) == count
    assert min(axes.get_position().width for axes in figure.axes) > 0.2
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert len(set(titles)) == count
    assert all(title[1].isalnum() for title in titles)


def test_the_legend_counts_trials_only_where_all_panels_have_as_many() -> None:
    for trials, text in ((3, "3 trials"), (5, "each trial")):
        figure = step_figure([panel(0), panel(1, trials)])
        assert figure.legends[0].get_texts()[0].get_text() == text


def test_every_experiment_of_an_ablation_is_drawn() -> None:
    groups = ["all", *(f"step_{i}" for i in range(9))]
    rows = pd.DataFrame(
        [
            {"group": g, "points": 50, "datasets": n, "curve_spread_deg": 1.0, "theory_deg": 1.0}
            for g in groups
            for n in (2, 4)
        ]
    )
    axes = Figure().subplots()
    _curve_panel(axes, rows)
    labels = [str(line.get_label()) for line in axes.lines]
    assert labels == [text for g in groups[1:] for text in (g, f"{g}, theory")]


@pytest.mark.parametrize("width_in", [ONE_COLUMN_IN, TWO_COLUMNS_IN])
def test_a_long_provenance_stays_within_the_figure(width_in: float) -> None:
    figure = Figure(figsize=(width_in, 3.0))
    mark_provenance(figure, "measured data; " + "a laboratory's archive of measurements, " * 12)
    figure.draw_without_rendering()
    (line,) = figure.texts
    assert line.get_window_extent().x1 < figure.bbox.x1
    assert "\n" in line.get_text()


def published(name: str, material: str) -> PublishedMaterial:
    given: dict[str, Any] = {field.name: None for field in fields(PublishedMaterial)}
    given |= {"name": name, "campaign": SimpleNamespace(material=material), "alone": True}
    return PublishedMaterial(**given)


def test_campaigns_of_one_material_have_labels_of_their_own() -> None:
    three = [published("a", "rubber"), published("b", "rubber"), published("c", "silicone")]
    labels = [material.label for material in told_apart(three)]
    assert labels == ["rubber (a)", "rubber (b)", "silicone"]
    assert replace(three[0]).label == "rubber"
