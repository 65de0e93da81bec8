"""The text of a delimited log: its lines, their fields, and the numbers in them."""

from __future__ import annotations

import codecs
import csv
import math
import re
from pathlib import Path

from spa_fo.errors import BadInput
from spa_fo.rig.raw import read_bytes

NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3}){2,}")
DECIMAL_COMMA = re.compile(r"[+-]?(?:\d+,\d*|,\d+)(?:[eE][+-]?\d+)?")
NOT_FINITE = {"nan", "inf", "infinity", "-nan", "-inf", "+inf", "na", "n/a", "null", "none"}
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
THOUSANDS_AND_COMMA = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+,\d*")


def read_lines(path: Path, encoding: str = "utf-8") -> tuple[list[str], bool]:
    """Return the lines without their ends, and whether the last one was ended.

    Raises
    ------
    BadInput
        Not readable, empty, or no text in this encoding.
    """
    data = read_bytes(path, "a csv log")
    if not data:
        raise BadInput(path, "is empty; expected a csv log")
    name = codecs.lookup(encoding).name
    wide = name.startswith(("utf-16", "utf-32"))
    if not wide and (b"\0" in data or data[:2] in _UTF16):
        raise BadInput(path, "is binary or UTF-16; expected a csv log in ASCII or UTF-8")
    # Damaged bytes cost their field alone; in an encoding of wide characters they cost all.
    text = data.decode("utf-8-sig" if name == "utf-8" else encoding, errors="replace")
    if wide and ("\0" in text or text.count("\ufffd") > 0.01 * len(text)):
        raise BadInput(path, f"is not {encoding}; expected a csv log in log.encoding")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    whole = lines[-1] == ""
    return (lines[:-1] if whole else lines), whole


def guess_encoding(data: bytes) -> str:
    """Guess how a text is encoded: UTF-16 with its mark, UTF-8, else cp1252 (Windows)."""
    if data[:2] in _UTF16:
        return "utf-16"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def split_fields(line: str, delimiter: str) -> list[str] | None:
    """Split a line into bare fields; None if it is blank. In quotes a delimiter is none."""
    if not line.strip():
        return None
    if delimiter in (" ", "whitespace"):
        fields = line.split()
    elif '"' in line and len(delimiter) == 1:
        fields = _unquoted(line, delimiter)
    else:
        fields = line.split(delimiter)
    return [field.strip().strip('"').strip() for field in fields]


def _unquoted(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    except csv.Error:  # a field of more than 128 KiB, and the like
        return line.split(delimiter)


def number(text: str) -> float:
    """Return a plain decimal number; ValueError for anything else, infinity and nan included."""
    if NUMBER.fullmatch(text) is None:
        raise ValueError(text)
    return _finite(float(text))


def comma_number(text: str) -> float:
    """Return a number with a decimal comma, or a whole one."""
    if "." in text or NUMBER.fullmatch(text.replace(",", ".")) is None:
        raise ValueError(text)
    return _finite(float(text.replace(",", ".")))


def _finite(value: float) -> float:
    if not math.isfinite(value):
        raise ValueError(value)
    return value


def reason(text: str, decimal: str = ".") -> str | None:
    """Say why a field is no number; None where it is one."""
    if not text:
        return "empty field"
    if text.lower() in NOT_FINITE:
        return "nan"
    if THOUSANDS.fullmatch(text) or THOUSANDS_AND_COMMA.fullmatch(text):
        return "thousands dots"
    if decimal == "." and DECIMAL_COMMA.fullmatch(text):
        return "decimal comma"
    if decimal == "," and "." in text and NUMBER.fullmatch(text):
        return "decimal point"
    try:
        (number if decimal == "." else comma_number)(text)
    except ValueError:
        return "nan" if NUMBER.fullmatch(text.replace(",", ".")) else "not a number"
    return None
