"""One bad input: what it is in words, and how it is given."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass

from flapgym import cli


@dataclass(frozen=True)
class Entry:
    """A bad input.

    Attributes
    ----------
    what : str
        In words, for the table.
    give : callable
        Makes what is needed in the working folder, which is empty, and gives it. It raises, or returns the line that a
        program printed.
    """

    what: str
    give: Callable[[], object]


@dataclass(frozen=True)
class Section:
    """Entries under one heading."""

    title: str
    entries: tuple[Entry, ...]


def line_of(entry: Entry) -> str:
    """The line that an entry gets, in the working folder.

    Raises
    ------
    RuntimeError
        If the input was taken.
    """
    try:
        told = entry.give()
    except (ValueError, TypeError, OSError) as error:
        return str(error)
    if not isinstance(told, str):
        raise RuntimeError(f"{entry.what}: was taken")
    return told


def command(*arguments: str) -> str:
    """What `flapgym` prints on standard error when it refuses its arguments."""
    printed = io.StringIO()
    with contextlib.redirect_stderr(printed), contextlib.redirect_stdout(io.StringIO()):
        try:
            code = cli.main(list(arguments))
        except SystemExit as ended:
            code = int(ended.code or 0)
    if code != 2:
        raise RuntimeError(f"flapgym {' '.join(arguments)}: ended with {code}: {printed.getvalue()}")
    return printed.getvalue().rstrip("\n")
