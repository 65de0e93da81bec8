"""Strict YAML and schema validation: every refusal is one line that names the key."""

from __future__ import annotations

from pathlib import Path

import pytest

from spa_fo.errors import BadInput
from spa_fo.validation import key_path, load_yaml, suggestion, validate

SCHEMA = {
    "type": "object",
    "additionalProperties": False,
    "required": ["name", "swarm"],
    "properties": {
        "name": {"type": "string", "minLength": 1},
        "swarm": {
            "type": "object",
            "additionalProperties": False,
            "properties": {
                "particles": {"type": "integer", "minimum": 1},
                "inertia": {"type": "number", "exclusiveMaximum": 2},
                "mode": {"enum": ["paper", "optimum"]},
                "bounds": {"type": "array", "minItems": 2, "items": {"type": ["number", "null"]}},
            },
        },
    },
}


def refused(document: object) -> str:
    with pytest.raises(BadInput) as caught:
        validate(document, SCHEMA, "config.yaml")
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_a_valid_document_passes() -> None:
    document = {"name": "a", "swarm": {"particles": 200, "mode": "paper", "bounds": [0, None]}}
    validate(document, SCHEMA, "config.yaml")


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (
            {"name": "a", "swarm": {"particels": 3}},
            "config.yaml: swarm.particels: unknown key; did you mean 'particles'?",
        ),
        (
            {"name": "a", "swarm": {"zzz": 3}},
            "config.yaml: swarm.zzz: unknown key; expected one of: bounds, inertia, mode, "
            "particles",
        ),
        ({"nmae": "a", "swarm": {}}, "config.yaml: nmae: unknown key; did you mean 'name'?"),
        ({"name": "a"}, "config.yaml: swarm: is missing"),
        (
            {"name": "a", "swarm": {"particles": 2.5}},
            "config.yaml: swarm.particles: is 2.5; expected a whole number",
        ),
        (
            {"name": "a", "swarm": {"particles": 0}},
            "config.yaml: swarm.particles: is 0; expected at least 1",
        ),
        (
            {"name": "a", "swarm": {"inertia": 2}},
            "config.yaml: swarm.inertia: is 2; expected less than 2",
        ),
        (
            {"name": "a", "swarm": {"mode": "papre"}},
            "config.yaml: swarm.mode: is 'papre'; did you mean 'paper'?",
        ),
        (
            {"name": "a", "swarm": {"bounds": [1, "x"]}},
            "config.yaml: swarm.bounds[1]: is 'x'; expected a number or null",
        ),
        (
            {"name": "a", "swarm": {"bounds": [1]}},
            "config.yaml: swarm.bounds: is [1]; expected at least 2 entries",
        ),
        ({"name": "", "swarm": {}}, "config.yaml: name: is ''; expected some text"),
        ([1], "config.yaml: is [1]; expected a mapping of keys"),
        (None, "config.yaml: is null; expected a mapping of keys"),
        (
            {"name": "a", "swarm": {"inertia": float("nan")}},
            "config.yaml: swarm.inertia: is nan; expected a finite number",
        ),
        (
            {"name": "a", "swarm": {"particles": 10**400}},
            f"config.yaml: swarm.particles: is 1{'0' * 36}...; expected a finite number",
        ),
    ],
)
def test_refusals_name_the_key_and_what_was_expected(document: object, message: str) -> None:
    assert refused(document) == message


def test_an_unknown_key_is_told_before_the_key_it_was_meant_to_be() -> None:
    assert "did you mean 'swarm'" in refused({"name": "a", "swam": {}})


def test_a_whole_number_has_no_point() -> None:
    assert "is 3.0; expected a whole number" in refused({"name": "a", "swarm": {"particles": 3.0}})


def test_a_document_that_holds_itself() -> None:
    document: dict[str, object] = {"name": "a"}
    document["swarm"] = document
    assert "config.yaml: holds itself by an alias" in refused(document)


def test_a_true_is_no_number() -> None:
    assert "expected a whole number" in refused({"name": "a", "swarm": {"particles": True}})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "is empty"),
        (b"  \n", "is empty"),
        (b"a: 1\nb: [1,\n", "line 3: is not valid YAML"),
        (b"a: 1\na: 2\n", "line 2: is not valid YAML: key 'a' is given twice"),
        (b"a: {b: 1, b: 2}\n", "key 'b' is given twice"),
        (b"a: \xff\xfe\n", "is not UTF-8"),
        (b"a: \x00\n", "is not valid YAML"),
        (b"!!python/object:os.system {}\n", "is not valid YAML"),
        (b"{[1]: 2}: 3\n", "is not valid YAML"),
    ],
)
def test_yaml_that_cannot_be_read(tmp_path: Path, text: bytes, message: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(text)
    with pytest.raises(BadInput, match=message.replace("[", r"\[")) as caught:
        load_yaml(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"nothing\.yaml: cannot be read"):
        load_yaml(tmp_path / "nothing.yaml")


def test_yaml_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: &x {b: 1}\nc: {<<: *x, d: 2}\n")
    assert load_yaml(path) == {"a": {"b": 1}, "c": {"b": 1, "d": 2}}


def test_key_path_and_suggestion() -> None:
    assert key_path(["experiments", 1, "trials", 0, "order"]) == "experiments[1].trials[0].order"
    assert suggestion("prssure", ["pressure", "angle"]) == "; did you mean 'pressure'?"
    assert suggestion("x", []) == ""


def test_numbers_with_an_exponent_need_no_point(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text("[1e-3, -2E3, 1.5e+2, .5e1, 12, e3, 1e3 kPa]")
    assert load_yaml(path) == [0.001, -2000.0, 150.0, 5.0, 12, "e3", "1e3 kPa"]
