"""A command line that answers a typing error in one line, with what was probably meant."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

from spa_fo.errors import suggestion

_NEGATIVE = re.compile(r"-(\d|\.\d|$)")  # a number, or the stream that is called -


class CommandParser(argparse.ArgumentParser):
    """Reads arguments; refuses in one line on stderr, exit code 2, where argparse writes several.

    Its commands (`add_subparsers`) are of this class too.
    """

    def parse_known_args(self, args: Iterable[str] | None = None, namespace: Any = None) -> Any:
        """Read the arguments, but first look for options that there are not.

        argparse would say first what is missing, which a mistyped ``--ouput`` makes ``--out``.
        """
        words = sys.argv[1:] if args is None else list(args)
        self._refuse_unknown(words)
        return super().parse_known_args(words, namespace)

    def error(self, message: str) -> NoReturn:
        """Leave with 2 after one line: what is wrong, and which help says more."""
        line = " ".join(message.removeprefix("argument ").split())
        self.exit(2, f"spa-fo: {line} ({self.prog} --help)\n")

    def _refuse_unknown(self, words: Sequence[str]) -> None:
        known = list(self._option_string_actions)
        for word in words:
            is_value = not word.startswith("-") or _NEGATIVE.match(word)
            if word == "--" or (is_value and self._subparsers is not None):
                return  # the rest is the command's
            name = word.partition("=")[0]
            if not is_value and not any(option.startswith(name) for option in known):
                self.error(f"{name}: is no option{suggestion(name, known)}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            near = suggestion(str(value), [str(choice) for choice in action.choices])
            raise argparse.ArgumentError(action, f"is '{value}'{near}")
