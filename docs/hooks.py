"""What the documentation site needs beyond Markdown: the command reference, and maths as MathML."""

from __future__ import annotations

import argparse
import html
import os
import re
from collections.abc import Iterator
from typing import Any

import latex2mathml.converter
from mkdocs.structure.files import File, Files

from spa_fo.cli import command_line

_MATHS = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)
_OUTSIDE = re.compile(r"\[([^\]]+)\]\(((?:\.\./)+([^)]+))\)")


def on_files(files: Files, config: Any) -> Files:
    """Add the command reference, made of what ``--help`` says."""
    files.append(File.generated(config, "commands.md", content=command_reference()))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Name files of the repository that are no page, where they are linked to."""
    depth = page.file.src_uri.count("/")

    def named(match: re.Match[str]) -> str:
        text, target, path = match.groups()
        leaves = target.count("../") > depth
        return f"{text} (`{path}` in the repository)" if leaves else match[0]

    return _OUTSIDE.sub(named, markdown)


def on_page_content(content: str, **_: Any) -> str:
    """Turn every formula into MathML, which browsers draw by themselves."""
    return _MATHS.sub(_mathml, content)


def _mathml(match: re.Match[str]) -> str:
    display = "block" if match[2] == "[" else "inline"
    return latex2mathml.converter.convert(html.unescape(match[3]), display=display)


def command_reference() -> str:
    """Write every command's help as one page."""
    parts = [
        "# Commands",
        "As each command's `--help` says; made of it when these pages are built. Every command "
        "leaves with 0 when done and with 2 on bad input, after one line on stderr that names the "
        "file, the line or key, and what was expected.",
    ]
    os.environ["COLUMNS"] = "100"  # argparse fits its help to the terminal
    for parser in _parsers(command_line()):
        parts += [f"## {parser.prog}", f"```text\n{parser.format_help().strip()}\n```"]
    return "\n\n".join(parts) + "\n"


def _parsers(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _parsers(command)
