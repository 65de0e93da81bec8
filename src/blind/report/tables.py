"""The blind benchmark as tables, figures and a page, all from its scores.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from blind.report.figures import (
    calibration_figure,
    confusion_figure,
    shrink_figure,
    size_figure,
)
from spa_fo.atomic import write_text
from spa_fo.report.style import save_figure
from spa_fo.report.tables import Table, write_table

KIND_NAMES = {
    "closed": "effect in the library",
    "no_effect": "no effect",
    "withheld": "effect withheld",
    "alien": "foreign effect",
    "pair": "pair of effects",
}
PROTOCOL_NAMES = {"rich": "rich", "up_steps": "up-steps"}
_BASELINES = {
    "refit_only": "refit only",
    "smallest_bic": "smallest BIC",
    "commonest": "commonest effect",
}
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
    return (
        f"synthetic: virtual rig, blind benchmark of seed {scores['benchmark']['seed']}, "
        f"{scores['cases']} cases"
    )


def publish(scores: Mapping[str, Any], folder: Path) -> None:
    """Write every table and figure of a benchmark.

    Parameters
    ----------
    scores : Mapping
        As read from scores.json.
    folder : Path
        Gets ``table.md``, the tables as csv, tex and md, the figures as pdf and png.

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
    save_figure(confusion_figure(scores["confusion"]), folder / "confusion", line)
    save_figure(calibration_figure(scores["calibration"]), folder / "calibration", line)
    save_figure(size_figure(scores["arms"]), folder / "size_curve", line)
    save_figure(shrink_figure(scores["shrink"]), folder / "shrink", line)


def tables(scores: Mapping[str, Any]) -> dict[str, Table]:
    """Make every table by the name of its file, the one of the worst classes first."""
    line = provenance(scores)
    return {
        "per_effect": _effect_table(scores["effects"], line),
        "marks": _mark_table(scores["marks"], line),
        "arms": _arm_table(scores["arms"], scores["variants"], line),
    }


def _effect_table(effects: Sequence[Mapping[str, Any]], line: str) -> Table:
    asked = dict.fromkeys(name for effect in effects for name in effect["rates"])
    protocols = dict.fromkeys(name for effect in effects for name in effect["smallest_found"])
    rows = [
        {
            "effect": effect["effect"],
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
        "Every effect, the worst first: rates of what is right; and the size, in multiples of the "
        "noise floor, from which on every case is found, or has the truth in the sets",
        line,
        {
            name: "g" if name.endswith(" from") else ".2f"
            for name in frame.columns
            if name.endswith(" from") or name in asked or name == "worst rate"
        },
    )


def _mark_table(marks: Sequence[Mapping[str, Any]], line: str) -> Table:
    rows = [
        {
            "mark": mark["name"],
            "goal": goal(mark),
            "value": mark["estimate"]["value"],
            "95 % from": mark["estimate"]["low"],
            "to": mark["estimate"]["high"],
            "cases": mark["estimate"]["n"],
            "reached": {True: "yes", False: "no", None: None}[mark["reached"]],
        }
        | {name: mark["baselines"][key]["value"] for key, name in _BASELINES.items()}
        for mark in marks
    ]
    figures = ("value", "95 % from", "to", *_BASELINES.values())
    return Table(
        pd.DataFrame(rows),
        "What the diagnosis has to reach, and what simpler rules reach in the same cases",
        line,
        dict.fromkeys(figures, ".3f"),
    )


def goal(mark: Mapping[str, Any]) -> str:
    """Write a mark's goal as ``≥ 0.95``."""
    return f"{'≥' if mark['at_least'] else '≤'} {mark['goal']:g}"


def _arm_table(
    arms: Sequence[Mapping[str, Any]], variants: Sequence[Mapping[str, Any]], line: str
) -> Table:
    named = [(_arm_name(arm), arm) for arm in arms]
    named += [(f"rich, 4 or more: {variant['name']}", variant) for variant in variants]
    rows = [
        {"cases of": name, "n": arm["n"]}
        | {title: arm["scores"][key]["value"] for key, title in _MEASURES.items()}
        for name, arm in named
    ]
    return Table(
        pd.DataFrame(rows),
        "Every kind of case, protocol and size (multiples of the noise floor)",
        line,
        dict.fromkeys(_MEASURES.values(), ".2f"),
    )


def _arm_name(arm: Mapping[str, Any]) -> str:
    parts = [KIND_NAMES[arm["kind"]], PROTOCOL_NAMES[arm["protocol"]]]
    return ", ".join(parts if arm["size"] is None else [*parts, f"{arm['size']:g}"])
