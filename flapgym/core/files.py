"""Read files that people give: one rule for what may be read, its size and encoding, and for JSON and TOML.

Whatever is wrong is a ValueError of one line that begins with the file's name; a file that is not there is a
FileNotFoundError.
"""

from __future__ import annotations

import codecs
import json
import math
import os
import re
import stat
import tomllib
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from flapgym.core.atomic import kind_of_file
from flapgym.core.wording import LONGEST_VALUE, one_line, shown

MEGABYTE = 1 << 20
LARGEST_SETTINGS = MEGABYTE // 4
"""Of a TOML file [bytes]: the NREL 5 MW with all its stations takes a tenth."""
DEEPEST = 32
"""Nesting of tables and lists."""
MOST_BITS = 63
"""Of a whole number beside its sign, as TOML promises."""

_MARKS = (
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)
# tomllib's time goes with the square of the parts of a dotted key.
_LONG_KEY = re.compile(rf"""(?<![\w"'-])(?:[\w"'-]+[ \t]*\.[ \t]*){{{DEEPEST}}}""")
_HALF_CHARACTER = re.compile("[\ud800-\udfff]")  # what UTF-16 writes in two parts


def regular_file(path: str | os.PathLike[str], largest: int) -> Path:
    """The path of a regular file of at most so many bytes.

    Pipes and devices would hang the reader or fill its memory.
    """
    try:
        found = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise FileNotFoundError(f"{_name(path)}: no such file") from None
    except (OSError, ValueError) as error:  # a name too long, or with a null byte
        reason = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"{_name(path)}: cannot be read ({reason})") from None
    if not stat.S_ISREG(found.st_mode):
        raise ValueError(f"{_name(path)}: expected a regular file, got {kind_of_file(found.st_mode)}")
    if found.st_size > largest:
        raise ValueError(f"{_name(path)}: expected at most {_size(largest)}, got {_size(found.st_size)}")
    return Path(path)


def read_bytes(path: str | os.PathLike[str], largest: int) -> bytes:
    """The content of a regular file of at most so many bytes."""
    try:
        with open(regular_file(path, largest), "rb") as file:
            content = file.read(largest + 1)  # some that the system makes up say they have no size
    except FileNotFoundError:
        raise
    except OSError as error:
        raise ValueError(f"{_name(path)}: cannot be read ({error.strerror})") from None
    if len(content) > largest:
        raise ValueError(f"{_name(path)}: expected at most {_size(largest)}, got more")
    return content


def read_text(path: str | os.PathLike[str], largest: int) -> str:
    """A text in UTF-8, with or without byte order mark; another encoding is named."""
    content = read_bytes(path, largest)
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            raise ValueError(f"{_name(path)}: expected text in UTF-8, got {encoding}; save it as UTF-8")
    if b"\0" in content:
        utf_16 = content[1::2].count(0) > 0.4 * len(content) or content[::2].count(0) > 0.4 * len(content)
        found = "UTF-16; save it as UTF-8" if utf_16 else "what is no text (it holds null bytes)"
        raise ValueError(f"{_name(path)}: expected text in UTF-8, got {found}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"{_name(path)}: expected text in UTF-8, got an encoding such as Latin-1 or Windows-1252 "
            f"(byte 0x{content[error.start]:02x} in line {line}); save it as UTF-8"
        ) from None


def read_toml(path: str | os.PathLike[str], largest: int = LARGEST_SETTINGS) -> dict[str, Any]:
    """The table of a TOML file.

    Finite values only where the field that takes them asks for it: "nan" is TOML.
    """
    text = read_text(path, largest)
    if _LONG_KEY.search(text):
        raise ValueError(f"{_name(path)}: not valid TOML here: a key of more than {DEEPEST} parts")
    document = _parsed(path, "TOML", tomllib.loads, text)
    _check_plain(document, "", path, finite=False)
    return document


def read_json(path: str | os.PathLike[str], largest: int) -> dict[str, Any]:
    """The object of a JSON file."""
    return parse_json(read_text(path, largest), path)


def parse_json(text: str, path: str | os.PathLike[str]) -> dict[str, Any]:
    """The object that a JSON text of a file holds: finite numbers, whole ones of 64 bits, each key once."""

    def load(text: str) -> Any:
        return json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_object)

    document = _parsed(path, "JSON", load, text)
    if not isinstance(document, dict):
        raise ValueError(f"{_name(path)}: expected a JSON object, got {shown(document)}")
    _check_plain(document, "", path)
    return document


def check_plain(value: object, name: str) -> None:
    """Refuse what JSON cannot hold or would hold otherwise; the message names the entry, below `name`."""
    if problem := _problem(value, name, finite=True, depth=0):
        raise ValueError(problem)


def _parsed(path: str | os.PathLike[str], kind: str, load: Callable[[str], Any], text: str) -> Any:
    try:
        return load(text)
    except RecursionError:
        raise ValueError(f"{_name(path)}: not valid {kind} here: nested too deeply") from None
    except ValueError as error:
        # Python's advice on long integers is for programmers.
        reason = "an integer of thousands of digits" if "set_int_max_str" in str(error) else one_line(error)
        raise ValueError(f"{_name(path)}: not valid {kind}: {reason}") from None


def _check_plain(value: object, name: str, path: str | os.PathLike[str], finite: bool = True) -> None:
    if problem := _problem(value, name, finite, depth=0):
        raise ValueError(f"{_name(path)}: {problem}")


def _problem(value: object, name: str, finite: bool, depth: int) -> str | None:
    """What is wrong with a value of JSON or TOML, or with what stands in it; of TOML, numbers may be infinite."""
    if isinstance(value, dict | list | tuple):
        return _problem_within(value, name, finite, depth + 1)
    wrong = None
    if isinstance(value, float):
        wrong = f"a finite number, got {value}" if finite and not math.isfinite(value) else None
    elif isinstance(value, int):
        wrong = f"a number of at most 64 bits, got {shown(value)}" if value.bit_length() > MOST_BITS else None
    elif isinstance(value, str):
        wrong = f"text, got half of a character in {shown(value)}" if _HALF_CHARACTER.search(value) else None
    elif value is not None and finite:  # TOML has dates and times, too
        wrong = f"a number, a text, a list or a mapping, got one of the class {type(value).__name__}"
    return wrong and f"{_place(name)}: expected {wrong}"


def _problem_within(
    value: dict[Any, Any] | list[Any] | tuple[Any, ...], name: str, finite: bool, depth: int
) -> str | None:
    if depth > DEEPEST:
        return f"{_place(name)}: expected at most {DEEPEST} levels of nesting"
    named = isinstance(value, dict)
    for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
        if named and (not isinstance(key, str) or _HALF_CHARACTER.search(key)):
            return f"{_place(name)}: expected texts as keys, got {shown(key)}"
        # Lists of a million numbers are common: the good ones take no call.
        if (type(entry) is float and math.isfinite(entry)) or (
            type(entry) is int and -(2**62) < entry < 2**62
        ):
            continue
        place = f"{name}[{key}]" if not named else f"{name}.{key}".removeprefix(".")
        if problem := _problem(entry, place, finite, depth):
            return problem
    return None


def _place(name: str) -> str:
    return one_line(name, LONGEST_VALUE) or "the document"


def _refuse_constant(text: str) -> NoReturn:
    raise ValueError(f"expected finite numbers, got {text}")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = next(key for key, times in Counter(key for key, _ in pairs).items() if times > 1)
        raise ValueError(f"the key {shown(twice)} stands there twice")
    return found


def _name(path: str | os.PathLike[str]) -> str:
    return one_line(os.fsdecode(path), 300)


def _size(size: int) -> str:
    """So many bytes in the unit that leaves digits."""
    return f"{size / MEGABYTE:,.0f} MB" if size >= MEGABYTE else f"{size / 1024:.0f} kB"
