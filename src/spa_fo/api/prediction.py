"""What a model predicts of a campaign."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spa_fo.api.show import card, text_table
from spa_fo.atomic import write_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from spa_fo.api.campaign import Campaign
    from spa_fo.api.model import Model

_COLUMNS = ("experiment", "trials", "samples", "rms error (°)", "largest error (°)")


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
        return float(np.sqrt(np.mean(self._errors() ** 2)))

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
        from spa_fo.report.figures import LogPanel, log_figure

        panels = []
        for trial in self.campaign.trials:
            if trial.trial != 1:
                continue
            of = (self.table["experiment"] == trial.experiment) & (self.table["trial"] == 1)
            predicted = self.table.loc[of, "predicted_deg"].to_numpy()
            panels.append(
                LogPanel(trial.label, trial.t_s, trial.angle_deg, predicted, trial.command_kpa)
            )
        return marked(log_figure(panels, "model"), self.campaign.provenance)

    def _errors(self) -> np.ndarray:
        difference = self.table["angle_deg"] - self.table["predicted_deg"]
        return np.asarray(difference.to_numpy())

    def _rows(self) -> list[list[str]]:
        errors = self.table.assign(error=self._errors()).groupby("experiment", sort=False)
        rows = []
        for name, group in errors:
            error = group["error"].to_numpy()
            rows.append(
                [
                    str(name),
                    f"{group['trial'].nunique()}",
                    f"{len(group)}",
                    f"{np.sqrt(np.mean(error**2)):.2f}",
                    f"{np.max(np.abs(error)):.2f}",
                ]
            )
        return rows

    def _title(self) -> str:
        return f"{self.campaign.name} predicted by the model of {self.model.document.campaign}"

    def _lines(self) -> list[str]:
        effects = f", with {', '.join(self.model.effects)}" if self.model.effects else ""
        return [
            f"rms error {self.rms_deg:.2f}° over {len(self.table)} samples{effects}",
            *filter(None, (self.stranger, self.note)),
        ]

    def __str__(self) -> str:
        table = text_table(_COLUMNS, self._rows())
        return "\n".join([self._title(), self.campaign.provenance, *self._lines(), "", table])

    def _repr_html_(self) -> str:
        return card(
            self._title(), self._lines(), _COLUMNS, self._rows(), muted=self.campaign.provenance
        )
