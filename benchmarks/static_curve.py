"""Fit a static curve to the campaigns that others measured: the table of docs/real_data.md.

    python benchmarks/static_curve.py data

What is left out at a time, and what is then predicted with the curve and without, is what
`spa-fo fit --static-curve` says of a campaign; nothing is set for one of them.
"""

from __future__ import annotations

import argparse
import re
import shutil
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from spa_fo.edge import keep_blas_to_one_thread

keep_blas_to_one_thread()

import yaml  # noqa: E402

from real_data import bellow, commit, list_checksums, soft_arm  # noqa: E402
from spa_fo.atomic import write_text  # noqa: E402
from spa_fo.identify import fit_campaign, log_data  # noqa: E402
from spa_fo.identify.curve_choice import CurveChoice, LeftOut, leave_out  # noqa: E402
from spa_fo.rig import CampaignData, read_campaign, read_trials  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "real_data.md"
BEGIN, END = "<!-- static curve: begin -->", "<!-- static curve: end -->"
COMMAND, PRESSURE = "command", "pressure"
ARM_REFERENCE_KPA, PNEUNET_REFERENCE_KPA = 100.0, 10.0


@dataclass(frozen=True)
class Measured:
    """A campaign: its source folder, how it is laid out, and what drives the model."""

    source: str
    lay_out: Callable[[Path, Path], None]
    signal: str = PRESSURE


def logs(
    files: tuple[str, ...], reference_kpa: float, pressure: dict[str, Any], rest_deg: float
) -> Callable[[Path, Path], None]:
    """Lay out whole logs that share one zero of the angle, driven by the measured pressure."""

    def lay_out(source: Path, folder: Path) -> None:
        for file in files:
            shutil.copy(source / f"{file}.csv", folder)
        columns = {
            "time": {"column": "t_s", "unit": "s"},
            "pressure": pressure,
            "angle": {"column": "angle_deg", "unit": "deg", "offset": -rest_deg},
        }
        document = {
            "schema": "spa-fo/campaign/1",
            "name": folder.name,
            "material": "as measured by others",
            "provenance": {"kind": "measured", "source": folder.name},
            "log": {"format": "csv", "columns": columns},
            "input": {"reference_kpa": reference_kpa},
            "experiments": [
                {
                    "name": file,
                    "protocol": "free",
                    "trials": [
                        {"file": f"{file}.csv", "order": order, "started_s": 1000.0 * order}
                    ],
                }
                for order, file in enumerate(files, 1)
            ],
        }
        write_text(folder / "campaign.yaml", yaml.safe_dump(document, sort_keys=False))

    return lay_out


def arm(*files: str, rest_psi: float, rest_deg: float) -> Callable[[Path, Path], None]:
    """Lay out logs of the soft arm; what it reads at rest is the zero of all of them."""
    pressure = {"column": "pressure_p1_psi", "unit": "psi", "offset": -rest_psi}
    return logs(files, ARM_REFERENCE_KPA, pressure, rest_deg)


def pneunet(*files: str) -> Callable[[Path, Path], None]:
    """Lay out logs of the PneuNet, whose zeros are kept."""
    pressure = {"column": "pressure_kpa", "unit": "kPa"}
    return logs(files, PNEUNET_REFERENCE_KPA, pressure, 0.0)


STEPS_170 = tuple(f"steps170_same_command_rep{n}" for n in (1, 2, 3))
CAMPAIGNS = {
    "soft arm, pulses, from the command": Measured("soft_arm_steps", soft_arm, COMMAND),
    "soft arm, pulses": Measured("soft_arm_steps", soft_arm),
    "bellow, chamber 1": Measured("bellow_bending", bellow(1)),
    "bellow, chamber 2": Measured("bellow_bending", bellow(2)),
    "soft arm, ramps": Measured(
        "arm_open_loop",
        arm("ramp_1psi_per_s_rep1", "ramp_1psi_per_s_rep2", rest_psi=0.4, rest_deg=17.0),
    ),
    "soft arm, staircases": Measured(
        "arm_open_loop",
        arm("random_staircase_rep1", "random_staircase_rep2", rest_psi=0.5, rest_deg=2.5),
    ),
    "soft arm, bias 1 psi": Measured(
        "arm_open_loop",
        arm("step25_bias1_x6", "triangle_bias1_x6", rest_psi=2.0, rest_deg=10.0),
    ),
    "soft arm, bias 0 psi": Measured(
        "arm_open_loop", arm("step25_bias0_x6", rest_psi=2.0, rest_deg=1.5)
    ),
    "soft arm, no payload": Measured(
        "arm_payload", arm("sine0p1Hz_0g", "sumsine_0g", rest_psi=1.0, rest_deg=8.0)
    ),
    "soft arm, 200 g": Measured(
        "arm_payload", arm("sine0p1Hz_200g", "sumsine_200g", rest_psi=1.0, rest_deg=9.5)
    ),
    "PneuNet, staircases": Measured("pneunet", pneunet("staircase_new_07", "staircase_new_08")),
    "PneuNet, steps to 170°": Measured("pneunet", pneunet(*STEPS_170, "saturating_steps_210deg")),
    "PneuNet, steps to 60°": Measured("pneunet", pneunet("step_0_60_01", "step_0_60_12")),
}


# Logs of the soft arm's pulses (5, 10, 15, 20, 25 psi) that are left out together.
TOGETHER = {
    "10 and 20 psi": frozenset({1, 3}),
    "5 and 15 psi": frozenset({0, 2}),
    "10, 15 and 20 psi": frozenset({1, 2, 3}),
    "20 and 25 psi": frozenset({3, 4}),
}


def laid_out(measured: Measured, name: str, data: Path, work: Path) -> CampaignData:
    """Lay out one campaign and read it."""
    folder = work / re.sub(r"\W+", "_", name)
    folder.mkdir()
    measured.lay_out(data / measured.source, folder)
    list_checksums(folder)
    return read_trials(read_campaign(folder))


def together(measured: Measured, name: str, data: Path, work: Path) -> list[LeftOut]:
    """Leave out several levels of the soft arm's pulses at once."""
    campaign = laid_out(measured, f"{name}, together", data, work)
    plain = fit_campaign(campaign, signal=measured.signal, whole_logs=True).optimum
    logs = log_data(campaign.trials, campaign.campaign.reference_kpa, measured.signal)
    return [leave_out(logs, plain, f"{name}: {what}", away) for what, away in TOGETHER.items()]


def run(measured: Measured, name: str, data: Path, work: Path) -> CurveChoice:
    """Lay out one campaign and fit it; say what the fit says."""
    campaign = laid_out(measured, name, data, work)
    result = fit_campaign(campaign, signal=measured.signal, static_curve=True)
    print(name, result.report(), "", sep="\n", flush=True)
    assert result.curve is not None
    return result.curve


def table(found: dict[str, CurveChoice]) -> str:
    """Write what is gained, a row a campaign, and the soft arm's levels one by one."""
    rows = [
        "| campaign | left out, one at a time | plain, left out | curved, left out | closed "
        "| closed within | better | plain, fitted | best form, fitted | its form | kept |",
        "|---|---|--:|--:|--:|--:|--:|--:|--:|---|---|",
        *(_row(name, choice) for name, choice in found.items()),
    ]
    levels = [
        replace(one, name=f"{name}: {one.name}")
        for name, choice in found.items()
        if choice.held_out == "level"
        for one in choice.left_out
    ]
    return "\n".join(rows) + "\n\n" + parts_table("left-out level", levels)


def parts_table(head: str, parts: Sequence[LeftOut]) -> str:
    """Write how each part that was left out is predicted."""
    rows = [
        f"| {one.name} | {one.plain_deg:.2f}° | {one.curved_deg:.2f}° | {one.form} |"
        for one in parts
    ]
    return "\n".join(
        [f"| {head} | plain | curved | chosen without it |", "|---|--:|--:|---|", *rows]
    )


def _row(name: str, choice: CurveChoice) -> str:
    fitted = f"{choice.plain_deg:.2f}° | {choice.curved_deg:.2f}° | {choice.fit.form} |"
    kept = "yes" if choice.kept else "no"
    if choice.closed is None:
        return f"| {name} | nothing: one log | | | | | | {fitted} {kept} |"
    parts = len(choice.left_out)
    within = choice.closed_within
    share = f"{100.0 * choice.closed:.0f} % | {'' if within is None else f'{100.0 * within:.0f} %'}"
    out = f"{choice.left_out_deg('plain'):.2f}° | {choice.left_out_deg('curved'):.2f}°"
    what = f"{parts} {choice.held_out}s"
    return f"| {name} | {what} | {out} | {share} | {choice.better} of {parts} | {fitted} {kept} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("data", type=Path, help="folder of the measured data")
    data = parser.parse_args().data
    with tempfile.TemporaryDirectory() as work:
        place = Path(work)
        found = {name: run(one, name, data, place) for name, one in CAMPAIGNS.items()}
        arms = {name: one for name, one in CAMPAIGNS.items() if one.source == "soft_arm_steps"}
        away = [part for name, one in arms.items() for part in together(one, name, data, place)]
    page = PAGE.read_text(encoding="utf-8")
    head, _, rest = page.partition(BEGIN)
    _, _, tail = rest.partition(END)
    tables = f"{table(found)}\n\n{parts_table('left out at once', away)}"
    made = f"Made by `make static-curve` at commit {commit()}. Measured data."
    write_text(PAGE, f"{head}{BEGIN}\n\n{made}\n\n{tables}\n\n{END}{tail}")


if __name__ == "__main__":
    main()
