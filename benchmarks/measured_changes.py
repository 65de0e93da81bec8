"""What `spa-fo compare` says of measured campaigns between which something is known to differ.

    python benchmarks/measured_changes.py data

Of every pair the model is identified on the first log and the second is compared with it. Which
pairs there are, what is known of each and how an answer is judged stands on the page that this
writes, docs/real_data/changes.md. The data are not part of the project (docs/real_data.md).
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from spa_fo.edge import keep_blas_to_one_thread

keep_blas_to_one_thread()

from tabulate import tabulate  # noqa: E402

from real_data import commit  # noqa: E402
from repeated_commands import ARM, SERIES, Columns, Series, lay_out, repeats_of  # noqa: E402
from spa_fo.api import Campaign, Comparison  # noqa: E402
from spa_fo.atomic import write_text  # noqa: E402
from spa_fo.report.change import measured_figure, provenance_of  # noqa: E402
from spa_fo.report.style import save_figure  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "docs" / "real_data"
NOTHING = "nothing"
PAYLOAD = Columns("psi", "angle_deg", "pressure_p1_psi", None, "command_p1_psi")
PNEUNET = Columns("kPa", "angle_deg", "pressure_kpa", None, "setpoint_deg")
BY_NAME = {series.name: series for series in SERIES}


@dataclass(frozen=True)
class Pair:
    """Two logs of one actuator.

    Parameters
    ----------
    name : str
    known : str
        What differs, in words.
    stages : tuple of str
        Stages in which that is a right answer; empty where nothing changed.
    before, after : Series
        Each with the number of its repeat.
    """

    name: str
    known: str
    stages: tuple[str, ...]
    before: tuple[Series, int]
    after: tuple[Series, int]


def whole(name: str, file: str, columns: Columns, rest: tuple[float, float], kpa: float) -> Series:
    """Take a log as one trial."""
    return Series(name, name, "silicone", (f"{file}.csv",), columns, *rest, reference_kpa=kpa)


def repeated(series: str, before: int, after: int) -> Pair:
    one = BY_NAME[series]
    name = f"{series}, repeat {before + 1} and {after + 1}"
    return Pair(name, NOTHING, (), (one, before), (one, after))


def together(series: str) -> Series:
    """Take the third to the fifth cycle of a log, and the second, as one campaign."""
    return replace(BY_NAME[series], cycles=((2, 3, 4, 5),))


BIAS = tuple(together(f"pulse25_bias{psi}") for psi in (0, 1))
LOADED = tuple(
    whole(f"sine_{grams}g", f"arm_payload/sine0p1Hz_{grams}g", PAYLOAD, (0.0, 0.0), 100.0)
    for grams in (0, 200)
)
STAIRS = tuple(
    whole(f"staircase_{n}", f"arm_open_loop/random_staircase_rep{n}", ARM, (3.0, 2.2), 100.0)
    for n in (1, 2)
)
SPECIMENS = tuple(
    whole(f"staircase_{which}", f"pneunet/staircase_{which}", PNEUNET, (0.0, 0.3), 10.0)
    for which in ("old_01", "new_07")
)
STIFFER = "the opposite chambers hold 1 psi in place of 0: stiffer"
WEIGHT = "200 g at the tip"
LOOSER, LIGHTER = f"the reverse: {STIFFER}", f"the reverse: {WEIGHT}"
ACTUATOR = ("actuator",)
PAIRS = (
    Pair("bias 0 to 1 psi", STIFFER, ACTUATOR, (BIAS[0], 0), (BIAS[1], 0)),
    Pair("bias 1 to 0 psi", LOOSER, ACTUATOR, (BIAS[1], 0), (BIAS[0], 0)),
    Pair("no load to 200 g", WEIGHT, ACTUATOR, (LOADED[0], 0), (LOADED[1], 0)),
    Pair("200 g to no load", LIGHTER, ACTUATOR, (LOADED[1], 0), (LOADED[0], 0)),
    Pair("old to new PneuNet", "another specimen", ACTUATOR, (SPECIMENS[0], 0), (SPECIMENS[1], 0)),
    Pair("random staircases", f"{NOTHING}; the levels differ", (), (STAIRS[0], 0), (STAIRS[1], 0)),
    repeated("ramp", 0, 1),
    repeated("ramp", 1, 0),
    repeated("pneunet", 0, 1),
    repeated("pneunet", 1, 2),
    repeated("pneunet", 2, 0),
    *(
        repeated(f"{name}_by_two", 0, 1)
        for name in ("triangle_bias1", "pulse05", "pulse10", "pulse15", "pulse20", "pulse25")
    ),
)  # fmt: skip


def compared(pair: Pair, data: Path, work: Path) -> Comparison:
    """Lay both logs out, and compare them."""
    campaigns = []
    for role, (series, number) in (("before", pair.before), ("after", pair.after)):
        repeat = repeats_of(series, data)[number]
        campaigns.append(Campaign.load(lay_out(series, repeat, role, work / pair.name)))
    before, after = campaigns
    return after.compare(before)


def judged(pair: Pair, comparison: Comparison) -> str:
    """Hold an answer against what is known."""
    if not pair.stages:
        if comparison.kind == "nothing_changed":
            return "right"
        return "no answer" if comparison.kind == "unknown" else "**wrong**"
    if comparison.kind == "nothing_changed":
        return "not seen"
    shares = comparison.document["where"]["stage"]
    if shares is None:
        return "no answer"
    right = max(shares, key=lambda stage: shares[stage]) in pair.stages
    if comparison.kind == "unknown":
        return "right stage, no name" if right else "no answer"
    return "right stage" if right else "**wrong**"


def row(pair: Pair, comparison: Comparison) -> tuple[str, ...]:
    gap = comparison.document["gap"]
    shares = comparison.document["where"]["stage"] or {}
    stage = max(shares, key=lambda each: shares[each], default="")
    share = f"{stage} {shares[stage]:.0%}" if stage and shares[stage] else ""
    names = " or ".join(" + ".join(ids) for ids in comparison.causes)
    said = comparison.kind.replace("_", " ") + (f": {names}" if names else "")
    sizes = f"{gap['rmse_deg']:.2f}", f"{gap['noise_floor_deg']:.2f}"
    return pair.name, pair.known, said, share, *sizes, judged(pair, comparison)


_PAGE = """\
# What changed between measured logs

Made by `benchmarks/measured_changes.py` at commit {commit}; [Real actuators](../real_data.md) says
where the logs are from. Of each pair the model is identified on the first log, what it misses there
is learned, and `spa-fo compare` is asked what changed in the second. *differs* is the RMS of what
is left in degrees, *expected* what would be left without any change.

All of these pairs were looked at while the comparison was built, so they show how it fares and are
no proof; nothing was fitted to them. *right stage*: the largest share of the change is of the stage
that is known to have changed. *no answer*: `unknown`, and in no stage or another one.

{table}

{sums}
"""


def page(found: Sequence[tuple[Pair, Comparison]]) -> str:
    """Return the page in Markdown."""
    head = ("logs", "what is known to differ", "answer", "stage", "differs (°)", "expected (°)", "")
    align = ("left", "left", "left", "left", "right", "right", "left")
    lines = [row(pair, comparison) for pair, comparison in found]
    table = tabulate(lines, head, tablefmt="pipe", disable_numparse=True, colalign=align)
    return _PAGE.format(commit=commit(), table=table, sums="\n".join(sums(found)))


def sums(found: Sequence[tuple[Pair, Comparison]]) -> Iterator[str]:
    for changed, words in ((True, "Something differs"), (False, "Nothing differs")):
        marks = [judged(pair, each) for pair, each in found if bool(pair.stages) is changed]
        counts = ", ".join(f"{marks.count(mark)} {mark}" for mark in sorted(set(marks)))
        yield f"- {words}, {len(marks)} pairs: {counts}."


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="folder of the measured logs")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        for pair in PAIRS:
            comparison = compared(pair, given.data, Path(scratch))
            print(*row(pair, comparison), sep=" | ", flush=True)
            found.append((pair, comparison))
    first = found[0][1].result
    pdf, _ = save_figure(measured_figure(first), given.out / "changes", provenance_of(first))
    pdf.unlink()
    write_text(given.out / "changes.md", page(found))


if __name__ == "__main__":
    main()
