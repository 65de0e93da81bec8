"""A model at hand."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spa_fo.api.show import COLUMNS, card, estimate_rows, text_table
from spa_fo.errors import BadInput
from spa_fo.plant import Model as ModelDocument
from spa_fo.plant import TransferFunction, read_model, write_model
from spa_fo.plant.estimates import Estimate, read_estimates
from spa_fo.plant.model_file import UNKNOWN, VERDICT

if TYPE_CHECKING:
    from control import StateSpace
    from matplotlib.figure import Figure

    from spa_fo.api.campaign import Campaign
    from spa_fo.api.diagnosis import Diagnosis
    from spa_fo.api.exported import ExportedModel
    from spa_fo.api.prediction import Prediction
    from spa_fo.gap import Diagnosis as Diagnosed


@dataclass(frozen=True)
class Model:
    """A fractional-order model of an actuator, plain or augmented with effects.

    Attributes
    ----------
    document : spa_fo.plant.Model
        What its file holds.
    source : Path or str
        Where it comes from, for messages.
    """

    document: ModelDocument
    source: Path | str = "model"

    @classmethod
    def load(cls, path: Path | str) -> Model:
        """Read a model file.

        Raises
        ------
        BadInput
            It is none; the text names the key.
        """
        return cls(read_model(path), Path(path))

    def save(self, path: Path | str) -> None:
        """Write the model file, whole or not at all."""
        write_model(path, self.document)

    @property
    def transfer_function(self) -> TransferFunction:
        """G(s), its five parameters."""
        return self.document.transfer_function

    @property
    def gain(self) -> float:
        """Static gain K = b0/a0, rad for u = 1."""
        return self.transfer_function.gain

    @property
    def parameters(self) -> Mapping[str, Estimate]:
        """alpha2, alpha1, a1, a0, b0 and K with their uncertainty, where the file holds any.

        Raises
        ------
        BadInput
            What the file holds of it is damaged.
        """
        return {one.name: one for one in read_estimates(self.document, self.source)}

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects on top of G(s); empty for a plain model."""
        return tuple(str(effect["id"]) for effect in self.document.effects)

    @property
    def provenance(self) -> str:
        """Whether the data behind it are measured or synthetic, where its file says so."""
        from spa_fo.export.exported import provenance_text

        return provenance_text(self.document)

    def step(self, t_s: ArrayLike, pressure_kpa: float | None = None) -> NDArray[np.float64]:
        """Step response of G(s), exact.

        Parameters
        ----------
        t_s : array_like
            Times after the step, s.
        pressure_kpa : float, optional
            Height of the step; the reference pressure, u = 1, unless given.

        Returns
        -------
        ndarray
            Angle in degrees, same shape.
        """
        from spa_fo.fractional import step_response

        g = self.transfer_function
        u = 1.0 if pressure_kpa is None else pressure_kpa / self.document.reference_kpa
        response = step_response(t_s, g.alpha2, g.alpha1, g.a1, g.a0, g.b0)
        return np.asarray(np.degrees(u * response))

    def predict(self, campaign: Campaign | Path | str) -> Prediction:
        """Predict every sample of a campaign.

        An augmented model runs through the trials in their order, and goes on from the state
        that its own campaign ended in where this one continues it; `Prediction.note` says so.

        Raises
        ------
        BadInput
            The campaign cannot be read, or does not hold the signal that drives the model.
        """
        from spa_fo.api.campaign import Campaign
        from spa_fo.api.prediction import Prediction
        from spa_fo.identify import predict_campaign
        from spa_fo.plant.augmented import is_augmented, past_note
        from spa_fo.plant.effects.own import use_effects_of

        at_hand = campaign if isinstance(campaign, Campaign) else Campaign.load(campaign)
        data = at_hand.data
        use_effects_of(data.campaign.folder)
        augmented = is_augmented(self.document, self.source)
        note = past_note(self.document, data.campaign, self.source) if augmented else None
        table = predict_campaign(self.document, data, self.source)
        return Prediction(table, self, at_hand, note)

    def diagnose(
        self,
        campaign: Campaign | Path | str,
        *,
        exclude: Sequence[str] = (),
        seed: int = 1,
        progress: Callable[[str], None] | None = None,
    ) -> Diagnosis:
        """Say whether, where and why this plain model and a campaign disagree.

        Takes some tens of seconds.

        Parameters
        ----------
        campaign : Campaign or path
            The measurements.
        exclude : sequence of str
            Effects to take out of the library.
        seed : int
            Of the held-out trials and the bootstrap.
        progress : callable, optional
            Told each step in words.

        Raises
        ------
        BadInput
            The model has effects already, an effect is unknown, or the campaign is unusable.
        """
        from spa_fo.api.campaign import Campaign
        from spa_fo.api.diagnosis import Diagnosis
        from spa_fo.gap.diagnose import check_request, diagnose
        from spa_fo.plant.belonging import strangers
        from spa_fo.plant.effects.own import use_effects_of

        if not isinstance(campaign, Campaign):
            campaign = Campaign.load(campaign)
        use_effects_of(campaign.data.campaign.folder)
        check_request(self.document, exclude, self.source)
        tell = progress or _silent
        for warning in campaign.parse_report.warnings:
            tell(f"{campaign.name}: {warning}")
        stranger = strangers(self.document, campaign.data.campaign)
        if stranger:
            tell(f"{self.source}: {stranger}")
        found = diagnose(
            campaign.data,
            self.document,
            excluded=exclude,
            seed=seed,
            progress=tell,
        )
        return Diagnosis(found.to_dict(), _with_verdict(found))

    def approximate(
        self,
        *,
        method: str | None = None,
        band: tuple[float, float] | None = None,
        order: int | None = None,
        sample_time_s: float | None = None,
        hold: str = "zoh",
        linear_part: bool = False,
    ) -> ExportedModel:
        """Approximate G(s) by a rational function, and by a discrete filter, with their errors.

        Parameters
        ----------
        method : {"fitted", "oustaloup"}, optional
            Poles and zeros of the whole fitted (more accurate at equal order, the default), or
            Oustaloup's filter for each fractional power.
        band : (float, float), optional
            Where it is to hold, rad/s; by default from the model's time scales and the sampling.
        order : int, optional
            Number of poles (fitted, 10), or N of Oustaloup's filters (5).
        sample_time_s : float, optional
            Of the discrete filter; by default that of the logs behind the model.
        hold : {"zoh", "tustin"}
            Its input held between samples, or straight.
        linear_part : bool
            Leave out effects that are not linear, rather than refuse them.

        Raises
        ------
        BadInput
            An option is out of its range, or the model has effects that are not linear.
        """
        from spa_fo.api.exported import ExportedModel
        from spa_fo.export import Band, Options, export_model

        try:
            ends = None if band is None else Band(*band)
        except ValueError as error:
            raise BadInput("--band", str(error)) from None
        options = Options(method, ends, order, sample_time_s, hold, linear_part)
        return ExportedModel(export_model(self.document, options, self.source), self.source)

    def to_control(self, **options: Any) -> StateSpace:
        """Return a `control.StateSpace` from u to rad; `options` as for `approximate`."""
        return self.approximate(**options).to_control()

    def export(self, to: str, path: Path | str | None = None, **options: Any) -> Path:
        """Write a file for another tool, as ``spa-fo export`` does.

        Parameters
        ----------
        to : {"python-control", "simulink", "oustaloup", "csv"}
            What for.
        path : Path or str, optional
            The file; by default beside the model's.
        **options
            As for `approximate`.

        Returns
        -------
        Path
            The file.
        """
        if to == "oustaloup":
            options = {"method": "oustaloup", **options}
        return self.approximate(**options).save(to, path)

    def plot(self, campaign: Campaign | None = None) -> Figure:
        """Draw step response and Bode plot of G(s), or its predictions of a campaign."""
        from spa_fo.api.figures import marked
        from spa_fo.report.campaign_figure import model_figure
        from spa_fo.report.figures import log_figure
        from spa_fo.report.material import log_panels

        if campaign is None:
            return marked(model_figure(self.document), self.provenance)
        panels = log_panels(campaign.data, self.document)
        return marked(log_figure(panels, "model"), campaign.provenance)

    def _lines(self) -> list[str]:
        kind = next(iter(self.parameters.values())).kind
        lines = [
            f"G(s) = b0 / (s^alpha2 + a1 s^alpha1 + a0), u = {self.document.signal} / "
            f"{self.document.reference_kpa:g} kPa, output the bending angle in rad"
        ]
        if self.effects:
            lines.append(f"with effects: {', '.join(self.effects)}")
        return [*lines, kind or "no uncertainty is known"]

    def _title(self) -> str:
        return f"Model of {self.document.material}, from {self.document.campaign}"

    def __str__(self) -> str:
        table = text_table(COLUMNS, estimate_rows(list(self.parameters.values())))
        return "\n".join([self._title(), self.provenance, *self._lines(), "", table])

    def _repr_html_(self) -> str:
        rows = estimate_rows(list(self.parameters.values()))
        return card(self._title(), self._lines(), COLUMNS, rows, muted=self.provenance)


def _with_verdict(found: Diagnosed) -> Diagnosed:
    """Let the model's file say that its diagnosis does not know the cause of the gap."""
    if found.kind != UNKNOWN:
        return found
    model = replace(found.model, extra={**found.model.extra, VERDICT: found.kind})
    return replace(found, model=model)


def _silent(step: str) -> None:
    """Keep to oneself what is being done."""
