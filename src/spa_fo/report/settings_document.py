"""The page of numbers that a diagnosis weighs by, from `spa_fo.gap.settings`.

``python -m spa_fo.report.settings_document docs`` writes it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from spa_fo.atomic import write_text
from spa_fo.edge import bad_input_exits
from spa_fo.gap.settings import SETTINGS, Origin, Settings

_HEAD = """\
# Settings of the diagnosis

The priors and thresholds of [a diagnosis](diagnosis.md): value, unit, origin and reason. Written
from `src/spa_fo/gap/settings.py` by
`python -m spa_fo.report.settings_document docs`. There are {total} of them: {counts}.

- **derived**: follows from something else, by the reason given;
- **learned**: from opened cases, of our rigs and of other hands, never from those that judge;
- **measured**: on real actuators or on the machine;
- **assumed**: set by hand; another value may do as well.

What is plausible of each effect's parameters stands apart, in
`src/spa_fo/plant/effects/`; how finely things are computed stands beside the code that
does it.

How many verdicts move when a number is halved or doubled is what {sweep} says.

| name | value | unit | origin | reason |
|---|--:|---|---|---|
"""


_SWEEP = "settings_sweep.md"


def page(settings: Settings = SETTINGS, swept: bool = False) -> str:
    """Return the page of numbers in Markdown; `swept` links to the page of what each moves."""
    listed = list(settings.listed())
    origins = [origin for _, _, _, origin, _ in listed]
    counts = [f"{origins.count(kind)} {kind}" for kind in get_args(Origin)]
    head = _HEAD.format(
        total=len(listed),
        counts=f"{', '.join(counts[:-1])} and {counts[-1]}",
        sweep=f"[the sweep]({_SWEEP})" if swept else "`benchmarks/settings_sweep.py`",
    )
    return head + "".join(_row(*number) for number in listed)


def _row(name: str, value: float, unit: str, origin: str, reason: str) -> str:
    shown = "" if unit == "1" else _cell(unit)
    return f"| `{name}` | {value:g} | {shown} | {origin} | {_cell(reason)} |\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m spa_fo.report.settings_document",
        description="Write the page of numbers that a verdict depends on.",
        epilog="example: python -m spa_fo.report.settings_document docs",
    )
    parser.add_argument("folder", metavar="DOCS", type=Path, help="gets settings.md")
    given = parser.parse_args(arguments)
    with bad_input_exits():
        swept = (given.folder / _SWEEP).is_file()
        write_text(given.folder / "settings.md", page(swept=swept))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
