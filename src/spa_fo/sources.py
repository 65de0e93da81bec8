"""What a script's result depends on in this package: the sources it imports, hashed.

Snakemake sees an edit of a script, not of the package behind it. A rule that passes
``code_hash(script)`` as a parameter runs again when, and only when, a module that its script
imports, directly or not, has changed.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

_SOURCES = Path(__file__).parents[1]
_PACKAGES = ("spa_fo", "blind")  # the second stands beside the first in the project's sources
_DATA = ("css", "js", "json", "mplstyle", "yaml")  # files beside modules that change what they do


def code_hash(script: Path | str) -> str:
    """Hash `script` with every module and data file of the package that it imports.

    Parameters
    ----------
    script : Path or str
        A Python file.

    Returns
    -------
    str
        Sixteen hexadecimal digits.
    """
    digest = hashlib.sha256()
    for path in [Path(script), *sorted(imported_files(script))]:
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def imported_files(script: Path | str) -> set[Path]:
    """Files of the project that `script` imports, directly or not, with their data files."""
    found: set[Path] = set()
    waiting = [Path(script)]
    while waiting:
        for module in _imported_modules(waiting.pop().read_bytes()):
            for path in _files_of(module) - found:
                found.add(path)
                if path.suffix == ".py":
                    waiting.append(path)
    return found


# Many scripts import the same modules, and every job of the workflow reads all scripts.
@cache
def _imported_modules(source: bytes) -> tuple[str, ...]:
    """Dotted names of the project's modules that a source may import."""
    found: list[str] = []
    for node in _run(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            # `from a import b`: b may be a module or a name within a.
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        found += [name for name in names if name.split(".")[0] in _PACKAGES]
    return tuple(found)


def _run(node: ast.AST) -> Iterator[ast.AST]:
    """Walk what may run of a source: all but what is there for the type checker alone."""
    yield node
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
            for other in child.orelse:
                yield from _run(other)
        else:
            yield from _run(child)


@cache
def _files_of(module: str) -> frozenset[Path]:
    """Source and data files of a dotted module name and of the packages above it."""
    files: set[Path] = set()
    place = _SOURCES
    for part in module.split("."):
        place = place / part
        if place.is_dir():
            files.add(place / "__init__.py")
            files.update(*(place.glob(f"*.{kind}") for kind in _DATA))
        elif place.with_suffix(".py").is_file():
            files.add(place.with_suffix(".py"))
    return frozenset(path for path in files if path.is_file())
