"""The page about the blind benchmark: ``python -m blind.report.document --help``.

Every number on it comes from scores.json.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from blind.judge.statistics import rate
from blind.judge.targets import FALSE_ALARMS, IN_SETS, UNNAMED, WRONG_NAMES
from blind.report import sections
from blind.report.history import Mark, marks_of, read_history, rigs_of, table, with_run, written
from blind.report.other_rigs import hits, pooled
from blind.report.tables import read_classes
from blind.report.words import percent, rig_name
from spa_fo.atomic import replacing, write_text
from spa_fo.edge import bad_input_exits
from spa_fo.errors import BadInput

Priors = Sequence[tuple[str, str, str, str]]

_COPIED = ("*.csv", "*.png", "table.md", "seals.txt")
_FIGURES = {
    "surroundings": "Answers by coloured noise and its correlation time (*nearly white*: less than "
    "0.05° of it), by the scatter of the gain from trial to trial, and by the error of the "
    "calibration's known angles; with 95 % intervals.",
    "size_curve": "Answers by the size of the effect, with 95 % intervals.",
    "confusion": "Confusion matrix of effects of at least four times the noise floor: truth in "
    "rows, most probable explanation in columns.",
    "calibration": "Calibration of the probabilities: how often the most probable explanation is "
    "right, against its probability.",
    "shrink": "The share of the gap that the augmented model closes: claimed, and realised on a "
    "later campaign of the same specimen with other levels and protocols.",
}
_WORDS = """\
- **Noise floor**: the RMS by which repeats of one experiment differ. The **size** of an effect is
  the RMS by which it changes the logged angle, in noise floors.
- **Rich protocol**: releases, several levels and at least two repeats of everything. **Other
  protocols**: up-steps alone, releases alone, or a single log.
- **Set**: effects that explain the gap together. An answer lists every set that the data cannot
  tell apart; *truth in the sets*: one of them is exactly what is at work. **Found**: any answer
  but no gap.
- **Sure**, or **confident**, name: the answer is `cause`, one set alone, whatever its
  probability.
- **Withheld**: an effect that was taken out of the library for this case; **foreign**: one that
  it never had. The right answer to either is `unknown`, or an **equal** (a fair answer): an
  effect that nobody could tell from it with these data, as recorded before with the labels.
- **Beyond the contract's**: the rarer effects, which [the library](diagnosis.md#the-library) has
  beside the twenty-two that all rigs of [other hands](other_rigs.md) have.
- **Claim**: the share of the gap that the answer says its augmented model closes, with an
  interval; **realised**: what that model closes on a later campaign of the same specimen.
- **Calibration error**: by how much the probability of the first explanation and how often it is
  right differ, on average over ten classes of probability. So few cases never give 0."""
_METHOD = """\
Every case is a campaign of one of the rigs, which share no code, no solver and no functional form
with the diagnosis, nor with each other; `src/blind/CASE.md` is their common interface. The
learned settings and the forms of the effects come from opened cases of both rigs, and of rigs of
other hands: what is new to the diagnosis here is the draw, not the rig. Specimen, protocol,
surroundings and the error of the given model are drawn at random; the effect's size is chosen so
that it changes the logged angle by a multiple of the noise floor (RMS over all samples). The
labels are sealed: their salted SHA-256 is in `seals.txt` before the first diagnosis, every batch
of diagnoses records the hash of that file before it begins, and the labels are opened only if all
of it agrees. The folders say neither rig nor cause.

All settings of the diagnosis were frozen before, on other seeds. This benchmark has seed {seed}.

The scoring is strict. Naming more than the truth is a wrong name; an `unknown` that holds the
truth as the explained part does not count as naming it; sets are counted in the answers that name
any; a diagnosis that ends in an error found and named nothing, and is a false alarm where there
is no effect. An error of the given model is a shift of the parameters: naming that alone is no
false alarm, and beside the truth it is no wrong name. Intervals are Wilson's for shares and
bootstrap over cases for means; the rigs are compared by square and add of their intervals. A
claimed shrink is judged where the plain model's error on the later campaign is at least {clear:g}
times the noise floor of the specimen's own repeated trials ({left_out} claims are not)."""
_WIDTHS = """\
A claim's own interval says how far it can be trusted: it is wide where the trials that were held
out are few, or say different things."""

_LATEST = 4  # runs that are shown
_HISTORY = """\
The last {latest} of {runs} published runs, in order of time; what was not reached is bold. The
diagnosis changed between runs, and each run has new cases. All runs with their commits:
[{folder}/history.csv]({folder}/history.csv). Earlier runs had the virtual rig alone, which the
diagnosis was tuned on, and say nothing of other rigs:
[{folder}/history_one_rig.csv]({folder}/history_one_rig.csv)."""


@dataclass(frozen=True)
class Origin:
    """What made the results: the commit, the command, and the benchmark's configuration."""

    commit: str
    command: str


@dataclass(frozen=True)
class Further:
    """What stands on the page beside the scores.

    Attributes
    ----------
    history : sequence of Mark
        Of all runs, this one last.
    priors : sequence of tuples
        What surroundings are drawn from: name, prior in words, unit, reason.
    note : str
        What this run means; Markdown.
    measured : str
        What is said of measured campaigns in which nothing was changed; Markdown.
    others : sequence of Mark
        Of rigs of other hands, set by set.
    """

    history: Sequence[Mark] = ()
    priors: Priors = ()
    note: str = ""
    measured: str = ""
    others: Sequence[Mark] = ()


_OTHERS = """\
Whoever wrote these had read neither the engine nor the two rigs above, which learned settings know.
All sets of {hands} such hands, each judged once, before anybody had looked at it; beside them the
sets that were judged before anything of their hand had been opened. Set by set, and what an answer
is worth there: [Rigs of other hands](other_rigs.md)."""


def document(
    scores: Mapping[str, Any], origin: Origin, further: Further, folder: str = "blind"
) -> str:
    """Write the page.

    Parameters
    ----------
    scores : Mapping
        As read from scores.json.
    origin : Origin
        Stands at the end.
    further : Further
    folder : str
        Where the figures and tables are, seen from the page.

    Returns
    -------
    str
        Markdown.
    """
    parts = [
        "# The blind benchmark of the diagnosis",
        sections.summary(scores),
        _lead(further.others),
        further.note,
        sections.origin_of_data(scores),
        "## Words of this page",
        _WORDS,
        "## Goals and results",
        sections.marks(scores),
        "## By class of surroundings",
        sections.classes(scores, folder),
        *_figure("surroundings", folder),
        "## By effect, the worst first",
        sections.effects(scores, folder),
        *_figure("confusion", folder),
        "## By size of the effect",
        sections.sizes(scores),
        *_figure("size_curve", folder),
        "## Probabilities",
        *_figure("calibration", folder),
        "## Claims of how far the gap closes, by kind of answer",
        sections.claims(scores),
        _WIDTHS,
        sections.claims_by_width(scores),
        *_figure("shrink", folder),
        "## Errors of the given model",
        sections.shifts(scores),
        "## Errors",
        sections.errors(scores),
        *_measured(further.measured),
        *_of_others(further.others),
        "## All runs",
        *_histories(further.history, folder),
        "## How it was done",
        _method(scores),
        sections.cases(scores),
        "## What surroundings, protocols and models are drawn from",
        sections.priors(further.priors),
        "## Fair answers where the library lacks the effect",
        sections.equivalents(scores),
        "## What made it",
        _origin(origin, scores["benchmark"]),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _figure(name: str, folder: str) -> Iterator[str]:
    caption = _FIGURES[name]
    yield f"![{caption.replace('*', '')}]({folder}/{name}.png)"
    yield f"_{caption}_" if "*" in caption else f"*{caption}*"


def _measured(text: str) -> Iterator[str]:
    if text:
        yield "## Measured actuators, nothing changed"
        yield text


def _lead(others: Sequence[Mark]) -> str:
    """Say in one sentence how often it is right on rigs of other hands."""
    if not others:
        return ""
    shares = {
        target.name: rate(hits([mark for mark in others if mark.mark == target.name]))
        for target in (FALSE_ALARMS, IN_SETS, WRONG_NAMES, UNNAMED)
    }
    said = [f"{percent(one.value)} of {one.n} cases" for one in shares.values()]
    return (
        f"On {len(rigs_of(others))} [rigs of other hands](other_rigs.md), which judge best, all "
        f"sets together: false alarms in {said[0]}; what is as large is among the names in "
        f"{said[1]}; a sure and wrong name in {said[2]}; what the library lacks is unknown or an "
        f"equal in {said[3]}."
    )


def _of_others(others: Sequence[Mark]) -> Iterator[str]:
    if others:
        yield "## Rigs of other hands"
        yield _OTHERS.format(hands=len(rigs_of(others)))
        yield pooled(others)


def _histories(history: Sequence[Mark], folder: str) -> Iterator[str]:
    runs = list(dict.fromkeys(mark.run for mark in history))
    latest = [mark for mark in history if mark.run in runs[-_LATEST:]]
    shown = min(_LATEST, len(runs))
    yield _HISTORY.format(latest=shown, runs=len(runs), folder=folder)
    for rig in rigs_of(latest):
        yield f"### {rig_name(rig).capitalize()}"
        yield table(latest, rig)


def _method(scores: Mapping[str, Any]) -> str:
    return _METHOD.format(
        seed=scores["benchmark"]["seed"],
        left_out=sum(own["shrink_left_out"] for own in scores["rigs"].values()),
        clear=scores["shrink_clear"],
    )


def _origin(origin: Origin, benchmark: Mapping[str, Any]) -> str:
    config = yaml.safe_dump({"blind": dict(benchmark)}, sort_keys=False, default_flow_style=None)
    return (
        f"Commit `{origin.commit}`, command `{origin.command}`, with this in `config.yaml` "
        f"(*dirty*: some of it differed from the commit):\n\n```yaml\n{config}```"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Copy the results beside the documents and write the page; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m blind.report.document",
        description="Copy the results of the blind benchmark into the documents, with their page. "
        "blind/note.md there becomes a part of it, and so does how "
        "blind/measured_repeats.md begins. Of DOCUMENTS/blind itself the page of the last run is "
        "written again.",
        epilog="example: python -m blind.report.document docs/blind docs "
        '--command "snakemake --cores 2 blind"',
    )
    parser.add_argument("results", type=Path, help="folder with scores.json, tables and figures")
    parser.add_argument("documents", type=Path, help="gets blind.md and blind/")
    parser.add_argument("--command", required=True, help="what made the results")
    given = parser.parse_args(arguments)
    with bad_input_exits():
        scores = _scores(given.results / "scores.json")
        beside = given.documents / "blind"
        told = beside / "history.csv"
        known, again = read_history(told), given.results.resolve() == beside.resolve()
        origin = Origin(known[-1].commit if again else _commit(), given.command)
        further = Further(
            history=known if again else with_run(known, marks_of(scores, origin.commit)),
            priors=import_module("blind.surroundings").describe(),
            note=_part(beside / "note.md"),
            measured=_opening(beside / "measured_repeats.md"),
            others=read_history(beside / "other_rigs.csv"),
        )
        page = document(scores, origin, further)
        if not again:
            _copy((path for name in _COPIED for path in sorted(given.results.glob(name))), beside)
            write_text(beside / "scores.json", _without_classes(scores))
            write_text(told, written(further.history))
        write_text(given.documents / "blind.md", page)
    return 0


def _without_classes(scores: Mapping[str, Any]) -> str:
    """Write the scores but for the classes of surroundings, which have a table of their own."""
    kept = {key: value for key, value in scores.items() if key != "classes"}
    return json.dumps(kept, indent=1, allow_nan=False) + "\n"


def _copy(paths: Iterable[Path], folder: Path) -> None:
    for path in paths:
        with replacing(folder / path.name) as temporary:
            shutil.copyfile(path, temporary)


def _part(path: Path) -> str:
    """Read a part of the page without its heading; empty where there is none."""
    if not path.is_file():
        return ""
    text = path.read_text(encoding="utf-8").strip()
    first, _, rest = text.partition("\n")
    return rest.strip() if first.startswith("# ") else text


def _opening(path: Path) -> str:
    """Read how a page in the folder beside begins, its links seen from here, and link to it."""
    text, _, _ = _part(path).partition("\n## ")
    if not text:
        return ""
    here = re.sub(r"\]\((?!\w+:|\.\./)", f"]({path.parent.name}/", text.strip())
    here = here.replace("](../", "](")
    return (
        f"{here}\n\nWhat is asked, and every answer: [{path.stem}]({path.parent.name}/{path.name})."
    )


def _scores(path: Path) -> Mapping[str, Any]:
    try:
        scores: Mapping[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(path, f"expected the scores of a blind benchmark: {error}") from error
    if "classes" in scores:
        return scores
    # What is published has the classes of surroundings in a table of its own.
    return {**scores, "classes": read_classes(path.with_name("classes.csv"))}


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
