"""Repeated commands on measured actuators: does the diagnosis name a change where nothing changed?

Of every two repeats A and B of one command the plain model is identified on A, and B is diagnosed
with it. What counts as a false cause, and which logs hold repeats, stands on the page that this
writes, docs/blind/measured_repeats.md, beside a table of all pairs and a figure. The data are not
part of the project (docs/real_data.md).
"""

from __future__ import annotations

import argparse
import csv
import io
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Any

from spa_fo.edge import keep_blas_to_one_thread

keep_blas_to_one_thread()

import numpy as np  # noqa: E402
from matplotlib import style  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from tabulate import tabulate  # noqa: E402

from real_data import SEED, commit  # noqa: E402
from repeated_commands import (  # noqa: E402
    SERIES,
    Repeat,
    Series,
    lay_out,
    numbers,
    repeats_of,
)
from spa_fo.atomic import replacing, write_text  # noqa: E402
from spa_fo.gap import diagnose_campaign  # noqa: E402
from spa_fo.identify import fit_campaign, predict_trial  # noqa: E402
from spa_fo.plant import Model, write_model  # noqa: E402
from spa_fo.report.style import (  # noqa: E402
    BLACK,
    BLUE,
    GREY,
    SKY,
    TWO_COLUMNS_IN,
    VERMILION,
    mark_provenance,
    new_figure,
    styled,
)
from spa_fo.rig import CampaignData, read_campaign, read_trials  # noqa: E402

Floats = NDArray[np.float64]
Progress = Callable[[str], None]

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "docs" / "blind"
NAME = "measured_repeats"
STYLE = ROOT / "src" / "spa_fo" / "report" / "spa_fo.mplstyle"
PROVENANCE = "measured, by others: three-chamber soft arm, silicone PneuNet"
KINDS = ("no_gap", "cause", "ambiguous", "unknown")
ERROR = "error"
ALIKE = 0.05  # of A's swing: repeats that differ by less are counted once more by themselves
WITHIN = f"{100.0 * ALIKE:.0f} %"
JUMP = 2.0  # psi or deg from one sample to the next: less is a ramp
EXAMPLE = """\
example:
  python benchmarks/measured_repeats.py data
  python benchmarks/measured_repeats.py data --only ramp pneunet --out build"""


# How far repeats differ, and the model from both.


@dataclass(frozen=True)
class Track:
    """One trial's angle over time, and when its command jumps or turns.

    Attributes
    ----------
    t_s, angle_deg : (n,) arrays
    marks_s : (marks,) array
    """

    t_s: Floats
    angle_deg: Floats
    marks_s: Floats


def marks(time: Floats, value: Floats) -> Floats:
    """Return when a command jumps; where it never does, when it is at its largest."""
    jumps = np.flatnonzero(np.abs(np.diff(value)) > JUMP) + 1
    return time[jumps] if jumps.size else time[[int(np.argmax(value))]]


def tracks(repeat: Repeat, series: Series, data: CampaignData) -> list[Track]:
    """Return the angle of each trial with the marks of its command."""
    found = []
    for log, trial in zip(repeat.logs, data.trials, strict=True):
        time, value = numbers(log, "t_s", series.columns.repeated)
        found.append(Track(trial.t_s, trial.angle_deg, marks(time - time[0], value)))
    return found


def differences(a: Track, b: Track) -> Floats:
    """Return the angle of B less that of A, from mark to mark: people press no button alike.

    What lies before the first mark is aligned by its end, the rest by its start. Where a part of
    one is longer, the rest of it is left out.
    """
    if a.marks_s.size != b.marks_s.size:
        raise ValueError(f"expected {a.marks_s.size} marks, not {b.marks_s.size}")
    parts = [_part(a, b, a.marks_s[0], b.marks_s[0], before=True)]
    for mark in range(a.marks_s.size):
        parts.append(_part(a, b, a.marks_s[mark], b.marks_s[mark], mark=mark))
    return np.concatenate(parts)


def _part(
    a: Track, b: Track, mark_a: float, mark_b: float, mark: int = 0, before: bool = False
) -> Floats:
    if before:
        since = a.t_s[(a.t_s < mark_a) & (a.t_s - mark_a >= b.t_s[0] - mark_b)] - mark_a
    else:
        length = min(_end(a, mark) - mark_a, _end(b, mark) - mark_b)
        since = a.t_s[(a.t_s >= mark_a) & (a.t_s < mark_a + length)] - mark_a
    of_a = np.interp(mark_a + since, a.t_s, a.angle_deg)
    return np.asarray(np.interp(mark_b + since, b.t_s, b.angle_deg) - of_a)


def _end(track: Track, mark: int) -> float:
    last = mark + 1 == track.marks_s.size
    return float(track.t_s[-1] if last else track.marks_s[mark + 1])


def rms(values: Floats) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def model_error(model: Model, data: CampaignData) -> float:
    """Return the RMS error of a model over all samples of all trials, deg."""
    return rms(np.concatenate([predict_trial(model, t) - t.angle_deg for t in data.trials]))


# What the diagnosis says.


@dataclass(frozen=True)
class Answer:
    """What a diagnosis says, or the error that it ended in.

    Attributes
    ----------
    kind : str
        One of `KINDS`, or `ERROR`.
    sets : tuple of frozensets of str
        Explanations that stand.
    probability : float or None
        Of the first of them; of `unknown` or `none` where none is named.
    gap_deg, floor_deg : float or None
    message : str
        Of the error.
    """

    kind: str
    sets: tuple[frozenset[str], ...] = ()
    probability: float | None = None
    gap_deg: float | None = None
    floor_deg: float | None = None
    message: str = ""

    @property
    def words(self) -> str:
        """The answer in one cell of a table."""
        named = " or ".join(" + ".join(sorted(ids)) for ids in self.sets)
        said = f"{self.kind}: {named}" if named else self.message or self.kind
        return said if self.probability is None else f"{said} ({self.probability:.2f})"


def answer(document: Mapping[str, Any]) -> Answer:
    """Read the answer out of a diagnosis.json."""
    verdict = document["verdict"]
    sets = tuple(frozenset(ids) for ids in verdict["sets"])
    kind = verdict["kind"]
    weighed = {"no_gap": frozenset({"none"}), "unknown": frozenset({"unknown"})}
    first = weighed[kind] if kind in weighed else sets[0]
    return Answer(
        kind=kind,
        sets=sets,
        probability=sum(
            cause["probability"] for cause in document["causes"] if frozenset(cause["set"]) == first
        ),
        gap_deg=document["gap"]["rmse_deg"],
        floor_deg=document["gap"]["noise_floor_deg"],
    )


def ask(campaign: Path, model: Path) -> Answer:
    """Diagnose a campaign folder; an error is an answer too."""
    try:
        return answer(diagnose_campaign(campaign, model, seed=SEED).to_dict())
    except Exception as error:  # whatever it is, it is what a user would have got
        message = f"{type(error).__name__}: {error}".replace(f"{campaign.parent}/", "")
        return Answer(ERROR, message=message)


@dataclass(frozen=True)
class Pair:
    """Two repeats, and what is said of them with the model of the first.

    Attributes
    ----------
    series, a, b : str
    swing_deg : float
        From the least to the largest angle of A.
    between_deg : float
        RMS by which B differs from A.
    on_a_deg, on_b_deg : float
        RMS error of A's model.
    of_a, of_copy, of_b : Answer
        Of A; of A's own bytes under another name, so that the model is not known to be its own;
        of B.
    """

    series: str
    a: str
    b: str
    swing_deg: float
    between_deg: float
    on_a_deg: float
    on_b_deg: float
    of_a: Answer
    of_copy: Answer
    of_b: Answer

    @property
    def alike(self) -> bool:
        """Whether B repeats A closely."""
        return self.between_deg <= ALIKE * self.swing_deg

    @property
    def false_cause(self) -> bool:
        """Whether a cause is named of B that is not named of A."""
        return self.of_b.kind == "cause" and self.of_b.sets[0] not in self.of_a.sets

    @property
    def of_no_difference(self) -> bool:
        """Whether that same cause is named of a copy of A, which differs from A in nothing."""
        return self.false_cause and self.of_b.sets[0] in self.of_copy.sets


@dataclass(frozen=True)
class Fitted:
    """A repeat with its model, and what is said of it with that model."""

    name: str
    folder: Path
    data: CampaignData
    tracks: list[Track]
    model: Model
    model_path: Path
    itself: Answer
    copy: Answer


def fit(series: Series, repeat: Repeat, work: Path) -> Fitted:
    """Lay a repeat out, identify the plain model on it, and diagnose it with that."""
    name = f"{series.name}_{repeat.name}"
    folder = lay_out(series, repeat, name, work)
    data = read_trials(read_campaign(folder))
    model = fit_campaign(data, seed=SEED, signal=series.signal).model
    path = work / f"{name}.json"
    write_model(path, model)
    copied = lay_out(series, repeat, f"{name}_copy", work)
    return Fitted(
        name=repeat.name,
        folder=folder,
        data=data,
        tracks=tracks(repeat, series, data),
        model=model,
        model_path=path,
        itself=ask(folder, path),
        copy=ask(copied, path),
    )


def compare(series: Series, a: Fitted, b: Fitted) -> Pair:
    """Diagnose B with A's model."""
    apart = [differences(one, other) for one, other in zip(a.tracks, b.tracks, strict=True)]
    return Pair(
        series=series.name,
        a=a.name,
        b=b.name,
        swing_deg=max(float(np.ptp(track.angle_deg)) for track in a.tracks),
        between_deg=rms(np.concatenate(apart)),
        on_a_deg=model_error(a.model, a.data),
        on_b_deg=model_error(a.model, b.data),
        of_a=a.itself,
        of_copy=a.copy,
        of_b=ask(b.folder, a.model_path),
    )


def run(
    series: Series, data: Path, work: Path, progress: Progress = print
) -> tuple[list[Fitted], list[Pair]]:
    """Judge every ordered pair of a series."""
    fitted, pairs = [], []
    for repeat in repeats_of(series, data):
        one = fit(series, repeat, work)
        progress(f"{series.name} {one.name}: {one.itself.words}; its copy: {one.copy.words}")
        fitted.append(one)
    for a, b in permutations(fitted, 2):
        pair = compare(series, a, b)
        progress(f"{series.name} {a.name} -> {b.name}: {pair.of_b.words}")
        pairs.append(pair)
    return fitted, pairs


# The page, its table and its figure.


def row(pair: Pair) -> dict[str, Any]:
    """Return a pair as a row of the csv file."""
    found: dict[str, Any] = {
        "series": pair.series,
        "a": pair.a,
        "b": pair.b,
        "swing_deg": f"{pair.swing_deg:.2f}",
        "between_deg": f"{pair.between_deg:.3f}",
        "alike": int(pair.alike),
        "model_on_a_deg": f"{pair.on_a_deg:.3f}",
        "model_on_b_deg": f"{pair.on_b_deg:.3f}",
    }
    for name, said in (("a", pair.of_a), ("copy", pair.of_copy), ("b", pair.of_b)):
        found |= {
            f"kind_of_{name}": said.kind,
            f"sets_of_{name}": "|".join("+".join(sorted(ids)) for ids in said.sets),
            f"probability_of_{name}": _number(said.probability, 3),
            f"gap_of_{name}_deg": _number(said.gap_deg, 3),
            f"floor_of_{name}_deg": _number(said.floor_deg, 3),
            f"error_of_{name}": said.message,
        }
    return found | {
        "false_cause": int(pair.false_cause),
        "of_no_difference": int(pair.of_no_difference),
    }


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def table_of_pairs(pairs: Sequence[Pair]) -> str:
    """Return the csv file."""
    rows = [row(pair) for pair in pairs]
    text = io.StringIO()
    writer = csv.DictWriter(text, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


@styled
def figure(found: Mapping[Series, Sequence[Fitted]]) -> Figure:
    """Draw the repeats of each log over each other, with two predictions of the last one."""
    shown = {s: fits for s, fits in found.items() if len(fits[0].data.trials) == 1}
    names = [series.name for series in shown]
    columns = 3
    cells = [*names, *["legend"] * (-len(names) % columns or columns)]
    mosaic = [cells[i : i + columns] for i in range(0, len(cells), columns)]
    drawn = new_figure(TWO_COLUMNS_IN, 0.3 + 1.65 * len(mosaic), mosaic)
    axes = {axis.get_label(): axis for axis in drawn.axes}
    for series, fits in shown.items():
        axis, first, last = axes[series.name], fits[0], fits[-1]
        for number, one in enumerate(fits):
            (trial,) = one.data.trials
            axis.plot(
                trial.t_s,
                trial.angle_deg,
                "-",
                color={0: BLACK, len(fits) - 1: SKY}.get(number, GREY),
                linewidth=0.9,
                label={
                    0: "measured: first repeat",
                    len(fits) - 1: "measured: last repeat",
                    1: "measured: those between",
                }.get(number),
            )
        (trial,) = last.data.trials
        for model, colour, line, whose in (
            (first.model, VERMILION, "--", "model of the first"),
            (last.model, BLUE, ":", "its own model"),
        ):
            axis.plot(
                trial.t_s,
                predict_trial(model, trial),
                line,
                color=colour,
                linewidth=1.0,
                label=f"last repeat predicted: {whose}",
            )
        axis.set_title(f"{series.name}: {len(fits)} repeats", loc="left")
        axis.set(xlabel="time (s)", ylabel="angle (°)")
    handles, labels = axes[max(shown, key=lambda s: len(shown[s])).name].get_legend_handles_labels()
    axes["legend"].axis("off")
    axes["legend"].legend(handles, labels, loc="center left")
    return drawn


def write_figure(drawn: Figure, path: Path) -> None:
    mark_provenance(drawn, PROVENANCE)
    with style.context(STYLE), replacing(path) as temporary:
        drawn.savefig(temporary, metadata={"Software": None})


PAGE = """\
# Repeated commands on measured actuators

{lead}

All data are measured, by others, and not part of the project ([where they are from, and how to run
such a thing](../real_data.md)). Made by `{command}` at commit {commit}, seed {seed}. All pairs:
[measured_repeats.csv](measured_repeats.csv).

## What is asked

An actuator is given the same command twice, and nothing was changed between the repeats A and B.
The plain model is identified on A, on whole logs, and B is diagnosed with it: every ordered pair of
repeats, {pairs} in all, of {logs} logs.

The plain model misses a real actuator by degrees, B as much as A, and an effect of the library that
is named of both may be true of the actuator: hysteresis does not go away when a command is
repeated. So what is counted is a cause that *appears between repeats*:

- A **false cause** is a verdict `cause` on B whose set is not among the sets of the verdict on A
  with A's own model. One effect more or less makes another set, and counts.
- The diagnosis knows a model by its campaign's name, or by what least squares leave, as fitted to
  it, and then frees the model's coefficients. So it is asked a third time,
  of **a copy of A** under another name: the same bytes,
  in which nothing can have changed. A false cause that is said of the copy too is *of no
  difference*: it comes from taking the coefficients for given, not from what B does otherwise.
- `ambiguous`, `unknown` and `no_gap` are no false causes; a table counts them. The model misses A
  itself by more than noise, so that `no_gap` is not what is right of B either.
- A diagnosis that ends in an error is an answer as well, with its message.

This is one side of the question alone: a diagnosis that always abstains passes. How often a cause
is found that is there is what [the blind benchmark](../blind.md) is for.

Real repeats are not quite alike, least where the arm has not come back to rest. Their RMS
difference stands beside every answer, and pairs that differ by at most {alike} of A's swing are
counted once more by themselves. Pairs of one log share cycles, and both directions share both
repeats, so there is no interval here: the numbers rest on {logs} logs of {kinds_of_actuator}
kinds of actuator.

## What is said

{kinds}

*A*: each repeat with the model identified on it. *Copy of A*: the same bytes under another name.
*B*: each pair.

## Series by series

{errors_of_model}

Medians over the pairs. *A to B* is the RMS by which the repeats themselves differ, aligned from one
jump or turn of the command to the next; *swing* is the angle's range; *model on A*, *on B* are the
RMS errors of the model identified on A. *Floor* is what the diagnosis takes for noise: where a
campaign is a single trial, the noise of single samples alone, so that every repeatable miss of the
model is a gap to it.

{verdicts}

{words}

![Repeats drawn over each other, and the last one predicted by two models](measured_repeats.png)

*Repeats drawn over each other, and the last one predicted by the model identified on the first and
by its own. Where the two predictions lie on each other, identification repeats as the actuator
does.*

## Every false cause

{false_causes}

## Where a cause or no gap is said of A or of its copy

{of_itself}

## Errors

{errors}

## What counts as a repeat

- *ramp*: two logs of one command, which begins at 3 psi. Above 29.7 psi the regulator does not
  follow.
- *pneunet*: three logs of one sequence of setpoints. The command is a signed PWM that a controller
  makes of the angle, and no pressure, so the measured pressure is the input. What repeats is the
  setpoint.
- *pulse* and *triangle*: cycles of one log, their lines as they are. A pulse begins one second
  before the command rises, a triangle where it turns. The first two cycles condition the arm and
  are left out, and so is the sixth of the two logs with a bias, which ends at another pressure.
  What is left still changes: with the other chambers at 0 psi (*pulse25_bias0*) the arm does not
  come back to rest between pulses, and swings less each time.
- *by_two*: two successive cycles as the two trials of a campaign, so that it has repeated trials as
  a campaign should: a noise floor that holds their scatter, and a trial to hold out. The
  cycles are those of the series of single ones.
- Angle, command and pressure count from what they read at rest.

Left out: the random staircases (their levels differ), the arm with and without a payload (in closed
loop the reference repeats, not the command), logs without an angle, 10 and 25 psi of
`soft_arm_steps` (the recordings of *pulse10* and *pulse25* once more), and whatever was commanded
once.
"""


def page(found: Mapping[Series, Sequence[Fitted]], pairs: Sequence[Pair], command: str) -> str:
    """Return the page as Markdown."""
    files = {file for series in found for file in series.files}
    return PAGE.format(
        lead=_lead(pairs),
        command=command,
        commit=commit(),
        seed=SEED,
        pairs=len(pairs),
        logs=len(files),
        kinds_of_actuator=len({series.material for series in found}),
        alike=WITHIN,
        kinds=_markdown(_kinds(pairs)),
        errors_of_model=_markdown([_sizes(series, pairs) for series in found]),
        verdicts=_markdown([_verdicts(series, pairs) for series in found]),
        words="\n".join(f"- *{series.name}*: {series.words}" for series in found),
        false_causes=_listed(_false_causes(pairs), "None."),
        of_itself=_listed(_of_itself(pairs), "Nowhere."),
        errors=_listed(_errors(pairs), "No diagnosis ended in an error."),
    )


def _lead(pairs: Sequence[Pair]) -> str:
    near = [pair for pair in pairs if pair.alike]
    wrong = [pair for pair in pairs if pair.false_cause]
    idle = f"{sum(pair.of_no_difference for pair in wrong)} of the {len(wrong)}"
    of_copies = f" {idle} are named of a copy of A as well, which differs from A in nothing."
    count = Counter(pair.of_b.kind for pair in pairs)
    said = ", ".join(f"`{kind}` {count[kind]}" for kind in (*KINDS, ERROR) if count[kind])
    return (
        f"**A cause that appears between repeats is named in {len(wrong)} of {len(pairs)} pairs**, "
        f"in {sum(pair.false_cause for pair in near)} of the {len(near)} whose repeats differ by "
        f"at most {WITHIN} of the swing. The answers on B: {said}." + of_copies * bool(wrong)
    )


def _kinds(pairs: Sequence[Pair]) -> Iterator[dict[str, Any]]:
    firsts = list({(pair.series, pair.a): pair for pair in pairs}.values())
    for what, answers in (
        ("A", [pair.of_a for pair in firsts]),
        ("copy of A", [pair.of_copy for pair in firsts]),
        ("B", [pair.of_b for pair in pairs]),
        (f"B within {WITHIN}", [pair.of_b for pair in pairs if pair.alike]),
    ):
        count = Counter(said.kind for said in answers)
        yield {"of": what, "answers": len(answers)} | {k: count[k] for k in (*KINDS, ERROR)}


def _sizes(series: Series, pairs: Sequence[Pair]) -> dict[str, Any]:
    own = [pair for pair in pairs if pair.series == series.name]
    floors = [pair.of_b.floor_deg for pair in own if pair.of_b.floor_deg is not None]
    middle: dict[str, float] = {
        "swing °": np.median([pair.swing_deg for pair in own]),
        "A to B °": np.median([pair.between_deg for pair in own]),
        "model on A °": np.median([pair.on_a_deg for pair in own]),
        "on B °": np.median([pair.on_b_deg for pair in own]),
        "floor °": np.median(floors) if floors else np.nan,
    }
    return {
        "series": series.name,
        "pairs": len(own),
        f"within {WITHIN}": sum(pair.alike for pair in own),
        **{name: f"{value:.2f}" for name, value in middle.items()},
    }


def _verdicts(series: Series, pairs: Sequence[Pair]) -> dict[str, Any]:
    own = [pair for pair in pairs if pair.series == series.name]
    count = Counter(pair.of_b.kind for pair in own)
    return {
        "of B": series.name,
        **{kind: count[kind] for kind in (*KINDS, ERROR)},
        "false causes": sum(pair.false_cause for pair in own),
        "of no difference": sum(pair.of_no_difference for pair in own),
    }


def _false_causes(pairs: Sequence[Pair]) -> Iterator[dict[str, Any]]:
    for pair in pairs:
        if pair.false_cause:
            share = 100.0 * pair.between_deg / pair.swing_deg
            yield {
                "series": pair.series,
                "A": pair.a,
                "B": pair.b,
                "A to B": f"{pair.between_deg:.2f}° ({share:.1f} %)",
                "on A °": f"{pair.on_a_deg:.2f}",
                "on B °": f"{pair.on_b_deg:.2f}",
                "said of B": pair.of_b.words,
                "of A": pair.of_a.words,
                "of a copy of A": pair.of_copy.words,
            }


def _of_itself(pairs: Sequence[Pair]) -> Iterator[dict[str, Any]]:
    for pair in {(pair.series, pair.a): pair for pair in pairs}.values():
        if {"cause", "no_gap"} & {pair.of_a.kind, pair.of_copy.kind}:
            yield {
                "series": pair.series,
                "A": pair.a,
                "model on A °": f"{pair.on_a_deg:.2f}",
                "said of A": pair.of_a.words,
                "of a copy of A": pair.of_copy.words,
            }


def _errors(pairs: Sequence[Pair]) -> Iterator[dict[str, Any]]:
    said: dict[tuple[str, str, str], str] = {}
    for pair in pairs:
        said[pair.series, pair.a, "itself"] = pair.of_a.message
        said[pair.series, pair.a, "its copy"] = pair.of_copy.message
        said[pair.series, pair.a, pair.b] = pair.of_b.message
    for (series, a, b), message in said.items():
        if message:
            yield {"series": series, "model of": a, "diagnosed": b, "message": message}


def _listed(rows: Iterator[dict[str, Any]], otherwise: str) -> str:
    listed = list(rows)
    return _markdown(listed) if listed else otherwise


def _markdown(rows: Iterator[dict[str, Any]] | Sequence[dict[str, Any]]) -> str:
    return str(tabulate(list(rows), headers="keys", tablefmt="pipe", disable_numparse=True))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").partition("\n")[0],
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("data", type=Path, help="folder of the measured data")
    names = [series.name for series in SERIES]
    parser.add_argument(
        "--only", nargs="+", choices=names, metavar="SERIES", default=names, help=", ".join(names)
    )
    parser.add_argument("--out", type=Path, default=OUT, help="where to write (docs/blind)")
    options = parser.parse_args(arguments)
    chosen = [series for series in SERIES if series.name in options.only]
    found, pairs = dict[Series, list[Fitted]](), list[Pair]()
    with tempfile.TemporaryDirectory() as work:
        for number, series in enumerate(chosen, 1):
            print(f"{series.name} ({number} of {len(chosen)}): {series.words}", flush=True)
            found[series], judged = run(series, options.data, Path(work))
            pairs += judged
    write_text(options.out / f"{NAME}.csv", table_of_pairs(pairs))
    write_figure(figure(found), options.out / f"{NAME}.png")
    command = "make repeats"
    if len(chosen) < len(SERIES):
        command = f"measured_repeats.py --only {' '.join(options.only)}"
    write_text(options.out / f"{NAME}.md", page(found, pairs, command))


if __name__ == "__main__":
    main()
