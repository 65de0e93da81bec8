"""What a study costs against its size: campaigns, processors, Slurm jobs; a page of docs/ from it.

    python benchmarks/bench_scale.py docs

Every study is made anew of small campaigns of the virtual rig, goes through the whole workflow at
a reduced size (config below), and is thrown away. Kernels are compiled beforehand. Where Slurm is
installed and one is root, one study goes through it as well: a job a step, and grouped. Takes
two hours with a hundred campaigns, and means little on a machine that does other things besides.
"""

from __future__ import annotations

import argparse
import csv
import io
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from tabulate import tabulate

from spa_fo.atomic import replacing, write_text
from spa_fo.report.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    TWO_COLUMNS_IN,
    VERMILION,
    mark_provenance,
    new_figure,
    styled,
)
from spa_fo.virtual_rig.actuators import PLANS
from spa_fo.virtual_rig.campaign_writer import write_campaign

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from slurm_cluster import NoCluster, find_programs, jobs, one_node_cluster  # noqa: E402

PROVENANCE = "synthetic: campaigns of the virtual rig"
PLAN = PLANS["dragon_skin_20"]
TRIALS = ("step_30", "step_60", "step_60", "step_30")
CONFIG = {
    "materials": {"study_*": {}},
    "identify": {"swarm": {"particles": 50}, "swarm_seeds": 2, "bootstrap": 40},
    "ablation": {"points": [20], "outliers": [0.0]},
}
# As docs/cluster.md tells those who run hundreds of campaigns on one machine.
LARGE, FOR_LARGE = 50, ("--max-jobs-per-timespan", "1000/10s")
STEPS = ("raw_to_angle", "identify", "diagnose", "ablation", "figures", "publish")
LOCAL, SINGLE = "this machine", "Slurm, a job a step"


@dataclass(frozen=True)
class Run:
    """One study from raw logs to its summary.

    Parameters
    ----------
    how : str
        What ran it: `LOCAL`, or how it went through Slurm.
    campaigns, processors : int
        Size of the study, and processors in use at a time.
    steps : int
        Steps of the workflow, each a process of its own.
    slurm_jobs : int
        Jobs that were submitted; 0 without Slurm.
    wall_s : float
        From start to end.
    held_s : float
        Processor time that the study held: all processors all the time on this machine, with Slurm
        those of each job while it ran.
    inside_s : float
        Time within the steps' own processes, summed.
    """

    how: str
    campaigns: int
    processors: int
    steps: int
    slurm_jobs: int
    wall_s: float
    held_s: float
    inside_s: float

    @property
    def overhead_s(self) -> float:
        """Processor time that a step holds besides its own: starts, and waiting for the last."""
        return (self.held_s - self.inside_s) / self.steps


@dataclass(frozen=True)
class Step:
    """Time and memory of one step of the workflow, as Snakemake saw it, and what it asks for."""

    rule: str
    campaigns: int
    seconds: float
    processor_s: float
    memory_mb: float
    asked_mb: int
    asked_min: int


def make_study(folder: Path, campaigns: int) -> None:
    """Write the raw logs of a study, each campaign with a seed of its own."""
    by_name = {experiment.name: experiment for experiment in PLAN.experiments}
    experiments = tuple(by_name[name] for name in dict.fromkeys(TRIALS))
    for number in range(1, campaigns + 1):
        name = f"study_{number:04d}"
        plan = replace(
            PLAN, name=name, experiments=experiments, order=TRIALS, reset=None, wrap=None
        )
        write_campaign(plan, number, folder / "raw" / name)
    (folder / "config.yaml").write_text(yaml.safe_dump(CONFIG))


def snakemake(folder: Path, *options: str, environment: Mapping[str, str] = os.environ) -> str:
    """Run the workflow in a folder of its own; return what it said."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    run = subprocess.run(
        [*command, "--directory", str(folder), *options],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    if run.returncode:
        raise SystemExit(run.stdout + run.stderr)
    return run.stdout + run.stderr


def clean(folder: Path) -> None:
    for name in ("results", ".snakemake"):
        shutil.rmtree(folder / name, ignore_errors=True)


def measured_steps(folder: Path, campaigns: int, said: str) -> list[Step]:
    """Read Snakemake's own measurements, and what it said that the rules ask for."""
    asked = {
        rule: tuple(int(re.search(rf"\b{name}=(\d+)", line)[1]) for name in ("mem_mb", "runtime"))
        for rule, line in re.findall(r"rule (\w+):\n(?: .*\n)*? +resources: (.*)", said)
        if "mem_mb" in line
    }
    steps = []
    for path in sorted((folder / "results" / "logs").rglob("*.tsv")):
        row = next(csv.DictReader(path.open(encoding="ascii"), delimiter="\t"))
        measured = [
            float(row[key]) if row[key] not in ("-", "NA") else 0.0
            for key in ("s", "cpu_time", "max_rss")
        ]
        steps.append(Step(path.stem, campaigns, *measured, *asked[path.stem]))
    return steps


def local_run(folder: Path, campaigns: int, processors: int) -> tuple[Run, list[Step]]:
    clean(folder)
    start = time.perf_counter()
    options = FOR_LARGE if campaigns >= LARGE else ()
    said = snakemake(folder, "--cores", str(processors), *options)
    wall = time.perf_counter() - start
    steps = measured_steps(folder, campaigns, said)
    inside = sum(step.seconds for step in steps)
    return Run(LOCAL, campaigns, processors, len(steps), 0, wall, wall * processors, inside), steps


def slurm_run(folder: Path, campaigns: int, grouped: int) -> Run:
    """Go through a Slurm of this machine alone; `grouped` campaigns a job, 0 for a job a step."""
    clean(folder)
    profile = yaml.safe_load((ROOT / "workflow/profiles/slurm/config.yaml").read_text())
    # A small study on an idle machine is not to wait for the next look at it.
    profile |= {"slurm-init-seconds-before-status-checks": 1, "latency-wait": 5}
    if grouped:
        profile["group-components"] = {"campaign": grouped}
    else:
        del profile["groups"], profile["group-components"]
    (folder / "profile").mkdir(exist_ok=True)
    (folder / "profile" / "config.yaml").write_text(yaml.safe_dump(profile))
    with one_node_cluster() as environment:
        start = time.perf_counter()
        said = snakemake(folder, "--profile", str(folder / "profile"), environment=environment)
        wall = time.perf_counter() - start
        submitted = jobs(environment)
    steps = measured_steps(folder, campaigns, said)
    inside = sum(step.seconds for step in steps)
    held = sum(seconds(job["RunTime"]) * int(job["NumCPUs"]) for job in submitted)
    how = f"Slurm, {grouped} campaign{'s' * (grouped > 1)} a job" if grouped else SINGLE
    processors = os.cpu_count() or 1
    return Run(how, campaigns, processors, len(steps), len(submitted), wall, held, inside)


def seconds(duration: str) -> int:
    """Slurm's ``[days-]hours:minutes:seconds``."""
    days, _, clock = duration.rpartition("-")
    hours, minutes, rest = map(int, clock.split(":"))
    return ((int(days or 0) * 24 + hours) * 60 + minutes) * 60 + rest


def bootstraps(counts: Sequence[int], processors: Sequence[int]) -> list[tuple[int, int, float]]:
    """Time of one fit, in this process, against resamples and threads: the best of three."""
    import numba

    from spa_fo.identify import fit_campaign
    from spa_fo.rig import read_campaign, read_trials

    data = read_trials(read_campaign(ROOT / "raw" / PLAN.name))
    fit_campaign(data, bootstrap=counts[0])  # compiles
    rows = []
    for threads in processors:
        numba.set_num_threads(threads)
        for count in counts:
            times = []
            for _ in range(3):
                start = time.perf_counter()
                fit_campaign(data, bootstrap=count)
                times.append(time.perf_counter() - start)
            rows.append((count, threads, min(times)))
    return rows


@styled
def cost_figure(runs: Sequence[Run]) -> Figure:
    """Draw the time of a study against its campaigns, and what a step costs besides itself."""
    figure = new_figure(TWO_COLUMNS_IN, 2.6, [["time", "overhead"]])
    axes = {axis.get_label(): axis for axis in figure.axes}
    time_axes, overhead_axes = axes["time"], axes["overhead"]
    local = [run for run in runs if run.how == LOCAL]
    styles = [(BLUE, "o", "-"), (VERMILION, "s", "--"), (GREEN, "^", "-."), (ORANGE, "D", ":")]
    for processors, (colour, marker, line) in zip(
        sorted({run.processors for run in local}), styles, strict=False
    ):
        chosen = sorted((r for r in local if r.processors == processors), key=lambda r: r.campaigns)
        sizes = np.array([run.campaigns for run in chosen], dtype=float)
        minutes = np.array([run.wall_s for run in chosen]) / 60
        label = f"{processors} processor{'s' if processors > 1 else ''}"
        label += f": {chosen[-1].wall_s / chosen[-1].campaigns:.1f} s a campaign"
        time_axes.plot(sizes, minutes, line, color=colour, marker=marker, label=label)
    sizes = np.array(sorted({run.campaigns for run in local}), dtype=float)
    first = min((run for run in local), key=lambda r: (r.processors, r.campaigns))
    proportional = first.wall_s / 60 * sizes / first.campaigns
    time_axes.plot(sizes, proportional, color=GREY, linewidth=0.8, label="in proportion", zorder=0)
    time_axes.set(xscale="log", yscale="log", xlabel="campaigns", ylabel="time (min)")
    for axis in (time_axes.xaxis, time_axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    time_axes.set_ylim(top=6 * time_axes.get_ylim()[1])  # room for the legend
    time_axes.legend(loc="upper left")

    size = max((run.campaigns for run in runs if run.how != LOCAL), default=max(sizes))
    compared = [
        run for run in runs if run.campaigns == size and (run.how != LOCAL or run.processors == 1)
    ]
    places = np.arange(len(compared))[::-1]
    bars = overhead_axes.barh(places, [run.overhead_s for run in compared], color=BLUE, height=0.6)
    overhead_axes.bar_label(bars, fmt="%.1f s", padding=3)
    overhead_axes.set_yticks(
        places,
        [f"{run.how}\n({run.slurm_jobs} jobs)" if run.slurm_jobs else run.how for run in compared],
    )
    overhead_axes.set(xlabel=f"processor time a step besides its own (s)\n{size:g} campaigns")
    overhead_axes.margins(x=0.2)
    return figure


def rows_of_steps(steps: Sequence[Step]) -> list[dict[str, Any]]:
    rows = []
    for rule in STEPS:
        ours = [step for step in steps if step.rule == rule]
        # What is made of all campaigns together grows with their number.
        if rule == "publish":
            ours = [step for step in ours if step.campaigns == max(s.campaigns for s in steps)]
        rows.append(
            {
                "step": f"`{rule}`",
                "time, median (s)": f"{median(step.seconds for step in ours):.1f}",
                "largest (s)": f"{max(step.seconds for step in ours):.1f}",
                "asked for (min)": ours[0].asked_min,
                "memory, largest (MB)": f"{max(step.memory_mb for step in ours):.0f}",
                "asked for (MB)": ours[0].asked_mb,
            }
        )
    return rows


PAGE = """\
# What a study costs

All data are synthetic: campaigns of the virtual rig. Every number on this page was measured by
`{command}`,
at commit {commit}, on {machine}, with {processors} processors. How to run a study on a cluster
stands in [cluster.md](cluster.md).

A study here is a number of small campaigns ({trials} trials each, without longer protocols) that go
through the whole workflow, from raw logs to the summary, with a reduced configuration:

```yaml
{config}```

Kernels are compiled beforehand. A step had {share:.0%} of a processor while it ran: well below
100 % the machine was busy with other things, and the times are longer than they need be.

## Time against campaigns

![Time of a study against its campaigns, and what a step costs besides itself](scale/cost.png)

{runs}

*Inside* is the time within the steps' own processes, summed; *held* the processor time that the
study occupied: all processors all the time on this machine, with Slurm those of each job while it
ran. The difference, *overhead*, is the start of jobs and of Snakemake, and processors that wait for
the last step. From {large} campaigns on Snakemake is told to look at what waits less often
(`{for_large}`), as [cluster.md](cluster.md) advises.

## Slurm: a job a step, and grouped

{slurm}

## Time and memory of each step

From all runs without Slurm; `publish` for the largest study ({largest} campaigns). What a rule asks
for leaves room for longer campaigns, for the first compilation, and for the two Snakemakes of its
Slurm job.

{steps}

## Thousands of resamples

One fit of `raw/{campaign}`, all its steps, in one process:

{bootstraps}

More threads for it: `snakemake --set-threads identify=8`. The answer is the same for any number.
"""


def slurm_words(runs: Sequence[Run], reason: str) -> str:
    single = next((run for run in runs if run.how == SINGLE), None)
    grouped = [run for run in runs if run.how not in (LOCAL, SINGLE)]
    if single is None or not grouped:
        return f"Not measured here: {reason}."
    best = min(grouped, key=lambda run: run.overhead_s)
    local = [
        run
        for run in runs
        if run.how == LOCAL and run.campaigns == single.campaigns and run.processors == 1
    ]
    beside = f" On one processor without Slurm it is {local[0].overhead_s:.1f} s." if local else ""
    return (
        f"A study of {single.campaigns} campaigns on a Slurm of this one machine. With a job a "
        f"step it is {single.slurm_jobs} Slurm jobs, and a step holds {single.overhead_s:.1f} s of "
        f"a processor besides its own; *{best.how}* makes that {best.slurm_jobs} jobs and "
        f"{best.overhead_s:.1f} s.{beside} What grouping spares is a turn in the queue and one of "
        "two starts of Snakemake a step; the other remains, as the executor runs each step of a "
        "group by a Snakemake of its own. On a real cluster a turn in the queue takes longer than "
        "here, where nobody else is in it."
    )


def page(
    runs: Sequence[Run],
    steps: Sequence[Step],
    fits: Sequence[tuple[int, int, float]],
    command: str,
    reason: str,
) -> str:
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    ).stdout.strip()
    table = [
        {
            "how": run.how,
            "campaigns": run.campaigns,
            "processors": run.processors,
            "steps": run.steps,
            "Slurm jobs": run.slurm_jobs or "–",
            "time (s)": f"{run.wall_s:.0f}",
            "a campaign (s)": f"{run.wall_s / run.campaigns:.1f}",
            "held (s)": f"{run.held_s:.0f}",
            "inside (s)": f"{run.inside_s:.0f}",
            "overhead a step (s)": f"{run.overhead_s:.1f}",
        }
        for run in runs
    ]
    fitted = [
        {"resamples": count, "threads": threads, "time (s)": f"{seconds:.2f}"}
        for count, threads, seconds in fits
    ]

    def markdown(rows: Sequence[Mapping[str, Any]]) -> str:
        return tabulate(rows, headers="keys", tablefmt="pipe", disable_numparse=True)

    return PAGE.format(
        command=command,
        commit=commit or "unknown",
        machine=f"{platform.machine()}, Python {platform.python_version()}",
        processors=os.cpu_count(),
        trials=len(TRIALS),
        config=yaml.safe_dump(CONFIG, sort_keys=False),
        large=LARGE,
        for_large=" ".join(FOR_LARGE),
        share=sum(step.processor_s for step in steps) / sum(step.seconds for step in steps),
        runs=markdown(table),
        slurm=slurm_words(runs, reason),
        largest=max(step.campaigns for step in steps),
        steps=markdown(rows_of_steps(steps)),
        campaign=PLAN.name,
        bootstraps=markdown(fitted),
    )


def write(
    docs: Path,
    runs: Sequence[Run],
    steps: Sequence[Step],
    fits: Sequence[tuple[int, int, float]],
    command: str,
    reason: str,
) -> None:
    """Write the page, its figure and the figure's numbers."""
    table = io.StringIO()
    writer = csv.DictWriter(table, [*asdict(runs[0]), "overhead_s"], lineterminator="\n")
    writer.writeheader()
    for run in runs:
        writer.writerow(asdict(run) | {"overhead_s": round(run.overhead_s, 3)})
    write_text(docs / "scale" / "cost.csv", table.getvalue())
    figure = cost_figure(runs)
    mark_provenance(figure, PROVENANCE)
    with replacing(docs / "scale" / "cost.png") as temporary:
        figure.savefig(temporary, metadata={"Software": None})
    write_text(docs / "scale.md", page(runs, steps, fits, command, reason))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("docs", type=Path, help="gets scale.md and scale/")
    parser.add_argument("--campaigns", type=int, nargs="+", default=[1, 10, 100])
    parser.add_argument("--processors", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--slurm", type=int, default=10, help="campaigns for Slurm; 0: without")
    parser.add_argument("--groups", type=int, nargs="+", default=[1, 5], help="campaigns a job")
    parser.add_argument("--bootstraps", type=int, nargs="+", default=[400, 4000, 40000])
    parser.add_argument("--command", help="what the page says it was made by")
    given = parser.parse_args()
    # Terminated, it leaves neither daemons nor studies behind.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    command = given.command or f"python {' '.join(sys.argv)}"
    runs: list[Run] = []
    steps: list[Step] = []
    reason = "not reached" if given.slurm else "switched off"
    fits = bootstraps(given.bootstraps, given.processors)

    def keep(run: Run) -> None:
        """Write the page anew after each run: what is stopped keeps what it has."""
        print(run, flush=True)
        runs.append(run)
        write(given.docs, runs, steps, fits, command, reason)

    with tempfile.TemporaryDirectory() as scratch:
        for campaigns in given.campaigns:
            folder = Path(scratch) / str(campaigns)
            make_study(folder, campaigns)
            if not runs:
                local_run(folder, campaigns, max(given.processors))  # compiles the kernels
            for processors in given.processors:
                run, measured = local_run(folder, campaigns, processors)
                steps += measured
                keep(run)
        if given.slurm:
            folder = Path(scratch) / "slurm"
            make_study(folder, given.slurm)
            try:
                find_programs()
                for grouped in (0, *given.groups):
                    keep(slurm_run(folder, given.slurm, grouped))
            except NoCluster as found:
                reason = str(found)
                print(f"without Slurm: {reason}", flush=True)
                write(given.docs, runs, steps, fits, command, reason)


if __name__ == "__main__":
    main()
