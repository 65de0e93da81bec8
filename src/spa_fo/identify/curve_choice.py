"""Whether a static curve is worth having: chosen by BIC, believed on levels that were left out.

Place, knots and conditioning are chosen by BIC on the logs that are fitted. A form could as well be
chosen by leaving out levels, but then no level would be left to judge it by. So the whole choice is
repeated with each level left out, all its logs at once: samples of a level that was fitted, or of a
neighbouring moment, say nothing of another (Roberts et al. 2017, doi:10.1111/ecog.02881). A curve
that predicts left-out levels no better than the plain model is not taken, whatever its BIC.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from spa_fo.identify.polish import Optimum
from spa_fo.identify.selection import criteria, independent_samples
from spa_fo.identify.static_curve import (
    PLAIN,
    CurveFit,
    Form,
    fit_form,
    plain_fit,
    top_angle,
    top_level,
)
from spa_fo.identify.whole_log import LogData, fit_whole_logs
from spa_fo.plant import Model, TransferFunction
from spa_fo.plant.static_curve import (
    BEHIND,
    POSITIONS,
    Conditioning,
    MonotoneCurve,
    StaticCurve,
)

KNOTS = (2, 3, 5, 8)
TIMES_S = (3.0, 10.0, 30.0)
"""Time constants of the conditioning that are tried."""
SAME_LEVEL = 0.1
"""Logs whose highest inputs differ by less than this share are of one level."""
_MOST_PARTS = 6  # left out one after the other; neighbouring levels are joined beyond
KEY = "static_curve"
"""Key of a model file that holds the evidence."""


@dataclass(frozen=True)
class LeftOut:
    """One part of the logs, predicted by models that were chosen and fitted without it.

    Attributes
    ----------
    name : str
        Its level or its log.
    logs, samples : int
    form : str
        What was chosen without it.
    plain_deg, curved_deg : float
        RMS errors.
    beyond : bool
        Whether it reaches beyond the levels that were fitted.
    """

    name: str
    logs: int
    samples: int
    form: str
    plain_deg: float
    curved_deg: float
    beyond: bool


@dataclass(frozen=True)
class CurveChoice:
    """The curve that was chosen, and the evidence for it.

    Attributes
    ----------
    plain, fit : CurveFit
        Both fitted to all logs.
    curve : StaticCurve or None
        In kPa and degrees; None where the choice is the plain model.
    bic : dict
        Of each form that was tried, less the plain model's; empty where the independent samples
        are too few.
    held_out : str
        "level" or "log": what was left out at a time; empty for a single log.
    left_out : tuple of LeftOut
    in_order : bool
        Whether the levels rise or fall with the order of the logs, so that a change with time looks
        like one with the level.
    """

    plain: CurveFit
    fit: CurveFit
    curve: StaticCurve | None
    bic: dict[str, float]
    held_out: str
    left_out: tuple[LeftOut, ...]
    in_order: bool

    @property
    def closed(self) -> float | None:
        """Share of the plain model's squared error on what was left out that is closed."""
        return _closed(self.left_out)

    @property
    def closed_within(self) -> float | None:
        """The same of the levels that lie within the others; None where none is beyond them."""
        within = [one for one in self.left_out if not one.beyond]
        return _closed(within) if len(within) < len(self.left_out) else None

    def left_out_deg(self, which: str) -> float:
        """Return the RMS error over all that was left out, of the "plain" or the "curved" model."""
        return _pooled(self.left_out, which)

    @property
    def better(self) -> int:
        """How many of the parts left out are predicted better."""
        return sum(one.curved_deg < one.plain_deg for one in self.left_out)

    @property
    def kept(self) -> bool:
        """Whether the curve goes into the model."""
        if self.curve is None:
            return False
        closed = self.closed
        return closed is None or (closed > 0.0 and 2 * self.better > len(self.left_out))

    @property
    def plain_deg(self) -> float:
        """RMS error of the plain model on the logs it was fitted to."""
        return rms_deg(self.plain)

    @property
    def curved_deg(self) -> float:
        """RMS error of the chosen form on the logs it was fitted to."""
        return rms_deg(self.fit)

    def augment(self, plain: Model) -> Model:
        """Return the model with the curve, and the evidence; the plain one where none is kept."""
        if self.curve is None or not self.kept:
            return plain
        sampling = ("provenance", "sampling")
        kept = {key: value for key, value in plain.extra.items() if key in sampling}
        return replace(
            plain,
            transfer_function=TransferFunction.from_array(self.fit.x),
            effects=(self.curve.to_effect(),),
            extra={**kept, KEY: self.to_dict()},
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the evidence as plain data for JSON."""
        return {
            "form": str(self.fit.form),
            "kept": self.kept,
            "plain_rms_deg": self.plain_deg,
            "curved_rms_deg": self.curved_deg,
            "bic_less_plain": self.bic,
            "left_out_by": self.held_out or None,
            "left_out": [asdict(one) for one in self.left_out],
            "levels_in_order": self.in_order,
            "squared_error_closed": self.closed,
            "squared_error_closed_within": self.closed_within,
        }


def _closed(parts: Sequence[LeftOut]) -> float | None:
    return 1.0 - (_pooled(parts, "curved") / _pooled(parts, "plain")) ** 2 if parts else None


def _pooled(parts: Sequence[LeftOut], which: str) -> float:
    samples = np.array([one.samples for one in parts], dtype=float)
    errors = np.array([getattr(one, f"{which}_deg") for one in parts])
    return float(np.sqrt(samples @ errors**2 / samples.sum()))


def rms_deg(fit: CurveFit) -> float:
    """Return the RMS error of a fit on its own logs, degrees."""
    samples = sum(one.size for one in fit.residuals)
    return float(np.degrees(np.sqrt(fit.squares / samples)))


def choose_curve(
    logs: Sequence[LogData],
    plain: Optimum,
    reference_kpa: float,
    times_s: Sequence[float] = TIMES_S,
    unit: str = "kPa",
) -> CurveChoice:
    """Choose a curve for logs whose plain model is known.

    Parameters
    ----------
    logs : sequence of LogData
        Whole logs of a campaign.
    plain : Optimum
        Their plain least squares.
    reference_kpa : float
        Pressure at which u = 1.
    times_s : sequence of float
        Time constants of the conditioning to try.
    unit : str
        Of the levels, for their names.

    Raises
    ------
    ValueError
        The input never rises above zero, or the angle hardly ever does.
    """
    if top_level(logs) <= 0.0 or top_angle(logs) <= 0.0:
        raise ValueError("expected an input and an angle that rise above 0")
    fits = list(_fits(logs, plain, times_s))
    bic = _bic(fits)
    best = _smallest(fits, bic)
    held_out, parts = parts_of(logs, reference_kpa, unit)
    return CurveChoice(
        plain=fits[0],
        fit=best,
        curve=_in_units(best, reference_kpa),
        bic={str(fit.form): value - bic[0] for fit, value in zip(fits, bic, strict=True)}
        if bic
        else {},
        held_out=held_out,
        left_out=tuple(leave_out(logs, plain, *part, times_s) for part in parts),
        in_order=held_out == "level" and _in_order(logs),
    )


def parts_of(
    logs: Sequence[LogData], reference_kpa: float, unit: str = "kPa"
) -> tuple[str, list[tuple[str, frozenset[int]]]]:
    """Say what is left out at a time: whole levels, or logs where there is but one level.

    Returns
    -------
    str
        "level", "log", or nothing for a single log.
    list of (str, frozenset of int)
        A name, and which logs.
    """
    if len(logs) < 2:
        return "", []
    levels = _levels(logs)
    if len(levels) > 1:
        tops = [max(float(logs[i].u.max()) for i in level) for level in levels]
        names = [f"up to {top * reference_kpa:.3g} {unit}" for top in tops]
        return "level", list(zip(names, map(frozenset, levels), strict=True))
    joined = np.array_split(np.arange(len(logs)), min(_MOST_PARTS, len(logs)))
    return "log", [
        (", ".join(logs[i].trial.label for i in part), frozenset(part.tolist())) for part in joined
    ]


def _levels(logs: Sequence[LogData]) -> list[list[int]]:
    """Sort logs by their highest input, and join those of one level, the lowest first."""
    top = [float(log.u.max()) for log in logs]
    levels: list[list[int]] = []
    for i in np.argsort(top).tolist():
        if levels and top[i] <= (1.0 + SAME_LEVEL) * top[levels[-1][0]]:
            levels[-1].append(i)
        else:
            levels.append([i])
    while len(levels) > _MOST_PARTS:
        apart = [top[b[0]] / top[a[-1]] for a, b in pairwise(levels)]
        nearest = int(np.argmin(apart))
        levels[nearest : nearest + 2] = [levels[nearest] + levels[nearest + 1]]
    return levels


def _in_order(logs: Sequence[LogData]) -> bool:
    """Say whether the highest inputs only rise, or only fall, from one log to the next."""
    in_time = sorted(logs, key=lambda log: log.trial.order)
    top = np.array([log.u.max() for log in in_time])
    ratios = top[1:] / top[:-1]
    rises, falls = ratios > 1.0 + SAME_LEVEL, ratios < 1.0 / (1.0 + SAME_LEVEL)
    return bool(rises.any() != falls.any())


def _fits(logs: Sequence[LogData], plain: Optimum, times_s: Sequence[float]) -> Iterator[CurveFit]:
    """Fit the plain model, curves of every place and size, and the best of these conditioned."""
    fits = [plain_fit(logs, plain)]
    for position in POSITIONS:
        fits += [fit_form(logs, Form(position, knots), plain.bounds, fits[0]) for knots in KNOTS]
    yield from fits
    best = _smallest(fits, _bic(fits))
    for time_s in times_s:
        yield fit_form(logs, replace(best.form, time_s=time_s), plain.bounds, best)


def _bic(fits: Sequence[CurveFit]) -> list[float]:
    """Return each fit's BIC; nothing where the independent samples are too few."""
    best = min(fits, key=lambda fit: fit.squares)
    samples = sum(one.size for one in best.residuals)
    independent = independent_samples(best.residuals)
    found = []
    for fit in fits:
        _, bic = criteria(fit.squares / samples, fit.x.size + fit.form.free, independent)
        if bic is None:
            return []
        found.append(bic)
    return found


def _smallest(fits: Sequence[CurveFit], bic: Sequence[float]) -> CurveFit:
    return fits[int(np.argmin(bic))] if bic else fits[0]


def leave_out(
    logs: Sequence[LogData],
    plain: Optimum,
    name: str,
    left_out: frozenset[int],
    times_s: Sequence[float] = TIMES_S,
) -> LeftOut:
    """Choose and fit without some logs, and predict these.

    Parameters
    ----------
    logs : sequence of LogData
    plain : Optimum
        Of all of them: its bounds are kept.
    name : str
        Of what is left out.
    left_out : frozenset of int
        Which logs.
    times_s : sequence of float
        As of `choose_curve`.
    """
    fitted = [log for i, log in enumerate(logs) if i not in left_out]
    away = [logs[i] for i in sorted(left_out)]
    without = fit_whole_logs(fitted, plain.bounds, [plain.x])
    fits = list(_fits(fitted, without, times_s))
    best = _smallest(fits, _bic(fits))
    missed = {
        fit.form: np.concatenate([fit.residual(log) for log in away]) for fit in (fits[0], best)
    }
    rms = {form: float(np.degrees(np.sqrt(np.mean(one**2)))) for form, one in missed.items()}
    return LeftOut(
        name=name,
        logs=len(away),
        samples=missed[PLAIN].size,
        form=str(best.form),
        plain_deg=rms[PLAIN],
        curved_deg=rms[best.form],
        beyond=max(float(log.u.max()) for log in away) > (1.0 + SAME_LEVEL) * fits[0].top,
    )


def _in_units(fit: CurveFit, reference_kpa: float) -> StaticCurve | None:
    """Turn a fit into a curve in kPa and degrees; beside conditioning alone, a straight one."""
    if fit.form == PLAIN:
        return None
    conditioning = None
    if fit.form.time_s is not None:
        rest, soft = fit.conditioning.tolist()
        level = fit.top * reference_kpa
        conditioning = Conditioning(level, fit.form.time_s, float(np.degrees(rest)), soft)
    if fit.curve is None:
        straight = MonotoneCurve(np.array([0.0, fit.top * reference_kpa]), np.ones(2))
        return StaticCurve(POSITIONS[0], straight, conditioning)
    scale = float(np.degrees(1.0)) if fit.form.position == BEHIND else reference_kpa
    curve = MonotoneCurve(fit.curve.knots * scale, fit.curve.slopes)
    return StaticCurve(str(fit.form.position), curve, conditioning)
