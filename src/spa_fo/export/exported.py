"""A model made ready for other tools: approximation, filter, errors, and what to say of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from spa_fo.atomic import write_text
from spa_fo.errors import BadInput
from spa_fo.export.accuracy import Accuracy, FilterAccuracy, measure, measure_filter
from spa_fo.export.approximation import Approximation, Band, approximate, default_band
from spa_fo.export.discrete import DiscreteFilter, discretise
from spa_fo.export.linear_part import LinearPart, linear_part
from spa_fo.export.rational import Rational
from spa_fo.plant import Model
from spa_fo.plant.estimates import Estimate, read_estimates
from spa_fo.plant.model_file import UNKNOWN, VERDICT

TARGETS = ("python-control", "simulink", "oustaloup", "csv")
SAMPLING = "sampling"
"""Key of a model file: ``interval_s`` of the logs it was identified from."""
PROVENANCE = "provenance"
"""Key of a model file: as in the campaign's campaign.yaml."""
_SAMPLE_TIME_S = 0.02
_FASTEST = 20.0  # samples within the model's fastest time scale, where the sampling is not known


@dataclass(frozen=True)
class Options:
    """How to export.

    Attributes
    ----------
    method : str or None
        "fitted" or "oustaloup"; the target's own by default.
    band : Band or None
        Where the approximation is to hold; see `default_band`.
    order : int or None
        See `approximate`.
    sample_time_s : float or None
        Of the discrete filter; by default that of the logs.
    hold : {"zoh", "tustin"}
        See `discretise`.
    allow_left_out : bool
        Export the linear part of a model that has others.
    """

    method: str | None = None
    band: Band | None = None
    order: int | None = None
    sample_time_s: float | None = None
    hold: str = "zoh"
    allow_left_out: bool = False


@dataclass(frozen=True)
class Exported:
    """Everything that an export is made of.

    Attributes
    ----------
    model : Model
        What is exported.
    approximation : Approximation
        Of its G(s).
    accuracy : Accuracy
        Of that.
    part : LinearPart
        Dead time and lags beside G(s), and what is left out.
    rational : Rational
        G(s) with the lags.
    filter : DiscreteFilter
        Of the same, with the dead time in whole samples.
    filter_accuracy : FilterAccuracy
        Of that.
    estimates : tuple of Estimate
        The parameters with the uncertainty that the model's file holds.
    """

    model: Model
    approximation: Approximation
    accuracy: Accuracy
    part: LinearPart
    rational: Rational
    filter: DiscreteFilter
    filter_accuracy: FilterAccuracy
    estimates: tuple[Estimate, ...] = field(default=())

    def statement(self) -> tuple[str, ...]:
        """Say what this is, how good, what it lacks, and how uncertain; a line each."""
        return (self.title(), *self.description(), *self.uncertainty())

    def title(self) -> str:
        """Name the actuator, its campaign and the provenance of its data."""
        model = self.model
        return f"{model.material}, campaign {model.campaign} ({provenance_text(model)})"

    def description(self) -> tuple[str, ...]:
        """Say what the approximation is, how good, and what it lacks."""
        return tuple(_description(self))

    def uncertainty(self) -> tuple[str, ...]:
        """Say how well the model's own parameters are known; empty where nothing is."""
        return tuple(uncertainty_lines(self.estimates))

    def input_text(self) -> str:
        """Say what goes in and what comes out."""
        return (
            f"input u = {self.model.signal} gauge pressure / {self.model.reference_kpa:g} kPa, "
            "output the bending angle in rad"
        )


def export_model(
    model: Model, options: Options | None = None, source: Path | str = "model"
) -> Exported:
    """Approximate a model and measure the errors.

    Parameters
    ----------
    model : Model
        Plain or augmented.
    options : Options, optional
        How.
    source : Path or str
        Its file, for messages.

    Raises
    ------
    BadInput
        The model holds effects that are not linear (see `linear_part`), or an option is out of
        its range.
    """
    options = options or Options()
    part = linear_part(model, source, options.allow_left_out)
    estimates = read_estimates(model, source)
    g = model.transfer_function
    logged = _logged_interval(model)
    sample_time = options.sample_time_s or logged
    band = options.band or default_band(g, sample_time)
    if sample_time is None:
        sample_time = min(_SAMPLE_TIME_S, 100.0 / (band.high * _FASTEST))
    try:
        approximation = approximate(g, options.method or "fitted", band, options.order)
        rational = approximation.rational.followed_by(part.lags_s, part.leads_s)
        filtered = discretise(rational, sample_time, options.hold, part.dead_time_s)
        bare = discretise(approximation.rational, sample_time, options.hold)
    except ValueError as error:
        raise BadInput("export", str(error)) from error
    return Exported(
        model=model,
        approximation=approximation,
        accuracy=measure(g, approximation),
        part=part,
        rational=rational,
        filter=filtered,
        filter_accuracy=measure_filter(g, bare, 1.0 / band.low),
        estimates=estimates,
    )


def _logged_interval(model: Model) -> float | None:
    sampling = model.extra.get(SAMPLING)
    interval = sampling.get("interval_s") if isinstance(sampling, dict) else None
    if isinstance(interval, int | float) and not isinstance(interval, bool) and interval > 0:
        return float(interval)
    return None


def provenance_text(model: Model) -> str:
    """Say whether the data behind a model are measured or synthetic, where its file says so."""
    entry = model.extra.get(PROVENANCE)
    if not isinstance(entry, dict):
        return "data of unknown provenance"
    words = [f"{entry.get('kind')} data", entry.get("source"), entry.get("note")]
    # One line, whatever the description: it stands in comments of other languages.
    return "; ".join(" ".join(str(word).split()) for word in words if word)


def _description(made: Exported) -> list[str]:
    approximation, part = made.approximation, made.part
    g, band = made.model.transfer_function, approximation.band
    lines = [
        f"G(s) = {g.b0:.6g} / (s^{g.alpha2:.6g} + {g.a1:.6g} s^{g.alpha1:.6g} + {g.a0:.6g}); "
        f"{made.input_text()}",
        f"{_method_text(approximation)}, for {band.low:.3g} to {band.high:.3g} rad/s",
        f"error of the approximation: {made.accuracy.text()}",
    ]
    if made.model.extra.get(VERDICT) == UNKNOWN:
        lines.append(
            "VERDICT UNKNOWN: the diagnosis behind this model could not explain its gap, or only a "
            "part of it; the cause that is missing is missing here too"
        )
    if part.dead_time_s:
        lines.append(f"dead time of the drive: {part.dead_time_s:.6g} s before the input")
    if part.lags_s:
        lags = " and ".join(f"{lag:.4g} s" for lag in part.lags_s if lag > 0.0)
        leads = " and ".join(f"{lead:.4g} s" for lead in part.leads_s if lead > 0.0)
        lines.append(f"lags of the drive are included: {lags}" + f"; leads: {leads}" * bool(leads))
    if part.left_out:
        lines.append(
            f"LEFT OUT, this is the linear part only: {', '.join(part.left_out)} (not linear)"
        )
    if part.not_of_the_actuator:
        lines.append(
            f"not of the actuator, so not included: {', '.join(part.not_of_the_actuator)}; the "
            "output is the true angle"
        )
    return lines


def _method_text(approximation: Approximation) -> str:
    states = approximation.rational.states
    if approximation.method == "oustaloup":
        count = 2 * approximation.order + 1
        return (
            f"Oustaloup's filter of N = {approximation.order} ({count} zeros and poles) for each "
            f"fractional power (doi:10.1109/81.817385), {states} poles in all"
        )
    return f"{states} poles and their zeros fitted to the frequency response"


def uncertainty_lines(estimates: Sequence[Estimate]) -> list[str]:
    """Write the parameters with their uncertainty, a line each; none where nothing is known."""
    if not estimates or not estimates[0].kind:
        return []
    lines = [f"uncertainty of the model itself ({estimates[0].kind}):"]
    for estimate in estimates:
        interval = estimate.interval_text()
        line = f"  {estimate.name} = {estimate.text()}"
        if interval:
            line += f", {interval}"
        lines.append(f"{line} {estimate.unit}".rstrip())
    return lines


def write_export(made: Exported, target: str, path: Path | str) -> None:
    """Write an export's file, whole or not at all.

    Parameters
    ----------
    made : Exported
        From `export_model`.
    target : {"python-control", "simulink", "oustaloup", "csv"}
        What for.
    path : Path or str
        The file.

    Raises
    ------
    BadInput
        The target is unknown, Oustaloup's filter was not asked for where it is the target, or
        the file cannot be written.
    """
    if target not in TARGETS:
        raise BadInput("--to", f"expected one of {', '.join(TARGETS)}, found '{target}'")
    if target == "oustaloup" and made.approximation.method != "oustaloup":
        raise BadInput(
            "--method", f"is '{made.approximation.method}'; --to oustaloup needs its own"
        )
    write_text(path, _writers()[target](made))


def _writers() -> dict[str, Callable[[Exported], str]]:
    from spa_fo.export.python_control import python_file
    from spa_fo.export.simulink import matlab_script
    from spa_fo.export.tables import filter_csv, oustaloup_json

    return {
        "python-control": python_file,
        "simulink": matlab_script,
        "oustaloup": oustaloup_json,
        "csv": filter_csv,
    }


def file_suffix(target: str) -> str:
    """Return how the name of a target's file ends."""
    return {
        "python-control": "_control.py",
        "simulink": "_simulink.m",
        "oustaloup": "_oustaloup.json",
        "csv": "_filter.csv",
    }[target]
