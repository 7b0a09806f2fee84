"""How messages show what they were given: numbers with the digits that matter, the rest short and on one line."""

from __future__ import annotations

import math
import reprlib
from numbers import Integral, Real
from typing import SupportsFloat

DIGITS = 15
"""A double holds as many of any decimal number; what `repr` adds beyond them is rounding."""
AFTER_ROUNDING = 12
LONGEST_VALUE = 120
LONGEST_LINE = 1000
LONGEST_INTEGER = 60


def number(value: SupportsFloat) -> str:
    """A number in decimals: all those it was written with, none that only rounding made.

    11.000001 stays that, a time of 1704067200.5 s keeps its seconds, and 19.985000000000003 is 19.985.
    """
    exact = repr(float(value))
    digits = sum(character.isdigit() for character in exact.partition("e")[0].strip("-0."))
    text = exact if digits <= DIGITS else f"{float(value):.{AFTER_ROUNDING}g}"
    return text.removesuffix(".0")


def shown(value: object) -> str:
    """What was given, as Python writes it: on one line, its middle left out where it is long."""
    if isinstance(value, Integral) and not isinstance(value, bool):
        return _integer(int(value))
    if isinstance(value, Real) and not isinstance(value, bool):
        text = number(float(value))
        # 2.0 is not 2 to one who is told that a whole number was expected.
        return f"{text}.0" if text.lstrip("-").isdecimal() else text
    try:
        text = _Short().repr(value)
    except (ValueError, RecursionError):  # too long a number within, or nesting too deep
        text = f"a {type(value).__name__}"
    return shortened(printable(text), LONGEST_VALUE)


def one_line(message: object, longest: int = LONGEST_LINE) -> str:
    """A message as one line that any terminal shows, however it was put together, its middle left out if it is long."""
    return shortened(printable(" ".join(str(message).split())), longest)


def printable(text: str) -> str:
    """The text with escapes in place of what would move a cursor, ring a bell or be no character at all."""
    return "".join(
        each if each.isprintable() else each.encode("unicode_escape", "backslashreplace").decode("ascii")
        for each in text
    )


def shortened(text: str, most: int) -> str:
    """The text with its middle left out if it is longer than `most` characters."""
    if len(text) <= most:
        return text
    half = (most - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"


def _integer(value: int) -> str:
    if abs(value) < 10**LONGEST_INTEGER:
        return str(value)
    # Python writes none of more than 4300 digits.
    return f"an integer of some {round(value.bit_length() * math.log10(2.0))} digits"


class _Short(reprlib.Repr):
    """Six entries of a collection, a line of a text."""

    def __init__(self) -> None:
        super().__init__()
        self.maxstring = self.maxother = 80
        self.maxlevel = 3

    def repr_int(self, x: int, level: int) -> str:
        return _integer(x)

    def repr_float(self, x: float, level: int) -> str:
        return number(x)

    def repr_bytes(self, x: bytes, level: int) -> str:
        return f"{len(x)} bytes"

    repr_bytearray = repr_bytes
