from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spa_fo.errors import BadInput
from spa_fo.plant import Model, TransferFunction, read_model, write_model

DOCUMENT: dict[str, Any] = {
    "schema": "spa-fo/model/1",
    "campaign": "dragon_skin_20",
    "material": "Dragon Skin 20",
    "transfer_function": {"alpha2": 1.406, "alpha1": 1.196, "a1": 0.794, "a0": 1.638, "b0": 0.934},
    "input": {"signal": "command", "reference_kpa": 30.0},
    "output": {"unit": "rad"},
    "effects": [],
}


def write(path: Path, change: Any) -> Path:
    document = copy.deepcopy(DOCUMENT)
    change(document)
    path.write_text(json.dumps(document))
    return path


def test_the_contracts_example(tmp_path: Path) -> None:
    model = read_model(write(tmp_path / "m.json", lambda d: None))
    assert model.transfer_function == TransferFunction(1.406, 1.196, 0.794, 1.638, 0.934)
    assert model.to_dict() == DOCUMENT


@given(
    alpha2=st.floats(1.01, 1.99),
    alpha1=st.floats(0.01, 1.0),
    coefficients=st.tuples(*[st.floats(1e-6, 1e6)] * 3),
    reference=st.floats(1e-3, 1e4),
)
@settings(max_examples=25, deadline=None)
def test_what_is_written_is_read_back_bit_by_bit(
    tmp_path_factory: pytest.TempPathFactory,
    alpha2: float,
    alpha1: float,
    coefficients: tuple[float, ...],
    reference: float,
) -> None:
    path = tmp_path_factory.getbasetemp() / "round.json"
    model = Model("a", "b", TransferFunction(alpha2, alpha1, *coefficients), reference)
    write_model(path, model)
    assert read_model(path) == model


def test_unknown_effects_and_further_keys_are_kept(tmp_path: Path) -> None:
    effect = {"id": "rust", "stage": "sensor", "parameters": {"depth": [1, 2]}, "note": "x"}
    path = write(tmp_path / "m.json", lambda d: d.update(effects=[effect], lab={"name": "here"}))
    model = read_model(path)
    assert model.effects == (effect,)
    assert model.to_dict()["lab"] == {"name": "here"}
    write_model(tmp_path / "again.json", model)
    assert read_model(tmp_path / "again.json") == model


def _without(key: str, within: str | None = None) -> Any:
    return lambda d: (d[within] if within else d).pop(key)


BAD = {
    "no schema": (_without("schema"), "schema"),
    "wrong schema": (lambda d: d.update(schema="spa-fo/model/2"), "schema"),
    "no campaign": (_without("campaign"), "campaign"),
    "empty material": (lambda d: d.update(material=""), "material"),
    "no order": (_without("alpha1", "transfer_function"), "transfer_function.alpha1"),
    "text for a number": (lambda d: d["transfer_function"].update(a0="1"), "transfer_function.a0"),
    "true for a number": (lambda d: d["transfer_function"].update(a0=True), "transfer_function.a0"),
    "a huge number": (lambda d: d["transfer_function"].update(a0=10**400), "transfer_function.a0"),
    "orders reversed": (lambda d: d["transfer_function"].update(alpha1=1.5), "transfer_function"),
    "order too high": (lambda d: d["transfer_function"].update(alpha2=2.01), "transfer_function"),
    "negative a0": (lambda d: d["transfer_function"].update(a0=-1.0), "transfer_function"),
    "a list for an object": (lambda d: d.update(input=[]), "input"),
    "no such signal": (lambda d: d["input"].update(signal="voltage"), "input.signal"),
    "zero reference": (lambda d: d["input"].update(reference_kpa=0), "input.reference_kpa"),
    "degrees": (lambda d: d["output"].update(unit="deg"), "output.unit"),
    "no effects": (_without("effects"), "effects"),
    "effects no list": (lambda d: d.update(effects={}), "effects"),
    "an effect of text": (lambda d: d.update(effects=["creep"]), "effects[0]"),
    "an effect without id": (
        lambda d: d.update(effects=[{"stage": "drive", "parameters": {}}]),
        "effects[0].id",
    ),
    "an effect without parameters": (
        lambda d: d.update(effects=[{"id": "creep", "stage": "actuator"}]),
        "effects[0].parameters",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_models_are_refused_by_key(case: str, tmp_path: Path) -> None:
    change, where = BAD[case]
    path = write(tmp_path / "m.json", change)
    with pytest.raises(BadInput) as refused:
        read_model(path)
    assert refused.value.where == where
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"{",
        b"[1]",
        b"null",
        b"\xff\xfe\x00",
        b'{"schema": NaN}',
        b"[" * 100_000,
        b'{"schema": 1' + b"0" * 5000 + b"}",
    ],
    ids=["empty", "cut", "list", "null", "binary", "nan", "deep", "long number"],
)
def test_what_is_no_json_object_is_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "m.json"
    path.write_bytes(data)
    with pytest.raises(BadInput, match=r"m\.json"):
        read_model(path)


def test_a_missing_file(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="cannot be read"):
        read_model(tmp_path / "none.json")
