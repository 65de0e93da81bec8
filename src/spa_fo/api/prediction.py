"""What a model predicts of a campaign."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spa_fo.api.show import card, text_table
from spa_fo.atomic import write_text
from spa_fo.identify.goodness import fit_percent, rms_error

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from spa_fo.api.campaign import Campaign
    from spa_fo.api.model import Model

_COLUMNS = ("experiment", "trials", "samples", "rms error (°)", "fit (%)", "largest error (°)")


@dataclass(frozen=True)
class Prediction:
    """Measured and predicted angle of every sample.

    Attributes
    ----------
    table : pandas.DataFrame
        experiment, trial, t_s, angle_deg, predicted_deg.
    model : Model
        Which predicted.
    campaign : Campaign
        What was predicted.
    note : str or None
        What was made of the specimen's past, where there is one.
    """

    table: pd.DataFrame
    model: Model
    campaign: Campaign
    note: str | None = None

    @property
    def rms_deg(self) -> float:
        """RMS error over all samples, degrees."""
        return rms_error(self.table["angle_deg"], self.table["predicted_deg"])

    @property
    def fit_percent(self) -> float:
        """Normalised RMS fit over all samples: 100 for a perfect model, 0 for the mean angle."""
        return fit_percent(self.table["angle_deg"], self.table["predicted_deg"])

    @property
    def stranger(self) -> str | None:
        """How model and campaign differ in what they are of, in words; None where they do not."""
        from spa_fo.plant.belonging import strangers

        return strangers(self.model.document, self.campaign.data.campaign)

    def save(self, path: Path | str) -> None:
        """Write the table as csv, as ``spa-fo predict`` does."""
        write_text(path, self.table.to_csv(index=False, lineterminator="\n"))

    def plot(self) -> Figure:
        """Draw the first trial of each experiment: measured, predicted, what is missed."""
        from spa_fo.api.figures import marked

        return marked(self._figure(), self.campaign.provenance)

    def save_figure(self, path: Path | str) -> tuple[Path, Path]:
        """Draw the same as PDF and PNG; `path` with or without either suffix."""
        from spa_fo.api.figures import stem_of
        from spa_fo.report.style import save_figure

        return save_figure(self._figure(), stem_of(path), self.campaign.provenance)

    def _figure(self) -> Figure:
        from spa_fo.report.figures import LogPanel, log_figure

        first = {trial.experiment: trial for trial in reversed(self.campaign.trials)}
        panels = []
        commanded = self.campaign.data.campaign.command_is_pressure
        for experiment in dict.fromkeys(trial.experiment for trial in self.campaign.trials):
            trial = first[experiment]
            rows = self.table["experiment"] == experiment
            predicted = self.table.loc[rows & (self.table["trial"] == trial.trial), "predicted_deg"]
            panels.append(
                LogPanel(
                    trial.label,
                    trial.t_s,
                    trial.angle_deg,
                    predicted.to_numpy(),
                    trial.command_kpa if commanded else trial.pressure_kpa,
                )
            )
        return log_figure(panels, "model")

    def _rows(self) -> list[list[str]]:
        groups = self.table.groupby("experiment", sort=False)
        rows = [_row(str(name), group) for name, group in groups]
        return [*rows, _row("all", self.table)] if len(rows) > 1 else rows

    def _title(self) -> str:
        return f"{self.campaign.name} predicted by the model of {self.model.document.campaign}"

    def _lines(self) -> list[str]:
        effects = f", with {', '.join(self.model.effects)}" if self.model.effects else ""
        return [
            f"rms error {self.rms_deg:.2f}°, fit {self.fit_percent:.1f} % "
            f"over {len(self.table)} samples{effects}",
            *filter(None, (self.stranger, self.note)),
        ]

    def __str__(self) -> str:
        table = text_table(_COLUMNS, self._rows())
        return "\n".join([self._title(), self.campaign.provenance, *self._lines(), "", table])

    def _repr_html_(self) -> str:
        return card(
            self._title(), self._lines(), _COLUMNS, self._rows(), muted=self.campaign.provenance
        )


def _row(name: str, group: pd.DataFrame) -> list[str]:
    measured, predicted = group["angle_deg"], group["predicted_deg"]
    fit = fit_percent(measured, predicted)
    return [
        name,
        f"{len(group[['experiment', 'trial']].drop_duplicates())}",
        f"{len(group)}",
        f"{rms_error(measured, predicted):.2f}",
        "" if math.isnan(fit) else f"{fit:.1f}",
        f"{(measured - predicted).abs().max():.2f}",
    ]
