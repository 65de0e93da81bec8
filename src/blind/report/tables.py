"""The blind benchmark as tables and figures, all from its scores.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from blind.judge.check import goal
from blind.judge.statistics import Estimate
from blind.judge.targets import TARGETS
from blind.report.figures import (
    calibration_figure,
    confusion_figure,
    shrink_figure,
    size_figure,
)
from blind.report.surroundings_figure import surroundings_figure
from blind.report.words import KIND_NAMES, PROTOCOL_NAMES, REACHED, rig_name
from spa_fo.atomic import write_text
from spa_fo.report.style import save_figure
from spa_fo.report.tables import Table, write_table

_MEASURES = {
    "found": "found",
    "in_sets": "in sets",
    "sets": "sets",
    "right_first": "most probable",
    "right_stage": "stage",
    "wrong_name": "wrong name",
    "unknown": "unknown",
    "fair_or_unknown": "unknown or equal",
    "one_named": "one named",
    "shrink_close": "shrink within 0.1",
    "shrink_covered": "shrink covered",
}


def provenance(scores: Mapping[str, Any]) -> str:
    """Say where the data come from: the line on every table and figure."""
    rigs = " and ".join(rig_name(rig) for rig in scores["rigs"])
    return (
        f"synthetic: {rigs}, blind benchmark of seed {scores['benchmark']['seed']}, "
        f"{scores['cases']} cases"
    )


def publish(scores: Mapping[str, Any], folder: Path) -> None:
    """Write every table and figure of a benchmark.

    Parameters
    ----------
    scores : Mapping
        As read from scores.json.
    folder : Path
        Gets ``table.md``, the tables as csv, tex and md, every class of surroundings as csv alone,
        the figures as pdf and png.

    Raises
    ------
    BadInput
        A file cannot be written.
    """
    found = tables(scores)
    for name, table in found.items():
        write_table(table, folder / name)
    parts = [(folder / f"{name}.md").read_text(encoding="utf-8") for name in found]
    write_text(folder / "table.md", "\n".join(parts))
    line = provenance(scores)
    classes = class_rows(scores["classes"]).assign(provenance=line)
    write_text(folder / "classes.csv", str(classes.to_csv(index=False, lineterminator="\n")))
    for name, figure in _figures(scores).items():
        save_figure(figure, folder / name, line)


def _figures(scores: Mapping[str, Any]) -> dict[str, Any]:
    rigs = scores["rigs"]

    def of_each(key: str) -> dict[str, Any]:
        return {rig: own[key] for rig, own in rigs.items()}

    return {
        "surroundings": surroundings_figure(scores["classes"], list(rigs)),
        "confusion": confusion_figure(of_each("confusion")),
        "calibration": calibration_figure(of_each("calibration")),
        "size_curve": size_figure(of_each("arms")),
        "shrink": shrink_figure(of_each("shrink")),
    }


def tables(scores: Mapping[str, Any]) -> dict[str, Table]:
    """Make every table by the name of its file."""
    line = provenance(scores)
    return {
        "marks": _mark_table(scores["marks"], line),
        "per_effect": _effect_table(scores["effects"], line),
        "arms": _arm_table(scores["rigs"], line),
    }


def _mark_row(mark: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "goal": goal(mark),
        "value": mark["estimate"]["value"],
        "95 % from": mark["estimate"]["low"],
        "to": mark["estimate"]["high"],
        "cases": mark["estimate"]["n"],
        "reached": REACHED[mark["reached"]],
    }


def _mark_table(marks: Sequence[Mapping[str, Any]], line: str) -> Table:
    rows = [
        {"rig": mark["rig"], "mark": mark["name"]}
        | _mark_row(mark)
        | {"worst": mark["which"] or None}
        for mark in marks
    ]
    return Table(
        pd.DataFrame(rows),
        "What the diagnosis has to reach",
        line,
        dict.fromkeys(("value", "95 % from", "to"), ".3f"),
    )


def class_rows(classes: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """List every mark in every class of surroundings, the one that misses its goal most first."""
    rows = [
        {
            "rig": mark["rig"],
            "dimension": mark["dimension"],
            "class": mark["class"],
            "mark": mark["name"],
        }
        | _mark_row(mark)
        for mark in classes
    ]
    return pd.DataFrame(rows)


def read_classes(path: Path) -> list[dict[str, Any]]:
    """Read the marks of every class of surroundings, as `class_rows` lists them."""
    targets = {target.name: target for target in TARGETS}
    told = {words: reached for reached, words in REACHED.items()}
    found = []
    for row in pd.read_csv(path, keep_default_na=False).to_dict("records"):
        target = targets[row["mark"]]
        low, high = float(row["95 % from"]), float(row["to"])
        estimate = Estimate(float(row["value"]), low, high, int(row["cases"]))
        found.append(
            {
                "rig": row["rig"],
                "dimension": row["dimension"],
                "class": row["class"],
                "name": target.name,
                "goal": target.goal,
                "at_least": target.at_least,
                "reached": told[row["reached"] or None],
                "missed_beyond_interval": target.surely_missed_by(estimate) > 0.0,
                "estimate": asdict(estimate),
            }
        )
    return found


def _effect_table(effects: Sequence[Mapping[str, Any]], line: str) -> Table:
    asked = dict.fromkeys(name for effect in effects for name in effect["rates"])
    protocols = dict.fromkeys(name for effect in effects for name in effect["smallest_found"])
    rows = [
        {
            "effect": effect["effect"],
            "rig": effect["rig"],
            "worst rate": effect["worst_rate"],
            "which": effect["worst"],
            "of": effect["rates"][effect["worst"]]["n"],
            "mistaken for": effect["mistaken_for"] or None,
            "cases": effect["cases"],
        }
        | {name: effect["rates"].get(name, {}).get("value") for name in asked}
        | {
            f"{PROTOCOL_NAMES[protocol]}: {title} from": effect[key].get(protocol)
            for key, title in (("smallest_found", "found"), ("smallest_named", "named"))
            for protocol in protocols
        }
        for effect in effects
    ]
    frame = pd.DataFrame(rows)
    return Table(
        frame,
        "Every effect on every rig, the worst first: rates of what is right; and the size, in "
        "multiples of the noise floor, from which on every case is found, or has the truth in the "
        "sets",
        line,
        {
            name: "g" if name.endswith(" from") else ".2f"
            for name in frame.columns
            if name.endswith(" from") or name in asked or name == "worst rate"
        },
    )


def _arm_table(rigs: Mapping[str, Mapping[str, Any]], line: str) -> Table:
    rows = [
        {"rig": rig, "cases of": _arm_name(arm), "n": arm["n"]}
        | {title: arm["scores"][key]["value"] for key, title in _MEASURES.items()}
        for rig, own in rigs.items()
        for arm in own["arms"]
    ]
    return Table(
        pd.DataFrame(rows),
        "Every kind of case, group of protocols and size (multiples of the noise floor)",
        line,
        dict.fromkeys(_MEASURES.values(), ".2f"),
    )


def _arm_name(arm: Mapping[str, Any]) -> str:
    parts = [KIND_NAMES[arm["kind"]], PROTOCOL_NAMES[arm["protocols"]]]
    return ", ".join(parts if arm["size"] is None else [*parts, f"{arm['size']:g}"])
