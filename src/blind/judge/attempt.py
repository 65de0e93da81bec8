"""Try one case of many: what goes wrong there is a result, and the others go on."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from spa_fo.errors import BadInput

Result = TypeVar("Result")


def attempt(case: Path, work: Callable[..., Result], *arguments: Any) -> tuple[Result | None, str]:
    """Call `work`.

    Parameters
    ----------
    case : Path
        The case's folder: left out of the message, and named in the log.
    work : callable
    *arguments
        Its arguments.

    Returns
    -------
    tuple
        The result and an empty text; or nothing and one line about what went wrong, of which the
        log gets the traceback.
    """
    try:
        return work(*arguments), ""
    except Exception as error:
        logging.error("%s: %s", case.name, traceback.format_exc())
        kind = "" if isinstance(error, BadInput) else f"{type(error).__name__}: "
        text = " ".join(f"{kind}{error}".split())
        return None, text.replace(f"{case}/", "") or type(error).__name__
