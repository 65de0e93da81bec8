"""Times that are written as a date and time, or as a time of day."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime

import numpy as np

from spa_fo.arrays import Floats

_EPOCH = datetime(1970, 1, 1)
_MIDNIGHT = datetime(1900, 1, 1)  # what strptime takes where a format has no date
_DAY_S, _HOUR_S = 86_400.0, 3_600.0
_LONG_FRACTION = re.compile(r"([.,]\d{6})\d+")  # Python reads microseconds
_FRACTION = re.compile(r"[.,]%f")
_DATES = (
    "%Y-%m-%d",
    "%Y/%m/%d",
    "%d.%m.%Y",
    "%d.%m.%y",
    "%d/%m/%Y",
    "%m/%d/%Y",
    "%d-%m-%Y",
    "%m/%d/%y",
    "%d-%b-%Y",
)
_TIMES = ("%H:%M:%S", "%I:%M:%S %p")
_FEWEST = 0.9  # of the texts must be of a format that is guessed


def is_format(text: str) -> bool:
    """Say whether `text` is a format that reads back what it writes, to the second."""
    moment = datetime(2001, 2, 3, 4, 5, 6)
    try:
        read = datetime.strptime(moment.strftime(text), text)
    except (ValueError, re.error):
        return False
    return (read.minute, read.second) == (moment.minute, moment.second)


def reader(form: str | None) -> Callable[[str], float]:
    """Return what turns a text into seconds; it raises ValueError for what is none.

    Parameters
    ----------
    form : str or None
        As for `datetime.strptime`; None is ISO 8601. A fraction may be missing where a format has
        one: some writers leave out that of a whole second.
    """
    if form is None:
        return _iso
    start = _EPOCH if has_date(form) else _MIDNIGHT
    bare = _FRACTION.sub("", form)

    def read(text: str) -> float:
        text = _LONG_FRACTION.sub(r"\1", text.strip())
        try:
            moment = datetime.strptime(text, form)
        except ValueError:
            if bare == form:
                raise
            moment = datetime.strptime(text, bare)
        return _seconds(moment, start)

    return read


def has_date(form: str | None) -> bool:
    """Say whether a format tells the day."""
    return form is None or any(key in form for key in ("%d", "%j", "%x", "%c"))


def unwrapped(seconds: Floats, form: str | None) -> Floats:
    """Let times of day, shape (n,), run on past midnight; minutes past the hour."""
    if has_date(form) or not seconds.size:
        return seconds
    period = _DAY_S if any(key in str(form) for key in ("%H", "%I", "%X")) else _HOUR_S
    falls = np.diff(seconds) < -0.5 * period
    return seconds + period * np.concatenate([[0.0], np.cumsum(falls)])


def guess_format(texts: Sequence[str]) -> tuple[str | None, str] | None:
    """Guess how dates and times are written.

    Parameters
    ----------
    texts : sequence of str
        Fields of one column.

    Returns
    -------
    (str or None, str) or None
        The format, None for ISO 8601, and a doubt in words, empty where there is none. None where
        the texts are no times.
    """
    stamps = [text for text in texts if ":" in text]
    if not stamps or len(stamps) < _FEWEST * len(texts):
        return None
    found = [form for form in (None, *_formats()) if _reads(form, stamps)]
    if not found:
        return None
    swapped = found[0] is not None and "/%m/" in found[0] and any("%m/%d" in str(f) for f in found)
    return found[0], "day or month first" if swapped else ""


def _formats() -> Iterator[str]:
    for fraction in ("", ".%f", ",%f"):
        for time in (time.replace("%S", f"%S{fraction}") for time in _TIMES):
            yield time
            for date in _DATES:
                yield f"{date} {time}"
    yield from ("%M:%S.%f", "%M:%S,%f", "%M:%S")


def _reads(form: str | None, texts: Sequence[str]) -> bool:
    """Say whether nearly all texts are of a format; the first one decides at little cost."""
    read = reader(form)
    misses = 0
    for text in texts:
        try:
            read(text)
        except ValueError:
            misses += 1
            if misses > (1.0 - _FEWEST) * len(texts):
                return False
    return True


def _iso(text: str) -> float:
    if ":" not in text:
        raise ValueError("expected a date and time")
    return _seconds(datetime.fromisoformat(text.strip()), _EPOCH)


def _seconds(moment: datetime, start: datetime) -> float:
    if moment.tzinfo is not None:
        moment = moment.astimezone(UTC).replace(tzinfo=None)
    return (moment - start).total_seconds()
