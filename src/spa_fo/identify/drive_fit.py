"""A drive whose command is no pressure: its curve and its dynamics, from command to pressure.

A pump's PWM, a valve's duty, volts: what pressure they make is a static curve and a dynamic part,
the same form as an actuator's. So it is fitted likewise, the measured pressure in the place of the
angle (a kPa for a degree), the highest command in that of the reference pressure.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from textwrap import wrap
from typing import Any

import numpy as np

from spa_fo.fractional import step_response
from spa_fo.identify.curve_choice import CurveChoice, choose_curve
from spa_fo.identify.curve_report import gain_text, left_out_table, table
from spa_fo.identify.moderate import moderate_optimum
from spa_fo.identify.whole_log import fit_whole_logs, log_data
from spa_fo.plant import TransferFunction
from spa_fo.plant.static_curve import BEFORE, StaticCurve
from spa_fo.rig import CampaignData

KEY = "drive"
"""Key of a model file that holds the drive."""
_RISEN = 1.0 - np.exp(-1.0)
_WIDTH = 96


@dataclass(frozen=True)
class DriveFit:
    """What was found of a drive.

    Attributes
    ----------
    highest : float
        Command at which u = 1, in the command's own unit.
    choice : CurveChoice
        Errors in kPa where it says degrees.
    longest_s : float
        Duration of the longest log.
    """

    highest: float
    choice: CurveChoice
    longest_s: float

    @property
    def curve(self) -> StaticCurve | None:
        """From command to command, or from pressure to pressure in kPa; None where none is kept."""
        return self.choice.curve if self.choice.kept else None

    @property
    def transfer_function(self) -> TransferFunction:
        """From u = command / `highest` to the pressure in kPa."""
        fit = self.choice.fit if self.choice.kept else self.choice.plain
        return TransferFunction.from_array(np.append(fit.x[:4], np.degrees(fit.x[4])))

    @property
    def rise_s(self) -> float:
        """Time to 63 % of what a step reaches within the longest log."""
        t = np.linspace(0.0, self.longest_s, 2000)
        y = step_response(t, *self.transfer_function.as_array())
        return float(t[int(np.argmax(y >= _RISEN * y[-1]))])

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        curve = self.curve
        return {
            "input": {"signal": "command", "highest": self.highest},
            "output": {"unit": "kPa"},
            "transfer_function": asdict(self.transfer_function),
            "static_curve": None
            if curve is None
            else {
                "position": curve.position,
                "knots": curve.curve.knots.tolist(),
                "slopes": curve.curve.slopes.tolist(),
            },
            "plain_rms_kpa": self.choice.plain_deg,
            "curved_rms_kpa": self.choice.curved_deg,
            "squared_error_closed": self.choice.closed,
        }

    def lines(self) -> Iterator[str]:
        """Say what was found, for the fit report."""
        choice = self.choice
        yield f"drive: the command is no pressure; {choice.fit.form} from command to pressure"
        yield (
            f"fitted logs: rms {choice.plain_deg:.2f} kPa without a curve, "
            f"{choice.curved_deg:.2f} kPa with it; 63 % of a step in {self.rise_s:.2g} s"
        )
        curve = self.curve
        if curve is not None:
            what, unit = ("command", "") if curve.position == BEFORE else ("linear pressure", "kPa")
            knots = [f"{knot:.3g}" for knot in curve.curve.knots]
            slopes = [f"{slope:.2f}" for slope in curve.curve.slopes]
            yield from table([[what, *knots, unit], ["slope", *slopes, ""]])
        if choice.left_out:
            yield from left_out_table(choice, " kPa")
            kept = "The drive's curve is kept" if choice.kept else "The drive is left without curve"
            yield from wrap(f"{kept}: {gain_text(choice)}.", _WIDTH, subsequent_indent="  ")


def fit_drive(data: CampaignData) -> DriveFit | None:
    """Identify the drive of a campaign; None where its command is a pressure, or none was measured.

    Raises
    ------
    BadInput
        A trial has too few samples.
    """
    if data.campaign.command_is_pressure:
        return None
    both = [
        replace(trial, angle_deg=trial.pressure_kpa)
        for trial in data.trials
        if trial.command_kpa is not None and trial.pressure_kpa is not None
    ]
    commands = [one.command_kpa for one in both if one.command_kpa is not None]
    highest = max((float(np.max(one)) for one in commands), default=0.0)
    if highest <= 0.0:
        return None
    logs = log_data(both, highest, "command", data.campaign.yaml)
    plain = moderate_optimum(lambda bounds: fit_whole_logs(logs, bounds))
    try:
        choice = choose_curve(logs, plain, highest, times_s=(), unit="of the command")
    except ValueError:
        return None  # the pressure hardly ever rises
    return DriveFit(highest, choice, max(float(log.t[-1]) for log in logs))
