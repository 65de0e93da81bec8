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
from repeated_commands import (  # noqa: E402
    ARM,
    SERIES,
    Columns,
    Repeat,
    Series,
    lay_out,
    repeats_of,
)
from spa_fo.api import Campaign, Comparison  # noqa: E402
from spa_fo.atomic import write_text  # noqa: E402
from spa_fo.report.change import measured_figure, provenance_of  # noqa: E402
from spa_fo.report.style import save_figure  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "docs" / "real_data"
NOTHING = "nothing"
Cycles = tuple[tuple[int, ...], ...]
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
OLD, NEW, AGAIN = (
    whole(f"staircase_{which}", f"pneunet/staircase_{which}", PNEUNET, (0.0, 0.3), 10.0)
    for which in ("old_01", "new_07", "new_08")
)
# Command and pressure alone: pulses 0 (or 1) to 25 psi at three rates, and two of a regulator.
PRESSURE_ALONE = Columns("psi", None, "pressure_p1_psi", "command_p1_psi", "command_p1_psi")
REGULATOR = Columns("kPa", None, "pressure_valve_kpa", "command_kpa", "command_kpa")


def drive(name: str, log: str, rest: tuple[float, float], halves: Cycles) -> Series:
    """Take the cycles of a log of pressure alone as two campaigns, or as one."""
    file = f"arm_open_loop/pressureonly_{log}.csv"
    options = {"cycles": halves, "lead_s": 0.3, "reference_kpa": 100.0}
    return Series(name, log, "silicone", (file,), PRESSURE_ALONE, *rest, **options)


RATES = (
    ("slow pulses", "sq25_bias0_0p1Hz_x5", (0.0, 2.0)),
    ("fast pulses", "sq25_bias0_1Hz_x5", (0.0, 1.6)),
    ("pulses from 1 psi", "sq25_bias1_0p25Hz_x5", (1.0, 2.5)),
)
HALVES = tuple(drive(f"{name}, pressure", log, rest, ((1, 2), (3, 4))) for name, log, rest in RATES)
WHOLE = tuple(drive(name, log, rest, ((1, 2, 3, 4, 5),)) for name, log, rest in RATES)
TAKES = tuple(
    Series(f"regulator, {take}", take, "regulator", (f"regulator/{take}.csv",), REGULATOR, 0.0, 0.0)
    for take in ("repeating_take1_20s", "sweep_take1_15s")
)
CONDITIONED = replace(BY_NAME["pulse25_bias0"], cycles=((1, 2), (4, 5)), rest_angle=1.6)
CEILING = whole("to_210", "pneunet/saturating_steps_210deg", PNEUNET, (0.0, 0.3), 10.0)
STIFFER = "the opposite chambers hold 1 psi in place of 0: stiffer"
WEIGHT = "200 g at the tip"
LOOSER, LIGHTER = f"the reverse: {STIFFER}", f"the reverse: {WEIGHT}"
CLIMB = "conditioning: the settled angle climbs from 89.5 to 104°"
AT_CEILING = "the reading ends at 181 to 186°, and the commands are larger"
SAME = f"{NOTHING}, as far as is known; the stairs last longer in one"
OTHER_RATE = f"{NOTHING}; 0.1 and 1 Hz, and the regulator vents faster when fully open"
OTHER_REST = f"{NOTHING}; down to 1 psi it vents slower than to 0"
ACTUATOR, SENSOR = ("actuator",), ("sensor",)
PAIRS = (
    Pair("bias 0 to 1 psi", STIFFER, ACTUATOR, (BIAS[0], 0), (BIAS[1], 0)),
    Pair("bias 1 to 0 psi", LOOSER, ACTUATOR, (BIAS[1], 0), (BIAS[0], 0)),
    Pair("no load to 200 g", WEIGHT, ACTUATOR, (LOADED[0], 0), (LOADED[1], 0)),
    Pair("200 g to no load", LIGHTER, ACTUATOR, (LOADED[1], 0), (LOADED[0], 0)),
    Pair("old to new PneuNet", "another specimen", ACTUATOR, (OLD, 0), (NEW, 0)),
    Pair("first to later pulses", CLIMB, ACTUATOR, (CONDITIONED, 0), (CONDITIONED, 1)),
    Pair("steps to 170 and 210°", AT_CEILING, SENSOR, (BY_NAME["pneunet"], 0), (CEILING, 0)),
    Pair("new PneuNet, once and again", SAME, (), (NEW, 0), (AGAIN, 0)),
    Pair("new PneuNet, again and once", SAME, (), (AGAIN, 0), (NEW, 0)),
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
    *(
        Pair(f"{one.name}, {way}", f"{NOTHING}; {words}", (), (one, before), (one, 1 - before))
        for one, words in (
            *((each, "first and later pulses") for each in HALVES),
            *((each, "halves of one log") for each in TAKES),
        )
        for before, way in enumerate(("early to late", "late to early"))
    ),
    Pair("slow to fast pulses, pressure", OTHER_RATE, (), (WHOLE[0], 0), (WHOLE[1], 0)),
    Pair("fast to slow pulses, pressure", OTHER_RATE, (), (WHOLE[1], 0), (WHOLE[0], 0)),
    Pair("pulses from 0 and 1 psi, pressure", OTHER_REST, (), (WHOLE[0], 0), (WHOLE[2], 0)),
    Pair("pulses from 1 and 0 psi, pressure", OTHER_REST, (), (WHOLE[2], 0), (WHOLE[0], 0)),
)  # fmt: skip


def compared(pair: Pair, data: Path, work: Path) -> Comparison:
    """Lay both logs out, and compare them."""
    before, after = laid_out(pair, data, work)
    if pair.before[0].columns.angle is None:
        return Comparison.of_pressure(before, after)
    return Campaign.load(after).compare(before)


def laid_out(pair: Pair, data: Path, work: Path) -> tuple[Path, Path]:
    """Write both logs as campaigns, `before` and `after`."""
    folders = []
    for role, (series, number) in (("before", pair.before), ("after", pair.after)):
        repeats = repeats_of(series, data)
        repeat = repeats[number] if len(repeats) > 1 else half(repeats[0], series, number, pair)
        folders.append(lay_out(series, repeat, role, work / pair.name))
    before, after = folders
    return before, after


def half(repeat: Repeat, series: Series, number: int, pair: Pair) -> Repeat:
    """Take one half of a lone log, where a pair is of both halves."""
    if pair.before[0] != pair.after[0]:
        return repeat
    header, *lines = repeat.logs[0].splitlines(keepends=True)
    middle = len(lines) // 2
    mine = lines[middle:] if number else lines[:middle]
    return Repeat(f"{series.name}_{number}", (header + b"".join(mine),))


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
    unit, key = ("°", "deg") if comparison.result.compared == "angle" else (" kPa", "kpa")
    sizes = f"{gap[f'rmse_{key}']:.2f}{unit}", f"{gap[f'noise_floor_{key}']:.2f}{unit}"
    return pair.name, pair.known, said, share, *sizes, judged(pair, comparison)


_PAGE = """\
# What changed between measured logs

Made by `benchmarks/measured_changes.py` at commit {commit}; [Real actuators](../real_data.md) says
where the logs are from. Of each pair the model is identified on the first log, what it misses there
is learned, and `spa-fo compare` is asked what changed in the second. *differs* is the RMS of what
is left, *expected* what would be left without any change: of the angle, or, where command and
pressure alone were logged, of the pressure.

All of these pairs were looked at while the comparison was built, so they show how it fares and are
no proof. The size from which on something has changed was learned on those with an angle, among
others, and two rules were made with a pair in sight: without an angle a name needs three times what
is expected (slow to fast pulses), and a zero taken from a moving angle is not sure (random
staircases). *right stage*: the largest share of the change is of the stage that is known to have
changed. *no answer*: `unknown`, and in no stage or another one.

{table}

{sums}
"""


def page(found: Sequence[tuple[Pair, Comparison]]) -> str:
    """Return the page in Markdown."""
    head = ("logs", "what is known to differ", "answer", "stage", "differs", "expected", "")
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
