"""The one reader of numbers in robot files: plain decimals, which every reader of XML takes for the same number.

Python alone would also take `1_0`, full-width digits and `nan`, and Drake would read something else or nothing.
"""

from __future__ import annotations

import re

import numpy as np

from pipeline.common.errors import RobotError

Vector = tuple[float, ...]

LARGEST = 1e20  # of a number that is not a limit: squares and products of larger ones leave what a computer counts
SPACE = " \t\r\n"  # XML's own: no other white space separates numbers
WORDS = ("none", "a number", *(f"{word} numbers" for word in ("two", "three", "four", "five", "six", "seven")))

_DECIMAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)


def number(text: str, where: str, *, infinite: bool = False) -> float:
    """The number that `text` is; raises RobotError, which begins with `where`. infinite: whether `inf` is one."""
    word = text.strip(SPACE)
    read = _DECIMAL.fullmatch(word) or (infinite and _INFINITE.fullmatch(word))
    value = float(word) if read else np.nan
    if not (np.isfinite(value) or (infinite and np.isinf(value))):
        raise RobotError(f"{where} '{shown(text)}', expected a number")
    if abs(value) > LARGEST and not infinite:
        raise RobotError(f"{where} '{shown(text)}', expected a number of at most {LARGEST:g} in size")
    return value


def numbers(text: str, counts: int | tuple[int, ...], where: str) -> Vector:
    """The numbers in `text`, as many as one of `counts`; raises RobotError, which begins with `where`."""
    allowed = (counts,) if isinstance(counts, int) else counts
    words = text.strip(SPACE)
    values = tuple(number(word, where) for word in (re.split(f"[{SPACE}]+", words) if words else ()))
    if len(values) not in allowed:
        raise RobotError(f"{where} '{shown(text)}', expected {' or '.join(WORDS[count] for count in allowed)}")
    return values


def shown(text: str) -> str:
    """Text of a file for a message of one line."""
    line = " ".join(text.split())
    return line if len(line) <= 60 else f"{line[:57]}..."


def written(values: Vector) -> str:
    """Numbers as they stand in an attribute, exact."""
    return " ".join(repr(float(value)) for value in values)
