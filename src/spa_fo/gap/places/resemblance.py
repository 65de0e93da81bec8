"""What a free-form law resembles: a short list of forms, each fitted to its curve.

Where the whole relation is known, the law with the line that the plain model has at its place, a
form that gives both with one amplitude comes first; else a form is sought for the law alone, beside
a line of any slope.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from spa_fo.gap.diagnosis import Likeness
from spa_fo.gap.places.law_basis import Basis
from spa_fo.plant.law import Place

Floats = NDArray[np.float64]
Form = Callable[[Floats, Floats], Floats]

_LEAST = 0.75  # of a curve, that a form has to give to be named
_STRAIGHT = 0.9  # a line that gives so much needs no other form beside it
_FORMS_NAMED = 3
_WHOLE = ("input_map", "reading")  # where the plain model has a line, of slope 1
_RESISTING = ("moment", "damping")  # a load against the motion grows downwards
_TOGETHER = 0.8  # of a spectrum, in neighbouring times: it is one time
_EXPONENTS = np.concatenate([np.linspace(0.2, 0.96, 39), np.linspace(1.04, 5.0, 100)])
_SHARES = np.geomspace(0.01, 20.0, 120)  # of the range
_INSIDE = np.linspace(0.02, 0.9, 80)

# A form's name, its parameter's, the form, what is tried of it, and whether that is of the range.
_FORMS: tuple[tuple[str, str, Form, Floats, bool], ...] = (
    ("power", "exponent", lambda q, exponent: q**exponent, _EXPONENTS, False),
    ("threshold", "at", lambda q, at: np.maximum(q - at, 0.0), _INSIDE, True),
    ("saturation", "scale", lambda q, at: -at * np.expm1(-q / at), _SHARES, True),
    ("logarithm", "scale", lambda q, at: at * np.log1p(q / at), _SHARES, True),
)


def likenesses(basis: Basis, e: Floats, covariance: Floats) -> tuple[Likeness, ...]:
    """Compare a law of coefficients (m,) with every form, the most alike first."""
    if basis.place == "relaxation":
        return (_of_spectrum(basis, e),)
    named: list[Likeness] = []
    if basis.place in _WHOLE:
        named = _named([_best(basis, e, covariance, True, *form) for form in _FORMS])
    if not named:
        found = [_best(basis, e, covariance, False, *form) for form in _FORMS]
        if basis.keeps_line:
            found.append(_straight(basis, e, covariance))
        named = _named(found)
    return tuple(named)


def _named(found: list[Likeness]) -> list[Likeness]:
    straight = [each for each in found if each.form == "linear" and each.explains >= _STRAIGHT]
    alike = [each for each in found if each.explains >= _LEAST]
    return straight or sorted(alike, key=lambda each: -each.explains)[:_FORMS_NAMED]


def _best(
    basis: Basis,
    e: Floats,
    covariance: Floats,
    whole: bool,
    name: str,
    parameter: str,
    form: Form,
    tried: Floats,
    relative: bool,
) -> Likeness:
    """Fit one form: the parameter that leaves least."""
    if relative:
        tried = tried * max(abs(basis.high), abs(basis.low))
    knots = basis.knots - (0.0 if basis.is_odd else basis.knots[0])
    curves = np.sign(knots) * form(np.abs(knots), tried[:, None])
    straight = curves @ basis.taken
    if whole:  # the amplitude is given by the line beside it
        use = np.abs(straight) > 1e-12
        tried, curves = tried[use], curves[use] / straight[use, None]
        straight = np.ones(tried.size)
    shapes = basis.coefficients((curves - straight[:, None] * basis.line).T)
    sizes = np.ones(tried.size) if whole else _sizes(shapes, e, covariance)
    left = e[:, None] - sizes * shapes
    misfit = np.sum(left * np.linalg.solve(covariance, left), axis=0)
    if basis.is_odd:
        # A form that bends the other way is another form.
        sign = -1.0 if basis.place in _RESISTING else 1.0
        misfit[sign * sizes <= 0.0] = np.inf
    k = int(np.argmin(misfit))
    like = sizes[k] * shapes[:, k] if misfit[k] < np.inf else np.zeros_like(e)
    return _likeness(basis, e, like, name, {parameter: float(tried[k])})


def _straight(basis: Basis, e: Floats, covariance: Floats) -> Likeness:
    knots = basis.knots - (0.0 if basis.is_odd else basis.knots.mean())
    shape = basis.coefficients(knots)
    (size,) = _sizes(shape[:, None], e, covariance).tolist()
    return _likeness(basis, e, size * shape, "linear", {"slope": size})


def _sizes(shapes: Floats, e: Floats, covariance: Floats) -> Floats:
    """Most probable amplitude of each shape, (m, n), in the law."""
    weighted = np.linalg.solve(covariance, shapes)
    return np.asarray((e @ weighted) / np.maximum(np.sum(shapes * weighted, axis=0), 1e-30))


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
    """Name a form with its parameter, in the units of its place."""
    name, value = next(iter(like.parameters.items()))
    unit = "s" if name.endswith("_s") else place.over_unit if name in ("at", "scale") else ""
    said = f"{name.removesuffix('_s')} {value:.3g} {unit}".rstrip()
    return f"{like.form} ({said})"
