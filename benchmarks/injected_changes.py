"""What `spa-fo compare` says of changes that were put into measured logs.

    python benchmarks/injected_changes.py data

Two measured repeats between which nothing changed, and a change computed into the angle of the
second: the actuator, the bench and their noise are real, and the truth is known. What an angle
alone cannot tell counts as right either way: an obstacle and a reading at its ceiling are the same
there. Writes docs/real_data/injected.md. The data are not part of the project (docs/real_data.md).
"""

from __future__ import annotations

import argparse
import io
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from spa_fo.edge import keep_blas_to_one_thread

keep_blas_to_one_thread()

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from tabulate import tabulate  # noqa: E402

from measured_changes import BY_NAME, OUT, Pair, judged, row  # noqa: E402
from real_data import commit  # noqa: E402
from repeated_commands import Repeat, Series, lay_out, repeats_of  # noqa: E402
from spa_fo.api import Campaign, Comparison  # noqa: E402
from spa_fo.atomic import write_text  # noqa: E402

Floats = NDArray[np.float64]

REPEATS = ("ramp", "pneunet", "pulse15_by_two", "pulse25_by_two", "triangle_bias1_by_two")


@dataclass(frozen=True)
class Change:
    """Something that happens to the angle.

    Parameters
    ----------
    name : str
    stages : tuple of str
        Where it may have happened, as far as an angle tells; empty for nothing.
    of : callable
        Angles from rest and times since the campaign began, as shares of it -> angles.
    """

    name: str
    stages: tuple[str, ...]
    of: Callable[[Floats, Floats, float], Floats]


def _late(angle: Floats, share: Floats, seconds: float) -> Floats:
    out, now = angle.copy(), angle[0]
    for i in range(1, angle.size):
        step_s = max((share[i] - share[i - 1]) * seconds, 0.0)
        now += (angle[i] - now) * -np.expm1(-step_s / 0.8)
        out[i] = now
    return out


def _stopped(angle: Floats, share: Floats, seconds: float) -> Floats:
    at = 0.75 * angle.max()
    return np.where(angle > at, at + 0.1 * (angle - at), angle)


def _frozen(angle: Floats, share: Floats, seconds: float) -> Floats:
    held = angle[min(int(np.searchsorted(share, 0.4)), angle.size - 1)]
    return np.where(share > 0.4, held, angle)


EITHER = ("actuator", "sensor")
CHANGES = (
    Change("nothing", (), lambda a, s, _: a),
    Change("an obstacle, or a ceiling, at three quarters", EITHER, _stopped),
    Change("a quarter less at all angles", EITHER, lambda a, s, _: 0.75 * a),
    Change(
        "a curve that flattens by a third", ("sensor",), lambda a, s, _: a * (1 - a / a.max() / 3)
    ),
    Change("0.8 s later", (*EITHER, "acquisition"), _late),
    Change("the zero jumps half way", ("sensor",), lambda a, s, _: a - 0.15 * a.max() * (s > 0.5)),
    Change("comes off at 40 %", ("sensor",), lambda a, s, _: np.where(s > 0.4, 0.25 * a, a)),
    Change("freezes at 40 %", ("sensor",), _frozen),
)


def changed(series: Series, repeat: Repeat, change: Change) -> Repeat:
    """Let a change happen in the course of a repeat's logs, one after another."""
    tables = [pd.read_csv(io.BytesIO(log)) for log in repeat.logs]
    lengths = [float(t["t_s"].iloc[-1] - t["t_s"].iloc[0]) for t in tables]
    total = sum(lengths)
    column, before, logs = series.columns.angle, 0.0, []
    whole = np.concatenate([t[column].to_numpy(float) for t in tables])
    rest = whole[0] if series.rest_angle is None else series.rest_angle
    share = np.concatenate(
        [
            (sum(lengths[:k]) + t["t_s"].to_numpy(float) - t["t_s"].iloc[0]) / total
            for k, t in enumerate(tables)
        ]
    )
    angle = rest + change.of(whole - rest, share, total)
    for table in tables:
        first = int(before)
        table[column] = angle[first : first + len(table)]
        before += len(table)
        logs.append(table.to_csv(index=False).encode())
    return Repeat(repeat.name, tuple(logs))


def compared(series: Series, change: Change, data: Path, work: Path) -> Comparison:
    """Compare the first repeat of a series with the second, changed."""
    first, second = repeats_of(series, data)[:2]
    before = lay_out(series, first, "before", work)
    after = lay_out(series, changed(series, second, change), "after", work)
    return Campaign.load(after).compare(before)


_PAGE = """\
# Changes put into measured logs

Made by `benchmarks/injected_changes.py` at commit {commit}; [Real actuators](../real_data.md) says
where the logs are from. Of two measured repeats of one command the second was changed by
computation: the actuator and its bench are real, the change is known. An angle alone does not tell
an obstacle from a reading at its ceiling, nor a stiffer actuator from a sensor that shows less:
either counts as the right stage there. *differs*, *expected* and the last column are those of
[the measured pairs](changes.md).

All of these logs were looked at while the comparison was built, with changes much like these, so
they show how it fares and are no proof. No number was fitted to them.

{table}

{sums}
"""


def page(found: Sequence[tuple[Pair, Comparison]]) -> str:
    """Return the page in Markdown."""
    head = ("logs", "change", "answer", "stage", "differs", "expected", "")
    align = ("left", "left", "left", "left", "right", "right", "left")
    lines = [row(pair, comparison) for pair, comparison in found]
    table = tabulate(lines, head, tablefmt="pipe", disable_numparse=True, colalign=align)
    return _PAGE.format(commit=commit(), table=table, sums="\n".join(sums(found)))


def sums(found: Sequence[tuple[Pair, Comparison]]) -> Iterator[str]:
    """Count the marks of each change."""
    for change in CHANGES:
        marks = [judged(pair, each) for pair, each in found if pair.known == change.name]
        counts = ", ".join(f"{marks.count(mark)} {mark}" for mark in sorted(set(marks)))
        yield f"- {change.name}: {counts}."


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="folder of the measured logs")
    parser.add_argument("--out", type=Path, default=OUT)
    given = parser.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        for name in REPEATS:
            for number, change in enumerate(CHANGES):
                series = BY_NAME[name]
                pair = Pair(name, change.name, change.stages, (series, 0), (series, 1))
                work = Path(scratch) / f"{name}_{number}"
                comparison = compared(series, change, given.data, work)
                print(*row(pair, comparison), sep=" | ", flush=True)
                found.append((pair, comparison))
    write_text(given.out / "injected.md", page(found))


if __name__ == "__main__":
    main()
