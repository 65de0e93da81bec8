"""A model approximated for other tools."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spa_fo.api.show import COLUMNS, card, estimate_rows
from spa_fo.errors import BadInput
from spa_fo.export import Accuracy, DiscreteFilter, Exported, FilterAccuracy, Rational
from spa_fo.export.exported import file_suffix, provenance_text, write_export

if TYPE_CHECKING:
    from control import StateSpace
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class ExportedModel:
    """A rational approximation, a discrete filter, and their errors.

    Attributes
    ----------
    made : spa_fo.export.Exported
        All of it.
    source : Path or str
        The model's file.
    """

    made: Exported
    source: Path | str = "model"

    @property
    def rational(self) -> Rational:
        """Zeros, poles, static gain, state-space form; without the dead time."""
        return self.made.rational

    @property
    def accuracy(self) -> Accuracy:
        """Errors over the band and in the step response."""
        return self.made.accuracy

    @property
    def filter(self) -> DiscreteFilter:
        """Second-order sections."""
        return self.made.filter

    @property
    def filter_accuracy(self) -> FilterAccuracy:
        """Errors of the filter's step response."""
        return self.made.filter_accuracy

    def to_control(self) -> StateSpace:
        """Return a `control.StateSpace` from u to the angle in rad."""
        from spa_fo.export.python_control import control_system

        return control_system(self.made)

    def save(self, to: str, path: Path | str | None = None) -> Path:
        """Write a file for another tool.

        Parameters
        ----------
        to : {"python-control", "simulink", "oustaloup", "csv"}
            What for.
        path : Path or str, optional
            The file; by default beside the model's.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        BadInput
            There is no such target, no place to write to, or the method is not the target's.
        """
        if path is None:
            if not isinstance(self.source, Path):
                raise BadInput("--out", "expected a file: the model has none to write it beside")
            path = self.source.with_name(self.source.stem + file_suffix(to))
        write_export(self.made, to, path)
        return Path(path)

    def plot(self) -> Figure:
        """Draw Bode and step plots of the exact model and the approximation, with their errors."""
        from spa_fo.api.figures import marked
        from spa_fo.report.export_figure import export_figure

        return marked(export_figure(self.made), provenance_text(self.made.model))

    def save_figure(self, path: Path | str) -> tuple[Path, Path]:
        """Write the plots as PDF and PNG; `path` with or without either suffix."""
        from spa_fo.api.figures import stem_of
        from spa_fo.report.export_figure import export_figure
        from spa_fo.report.style import save_figure

        figure = export_figure(self.made)
        return save_figure(figure, stem_of(path), provenance_text(self.made.model))

    def _filter_line(self) -> str:
        filtered = self.made.filter
        return (
            f"discrete filter ({filtered.hold}, {filtered.sample_time_s:g} s, "
            f"{len(filtered.sos)} sections): {self.made.filter_accuracy.text()}"
        )

    def __str__(self) -> str:
        made = self.made
        return "\n".join(
            [made.title(), *made.description(), self._filter_line(), *made.uncertainty()]
        )

    def _repr_html_(self) -> str:
        made, model = self.made, self.made.model
        kind = made.estimates[0].kind
        lines = [*made.description(), self._filter_line()]
        return card(
            f"{model.material}, campaign {model.campaign}: approximated for other tools",
            [*lines, f"The model itself ({kind}):"] if kind else lines,
            COLUMNS,
            estimate_rows(made.estimates) if kind else (),
            muted=provenance_text(model),
        )
