"""Read YAML strictly and validate it against a JSON schema, with a suggestion for unknown keys."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import jsonschema
import yaml

from spa_fo.errors import BadInput
from spa_fo.errors import suggestion as suggestion


def load_yaml(path: Path | str) -> Any:
    """Read one YAML document, refusing a key given twice (plain YAML keeps the last silently).

    Parameters
    ----------
    path : Path or str
        A UTF-8 file.

    Returns
    -------
    Any
        The document: dicts, lists and scalars.

    Raises
    ------
    BadInput
        The file is missing, unreadable, empty, not UTF-8, or not YAML; it names the line.
    """
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise BadInput(path, f"cannot be read ({error.strerror}); expected a YAML file") from error
    except UnicodeDecodeError as error:
        raise BadInput(path, "is not UTF-8 text; expected a YAML file") from error
    if not text.strip():
        raise BadInput(path, "is empty; expected a YAML document")
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise BadInput(path, f"is not valid YAML: {error.problem}", line) from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise BadInput(path, f"is not valid YAML: {error}") from error


@cache
def package_schema(package: str, name: str) -> dict[str, Any]:
    """Return the JSON schema stored as YAML file `name` in `package` (do not modify it)."""
    text = resources.files(package).joinpath(name).read_text(encoding="utf-8")
    schema: dict[str, Any] = yaml.safe_load(text)
    return schema


def validate(document: Any, schema: Mapping[str, Any], path: Path | str) -> None:
    """Check `document` against a JSON schema (draft 2020-12).

    Parameters
    ----------
    document : Any
        As read by `load_yaml`.
    schema : Mapping
        The JSON schema.
    path : Path or str
        The file `document` came from, for the message.

    Raises
    ------
    BadInput
        The first violation in document order, one line: the key's path, for example
        ``experiments[1].trials[0].order``, what stands there and what was expected. An unknown
        key is answered with the nearest known one. Numbers must be finite.
    """
    try:
        scalars = list(_scalars(document))
    except RecursionError:
        raise BadInput(path, "holds itself by an alias; expected plain YAML") from None
    for keys, value in scalars:
        if isinstance(value, int | float) and not abs(value) <= sys.float_info.max:
            raise BadInput(path, f"is {_shorten(value)}; expected a finite number", key_path(keys))
    errors = sorted(_Validator(schema).iter_errors(document), key=_precedence)
    if errors:
        error = errors[0]
        keys, message = _explain(error)
        raise BadInput(path, message, key_path(keys))


def key_path(keys: Iterable[str | int]) -> str:
    """Write a path of keys and 0-based indices as ``experiments[1].trials[0].order``."""
    text = ""
    for key in keys:
        text += f"[{key}]" if isinstance(key, int) else f".{key}"
    return text.removeprefix(".")


# JSON takes 3.0 for a whole number; an index or a count is written 3.
_Validator = jsonschema.validators.extend(  # type: ignore[no-untyped-call]
    jsonschema.Draft202012Validator,
    type_checker=jsonschema.Draft202012Validator.TYPE_CHECKER.redefine(
        "integer", lambda _, value: isinstance(value, int) and not isinstance(value, bool)
    ),
)


class _StrictLoader(yaml.SafeLoader):
    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        for key_node, _ in node.value:
            if key_node.tag == "tag:yaml.org,2002:merge":
                continue
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable):
                if key in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"key '{key}' is given twice", key_node.start_mark
                    )
                seen.add(key)
        return super().construct_mapping(node, deep)


# YAML 1.1 takes 1e-3 for text, as it has no point; everyone else, and YAML 1.2, for a number.
_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def _scalars(document: Any, keys: tuple[str | int, ...] = ()) -> Iterable[tuple[Any, Any]]:
    if isinstance(document, dict):
        for key, value in document.items():
            yield from _scalars(value, (*keys, str(key)))
    elif isinstance(document, list):
        for index, value in enumerate(document):
            yield from _scalars(value, (*keys, index))
    else:
        yield keys, document


def _precedence(error: jsonschema.ValidationError) -> tuple[int, int, list[str]]:
    # A misspelt key also makes the right one missing: the unknown key is the better message.
    # A wrong `schema` or a document of another kind comes before everything inside it.
    first = len(error.absolute_path) == 0 and error.validator == "type"
    wrong_schema = list(error.absolute_path) == ["schema"]
    unknown = error.validator == "additionalProperties"
    rank = 0 if first or wrong_schema else 1 if unknown else 2
    return rank, len(error.absolute_path), [f"{key:>6}" for key in map(str, error.absolute_path)]


def _explain(error: jsonschema.ValidationError) -> tuple[list[str | int], str]:
    keys = list(error.absolute_path)
    rule: Any = error.validator
    limit: Any = error.validator_value
    value: Any = error.instance
    if rule == "additionalProperties" and isinstance(error.schema, Mapping):
        known = error.schema.get("properties", {})
        unknown = next(key for key in value if key not in known)
        return [*keys, str(unknown)], f"unknown key{suggestion(str(unknown), known)}"
    if rule == "required":
        missing = next(key for key in limit if key not in value)
        return [*keys, missing], "is missing"
    shown = _shorten(value)
    expected: dict[str, Callable[[], str]] = {
        "type": lambda: _types(limit),
        "enum": lambda: "one of " + ", ".join(dict.fromkeys(map(str, limit))),
        "const": lambda: f"{limit}",
        "minimum": lambda: f"at least {limit}",
        "maximum": lambda: f"at most {limit}",
        "exclusiveMinimum": lambda: f"more than {limit}",
        "exclusiveMaximum": lambda: f"less than {limit}",
        "minItems": lambda: f"at least {limit} entries",
        "maxItems": lambda: f"at most {limit} entries",
        "minLength": lambda: "some text",
        "minProperties": lambda: f"at least {limit} entries",
    }
    if rule == "enum" and isinstance(value, str):
        return keys, f"is {shown}{suggestion(value, dict.fromkeys(map(str, limit)))}"
    if rule in expected:
        return keys, f"is {shown}; expected {expected[rule]()}"
    hint = error.schema.get("description") if isinstance(error.schema, Mapping) else None
    return keys, f"is {shown}; expected {hint}" if hint else error.message


def _types(names: str | list[str]) -> str:
    words = {
        "object": "a mapping of keys",
        "array": "a list",
        "string": "text",
        "integer": "a whole number",
        "number": "a number",
        "boolean": "true or false",
        "null": "null",
    }
    return " or ".join(words[name] for name in ([names] if isinstance(names, str) else names))


def _shorten(value: Any) -> str:
    text = "null" if value is None else repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
