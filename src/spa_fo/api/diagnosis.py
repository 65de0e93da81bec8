"""A diagnosis: whether, where and why model and actuator disagree."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spa_fo.api.campaign import Campaign
from spa_fo.api.model import Model
from spa_fo.api.show import card, text_table
from spa_fo.errors import BadInput
from spa_fo.gap import Diagnosis as Diagnosed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from spa_fo.api.plan import Plan

_SHOWN = 3  # parameters of a cause; the document holds all
_COLUMNS = ("cause", "probability", "held-out error (°)", "parameters (95 % interval)")
_MOST = 6
_FILE, _MODEL = "diagnosis.json", "augmented_model.json"


@dataclass(frozen=True)
class Diagnosis:
    """What a diagnosis found.

    Attributes
    ----------
    document : mapping
        As in diagnosis.json.
    result : spa_fo.gap.Diagnosis or None
        With the curves; None where it was loaded from its file.
    folder : Path or None
        Where it was loaded from.
    """

    document: Mapping[str, Any]
    result: Diagnosed | None = None
    folder: Path | None = None

    @classmethod
    def load(cls, folder: Path | str) -> Diagnosis:
        """Read what ``spa-fo diagnose --out`` or `save` wrote; its curves are not in the files.

        Raises
        ------
        BadInput
            There is no diagnosis.json of a diagnosis.
        """
        from spa_fo.gap.diagnosis import SCHEMA

        path = Path(folder) / _FILE
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise BadInput(path, f"cannot be read: {error.strerror or error}") from error
        except ValueError as error:
            raise BadInput(path, f"is not JSON: {error}") from error
        if not isinstance(document, dict) or document.get("schema") != SCHEMA:
            raise BadInput(path, f'expected a diagnosis of schema "{SCHEMA}"', "schema")
        return cls(document, None, Path(folder))

    @property
    def kind(self) -> str:
        """no_gap, cause, ambiguous or unknown."""
        return str(self.document["verdict"]["kind"])

    @property
    def causes(self) -> tuple[tuple[str, ...], ...]:
        """Explanations that stand, each a set of effects."""
        return tuple(tuple(ids) for ids in self.document["verdict"]["sets"])

    @property
    def next_experiment(self) -> str | None:
        """What to measure next, in words."""
        advice: str | None = self.document["verdict"]["next_experiment"]
        return advice

    @property
    def model(self) -> Model:
        """The augmented model; the plain one where nothing is explained.

        Raises
        ------
        BadInput
            It was loaded from a folder that does not hold the model.
        """
        if self.result is not None:
            return Model(self.result.model)
        assert self.folder is not None
        return Model.load(self.folder / _MODEL)

    @property
    def provenance(self) -> str:
        """Whether the data are measured or synthetic."""
        return f"{self.document.get('provenance', 'unknown')} data"

    def save(self, folder: Path | str) -> tuple[Path, ...]:
        """Write diagnosis.md, diagnosis.json, augmented_model.json and the figures, or none.

        Returns
        -------
        tuple of Path
            Page and figures, the page last.

        Raises
        ------
        BadInput
            A file cannot be written, or the curves are not at hand (see `load`).
        """
        from spa_fo.report.diagnosis import write_report

        return write_report(self._with_curves(), folder)

    def plan(
        self,
        campaign: Campaign | Path | str,
        *,
        max_duration_s: float | None = None,
        max_pressure_kpa: float | None = None,
    ) -> Plan:
        """Find the command profile that best tells apart what is still open.

        Parameters
        ----------
        campaign : Campaign or path
            The one that was diagnosed.
        max_duration_s, max_pressure_kpa : float, optional
            Limits in place of the campaign's own.

        Raises
        ------
        BadInput
            It is another campaign's diagnosis, or no profile fits the limits.
        """
        from spa_fo.api.plan import plan_next
        from spa_fo.gap.plan.rivals import standing_of
        from spa_fo.plant.effects.own import use_effects_of

        at_hand = campaign if isinstance(campaign, Campaign) else Campaign.load(campaign)
        use_effects_of(at_hand.data.campaign.folder)
        standing = standing_of(self.document, at_hand.name)
        return plan_next(at_hand, standing, max_duration_s, max_pressure_kpa)

    def plot(self, what: str = "before_after") -> Figure:
        """Draw one of the report's figures.

        Parameters
        ----------
        what : {"gap", "before_after", "ladder", "stages"}
            Where the gap lies; measured and modelled before and after; the explanations'
            ladder; pressure and sensor, where the campaign holds them.

        Raises
        ------
        BadInput
            There is no such figure of this diagnosis, or the curves are not at hand.
        """
        from spa_fo.api.figures import chosen
        from spa_fo.report.diagnosis_figures import before_after_figure, gap_figure, ladder_figure
        from spa_fo.report.stages_figure import has_stages, stages_figure

        result = self._with_curves()
        draw: dict[str, Callable[[], Figure]] = {
            "gap": lambda: gap_figure(result),
            "before_after": lambda: before_after_figure(result),
            "ladder": lambda: ladder_figure(result),
        }
        if has_stages(result.traces):
            draw["stages"] = lambda: stages_figure(result)
        return chosen(draw, what, self.provenance)

    def _with_curves(self) -> Diagnosed:
        if self.result is None:
            raise BadInput(
                self.folder or _FILE, "holds no curves; diagnose again to draw or to save it"
            )
        return self.result

    def _rows(self) -> list[list[str]]:
        from spa_fo.report.causes import percent
        from spa_fo.report.effect_words import phrase

        rows = []
        for cause in self.document["causes"][:_MOST]:
            error = cause.get("held_out_rmse_deg")
            rows.append(
                [
                    phrase(cause["set"]),
                    percent(cause["probability"]),
                    "" if error is None else f"{error:.2f}",
                    _parameters_text(cause["parameters"]),
                ]
            )
        return rows

    def headline(self) -> tuple[str, str]:
        """Say what it answers, and what that rests on, a line each."""
        from spa_fo.report.headline import headline

        return headline(self.document)

    def _title(self) -> str:
        return f"Diagnosis of {self.document['campaign']} ({self.provenance})"

    def __str__(self) -> str:
        table = text_table(_COLUMNS, self._rows())
        advice = [f"next: {self.next_experiment}"] if self.next_experiment else []
        return "\n".join([self._title(), *self.headline(), *advice, "", table])

    def _repr_html_(self) -> str:
        notes = [f"Next: {self.next_experiment}"] if self.next_experiment else []
        return card(self._title(), self.headline(), _COLUMNS, self._rows(), notes)


def _parameters_text(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    from spa_fo.plant.estimates import rounded
    from spa_fo.report.effect_words import parameter_words

    words = []
    for effect, values in parameters.items():
        for parameter, entry in values.items():
            name, unit = parameter_words(effect, parameter)
            interval = entry.get("ci95")
            if interval is None:
                words.append(f"{name} {rounded(entry['value'])} {unit}".strip())
                continue
            half = 0.5 * (interval[1] - interval[0])
            value = rounded(entry["value"], half)
            low, high = (rounded(end, half) for end in interval)
            words.append(f"{name} {value} ({low} .. {high}) {unit}".strip())
    shown = words[:_SHOWN]
    if len(words) > _SHOWN:
        shown.append(f"and {len(words) - _SHOWN} more")
    return ", ".join(shown)
