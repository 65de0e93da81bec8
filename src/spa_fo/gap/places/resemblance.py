"""What a free-form law resembles: a short list of forms, each fitted to its curve.

Where the whole relation is known, the law with the line that the plain model has at its place, a
form that gives both with one amplitude comes first; else a form is sought for the law alone, beside
a line of any slope.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.diagnosis import Likeness
from spa_fo.gap.places.law_basis import Basis
from spa_fo.plant.law import Place

Floats = NDArray[np.float64]
Form = Callable[[Floats, float], Floats]

_LEAST = 0.75  # of a curve, that a form has to give to be named
_STRAIGHT = 0.9  # a line that gives so much needs no other form beside it
_FORMS_NAMED = 3
_RESISTING = ("moment", "damping")  # a load against the motion grows downwards
_TOGETHER = 0.8  # of a spectrum, in neighbouring times: it is one time
_TIMES = ("time_s", "typical_s")
_EXPONENTS = np.concatenate([np.linspace(0.2, 0.96, 39), np.linspace(1.04, 5.0, 100)])
_SHARES = np.geomspace(0.01, 20.0, 120)  # of the range
_INSIDE = np.linspace(0.02, 0.9, 80)


def _power(q: Floats, exponent: float) -> Floats:
    return np.asarray(q**exponent)


def _threshold(q: Floats, at: float) -> Floats:
    return np.maximum(q - at, 0.0)


def _saturation(q: Floats, at: float) -> Floats:
    return np.asarray(-at * np.expm1(-q / at))


def _logarithm(q: Floats, at: float) -> Floats:
    return np.asarray(at * np.log1p(q / at))


_FORMS: tuple[tuple[str, str, Form, Floats, bool], ...] = (
    ("power", "exponent", _power, _EXPONENTS, False),
    ("threshold", "at", _threshold, _INSIDE, True),
    ("saturation", "scale", _saturation, _SHARES, True),
    ("logarithm", "scale", _logarithm, _SHARES, True),
)


def likenesses(
    basis: Basis, e: Floats, covariance: Floats, line: float | None = None
) -> tuple[Likeness, ...]:
    """Compare a law with every form, the most alike first.

    Parameters
    ----------
    basis : Basis
        The law's.
    e, covariance : (m,), (m, m) arrays
        Its coefficients.
    line : float, optional
        Slope of the line that the law stands beside, in its own units, where that is known.
    """
    if basis.place == "relaxation":
        return (_of_spectrum(basis, e),)
    named: list[Likeness] = []
    if line is not None:
        named = _named([_best(basis, e, covariance, line, *form) for form in _FORMS])
    if not named:
        found = [_best(basis, e, covariance, None, *form) for form in _FORMS]
        if basis.keeps_line:
            found.append(_straight(basis, e, covariance))
        named = _named(found)
    return tuple(named)


def _named(found: list[Likeness]) -> list[Likeness]:
    straight = [each for each in found if each.form == "linear" and each.explains >= _STRAIGHT]
    if straight:
        return straight
    alike = [each for each in found if each.explains >= _LEAST]
    return sorted(alike, key=lambda each: -each.explains)[:_FORMS_NAMED]


def _best(
    basis: Basis,
    e: Floats,
    covariance: Floats,
    line: float | None,
    name: str,
    parameter: str,
    form: Form,
    tried: Floats,
    relative: bool,
) -> Likeness:
    """Fit one form: the parameter that leaves least."""
    span = max(abs(basis.high), abs(basis.low))
    if relative:
        tried = tried * span
    precision = np.linalg.inv(covariance)
    best, least = (tried[0], np.zeros_like(e)), np.inf
    for value, shape in _shapes(basis, form, tried, line):
        # With a line beside it the amplitude is given; else it is the most probable one.
        size = 1.0 if line is not None else float(shape @ precision @ e)
        if line is None:
            size /= max(float(shape @ precision @ shape), 1e-30)
        if basis.is_odd and size * (-1.0 if basis.place in _RESISTING else 1.0) <= 0.0:
            continue  # a form that bends the other way is another form
        left = e - size * shape
        misfit = float(left @ precision @ left)
        if misfit < least:
            best, least = (value, size * shape), misfit
    return _likeness(basis, e, best[1], name, {parameter: float(best[0])})


def _shapes(
    basis: Basis, form: Form, tried: Floats, line: float | None
) -> Iterator[tuple[float, Floats]]:
    """Give the form's bent part in the law's coefficients, for each value of its parameter."""
    knots = basis.knots - (0.0 if basis.is_odd else basis.knots[0])
    for value in tried.tolist():
        whole = np.sign(knots) * form(np.abs(knots), value)
        slope = float(basis.taken @ whole)
        if line is None:
            yield value, basis.coefficients(whole - slope * basis.line)
        elif abs(slope) > 1e-12:
            yield value, basis.coefficients(line / slope * whole - line * basis.line)


def _straight(basis: Basis, e: Floats, covariance: Floats) -> Likeness:
    shape = basis.coefficients(basis.knots - (0.0 if basis.is_odd else basis.knots.mean()))
    precision = np.linalg.inv(covariance)
    size = float(shape @ precision @ e) / max(float(shape @ precision @ shape), 1e-30)
    return _likeness(basis, e, size * shape, "linear", {"slope": size})


def _likeness(
    basis: Basis, e: Floats, like: Floats, name: str, parameters: dict[str, float]
) -> Likeness:
    curve = basis.curve(basis.drawn_over())
    left, whole = np.mean((curve @ (e - like)) ** 2), np.mean((curve @ e) ** 2)
    explains = 1.0 - float(np.sqrt(left / max(float(whole), 1e-30)))
    return Likeness(name, explains, parameters, curve @ like)


def _of_spectrum(basis: Basis, e: Floats) -> Likeness:
    """Say whether a spectrum is one relaxation time or many."""
    weight = np.maximum(basis.shape @ e, 0.0)
    total = max(float(weight.sum()), 1e-30)
    pairs = weight[:-1] + weight[1:]
    at = int(np.argmax(pairs))
    share = float(pairs[at]) / total
    if share < _TOGETHER:
        typical = float(np.exp(weight @ np.log(basis.knots) / total))
        return Likeness("many times", 1.0, {"typical_s": typical}, weight)
    two = slice(at, at + 2)
    time = float(np.exp(weight[two] @ np.log(basis.knots[two]) / weight[two].sum()))
    return Likeness("one time", share, {"time_s": time}, weight)


def likeness_words(like: Likeness, place: Place) -> str:
    """Name a form with its parameter."""
    name, value = next(iter(like.parameters.items()))
    unit = {"at": place.over_unit, "scale": place.over_unit, **dict.fromkeys(_TIMES, "s")}.get(name)
    said = f"{name.removesuffix('_s')} {value:.3g}{f' {unit}' if unit else ''}"
    return f"{like.form} ({said})"
