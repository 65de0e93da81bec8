"""Zeros, poles and gains as JSON; discrete filter coefficients as csv."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from spa_fo.export.oustaloup import Operator
from spa_fo.export.rational import Complexes

if TYPE_CHECKING:
    from spa_fo.export.approximation import Band
    from spa_fo.export.exported import Exported

SCHEMA = "spa-fo/export/1"


def oustaloup_json(made: Exported) -> str:
    """Return zeros, poles and gain of each operator and of the whole, with their errors."""
    model, approximation = made.model, made.approximation
    rational = made.rational
    document = {
        "schema": SCHEMA,
        "statement": list(made.statement()),
        "source": "doi:10.1109/81.817385",
        "model": model.to_dict(),
        "method": approximation.method,
        "N": approximation.order,
        "band_rad_per_s": _ends(approximation.band),
        "filter_band_rad_per_s": _ends(approximation.reach),
        "operators": [
            _operator(name, operator, approximation.band)
            for name, operator in zip(("alpha2", "alpha1"), approximation.operators, strict=True)
        ],
        "whole": {
            "form": "gain * prod(s - zeros) / prod(s - poles), from u to rad",
            "zeros": rational.zeros.tolist(),
            "poles": _pairs(rational.poles),
            "gain": rational.leading_gain,
            "static_gain_rad": rational.gain,
            "dead_time_s": made.part.dead_time_s,
        },
        "errors": made.accuracy.to_dict(),
    }
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _operator(name: str, operator: Operator, band: Band) -> dict[str, Any]:
    from spa_fo.export.accuracy import measure_operator

    return {
        "of": name,
        "order": operator.order,
        "form": f"s^{operator.whole} * gain * prod(s - zeros) / prod(s - poles)",
        "whole_power": operator.whole,
        "zeros": operator.zeros.tolist(),
        "poles": operator.poles.tolist(),
        "gain": operator.gain,
        "errors": measure_operator(operator, band),
    }


def _ends(band: Band) -> list[float]:
    return [band.low, band.high]


def _pairs(values: Complexes) -> list[dict[str, float]]:
    return [{"re": float(value.real), "im": float(value.imag)} for value in values]


def filter_csv(made: Exported) -> str:
    """Return the discrete filter as csv: comments, a header, a row for each section."""
    filtered = made.filter
    notes = [
        *made.statement(),
        f"discrete filter ({filtered.hold}) for a sampling period of {filtered.sample_time_s:g} s: "
        f"{made.filter_accuracy.text()}",
        *_delay_note(made),
        f"reference_kpa = {made.model.reference_kpa!r}",
        f"sample_time_s = {filtered.sample_time_s!r}",
        f"delay_samples = {filtered.delay_samples}",
        "python: sos = numpy.loadtxt(FILE, delimiter=',', skiprows=SKIP, usecols=range(1, 7)); "
        "angle = scipy.signal.sosfilt(sos, u)",
        "board, each section in turn: y = b0*x + s1; s1 = b1*x - a1*y + s2; s2 = b2*x - a2*y; "
        "x of the next is y; s1 = s2 = 0 at rest",
    ]
    notes = [note.replace("skiprows=SKIP", f"skiprows={len(notes) + 1}") for note in notes]
    rows = [
        ",".join([str(number), *(repr(float(value)) for value in section)])
        for number, section in enumerate(filtered.sos, start=1)
    ]
    return "\n".join([*(f"# {note}" for note in notes), _HEADER, *rows]) + "\n"


_HEADER = "section,b0,b1,b2,a0,a1,a2"


def _delay_note(made: Exported) -> list[str]:
    dead_time = made.part.dead_time_s
    if not dead_time:
        return []
    kept = made.filter.delay_samples * made.filter.sample_time_s
    return [
        f"the dead time of {dead_time:.6g} s is taken as delay_samples whole samples, "
        f"{1000.0 * (kept - dead_time):+.3g} ms off: delay u by them before the first section"
    ]
