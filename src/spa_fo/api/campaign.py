"""A campaign at hand: its trials, parsed and calibrated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from spa_fo.api.overview import COLUMNS, ExperimentOverview, overview, overview_text
from spa_fo.api.show import card
from spa_fo.errors import BadInput
from spa_fo.rig import CampaignData, ParseReport, Trial, read_campaign, read_trials, write_trials

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from spa_fo.api.comparison import Comparison
    from spa_fo.api.fit import FitResult
    from spa_fo.api.model import Model
    from spa_fo.identify import Bounds


def search_box(bounds: Mapping[str, tuple[float, float]] | None) -> Bounds | None:
    """Turn bounds of some parameters into those of a search; None where there are none.

    Raises
    ------
    BadInput
        A bound is none.
    """
    from spa_fo.identify import own_bounds

    try:
        return own_bounds(dict(bounds)) if bounds else None
    except ValueError as error:
        raise BadInput("--bound", str(error)) from None


@dataclass(frozen=True)
class Campaign:
    """One actuator, one series of measurements.

    Attributes
    ----------
    data : spa_fo.rig.CampaignData
        What campaign.yaml says, the trials, the calibrations.
    """

    data: CampaignData

    @classmethod
    def load(
        cls, folder: Path | str, *, protocols: Literal["checked", "free"] = "checked"
    ) -> Campaign:
        """Read a campaign folder: check its bytes, parse every log, calibrate every angle.

        Parameters
        ----------
        folder : path
        protocols : {"checked", "free"}
            Whether a command that contradicts its protocol is refused, or the experiment is taken
            for a free one, with a warning: a comparison needs no protocol.

        Raises
        ------
        BadInput
            Something is wrong with campaign.yaml or a log; the text names file and line.
        """
        return cls(read_trials(read_campaign(folder), protocols=protocols))

    @property
    def name(self) -> str:
        """As campaign.yaml has it."""
        return self.data.campaign.name

    @property
    def material(self) -> str:
        """As campaign.yaml has it."""
        return self.data.campaign.material

    @property
    def provenance(self) -> str:
        """Whether its data are measured or synthetic, and from where."""
        from spa_fo.report.provenance import provenance_line

        return provenance_line(self.data.campaign.provenance)

    @property
    def trials(self) -> tuple[Trial, ...]:
        """All trials, in the order of campaign.yaml."""
        return self.data.trials

    @property
    def parse_report(self) -> ParseReport:
        """What was left out of each log, and why."""
        return self.data.report

    def table(self) -> pd.DataFrame:
        """Return every sample of every trial.

        Returns
        -------
        pandas.DataFrame
            experiment, trial, t_s, command_kpa, pressure_kpa (NaN where not logged), angle_deg.
        """
        import pandas as pd

        frames = [
            pd.DataFrame(
                {
                    "experiment": trial.experiment,
                    "trial": trial.trial,
                    "t_s": trial.t_s,
                    "command_kpa": np.nan if trial.command_kpa is None else trial.command_kpa,
                    "pressure_kpa": np.nan if trial.pressure_kpa is None else trial.pressure_kpa,
                    "angle_deg": trial.angle_deg,
                }
            )
            for trial in self.trials
        ]
        return pd.concat(frames, ignore_index=True)

    @property
    def overview(self) -> tuple[ExperimentOverview, ...]:
        """Each experiment at a glance: how much was read, at what rate, ranges, rest angle."""
        return overview(self.data)

    def describe(self) -> str:
        """Say what was read: a row an experiment, and its first trial's angle as a small line."""
        return "\n".join([self._title(), self.provenance, "", overview_text(self.overview)])

    def save_table(self, path: Path | str) -> None:
        """Write the samples as csv, as ``spa-fo parse --out`` does."""
        write_trials(path, self.trials)

    def fit(
        self,
        *,
        seed: int = 1,
        whole_logs: bool = False,
        input: str | None = None,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        static_curve: bool = False,
    ) -> FitResult:
        """Identify the fractional-order model.

        Parameters
        ----------
        seed : int
            Of the swarm and the bootstrap.
        whole_logs : bool
            Fit whole logs even where there are up-steps.
        input : {"command", "pressure"}, optional
            What drives the model.
        bounds : mapping, optional
            Parameter -> (low, high) to search within.
        static_curve : bool
            Try a monotone static curve before or behind the linear part as well, on whole logs;
            it goes into the model where it predicts left-out levels better.

        Raises
        ------
        BadInput
            The campaign holds nothing to fit, or a bound is none.
        """
        from spa_fo.api.fit import FitResult
        from spa_fo.identify import fit_campaign

        found = fit_campaign(
            self.data,
            seed=seed,
            whole_logs=whole_logs,
            signal=input,
            bounds=search_box(bounds),
            static_curve=static_curve,
        )
        return FitResult(found, self)

    def compare(
        self,
        reference: Campaign | Path | str,
        *,
        model: Model | None = None,
        exclude: Sequence[str] = (),
        seed: int = 1,
        progress: Callable[[str], None] | None = None,
    ) -> Comparison:
        """Say what changed since an earlier campaign of the same actuator.

        Parameters
        ----------
        reference : Campaign or path
            The earlier one.
        model : Model, optional
            A plain model of it; identified on it where there is none.
        exclude : sequence of str
            Effects to take out of the library.
        seed : int
            Of the identification, the held-out trials and the bootstrap.
        progress : callable, optional
            Told each step in words.

        Raises
        ------
        BadInput
            A campaign is unusable, the model has effects, or an effect is unknown.
        """
        from spa_fo.api.comparison import Comparison
        from spa_fo.compare import ReferenceModel, compare, identify_reference, with_finding
        from spa_fo.gap.diagnose import check_request
        from spa_fo.plant.effects.own import use_effects_of

        tell = progress or (lambda step: None)
        before = reference
        if not isinstance(before, Campaign):
            before = Campaign.load(before, protocols="free")
        if model is None:
            tell(f"identifying the model on {before.name}")
            known = identify_reference(before.data, self.data, seed)
        else:
            known = ReferenceModel(model.document, before.data, self.data)
        use_effects_of(self.data.campaign.folder)
        check_request(known.plain, exclude, "model" if model is None else model.source)
        found = compare(
            known.reference, known.data, known.plain, excluded=exclude, seed=seed, progress=tell
        )
        return Comparison(with_finding(found, known.finding) if known.finding else found)

    def plot(self, what: str = "trials") -> Figure:
        """Draw the trials, experiment by experiment, or the flex sensor's calibration.

        Parameters
        ----------
        what : {"trials", "calibration"}

        Raises
        ------
        BadInput
            There is no calibration, or no such plot.
        """
        from spa_fo.api.figures import chosen
        from spa_fo.report.campaign_figure import campaign_figure
        from spa_fo.report.figures import calibration_figure

        draw = {"trials": lambda: campaign_figure(self.data)}
        if self.data.calibration is not None:
            calibration = self.data.calibration
            draw["calibration"] = lambda: calibration_figure(calibration, self.data.drifts)
        return chosen(draw, what, self.provenance)

    def save_figure(self, path: Path | str) -> tuple[Path, Path]:
        """Draw every trial as PDF and PNG; `path` with or without either suffix."""
        from spa_fo.api.figures import stem_of
        from spa_fo.report.campaign_figure import campaign_figure
        from spa_fo.report.style import save_figure

        return save_figure(campaign_figure(self.data), stem_of(path), self.provenance)

    def _notes(self) -> list[str]:
        report = self.data.report
        damaged = sum(file.damaged_lines for file in report.files)
        lines = sum(file.lines for file in report.files)
        account = [f"{damaged} of {lines} lines are damaged (parse_report says which, and why)"]
        return [*(account if damaged else []), *report.warnings]

    def _title(self) -> str:
        return f"{self.material}: {self.name}, {len(self.trials)} trials"

    def __str__(self) -> str:
        return "\n".join([self.describe(), *(f"! {note}" for note in self._notes())])

    def _repr_html_(self) -> str:
        rows = [one.cells() for one in self.overview]
        return card(self._title(), [], COLUMNS, rows, self._notes(), self.provenance)
