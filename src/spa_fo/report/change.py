"""The page that says what changed between two campaigns, and its figures."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spa_fo.atomic import filling, write_text
from spa_fo.compare import NOTHING_CHANGED, Comparison
from spa_fo.plant import write_model
from spa_fo.plant.effects.library import LIBRARY
from spa_fo.report.causes import percent
from spa_fo.report.effect_words import joined, phrase
from spa_fo.report.experiments import Experiment, experiments
from spa_fo.report.headline import probability
from spa_fo.report.provenance import joint_provenance_line, provenance_line
from spa_fo.report.sections import (
    bullets,
    cause_table,
    parameter_tables,
    shrink_part,
    step_line,
    where_part,
)
from spa_fo.report.style import (
    BLACK,
    BLUE,
    GREY,
    TWO_COLUMNS_IN,
    VERMILION,
    new_figure,
    save_figure,
    styled,
)
from spa_fo.rig import CampaignData, Trial

PAGE, DOCUMENT, MODEL = "comparison.md", "comparison.json", "augmented_model.json"
_MOST_PANELS = 3
_TWO = 2.0  # standard deviations
_LABEL = 60  # characters of a legend's line
_BOTH = {"angle": "What the model misses in both", "pressure": "What the drive does in both"}
_FAINT: dict[str, Any] = {"linewidth": 0.5, "alpha": 0.35}
_CAPTIONS = {
    "measured": "Both campaigns as measured, drawn over each other: angle above, pressure below; "
    "faint lines are further trials.",
    "change": "What is left of the campaign when what the model misses on the reference, too, is "
    "taken off. The band, of two standard deviations, is what it may differ by without any change; "
    "where there is none, the reference never was, or no actuator reads so.",
}

_OF_PRESSURE = {
    "measured": "Both campaigns as measured, drawn over each other: pressure above, command below; "
    "faint lines are further trials.",
    "change": "What is left of the pressure when command and what the drive does to it on the "
    "reference, too, are taken off. The band is as wide as that is known to; what leaves it has "
    "changed.",
}


def write_comparison(comparison: Comparison, folder: Path | str) -> tuple[Path, ...]:
    """Write comparison.json, comparison.md, augmented_model.json and the figures, all or none.

    Where no angle was logged, there is no model.

    Parameters
    ----------
    comparison : Comparison
        Of any kind.
    folder : Path or str
        Where to.

    Returns
    -------
    tuple of Path
        Figures, PNG and PDF, and the page, last.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    folder = Path(folder)
    draw = {"measured": measured_figure, "change": change_figure}
    provenance = provenance_of(comparison)
    with filling(folder) as temporary:
        figures = chain.from_iterable(
            save_figure(figure(comparison), temporary / name, provenance)
            for name, figure in draw.items()
        )
        names = [path.name for path in figures]
        write_text(temporary / PAGE, document(comparison))
        said = {**comparison.to_dict(), "answer": list(answer(comparison))}
        text = json.dumps(said, indent=2, allow_nan=False)
        write_text(temporary / DOCUMENT, text + "\n")
        if comparison.model is not None:
            write_model(temporary / MODEL, comparison.model)
    return (*(folder / name for name in names), folder / PAGE)


def provenance_of(comparison: Comparison) -> str:
    """Say where the data of both campaigns are from."""
    both = (comparison.reference.campaign, comparison.data.campaign)
    return joint_provenance_line(
        [each.name for each in both], [provenance_line(each.provenance) for each in both]
    )


def answer(comparison: Comparison) -> tuple[str, str]:
    """Say what changed, and what that rests on, a sentence each."""
    found, document = comparison.change, comparison.to_dict()
    gap, unit = found.gap, unit_of(comparison)
    names = comparison.data.campaign.name, comparison.reference.campaign.name
    beside = "Apart from what no actuator reads, " if comparison.misread else ""
    sizes = (
        f"{beside}{names[0]} differs from what {names[1]} lets expect by {gap.rmse_deg:.2f}{unit} "
        f"(RMS); without any change that would be about {gap.noise_floor_deg:.2f}{unit}."
    )
    sets = [f"{phrase(ids)} ({percent(probability(document, ids))})" for ids in found.sets]
    if comparison.kind == NOTHING_CHANGED:
        none = percent(probability(document, ["none"]))
        if comparison.compared == "pressure":
            return f"Nothing changed in the drive ({none}); no angle was logged.", sizes
        return f"Nothing changed ({none}).", sizes
    if comparison.says_nothing:
        text = "Whether something changed cannot be said: the reference was hardly ever where this"
        return f"{text} campaign was.", sizes
    if comparison.kind == "cause":
        means = "; ".join(LIBRARY[each].means for each in found.sets[0])
        return f"What changed: {sets[0]}: {means}.", sizes
    if comparison.kind == "ambiguous":
        text = joined(sets, "and")
        return f"Something changed, and these data cannot tell apart {text}.", sizes
    if comparison.misread and not found.sets:
        return f"What changed: {comparison.misread[0].words}.", sizes
    chance = percent(probability(document, ["unknown"]))
    part = f"; a part is like {phrase(found.sets[0])}" if found.sets else ""
    return f"Something changed that no effect of the library explains ({chance}){part}.", sizes


def document(comparison: Comparison) -> str:
    """Write the page in Markdown."""
    found = comparison.change
    changed = comparison.kind != NOTHING_CHANGED
    stages = [*where_part(found)] if changed else []
    sections: tuple[tuple[str, Sequence[str]], ...] = (
        ("", [*_head(comparison)]),
        ("In short", [*answer(comparison), *_figure(comparison, "measured")]),
        (
            "What changed",
            [*_figure(comparison, "change"), _causes(comparison), _held_out(comparison)],
        ),
        ("Where", stages),
        ("The parameters of the change", [*parameter_tables(found)]),
        ("How far it explains the change", [*shrink_part(found)] if found.shrink else []),
        (_BOTH[comparison.compared], [_common(comparison)]),
        ("What to do next", bullets([step_line(step) for step in found.next_steps])),
        ("Findings", bullets(found.findings)),
    )
    parts: list[str] = []
    for title, paragraphs in sections:
        body = [paragraph for paragraph in paragraphs if paragraph]
        parts += [f"## {title}", *body] if title and body else body
    return "\n\n".join(parts) + "\n"


def _head(comparison: Comparison) -> Iterator[str]:
    names = comparison.data.campaign.name, comparison.reference.campaign.name
    yield f"# What changed in {names[0]} since {names[1]}"
    yield f"{provenance_of(comparison)}. Seed {comparison.change.seed}."


def unit_of(comparison: Comparison) -> str:
    """Return the unit of what was compared, as it stands behind a number."""
    return "°" if comparison.compared == "angle" else " kPa"


def _causes(comparison: Comparison) -> str:
    table = cause_table(comparison.change)
    return table.replace("RMSE (°)", f"RMSE ({unit_of(comparison).strip()})")


def _held_out(comparison: Comparison) -> str:
    return (
        f"`{phrase(('none',))}` is that nothing changed. Held out: {comparison.change.held_out_on}."
    )


def _common(comparison: Comparison) -> str:
    unit, common = unit_of(comparison), comparison.common_rms
    missed = "the plain model misses of the campaign it misses"
    if comparison.compared == "pressure":
        missed = "the pressure of the campaign differs from its command by it differs by"
    text = (
        f"{common:.2f}{unit} (RMS) of what {missed} on the reference in the same way: that is no "
        "change. It was learned there as a smooth function of where the input has been, and "
        "predicts trials of the reference that it did not learn from to "
        f"{comparison.law.left_rms:.2f}{unit}."
    )
    if comparison.compared == "angle" and comparison.unvisited > 0.0:
        beside = ", or are what no actuator reads" if comparison.misread else ""
        text += (
            f" {percent(comparison.unvisited)} of the campaign's samples lie where the reference "
            f"never was{beside}: they say next to nothing of what changed."
        )
    return text


def _figure(comparison: Comparison, name: str) -> list[str]:
    caption = caption_of(name, comparison.compared)
    return [f"![{caption}]({name}.png)", f"*{caption}*"]


def caption_of(figure: str, compared: str) -> str:
    """Say what a figure of a comparison by ``angle`` or ``pressure`` shows."""
    return (_CAPTIONS if compared == "angle" else _OF_PRESSURE)[figure]


@styled
def measured_figure(comparison: Comparison) -> Figure:
    """Draw the measured signals of both campaigns over each other."""
    names = [e.name for e in experiments(comparison.change.traces, _MOST_PANELS)]
    campaigns = (comparison.reference, comparison.data)
    bent = comparison.compared == "angle"
    pressed = all(trial.pressure_kpa is not None for data in campaigns for trial in data.trials)
    pressed = pressed and bent
    outputs = "angle (°)" if bent else "pressure (kPa)"
    rows = [[f"angle of {name}" for name in names], [f"input of {name}" for name in names]]
    figure = new_figure(TWO_COLUMNS_IN, 4.0, rows)
    panels = {axes.get_label(): axes for axes in figure.axes}
    for name in names:
        above, below = panels[f"angle of {name}"], panels[f"input of {name}"]
        for data, colour in zip(campaigns, (BLUE, VERMILION), strict=True):
            trials = trials_of(data, name)
            for number, trial in enumerate(trials):
                last = number + 1 == len(trials)
                look: dict[str, Any] = {"color": colour, "linestyle": "-"}
                look |= {"linewidth": 1.1, "alpha": 1.0} if last else _FAINT
                label = data.campaign.name if last else None
                shown = trial.angle_deg if bent else trial.pressure_kpa
                assert shown is not None
                above.plot(trial.t_s, shown, label=label, **look)
                driving = trial.pressure_kpa if pressed else trial.command_kpa
                if driving is not None:
                    below.plot(trial.t_s, driving, **look)
        above.set_title(name.replace("_", " "), loc="left")
        below.set_xlabel("time (s)")
    panels[rows[0][0]].set_ylabel(outputs)
    panels[rows[1][0]].set_ylabel("pressure (kPa)" if pressed else "command (kPa)")
    handles = panels[rows[0][0]].get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure


def trials_of(data: CampaignData, experiment: str) -> list[Trial]:
    """Return the trials of an experiment; where the campaign has none of its name, its first's."""
    own = [trial for trial in data.trials if trial.experiment == experiment]
    first = data.trials[0].experiment
    return own or [trial for trial in data.trials if trial.experiment == first]


def _band(axes: Axes, comparison: Comparison, label: str) -> None:
    """Draw by how much a trial may differ without any change, where that is known."""
    for trial, sigma in zip(comparison.data.trials, comparison.sigma, strict=True):
        if trial.label == label:
            ends = -_TWO * sigma, _TWO * sigma
            look: dict[str, Any] = {"color": GREY, "alpha": 0.3, "linewidth": 0}
            axes.fill_between(trial.t_s, *ends, **look, label="nothing changed")


def _compared(comparison: Comparison, experiment: Experiment) -> Experiment:
    """Show the last trial that was compared at all, where the one to be shown was not."""
    labels = comparison.change.traces.label
    known = {
        trial.label
        for trial, sigma in zip(comparison.data.trials, comparison.sigma, strict=False)
        if np.isfinite(sigma).any()
    }
    found = [trial for trial in experiment.trials if labels[trial] in known]
    if not found or labels[experiment.shown] in known:
        return experiment
    return replace(experiment, shown=found[-1])


@styled
def change_figure(comparison: Comparison) -> Figure:
    """Draw what is left of the campaign without what the reference lets expect."""
    found = comparison.change
    traces, floor = found.traces, found.gap.noise_floor_deg
    shown = [_compared(comparison, e) for e in experiments(traces, _MOST_PANELS)]
    figure = new_figure(TWO_COLUMNS_IN, 2.6, [[e.name for e in shown]])
    for axes, e in zip(figure.axes, shown, strict=True):
        if not comparison.sigma:
            axes.axhspan(-floor, floor, color=GREY, alpha=0.3, linewidth=0, label="nothing changed")
        for trial in e.trials:
            own = traces.trial == trial
            last = trial == e.shown
            if last and comparison.sigma:
                _band(axes, comparison, traces.label[trial])
            left = traces.measured_deg[own] - traces.plain_deg[own]
            axes.plot(
                traces.time_s[own],
                left,
                color=BLACK,
                linestyle="-",
                **({"linewidth": 1.1, "alpha": 1.0} if last else _FAINT),
                label="measured − expected" if last else None,
            )
            if found.sets and last:
                named = traces.explained_deg[own] - traces.plain_deg[own]
                axes.plot(
                    traces.time_s[own],
                    named,
                    color=VERMILION,
                    linestyle="--",
                    linewidth=1.1,
                    label=fill(phrase(found.sets[0], " + "), _LABEL),
                )
        axes.set_title(f"{e.title}, {e.place}", loc="left")
        axes.set_xlabel("time (s)")
    figure.axes[0].set_ylabel(
        f"change of the {comparison.compared} ({unit_of(comparison).strip()})"
    )
    handles = figure.axes[0].get_legend_handles_labels()[0]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure
