"""The page about the blind benchmark: ``python -m blind.report.document --help``.

Every number on it comes from scores.json.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from blind.report.history import Mark, marks_of, read_history, table, with_run, written
from blind.report.tables import KIND_NAMES, PROTOCOL_NAMES, goal
from spa_fo.atomic import replacing, write_text
from spa_fo.edge import bad_input_exits
from spa_fo.errors import BadInput

_COPIED = ("*.csv", "*.png", "table.md", "scores.json", "seals.txt")
_FIGURES = {
    "size_curve": "How the answers improve with the size of the effect, with 95 % intervals.",
    "confusion": "What each effect of at least four times the noise floor is taken for.",
    "calibration": "How often the most probable explanation is right, against its probability.",
    "shrink": "The share of the gap that the augmented model closes: claimed, and realised on a "
    "later campaign of the same specimen with other levels and protocols.",
}
_BASELINES = ("refit_only", "smallest_bic", "commonest")
_METHOD = """\
Every case is a campaign of the virtual rig, which shares no code, no solver and no functional form
with the diagnosis. Specimen, scatter between trials, order of the trials and secondary parameters
of the effect are drawn; its size is solved for, so that it changes the logged angle by a multiple
of the noise floor (RMS over all samples). The labels are sealed: their salted SHA-256 stands in
`seals.txt` before the first diagnosis, every batch of diagnoses writes down the hash of that file
before it begins, and the labels are opened only if all of it agrees.

Thresholds and learned weights of the diagnosis were frozen before, on other seeds: those of
development, and of benchmarks whose answers were open by then. This benchmark has seed {seed}.

The counting is strict. Naming more than what is at work is a wrong name; an `unknown` that holds
the truth as the explained part does not count as naming it (but *at least one named* of a pair
counts what an `unknown` gives as the explained part, too); sets are counted in the answers that
name any. Intervals are Wilson's for shares and bootstrap over cases for means. A claimed shrink
is judged where the plain model's error on the later campaign is at least {clear:g} times the
noise floor ({left_out} claims are not), as below the scatter of its few trials hides the
fraction; the floor is that of the specimen's own repeated trials. *Refit only* identifies the
plain model again and names nothing, *smallest BIC* always names the explanation of the smallest
Bayesian information criterion, *commonest effect* always the same one."""


@dataclass(frozen=True)
class Origin:
    """What made the results: the commit, the command, and the benchmark's configuration."""

    commit: str
    command: str


_HISTORY = """\
Every run that was published, the first one left, what was not reached bold. Between two runs the
diagnosis was changed after what the cases of the earlier one taught, and each run has new cases: no
column is chosen among several of one state. With so few cases a mark, the same diagnosis passes a
goal in one run and misses it in the next: the intervals above say by how much. All values with
their commits: [{folder}/history.csv]({folder}/history.csv)."""


def document(
    scores: Mapping[str, Any],
    origin: Origin,
    folder: str = "blind",
    history: Sequence[Mark] = (),
) -> str:
    """Write the page.

    Parameters
    ----------
    scores : Mapping
        As read from scores.json.
    origin : Origin
        Stands at the end.
    folder : str
        Where the figures and tables are, seen from the page.
    history : sequence of Mark
        Of all runs, this one last.

    Returns
    -------
    str
        Markdown.
    """
    parts = [
        "# The blind benchmark of the diagnosis",
        _lead(scores),
        "## The worst classes",
        _worst(scores["effects"], folder),
        "## What it had to reach",
        _marks(scores["marks"]),
        _sizes(scores),
        *_figures(folder),
        "## Claims of how far the gap closes, by kind of answer",
        _claims(scores["claims"]),
        "## All runs",
        _HISTORY.format(folder=folder),
        table(history),
        "## How it was done",
        _METHOD.format(
            seed=scores["benchmark"]["seed"],
            left_out=scores["shrink_left_out"],
            clear=scores["shrink_clear"],
        ),
        _cases(scores),
        "## Fair answers where the library lacks the effect",
        _equivalents(scores["equivalents"]),
        "## What made it",
        _origin(origin, scores["benchmark"]),
    ]
    return "\n\n".join(parts) + "\n"


def _lead(scores: Mapping[str, Any]) -> str:
    worst = scores["effects"][0]
    rate = worst["rates"][worst["worst"]]
    taken = f" It is mostly taken for `{worst['mistaken_for']}`." if worst["mistaken_for"] else ""
    judged = [mark["reached"] for mark in scores["marks"] if mark["reached"] is not None]
    return (
        f"The worst class is **{worst['effect']}**: right in {_percent(rate['value'])} of "
        f"{rate['n']} cases ({_interval(rate)}) by *{worst['worst']}*.{taken} Of {len(judged)} "
        f"marks {sum(judged)} are reached.\n\n"
        f"All data are synthetic: {scores['cases']} campaigns of the virtual rig."
    )


def _worst(effects: Sequence[Mapping[str, Any]], folder: str) -> str:
    lines = [
        "| class | worst rate | 95 % | of cases | which | mostly taken for |",
        "|:--|--:|:--|--:|:--|:--|",
    ]
    for effect in effects:
        rate = effect["rates"][effect["worst"]]
        lines.append(
            f"| {effect['effect']} | {_percent(rate['value'])} | {_interval(rate)} | {rate['n']} "
            f"| {effect['worst']} | {effect['mistaken_for'] or '–'} |"
        )
    return (
        "\n".join(lines)
        + f"\n\nEvery rate of every effect: [{folder}/per_effect.csv](\
{folder}/per_effect.csv); every kind, protocol and size: [{folder}/table.md]({folder}/table.md)."
    )


def _marks(marks: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        "| mark | goal | value | 95 % | cases | reached | refit only | smallest BIC | commonest |",
        "|:--|:--|--:|:--|--:|:--|--:|--:|--:|",
    ]
    for mark in marks:
        estimate, rivals = mark["estimate"], mark["baselines"]
        cells = [
            mark["name"],
            goal(mark),
            _figure(estimate["value"]),
            _ends(estimate),
            str(estimate["n"]),
            {True: "yes", False: "**no**", None: "–"}[mark["reached"]],
            *(
                _figure(rivals[name]["value"])
                for name in ("refit_only", "smallest_bic", "commonest")
            ),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _sizes(scores: Mapping[str, Any]) -> str:
    sentences = [
        f"On the protocol *{PROTOCOL_NAMES[protocol]}*, 95 % of the cases are found "
        f"{_from(size)}, and have the truth in the sets "
        f"{_from(scores['smallest_named'][protocol])}."
        for protocol, size in scores["smallest_found"].items()
    ]
    return " ".join(sentences)


def _from(size: float | None) -> str:
    return "at no size that was tried" if size is None else f"from {size:g} times the floor on"


def _figures(folder: str) -> Iterator[str]:
    for name, caption in _FIGURES.items():
        yield f"![{caption}]({folder}/{name}.png)"
        yield f"*{caption}*"


_ANSWER_NAMES = {
    "no_gap": "no gap",
    "cause": "one cause",
    "ambiguous": "several that these data cannot tell apart",
    "unknown": "unknown, but a part is explained",
}


def _claims(claims: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        "| answer | of this kind | claim something | judged | within 10 points | 95 % "
        "| interval holds |",
        "|:--|--:|--:|--:|--:|:--|--:|",
    ]
    for own in claims:
        close = own["close"]
        cells = [
            _ANSWER_NAMES[own["verdict"]],
            str(own["answers"]),
            str(own["claims"]),
            str(close["n"]),
            _figure(close["value"]),
            _ends(close),
            _figure(own["covered"]["value"]),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _cases(scores: Mapping[str, Any]) -> str:
    counts = ", ".join(f"{KIND_NAMES[kind]} {n}" for kind, n in sorted(scores["kinds"].items()))
    return (
        f"Cases: {counts}. In {scores['short']} of them the effect could not be made as large as "
        "asked without leaving what is physical; they count by the size they reached."
    )


def _equivalents(equivalents: Mapping[str, Sequence[str]]) -> str:
    lines = [
        f"- {effect}: {', '.join(fair)}" for effect, fair in sorted(equivalents.items()) if fair
    ]
    return (
        "Recorded with the sealed labels, before any diagnosis; the reasons stand in "
        "`blind/equivalents.py` and in each rig. For every effect that is "
        "not listed only `unknown` is right; the column *unknown* of the table by kind counts "
        "that alone.\n\n" + "\n".join(lines)
    )


def _origin(origin: Origin, benchmark: Mapping[str, Any]) -> str:
    config = yaml.safe_dump({"blind": dict(benchmark)}, sort_keys=False, default_flow_style=None)
    return f"Commit `{origin.commit}`, command `{origin.command}`, with\n\n```yaml\n{config}```"


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _interval(estimate: Mapping[str, Any]) -> str:
    return f"{100 * estimate['low']:.0f} to {100 * estimate['high']:.0f} %"


def _figure(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"


def _ends(estimate: Mapping[str, Any]) -> str:
    return "–" if estimate["n"] == 0 else f"{estimate['low']:.3f} to {estimate['high']:.3f}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Copy the results beside the documents and write the page; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m blind.report.document",
        description="Copy the results of the blind benchmark into the documents, with their page.",
    )
    parser.add_argument("results", type=Path, help="folder with scores.json, tables and figures")
    parser.add_argument("documents", type=Path, help="gets blind.md and blind/")
    parser.add_argument("--command", required=True, help="what made the results")
    given = parser.parse_args(arguments)
    with bad_input_exits():
        scores = _scores(given.results / "scores.json")
        origin = Origin(_commit(), given.command)
        run = marks_of(scores, origin.commit, [goal(mark) for mark in scores["marks"]])
        told = given.documents / "blind" / "history.csv"
        history = with_run(read_history(told), run)
        page = document(scores, origin, history=history)
        for pattern in _COPIED:
            for path in sorted(given.results.glob(pattern)):
                with replacing(given.documents / "blind" / path.name) as temporary:
                    shutil.copyfile(path, temporary)
        write_text(told, written(history))
        write_text(given.documents / "blind.md", page)
    return 0


def _scores(path: Path) -> Mapping[str, Any]:
    try:
        scores: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(path, f"expected the scores of a blind benchmark: {error}") from error
    return scores


def _commit() -> str:
    """Name the commit of the working folder; ``-dirty`` follows where files differ from it."""
    found = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"],
        capture_output=True,
        text=True,
        check=False,
    )
    return found.stdout.strip() or "unknown"


if __name__ == "__main__":
    raise SystemExit(main())
