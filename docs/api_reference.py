"""The Python reference on api.md, made of docstrings and signatures when the pages are built."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import spa_fo
from spa_fo import api, fractional

_PLACE = "<!-- reference -->"
_OBJECTS = (
    api.Campaign,
    api.FitResult,
    api.Model,
    api.Prediction,
    api.ExportedModel,
    api.Diagnosis,
    api.Plan,
)
_FUNCTIONS = (fractional.step_response, fractional.simulate, fractional.mittag_leffler)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put the reference in its place."""
    if _PLACE not in markdown:
        return markdown
    return markdown.replace(_PLACE, reference())


def reference() -> str:
    """Every object with its members, and the functions, as Markdown."""
    parts = []
    for one in _OBJECTS:
        home = "spa_fo" if one.__name__ in spa_fo.__all__ else "spa_fo.api"
        parts += [f"## {one.__name__}", f"`{home}.{one.__name__}`. {_doc(one)}"]
        for name, member in _members(one):
            parts += [f"### {one.__name__}.{name}", _member(name, member)]
    parts += ["## Functions", "From `spa_fo`, on arrays."]
    for function in _FUNCTIONS:
        parts += [f"### {function.__name__}", _member(function.__name__, function)]
    return "\n\n".join(parts)


def _members(one: type) -> Iterator[tuple[str, Any]]:
    for name, member in vars(one).items():
        if not name.startswith("_") and (
            isinstance(member, property | classmethod) or inspect.isfunction(member)
        ):
            yield name, member


def _member(name: str, member: Any) -> str:
    if isinstance(member, property):
        returned = inspect.signature(member.fget).return_annotation
        return f"`{name}: {returned}`\n\n{_doc(member)}"
    function = member.__func__ if isinstance(member, classmethod) else member
    signature = inspect.signature(function)
    shown = [p for p in signature.parameters.values() if p.name not in ("self", "cls")]
    text = str(signature.replace(parameters=shown)).replace("'", "")
    return f"```text\n{name}{text}\n```\n\n{_doc(function)}"


def _doc(thing: Any) -> str:
    """First paragraph as text, the numpydoc sections below it as they are."""
    first, _, rest = (inspect.getdoc(thing) or "").partition("\n\n")
    summary = " ".join(first.split())
    return f"{summary}\n\n```text\n{rest}\n```" if rest else summary
