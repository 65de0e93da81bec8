"""What a free-form law resembles: a short list of forms, each fitted to its curve.

Where the whole relation is known, the law with the line that the plain model has at its place, a
form that gives both with one amplitude comes first; else a form is sought for the law alone, beside
a line of any slope.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from spa_fo.arrays import Floats
from spa_fo.gap.diagnosis import Likeness
from spa_fo.gap.places.law_basis import Basis
from spa_fo.plant.law import Place

_LEAST = 0.75  # of a curve, that a form has to give to be named
_STRAIGHT = 0.9  # a line that gives so much needs no other form beside it
_FORMS_NAMED = 3
_WHOLE = ("input_map", "reading")  # where the plain model has a line, of slope 1
_RESISTING = ("moment", "damping")  # a load against the motion grows downwards
_TOGETHER = 0.8  # of a spectrum, in neighbouring times: it is one time
_EXPONENTS = np.concatenate([np.linspace(0.2, 0.96, 39), np.linspace(1.04, 5.0, 100)])
_SHARES = np.geomspace(0.01, 20.0, 120)  # of the range


class _Form(NamedTuple):
    name: str
    parameter: str
    curve: Callable[[Floats, Floats], Floats]  # over positive values, for the parameter's
    tried: Floats  # values of the parameter
    of_range: bool = True  # whether these are shares of the range


_LINE = _Form("linear", "slope", lambda q, slope: slope * q, np.ones(1), of_range=False)
_FORMS = (
    _Form("power", "exponent", lambda q, n: q**n, _EXPONENTS, of_range=False),
    _Form("threshold", "at", lambda q, at: np.maximum(q - at, 0.0), np.linspace(0.02, 0.9, 80)),
    _Form("saturation", "scale", lambda q, at: -at * np.expm1(-q / at), _SHARES),
    _Form("logarithm", "scale", lambda q, at: at * np.log1p(q / at), _SHARES),
)


def likenesses(basis: Basis, e: Floats, covariance: Floats) -> tuple[Likeness, ...]:
    """Compare a law of coefficients (m,) with every form, the most alike first."""
    if basis.place == "relaxation":
        return (_of_spectrum(basis, e),)
    if basis.place in _WHOLE:
        named = _named(_best(basis, e, covariance, form, whole=True) for form in _FORMS)
        if named:
            return named
    forms = (*_FORMS, _LINE) if basis.keeps_line else _FORMS
    return _named(_best(basis, e, covariance, form) for form in forms)


def _named(found: Iterable[Likeness]) -> tuple[Likeness, ...]:
    alike = sorted((each for each in found if each.explains >= _LEAST), key=lambda x: -x.explains)
    straight = [each for each in alike if each.form == "linear" and each.explains >= _STRAIGHT]
    return tuple(straight or alike[:_FORMS_NAMED])


def _best(
    basis: Basis, e: Floats, covariance: Floats, form: _Form, whole: bool = False
) -> Likeness:
    """Fit one form: the parameter that leaves least; of a whole relation the line is known."""
    tried = form.tried * (np.abs(basis.over).max() if form.of_range else 1.0)
    knots = basis.knots - (0.0 if basis.is_odd else basis.knots[0])
    curves = np.sign(knots) * form.curve(np.abs(knots), tried[:, None])
    slopes = curves @ basis.taken
    if whole:
        use = np.abs(slopes) > 1e-12
        tried, curves = tried[use], curves[use] / slopes[use, None]
        slopes = np.ones(tried.size)
    shapes = basis.coefficients((curves - slopes[:, None] * basis.line).T)
    sizes = np.ones(tried.size)
    if not whole:  # the amplitude is the most probable one
        weighted = np.linalg.solve(covariance, shapes)
        sizes = (e @ weighted) / np.maximum(np.sum(shapes * weighted, axis=0), 1e-30)
    left = e[:, None] - sizes * shapes
    misfit = np.sum(left * np.linalg.solve(covariance, left), axis=0)
    if basis.is_odd:  # a form that bends the other way is another form
        misfit[sizes * (-1.0 if basis.place in _RESISTING else 1.0) <= 0.0] = np.inf
    k = int(np.argmin(misfit))
    like = sizes[k] * shapes[:, k] if misfit[k] < np.inf else np.zeros_like(e)
    curve = basis.curve(basis.over)
    missed, size = np.mean((curve @ (e - like)) ** 2), np.mean((curve @ e) ** 2)
    explains = 1.0 - float(np.sqrt(missed / max(float(size), 1e-30)))
    value = float((sizes if form is _LINE else tried)[k])
    return Likeness(form.name, explains, {form.parameter: value}, curve @ like)


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
