from __future__ import annotations

import json
from dataclasses import replace

import pytest

from spa_fo.errors import BadInput
from spa_fo.plant import Model, TransferFunction
from spa_fo.plant.estimates import (
    KEY,
    QUANTITIES,
    Estimate,
    bare_estimates,
    plus_minus,
    read_estimates,
    rounded,
    uncertainty_entry,
)

MODEL = Model("c", "m", TransferFunction(1.406, 1.196, 0.794, 1.638, 0.934), 30.0)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        # The examples of the Particle Data Group's rule, and its edges.
        (0.827, 0.119, "0.83 ± 0.12"),
        (0.827, 0.367, "0.8 ± 0.4"),
        (0.827, 0.0961, "0.83 ± 0.10"),
        (1.0, 0.354, "1.00 ± 0.35"),
        (1.0, 0.355, "1.0 ± 0.4"),
        (1.0, 0.949, "1.0 ± 0.9"),
        (1.0, 0.95, "1.0 ± 1.0"),
        (12345.6, 123.0, "12350 ± 120"),
        (0.5685, 0.00348, "0.5685 ± 0.0035"),
    ],
)
def test_the_error_decides_the_digits(value: float, error: float, text: str) -> None:
    assert plus_minus(value, error) == text


def test_without_an_error_there_are_four_digits() -> None:
    assert rounded(1.23456) == "1.235"
    assert rounded(1.23456, 0.0) == "1.235"
    assert rounded(1.23456, float("nan")) == "1.235"


def test_an_interval_marks_its_open_end() -> None:
    one = Estimate("alpha2", 1.98, None, 1.85, 1.98, open_high=True, kind="k")
    assert one.text() == "1.98"
    assert one.interval_text() == "1.85 .. 1.98 (open)"
    assert Estimate("K", 0.5).interval_text() == ""


def test_a_model_file_gives_back_its_uncertainty() -> None:
    made = tuple(
        replace(one, error=0.1, low=0.0, high=9.0, open_low=True, kind="how", determined=False)
        for one in bare_estimates(MODEL)
    )
    entry = json.loads(json.dumps(uncertainty_entry(made)))
    assert read_estimates(replace(MODEL, extra={KEY: entry})) == made


def test_a_model_without_uncertainty_says_so() -> None:
    bare = read_estimates(MODEL)
    assert [one.name for one in bare] == list(QUANTITIES)
    assert all(one.kind == "" and one.error is None for one in bare)
    assert bare[-1].value == pytest.approx(0.934 / 1.638)


@pytest.mark.parametrize(
    ("entry", "where"),
    [
        ([], "uncertainty"),
        ({"kind": "k"}, "uncertainty.alpha2"),
        ({"kind": "k", **{name: {"error": "x"} for name in QUANTITIES}}, "uncertainty.alpha2"),
        (
            {"kind": "k", **{name: {"error": 1.0, "interval": [1]} for name in QUANTITIES}},
            "uncertainty.alpha2.interval",
        ),
    ],
)
def test_damaged_uncertainty_is_refused(entry: object, where: str) -> None:
    with pytest.raises(BadInput) as refused:
        read_estimates(replace(MODEL, extra={KEY: entry}), "model.json")
    assert refused.value.where == where
