"""How a file is spoilt: bytes, tokens and lines of any file, entries of a JSON document."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np

Random = np.random.Generator

NASTY = (
    *(
        b"",
        b"\0",
        b"\xff",
        b"\xef\xbb\xbf",
        b"\xff\xfe",
        b"\n",
        b"\r",
        b"\t",
        b";",
        b",",
        b"|",
        b"#",
        b'"',
        b"'",
    ),
    *(
        b"0",
        b"-1",
        b"1.5",
        b"1e999",
        b"-1e308",
        b"1e-320",
        b"nan",
        b"NaN",
        b"-inf",
        b"Infinity",
        b"true",
        b"null",
    ),
    *(
        b"9" * 400,
        b"9" * 5000,
        b"[" * 3000,
        b"{" * 50,
        b"]",
        b"}",
        b"[]",
        b"{}",
        b"a." * 500,
        b"=cmd()",
        b"1_000",
    ),
    *(
        b'"\\ud800"',
        b"\x1b[31m",
        b"\xe2\x80\xae",
        b"../../etc/passwd",
        b"/dev/zero",
        b"2024-01-31T13:00:00",
        b"3,5",
    ),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 2, 101, 10**9, 10**400, 0.0, -1.0, 2.0, 1e-320, 1e308, -1e308, 0.5, 1.1),
    *("", " ", "text", "nan", "\x1b[31m", "a\nb", "a|b", "=cmd()", "\ud800", "open_loop", "x" * 5000),
    *([], [[]], {}, [None], [True], [1.0], ["rbm"], ["rbm", "rbm"], [[1.0], [1.0, 2.0]], {"a": {"b": []}}),
)
_TOKEN = re.compile(rb'"[^"\n]{0,200}"|-?\d[\d.eE+-]*|\w+')


def spoilt(content: bytes, random: Random) -> bytes:
    """The content with one to four changes of its bytes."""
    for _ in range(random.integers(1, 5)):
        content = _CHANGES[random.integers(len(_CHANGES))](content, random)
    return content


def _flipped(content: bytes, random: Random) -> bytes:
    changed = bytearray(content)
    for _ in range(random.integers(1, 4)):
        if changed:
            changed[random.integers(len(changed))] ^= 1 << int(random.integers(8))
    return bytes(changed)


def _cut(content: bytes, random: Random) -> bytes:
    start, end = _piece(content, random)
    return content[:start] if random.random() < 0.3 else content[:start] + content[end:]


def _doubled(content: bytes, random: Random) -> bytes:
    start, end = _piece(content, random)
    return content[:end] + content[start:end] + content[end:]


def _inserted(content: bytes, random: Random) -> bytes:
    at = int(random.integers(len(content) + 1))
    return content[:at] + _nasty(random) + content[at:]


def _replaced(content: bytes, random: Random) -> bytes:
    """A number, a word or a text gives way to something else."""
    head = content[:20_000]
    tokens = list(_TOKEN.finditer(head))
    if not tokens:
        return content
    start, end = tokens[random.integers(len(tokens))].span()
    other = tokens[random.integers(len(tokens))].group() if random.random() < 0.3 else _nasty(random)
    return content[:start] + other + content[end:]


def _shuffled(content: bytes, random: Random) -> bytes:
    lines = content.splitlines(keepends=True)
    if len(lines) < 2:
        return content
    one, other = random.integers(len(lines), size=2)
    lines[one], lines[other] = lines[other], lines[one]
    return b"".join(lines)


_CHANGES: tuple[Callable[[bytes, Random], bytes], ...] = (
    *(_flipped, _cut, _doubled, _inserted, _shuffled),
    *(_replaced,) * 4,
)


def _piece(content: bytes, random: Random) -> tuple[int, int]:
    start = int(random.integers(len(content) + 1))
    return start, min(len(content), start + int(random.geometric(0.02)))


def _nasty(random: Random) -> bytes:
    return NASTY[random.integers(len(NASTY))]


def spoilt_entries(document: dict[str, Any], random: Random) -> dict[str, Any]:
    """A copy of a JSON document with one to three entries changed, taken out or added."""
    document = copy.deepcopy(document)
    for _ in range(random.integers(1, 4)):
        places = list(_places(document))
        if not places:
            break
        table, key = places[random.integers(len(places))]
        chance = random.random()
        value = copy.deepcopy(VALUES[random.integers(len(VALUES))])
        if chance < 0.1:
            del table[key]
        elif chance < 0.2 and isinstance(table, dict):
            table[f"{key}_"] = value
        elif chance < 0.3:
            table[key] = [table[key]]
        else:
            table[key] = value
    return document


def _places(value: Any) -> Any:
    """(table, key) of every entry, of long lists of some."""
    if isinstance(value, dict | list):
        for key in list(value) if isinstance(value, dict) else range(min(len(value), 6)):
            yield value, key
            yield from _places(value[key])


def spoilt_array(array: np.ndarray[Any, Any], random: Random) -> np.ndarray[Any, Any]:
    """An array of another shape, another type or other numbers."""
    changes: tuple[Callable[[], np.ndarray[Any, Any]], ...] = (
        lambda: np.full_like(array, np.nan),
        lambda: np.where(random.random(array.shape) < 0.1, np.inf, array),
        lambda: array * 1e3,
        lambda: -array,
        lambda: array * 1e300,
        lambda: array * 1e-320,
        lambda: array.astype(np.float32),
        lambda: array.astype(np.int64),
        lambda: array.astype(bool),
        lambda: array.ravel(),
        lambda: array[..., :-1],
        lambda: array[:-1],
        lambda: np.ascontiguousarray(array.T),
        lambda: array[None],
        lambda: np.zeros((0, *array.shape[1:])),
        lambda: np.array(1.0),
    )
    return np.ascontiguousarray(changes[random.integers(len(changes))]())


def as_json(document: dict[str, Any]) -> bytes:
    """The document as a hostile program would write it: NaN and long integers and all."""
    return json.dumps(document).encode()
