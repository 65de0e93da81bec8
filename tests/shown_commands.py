"""The commands and code that the documentation shows, and how a test carries them out.

Fenced blocks in bash, sh or python are run, page by page and in order, in a folder of the page's
own. A comment on the line before a fence says otherwise::

    <!-- not run: why -->            its commands are only checked against the command line
    <!-- run on: docs/start.md -->    that page shows, and runs, the same commands
    <!-- file: raw/my_arm/a.yaml --> the block is written to that file
"""

from __future__ import annotations

import contextlib
import functools
import io
import os
import re
import shlex
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from spa_fo.cli import command_line, main

ROOT = Path(__file__).resolve().parent.parent
SHELL = ("bash", "sh")
_FENCE = re.compile(
    r"^(?P<indent> *)(?:<!-- (?P<mark>[^\n]*?) -->\n *)?```(?P<language>\w*)[^\n]*\n"
    r"(?P<body>.*?)^ *```$",
    re.MULTILINE | re.DOTALL,
)
_SHELL_SIGNS = re.compile(r"[|&;<>$`()*]")


@dataclass(frozen=True)
class Block:
    """A fenced block.

    Attributes
    ----------
    language, body, mark : str
        As written; the mark is empty where there is none.
    """

    language: str
    body: str
    mark: str

    @property
    def reason(self) -> str:
        """Why it is not run; empty where it is."""
        return (
            self.mark.removeprefix("not run:").strip() if self.mark.startswith("not run:") else ""
        )

    @property
    def elsewhere(self) -> str:
        """The page that runs its commands; empty where it is this one."""
        return self._after("run on:")

    @property
    def file(self) -> str:
        """Where it is to be written; empty where nowhere."""
        return self._after("file:")

    def _after(self, sign: str) -> str:
        return self.mark.removeprefix(sign).strip() if self.mark.startswith(sign) else ""


def blocks(text: str) -> Iterator[Block]:
    """Find a page's fenced blocks."""
    for match in _FENCE.finditer(text):
        body = textwrap.dedent(match["body"])
        yield Block(match["language"], body, match["mark"] or "")


def commands(body: str) -> list[str]:
    """Return a shell block's commands, a line each, joined where a line goes on."""
    lines = body.replace("\\\n", " ").splitlines()
    return [line for line in lines if shlex.split(line, comments=True)]


def run(block: Block, names: dict[str, object]) -> None:
    """Carry out one block in the current folder.

    Parameters
    ----------
    block : Block
        In a shell's language or Python.
    names : dict
        Python's names, which go from block to block.
    """
    if block.language == "python":
        exec(compile(block.body, "documentation", "exec"), names)
        return
    for command in commands(block.body):
        words = shlex.split(command, comments=True)
        if words[0] == "spa-fo" and not _SHELL_SIGNS.search(" ".join(words)):
            _run_here(words[1:])
        else:
            _run_shell(command)


def _run_here(arguments: list[str]) -> None:
    """Run a command in this process, which has the kernels already."""
    said, complained = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
            code = main(arguments)
    except SystemExit as end:
        code = int(end.code or 0)
    assert code == 0, f"spa-fo {shlex.join(arguments)}: {complained.getvalue()}"


def _run_shell(command: str) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", command],
        env=os.environ | {"PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{command}: {done.stderr}"


def refusal(command: str) -> str:
    """Say what is wrong with a command that is not run; empty where it would be accepted.

    ``spa-fo`` is asked whether it knows the options, ``make`` whether it has the target, Snakemake
    and modules of Python for their help.
    """
    if command.startswith("until "):
        return _syntax_error(command)
    words = [word for word in shlex.split(command, comments=True) if word != "&"]
    words = words[next(i for i, word in enumerate(words) if "=" not in word) :]
    name, *rest = words
    if name == "spa-fo":
        complained = io.StringIO()
        try:
            with contextlib.redirect_stderr(complained), contextlib.redirect_stdout(io.StringIO()):
                command_line().parse_args(rest)
        except SystemExit as end:
            return complained.getvalue() if end.code else ""
        return ""
    if name == "make":
        targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
        unknown = [word for word in rest if "=" not in word and word not in targets]
        return f"make has no target {unknown}" if unknown else ""
    if name == "snakemake":
        return _unknown_options([sys.executable, "-m", "snakemake"], rest)
    if name == "python":
        if rest[0] == "-m":
            return _unknown_options([sys.executable, "-m", rest[1]], rest[2:])
        return "" if (ROOT / rest[0]).is_file() else f"{rest[0]} is not there"
    if name == ".":
        return "" if rest == [".venv/bin/activate"] else f"nothing is known of {rest}"
    return f"nothing is known of {name}"


def _syntax_error(command: str) -> str:
    return subprocess.run(
        ["bash", "-n", "-c", command], capture_output=True, text=True, check=False
    ).stderr


def _unknown_options(program: list[str], words: list[str]) -> str:
    options = [word.split("=")[0] for word in words if word.startswith("--")]
    unknown = [option for option in options if option not in _help(tuple(program))]
    return f"{program} has no {unknown}" if unknown else ""


@functools.cache
def _help(program: tuple[str, ...]) -> str:
    done = subprocess.run([*program, "--help"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{program} has no --help: {done.stderr}"
    return done.stdout
