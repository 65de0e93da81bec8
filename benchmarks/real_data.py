"""Fit and diagnose the campaigns that others measured; figures and pages for docs/real_data.

    python benchmarks/real_data.py data

reads `soft_arm_steps` and `bellow_bending` there as `examples/` does, and writes nothing of them
but what is made of them.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from spa_fo.edge import keep_blas_to_one_thread

keep_blas_to_one_thread()

import yaml  # noqa: E402

from spa_fo.atomic import write_text  # noqa: E402
from spa_fo.gap import Diagnosis, diagnose_campaign  # noqa: E402
from spa_fo.identify import fit_campaign  # noqa: E402
from spa_fo.plant import TransferFunction, write_model  # noqa: E402
from spa_fo.report.diagnosis import write_report  # noqa: E402
from spa_fo.report.headline import headline  # noqa: E402
from spa_fo.rig import read_campaign, read_trials  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "docs" / "real_data"
SEED = 1
# The bellow's columns, counted from 0, and when in its logs one chamber is driven alone.
TIME = 0
CHAMBERS = {1: (0.0, 61.5), 2: (58.0, 121.5)}


def soft_arm(source: Path, folder: Path) -> None:
    """Lay the soft arm out as its example says."""
    shutil.copy(ROOT / "examples" / "soft_arm_steps" / "campaign.yaml", folder)
    for log in source.glob("step_*psi.csv"):
        shutil.copy(log, folder)


def bellow(chamber: int) -> Callable[[Path, Path], None]:
    """Lay one chamber of the bellow out: its part of each log, bending counted as positive."""

    def lay_out(source: Path, folder: Path) -> None:
        text = (ROOT / "examples" / "bellow_bending" / "campaign.yaml").read_text(encoding="utf-8")
        document = yaml.safe_load(text)
        document["name"] = folder.name
        if chamber == 2:
            columns = document["log"]["columns"]
            columns["command"]["column"] = 7
            columns["pressure"] |= {"column": 4, "offset": -1006.5}
            columns["angle"]["scale"] = -1.0
        for experiment in document["experiments"]:
            (trial,) = experiment["trials"]
            lines = (source / trial["file"]).read_text(encoding="utf-8").splitlines()
            write_text(
                folder / trial["file"], "\n".join(_between(lines, *CHAMBERS[chamber])) + "\n"
            )
        write_text(folder / "campaign.yaml", yaml.safe_dump(document, sort_keys=False))

    return lay_out


def _between(lines: list[str], start_s: float, end_s: float) -> Iterator[str]:
    for line in lines:
        cells = line.split(";")
        time = float(cells[TIME])
        if start_s <= time < end_s:
            cells[TIME] = f"{time - start_s:.6g}"
            yield ";".join(cells)


# Name: source folder, layout, signal that drives the model. The bellow's command is the pump's
# PWM, which is no pressure.
CAMPAIGNS: dict[str, tuple[str, Callable[[Path, Path], None], str | None]] = {
    "soft_arm_steps": ("soft_arm_steps", soft_arm, None),
    "bellow_chamber_1": ("bellow_bending", bellow(1), "pressure"),
    "bellow_chamber_2": ("bellow_bending", bellow(2), "pressure"),
}


def list_checksums(folder: Path) -> None:
    logs = sorted(path for path in folder.iterdir() if path.name != "campaign.yaml")
    sums = [f"{hashlib.sha256(log.read_bytes()).hexdigest()}  {log.name}" for log in logs]
    write_text(folder / "SHA256SUMS", "\n".join(sums) + "\n")


def run(name: str, data: Path, work: Path) -> tuple[TransferFunction, Diagnosis]:
    """Lay out, fit and diagnose one campaign; write its page and figures."""
    source, lay_out, signal = CAMPAIGNS[name]
    folder = work / name
    folder.mkdir()
    lay_out(data / source, folder)
    list_checksums(folder)
    fitted = fit_campaign(read_trials(read_campaign(folder)), seed=SEED, signal=signal)
    model = work / f"{name}.json"
    write_model(model, fitted.model)
    print(name, fitted.report(), sep="\n")
    diagnosis = diagnose_campaign(folder, model, seed=SEED, progress=print)
    write_report(diagnosis, OUT / name)
    others = (OUT / name / "augmented_model.json", OUT / name / "diagnosis.html")
    for beside in [*(OUT / name).glob("*.pdf"), *others]:
        beside.unlink()
    return fitted.model.transfer_function, diagnosis


def answers(found: dict[str, tuple[TransferFunction, Diagnosis]], command: str) -> str:
    """What every campaign's diagnosis says, as Markdown."""
    parts = [
        "# What the diagnosis says of the measured campaigns",
        f"Made by `{command}` at commit {commit()}, seed {SEED}. Measured data.",
    ]
    for name, (model, diagnosis) in found.items():
        document: dict[str, Any] = diagnosis.to_dict()
        parts += [
            f"## {name}",
            " ".join(headline(document)),
            f"Model: α2 = {model.alpha2:.3g}, α1 = {model.alpha1:.3g}, a1 = {model.a1:.3g}, "
            f"a0 = {model.a0:.3g}, b0 = {model.b0:.3g}. By stage: {by_stage(document['where'])}.",
            "\n".join(f"- {finding}" for finding in diagnosis.findings),
            f"[The page, with its figures]({name}/diagnosis.md)",
        ]
    return "\n\n".join(parts) + "\n"


def by_stage(where: dict[str, Any]) -> str:
    """Say what share of the gap is each stage's, or why that is not known."""
    if where["stage"] is None:
        return f"not known: {where['not_known']}"
    return ", ".join(f"{stage} {100.0 * share:.0f} %" for stage, share in where["stage"].items())


def commit() -> str:
    """Return the checkout's commit, with a + where the package differs from it."""
    git = ["git", "-C", str(ROOT)]
    head = subprocess.run(
        [*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    )
    changed = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", "src"], check=False)
    return head.stdout.strip() + ("+" if changed.returncode else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("data", type=Path, help="folder of the measured data")
    data = parser.parse_args().data
    with tempfile.TemporaryDirectory() as work:
        found = {name: run(name, data, Path(work)) for name in CAMPAIGNS}
    write_text(OUT / "answers.md", answers(found, "make real-data"))


if __name__ == "__main__":
    main()
