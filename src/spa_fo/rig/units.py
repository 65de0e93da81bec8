"""What a unit written in a log's header means, in the units that campaign.yaml knows."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import pint

Kind = Literal["time", "pressure", "angle", "other"]

# Of each kind: the units of campaign.yaml by their names in pint, the first one for all others.
_KNOWN: dict[Kind, dict[str, str]] = {
    "time": {"s": "second", "ms": "millisecond", "us": "microsecond"},
    "pressure": {
        "kPa": "kilopascal",
        "Pa": "pascal",
        "hPa": "hectopascal",
        "bar": "bar",
        "psi": "pound_force_per_square_inch",
    },
    "angle": {"deg": "degree", "rad": "radian"},
}
# Prefixes in use, by unit: without this list `PA` would be petaamperes as well, `MS` megaseconds.
_PREFIXES: dict[str, tuple[str, ...]] = {
    "second": ("", "milli", "micro", "nano"),
    "pascal": ("", "hecto", "kilo", "mega", "milli"),
    "bar": ("", "milli"),
    "pound_force_per_square_inch": ("", "kilo"),
    "meter_Hg": ("milli", "centi"),
    "inch_Hg": ("",),
    "torr": ("",),
    "standard_atmosphere": ("",),
    "meter_H2O": ("", "centi", "milli"),
    "inch_H2O": ("",),
    "degree": ("",),
    "radian": ("", "milli"),
}
# Units that are words as well, or one letter: only where nothing but a unit can stand.
_ONLY_ALONE: dict[str, tuple[str, ...]] = {
    "minute": ("",),
    "hour": ("",),
    "day": ("",),
    "technical_atmosphere": ("",),
    "turn": ("",),
    "grade": ("",),
}
# Spellings that pint has not, or takes for something else.
_SPELLINGS = {
    "°": "degree",
    "º": "degree",  # the ordinal sign
    "degs": "degree",
    "rads": "radian",
    "millis": "millisecond",
    "micros": "microsecond",
    "sek": "second",
    "rev": "turn",
}
_OTHER_LETTERS = "VN"  # any other letter in brackets may be the name of a sensor
_GRAD = "'grad' is the German degree or a 400th of a turn"
_MILLIPASCAL = "'mPa' is a millipascal as written, MPa may be meant"
_ZERO = re.compile(r"(?P<unit>[khm]?pa|m?bar|psi)[ _(-]*(g|a|abs|gauge|absolute)\)?", re.I)
_TOKENS = re.compile(r"(?:[cm]m|in|m)H[2₂]O|[^\W\d_]+|[°º]", re.I)
_ATTACHED = re.compile(r"(?P<name>.*?[a-z]{2})(?P<unit>[khmKHM]?Pa|mbar|psi|kpa|hpa|deg|ms)")
_BRACKETS = re.compile(r"[\[({<](?P<unit>[^\[\](){}<>]*)[\])}>]")


@dataclass(frozen=True)
class Unit:
    """A unit as written, in those of campaign.yaml.

    Attributes
    ----------
    written : str
        As it stands in the log.
    kind : {"time", "pressure", "angle", "other"}
        What it measures; ``other`` is a unit of something that no campaign needs.
    unit : str
        The unit of campaign.yaml; empty for ``other``.
    scale : float
        Value in `unit` = raw * scale.
    doubt : str
        What else it may be; empty where it is sure.
    """

    written: str
    kind: Kind
    unit: str = ""
    scale: float = 1.0
    doubt: str = ""


def unit_of_name(name: str, below: str = "") -> Unit | None:
    """Return the unit that a column's name holds, or that stands below it.

    Looked for in brackets, behind a slash, and among the words of the name, the last one first:
    ``p [kPa]``, ``p/kPa``, ``p_set_kPa``, ``setpoint kPa``, ``pressureKPa``.

    Parameters
    ----------
    name : str
        The column's name.
    below : str
        The field below it, where a row of units follows the names.

    Returns
    -------
    Unit or None
        None where nothing there is a unit.
    """
    for text in (_bare(below), *_in_brackets(name)):
        if text and (unit := read_unit(text)) is not None:
            return unit
    before, slash, after = _BRACKETS.sub(" ", name).partition("/")
    words, units = _words_and_units(before, name)
    if slash and units and units[-1] is not None:
        return Unit(f"{words[-1]}/{after.strip()}", "other")  # deg/s is no angle
    if slash:
        below_slash = read_unit(after.strip())
        return None if below_slash is None or below_slash.kind == "other" else below_slash
    return _last_unit(words, units)


def read_unit(text: str) -> Unit | None:
    """Return what a text means that should be nothing but a unit.

    Parameters
    ----------
    text : str
        Such as ``kPa``, ``PSIG``, ``mm Hg``, ``N/mm²``, ``µs``, ``deg/s``.

    Returns
    -------
    Unit or None
        None where it is no unit.
    """
    found = _everyday(text.replace(" ", ""), _PREFIXES | _ONLY_ALONE)
    if found is not None:
        return found
    try:
        unit = _registry().parse_units(_as_pint_writes(text))
    except Exception:  # pint raises errors of its tokenizer, of Python's, and its own
        return None
    known = _in_known(text, unit)
    if known is not None or unit.dimensionless or (len(text) == 1 and text not in _OTHER_LETTERS):
        return known
    return Unit(text, "other")


def _words_and_units(text: str, name: str) -> tuple[list[str], list[Unit | None]]:
    words = [word for token in _TOKENS.findall(text) for word in _parts(token)]
    last = len(words) - 1
    return words, [_word_unit(word, i == last, name) for i, word in enumerate(words)]


def _last_unit(words: Sequence[str], units: Sequence[Unit | None]) -> Unit | None:
    """Return the last unit among the words of a name; ``deg_s`` is one of neither."""
    rate = [unit.kind for unit in units[-2:] if unit is not None]
    if len(rate) == 2 and rate[0] != "time" == rate[1]:
        return Unit(" ".join(words[-2:]), "other")
    return next((unit for unit in reversed(units) if unit is not None), None)


def _word_unit(word: str, last: bool, name: str) -> Unit | None:
    """Read a word of a name; one letter is a unit only where it ends the name: ``t_s``."""
    ends = last and (word == "s" or name.upper() == name)
    return _everyday(word, _PREFIXES) if len(word) > 1 or word in "°º" or ends else None


def _everyday(text: str, prefixes: Mapping[str, Sequence[str]]) -> Unit | None:
    """Read a unit in use, in any case; gauge or absolute, it is the same unit."""
    zero = _ZERO.fullmatch(text)
    names = list(dict.fromkeys(_candidates(zero["unit"] if zero else text, prefixes)))
    if not names:
        return None
    first, *others = (_in_known(text, _registry().Unit(name)) for name in names)
    if first is None:
        return None
    if names == ["grade"]:
        return Unit(text, "angle", "deg", doubt=_GRAD)
    doubt = _MILLIPASCAL if names == ["millipascal"] else ""
    if any(other != first for other in others):
        doubt = f"'{text}' may be {' or '.join(names)}"
    return replace(first, doubt=doubt)


def _candidates(text: str, prefixes: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """Yield the names of what is written, the likeliest first: as it is, then in other cases."""
    own = _SPELLINGS.get(text.lower())
    if own is not None:
        yield own
        return
    if not text.replace("2", "").replace("°", "").isalpha():
        return
    exact = list(_names([text], prefixes, case_sensitive=True))
    if exact:
        yield from exact[:1]
        return
    capital, small = text[0].upper() + text[1:].lower(), text.lower()
    yield from _names([capital, small], prefixes, case_sensitive=False)


def _names(
    texts: Iterable[str], prefixes: Mapping[str, Sequence[str]], *, case_sensitive: bool
) -> Iterator[str]:
    for text in texts:
        for prefix, unit, _ in _registry().parse_unit_name(text, case_sensitive=case_sensitive):
            if prefix in prefixes.get(unit, ()):
                yield prefix + unit


def _in_known(written: str, unit: pint.Unit) -> Unit | None:
    """Express a unit in the one of campaign.yaml that is the same, or in the first by a scale."""
    quantity = _registry().Quantity(1.0, unit)
    for kind, units in _KNOWN.items():
        if not quantity.is_compatible_with(next(iter(units.values()))) or not _is(kind, unit):
            continue
        factors = {own: _rounded(quantity.to(name).magnitude) for own, name in units.items()}
        same = next((own for own, factor in factors.items() if factor == 1.0), None)
        chosen = same or next(iter(units))
        if kind == "angle" and same is None and "radian" in str(unit):
            chosen = "rad"
        if kind == "time" and same is None and factors["s"] < 1e-6:
            chosen = "us"
        return Unit(written, kind, chosen, factors[chosen])
    return None


def _is(kind: Kind, unit: pint.Unit) -> bool:
    """Say whether a unit of an angle's dimension, which is none, is one of angles."""
    return kind != "angle" or any(
        word in str(unit) for word in ("degree", "radian", "grade", "turn", "arc")
    )


def _as_pint_writes(text: str) -> str:
    """Write ``kgf/cm2`` and ``N/mm²`` as ``kgf/cm**2``."""
    text = text.replace("²", "2").replace("^", "**").replace("º", "°").strip()
    return re.sub(r"(?<=[A-Za-z])2\b", "**2", text)


def _in_brackets(name: str) -> Iterator[str]:
    """Yield what stands in brackets, the last ones first."""
    for match in reversed(list(_BRACKETS.finditer(name))):
        yield match["unit"].strip()


def _parts(token: str) -> list[str]:
    """Split ``pressureKPa``, ``timeMs`` and ``pressurekPa`` into name and unit."""
    if _everyday(token, _PREFIXES) is not None:
        return [token]
    attached = _ATTACHED.fullmatch(token)
    if attached:
        return [attached["name"], attached["unit"]]
    return re.split(r"(?<=[a-z])(?=[A-Z])", token)


def _bare(text: str) -> str:
    """Strip brackets: a row of units may hold ``[kPa]`` or ``(kPa)``."""
    return text.strip().strip("[](){}<>").strip()


def _rounded(value: float) -> float:
    return float(f"{value:.12g}")


@cache
def _registry() -> pint.UnitRegistry[float]:
    return pint.UnitRegistry()
