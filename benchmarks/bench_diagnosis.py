"""Cost of the simulator with effects and of a whole diagnosis, in one run.

The simulator runs a whole campaign, memory and all; times are the least of the repeats, as ratios
to the plain chain, beside the virtual rig (another solver, at 1 kHz) on a campaign of the same
length. A diagnosis is that of the committed campaigns with their own fits, and of two campaigns of
the rich protocol with a hysteresis and with a slow interference, all compiled beforehand; sets of
up to five effects are tried. Run it with OPENBLAS_NUM_THREADS=1, as the command does for itself.
"""

from __future__ import annotations

import argparse
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numba
import numpy as np
from tabulate import tabulate

from blind.first_rig import write_case
from spa_fo.atomic import write_text
from spa_fo.gap import diagnose
from spa_fo.gap.data.evidence import angle_chain, collect
from spa_fo.identify import fit_campaign
from spa_fo.plant import Model, read_model
from spa_fo.plant.effects.library import LIBRARY, absent
from spa_fo.rig import CampaignData, read_campaign, read_trials
from spa_fo.virtual_rig.actuators import PLANS
from spa_fo.virtual_rig.campaign_writer import write_campaign

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests"))
from blind_documents import document  # noqa: E402

RAW = ROOT / "raw"


def least(run: Callable[[], object], repeats: int, warm: bool = True) -> float:
    if warm:
        run()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return min(times)


def simulator(data: CampaignData, repeats: int) -> str:
    evidence = collect(data)
    x = fit_campaign(data, bootstrap=0).model.transfer_function.as_array()
    chain = angle_chain(evidence, x, None)
    rows = [("plain", least(lambda: chain.run(x, absent()), repeats))]
    every = absent()
    for name, effect in LIBRARY.items():
        one = absent()
        values = [p.starts[0] if p.starts else p.centre for p in effect.parameters]
        one[effect.slots] = values
        every[effect.slots] = values
        if effect.parameters and name != "mains_pickup":
            rows.append((name, least(lambda one=one: chain.run(x, one), repeats)))
    rows.append(("all together", least(lambda: chain.run(x, every), repeats)))
    with tempfile.TemporaryDirectory() as scratch:
        count = iter(range(100))

        def rig() -> None:
            write_campaign(PLANS[data.campaign.name], 1, Path(scratch) / f"rig_{next(count)}")

        rows.append(("virtual rig, logs written", least(rig, 2)))
    plain = rows[0][1]
    seconds = sum(float(trial.t_s[-1]) for trial in data.trials)
    table = [(name, f"{1e3 * t:.3g}", f"{t / plain:.3g}") for name, t in rows]
    head = f"{data.campaign.name}: {len(data.trials)} trials, {seconds:.0f} s of log\n\n"
    return head + tabulate(table, ("effect", "ms a campaign", "time ratio"), tablefmt="github")


def with_effect(name: str, scratch: Path) -> tuple[CampaignData, Model]:
    """Make a campaign of the rich protocol with one effect, and the model of its bare core."""
    rich = {"name": "rich", "repeats": 4}
    write_case(document(name, seed=7, protocol=rich), scratch)
    return read_trials(read_campaign(scratch / "campaign")), read_model(scratch / "model.json")


def diagnosed() -> Iterator[tuple[str, CampaignData, Model]]:
    for name in PLANS:
        data = read_trials(read_campaign(RAW / name))
        yield name, data, fit_campaign(data, bootstrap=None).model
    for effect in ("hysteresis", "mains_pickup"):
        with tempfile.TemporaryDirectory() as scratch:
            yield effect, *with_effect(effect, Path(scratch))


def diagnosis(repeats: int) -> str:
    rows = []
    every = numba.get_num_threads()
    for name, data, plain in diagnosed():
        if not rows:
            diagnose(data, plain)  # compiles
        log_s = sum(float(trial.t_s[-1]) for trial in data.trials)
        seconds = []
        for processes in (1, every):
            numba.set_num_threads(processes)
            seconds.append(least(lambda d=data, p=plain: diagnose(d, p), repeats, warm=False))
        one, all_of_them = seconds
        times = (f"{one:.1f}", f"{all_of_them:.1f}", f"{all_of_them / one:.2f}")
        rows.append((name, len(data.trials), f"{log_s:.0f}", *times))
    head = (
        *("campaign", "trials", "log (s)", "diagnosis, one process (s)"),
        *(f"{every} processes (s)", f"{every} processes / one"),
    )
    return tabulate(rows, head, tablefmt="github")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=50, help="of the simulator, which is short")
    parser.add_argument("--diagnoses", type=int, default=1, help="of each campaign")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    np.seterr(all="raise", under="ignore")
    text = (
        f"{platform.machine()}, Python {platform.python_version()}\n\n### Simulator\n\n"
        f"{simulator(read_trials(read_campaign(RAW / 'dragon_skin_20')), given.repeats)}\n\n"
        f"### Diagnosis\n\n{diagnosis(given.diagnoses)}\n"
    )
    print(text)
    if given.out:
        write_text(given.out, text)


if __name__ == "__main__":
    main()
