"""What a fit with a static curve says of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from textwrap import wrap

from spa_fo.identify.curve_choice import CurveChoice
from spa_fo.plant import PARAMETERS
from spa_fo.plant.static_curve import BEFORE, StaticCurve

_WIDTH = 96


def curve_lines(choice: CurveChoice) -> list[str]:
    """Return the part of the fit report about the static curve, line by line."""
    lines = [*_chosen(choice)]
    if choice.left_out:
        lines += ["", *left_out_table(choice)]
    return [*lines, *wrap(curve_verdict(choice), _WIDTH, subsequent_indent="  ")]


def curve_verdict(choice: CurveChoice) -> str:
    """Say in one or two sentences what becomes of the curve, and why."""
    if not choice.bic:
        return "No static curve: the logs hold too few independent samples to choose one."
    if choice.curve is None:
        return f"No static curve: of {len(choice.bic)} forms the plain model has the smallest BIC."
    gain = gain_text(choice)
    if not choice.kept:
        return (
            f"No static curve: it fits better, but {gain}. What it gains on the logs it was fitted "
            "to does not hold elsewhere, so the model file holds the plain model."
        )
    if not choice.left_out:
        return (
            "The model file holds the curve. A single log: nothing could be left out, so these "
            "data cannot tell whether the curve predicts anything."
        )
    said = f"The model file holds the curve: {gain}."
    if choice.held_out == "log":
        return f"{said} All logs reach one level: of other levels these data cannot tell."
    if choice.in_order:
        return (
            f"{said} The levels follow the order of the logs: what comes with the level and what "
            "comes with time these data cannot tell apart."
        )
    return said


def gain_text(choice: CurveChoice) -> str:
    """Say what a curve gains on what was left out."""
    closed, within = choice.closed or 0.0, choice.closed_within
    change = "closes {:.0f} % of" if closed >= 0.0 else "adds {:.0f} % to"
    levels = "" if within is None else f" ({100.0 * within:.0f} % on those within the others)"
    return (
        f"on left-out {choice.held_out}s it {change.format(100.0 * abs(closed))} the plain "
        f"model's squared error{levels}, and predicts {choice.better} of "
        f"{len(choice.left_out)} better"
    )


def _chosen(choice: CurveChoice) -> Iterator[str]:
    fit, curve = choice.fit, choice.curve
    yield f"static curve: {fit.form}" + (
        f" (BIC {choice.bic[str(fit.form)]:+.0f} against the plain model's, smallest of "
        f"{len(choice.bic)} forms)"
        if curve is not None
        else ""
    )
    if curve is None:
        return
    yield f"fitted logs: rms {choice.plain_deg:.3f}° plain, {choice.curved_deg:.3f}° with it" + (
        "" if fit.converged else "; the search ended before it had converged"
    )
    values = zip(PARAMETERS, fit.x.tolist(), strict=True)
    yield f"G(s) beside it: {', '.join(f'{name} {value:.3g}' for name, value in values)}"
    yield from described(curve)


def described(curve: StaticCurve) -> Iterator[str]:
    """Say what a curve is, in lines."""
    unit, what = ("kPa", "pressure") if curve.position == BEFORE else ("°", "linear angle")
    knots = [f"{knot:.3g}" for knot in curve.curve.knots]
    rows = [[what, *knots, unit], ["slope", *(f"{one:.2f}" for one in curve.curve.slopes), ""]]
    yield from table(rows)
    effect = curve.conditioning
    if effect is not None:
        yield (
            f"where {effect.level_kpa:.3g} kPa has been reached, in {effect.time_s:g} s: "
            f"rest angle {effect.set_deg:+.2f}°, gain {100.0 * effect.softening:+.0f} %"
        )


def left_out_table(choice: CurveChoice, unit: str = "°") -> Iterator[str]:
    """Say how each part that was left out is predicted, a line each."""
    rows = [[f"left-out {choice.held_out}", "logs", "plain", "curved", "chosen without it"]]
    rows += [
        [
            one.name + (" (beyond the others)" if one.beyond else ""),
            f"{one.logs}",
            f"{one.plain_deg:.3f}{unit}",
            f"{one.curved_deg:.3f}{unit}",
            one.form,
        ]
        for one in choice.left_out
    ]
    return table(rows)


def table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Lay rows out; what is between the first and the last column stands to the right."""
    last = len(rows[0]) - 1
    widths = [max(len(row[i]) for row in rows) for i in range(last + 1)]
    for row in rows:
        cells = [
            cell.ljust(width) if i in (0, last) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        yield "  ".join(cells).rstrip()
