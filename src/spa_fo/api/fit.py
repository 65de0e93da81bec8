"""The result of an identification."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from spa_fo.api.campaign import Campaign
from spa_fo.api.model import Model
from spa_fo.api.show import COLUMNS, card, estimate_rows
from spa_fo.identify import FitResult as Identified
from spa_fo.identify.curve_report import curve_verdict
from spa_fo.identify.fit_report import error_lines, head_lines
from spa_fo.plant.estimates import Estimate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FitResult:
    """A model, what it was fitted to, and how well the data determine it.

    Attributes
    ----------
    result : spa_fo.identify.FitResult
        All of it.
    campaign : Campaign
        What was fitted.
    """

    result: Identified
    campaign: Campaign

    @property
    def model(self) -> Model:
        """The identified model, with its static curve where one is worth having."""
        return Model(self.result.chosen_model)

    @property
    def parameters(self) -> Mapping[str, Estimate]:
        """alpha2, alpha1, a1, a0, b0 and K: value, standard error, interval, determined or not.

        Those of the plain model, whether or not a static curve stands beside it.
        """
        return {one.name: one for one in self.result.estimates}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a reader of the parameters must know, in words."""
        return self.result.warnings

    def save(self, path: Path | str) -> None:
        """Write the model file."""
        self.model.save(path)

    def plot(self, what: str = "fit") -> Figure:
        """Draw the fit, or how well each parameter is determined.

        Parameters
        ----------
        what : {"fit", "profiles"}
            Trials and model; or profile likelihoods, which fits of whole logs do not have.

        Raises
        ------
        BadInput
            There is no such plot of this fit.
        """
        from spa_fo.api.figures import chosen
        from spa_fo.report.campaign_figure import fit_figure
        from spa_fo.report.figures import identifiability_figure, log_figure
        from spa_fo.report.material import log_panels, profiles_of

        result = self.result
        draw: dict[str, Callable[[], Figure]] = {}
        if result.data is not None:
            draw["fit"] = lambda: fit_figure(result)
            draw["profiles"] = lambda: identifiability_figure(profiles_of(result.to_dict()))
        else:
            panels = log_panels(self.campaign.data, result.chosen_model)
            draw["fit"] = lambda: log_figure(panels, "model")
        return chosen(draw, what, self.campaign.provenance)

    def __str__(self) -> str:
        return self.result.report()

    def _repr_html_(self) -> str:
        kind = self.result.estimates[0].kind or "a single log: its errors cannot be told"
        curve = [] if self.result.curve is None else [curve_verdict(self.result.curve)]
        _, *head = "   ".join(head_lines(self.result)).split("   ")  # the first names the campaign
        return card(
            f"Fit of {self.campaign.material}: {self.campaign.name}",
            [" · ".join(head), *error_lines(self.result), kind, *curve],
            COLUMNS,
            estimate_rows(self.result.estimates),
            self.warnings,
            self.campaign.provenance,
        )
