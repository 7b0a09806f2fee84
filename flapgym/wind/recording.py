"""Recorded wind series in text files: a header with units, then one sample a line.

    time [s], wind [m/s]
    0.0, 11.3
    0.5, 11.1

    time; wind [m/s]
    2024-01-31 13:00:00,0; 11,3
    2024-01-31 13:00:00,5; 11,1

Columns are separated by commas, semicolons or tabs, as the header has them; beside the latter two, numbers may have
decimal commas. Units are those of case files: s, ms, min or h, and m/s, km/h or kn. Times may be dates of ISO 8601, and
then need no unit: they are counted from the first. The second column may be called `wind_perturbation` instead: about
the mean wind. Lines that begin with # are comments.
"""

from __future__ import annotations

import csv
import io
import math
import os
import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from flapgym.core.arrays import Array
from flapgym.core.files import MEGABYTE, read_text
from flapgym.core.units import unit_size
from flapgym.core.wording import one_line, shown

LARGEST = 16 * MEGABYTE
"""Of a file [bytes]: a day of ten samples a second, three times what an episode can last."""
_COLUMN = re.compile(r"\s*(\w+)\s*(?:\[([^\]]*)\])?\s*")
_DIMENSIONS = {"time": "time", "wind": "speed", "wind_perturbation": "speed"}
_EXAMPLE = '"time [s], wind [m/s]"'
_NUMBER = re.compile(
    r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?|[+-]?(?:nan|inf|infinity)", re.I | re.A
)


@dataclass(frozen=True, eq=False)
class WindSeries:
    """A recording.

    Attributes
    ----------
    time : (t,) float
        Increasing [s]; of dates, since the first.
    wind : (t,) float
        [m/s].
    perturbation : bool
        Whether `wind` is about the mean wind, or the wind itself.
    """

    time: Array
    wind: Array
    perturbation: bool


@dataclass(frozen=True)
class _Header:
    """Names of the two columns in their order, sizes of the units of time (None: dates) and wind, and the separator."""

    names: tuple[str, str]
    time_size: float | None
    wind_size: float
    separator: str


def read_wind(path: str | os.PathLike[str]) -> WindSeries:
    """Read a wind recording.

    Raises
    ------
    ValueError
        If the file is missing or holds anything else; the message names file, line and what is expected there.
    """
    try:
        text = read_text(path, LARGEST)
    except (ValueError, FileNotFoundError) as error:
        raise ValueError(f"{error}; give the path of a CSV file that begins with {_EXAMPLE}") from None
    times, winds = array("d"), array("d")
    header: _Header | None = None
    reader = _Samples()
    for place, row in _rows(text, _name(path)):
        if header is None:
            header = _header(row, _separator(text), place)
            continue
        time, wind = reader.sample(row, header, place)
        if times and not time > times[-1]:
            raise ValueError(
                f"{place}: expected times that increase, got {_seconds(time)} after {_seconds(times[-1])}"
            )
        times.append(time)
        winds.append(wind)
    if header is None or len(times) < 2:
        raise ValueError(
            f"{_name(path)}: expected a header {_EXAMPLE} and at least two samples, got {len(times)}"
        )
    return WindSeries(np.array(times), np.array(winds), "wind_perturbation" in header.names)


def _rows(text: str, name: str) -> Iterator[tuple[str, list[str]]]:
    """Place and cells of each line that is neither empty nor a comment."""
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=_separator(text), skipinitialspace=True)
    try:
        for row in rows:
            if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#"):
                yield f"{name}, line {rows.line_num}", row
    except csv.Error as error:
        raise ValueError(
            f"{name}, line {rows.line_num}: not a table ({error}); expected CSV that begins with {_EXAMPLE}"
        ) from None


def _separator(text: str) -> str:
    """What separates the columns of the header."""
    for line in io.StringIO(text):
        if line.strip() and not line.lstrip().startswith("#"):
            return next((sign for sign in ";\t" if sign in line), ",")
    return ","


def _header(row: list[str], separator: str, place: str) -> _Header:
    found: dict[str, float | None] = {}
    for cell in row:
        match = _COLUMN.fullmatch(cell)
        dated = (
            match is not None and match[1] == "time" and (match[2] or "").strip() in ("", "UTC", "ISO 8601")
        )
        if match is None or match[1] not in _DIMENSIONS or (match[2] is None and not dated):
            raise ValueError(
                f"{place}: expected a header of two columns with units, {_EXAMPLE} or with wind_perturbation [m/s], "
                f"got {shown(cell.strip())}"
            )
        size = None if dated else unit_size(_DIMENSIONS[match[1]], match[2], f"{place}: column {match[1]}")
        found[match[1]] = size
    names = tuple(found)
    if len(row) != 2 or len(names) != 2 or "time" not in found:
        raise ValueError(
            f"{place}: expected two columns, {_EXAMPLE}, got {one_line(', '.join(map(str.strip, row)))}"
        )
    wind = found[next(name for name in names if name != "time")]
    assert wind is not None
    return _Header((names[0], names[1]), found["time"], wind, separator)


class _Samples:
    """Reads samples of one file, which keeps to one decimal sign and counts dates from its first."""

    def __init__(self) -> None:
        self._decimal = ""
        self._first: datetime | None = None

    def sample(self, row: list[str], header: _Header, place: str) -> tuple[float, float]:
        """Time [s] and wind [m/s] of a line."""
        try:
            time, wind = self._sample(row, header)
        except ValueError as error:
            raise ValueError(f"{place}: {error}, got {shown(header.separator.join(row))}") from None
        return time, wind

    def _sample(self, row: list[str], header: _Header) -> tuple[float, float]:
        if len(row) != 2:
            sign = {",": "a comma", ";": "a semicolon", "\t": "a tab"}[header.separator]
            raise ValueError(f"expected two numbers separated by {sign}")
        first, second = row if header.names[0] == "time" else reversed(row)
        clock = first.strip()
        if header.time_size is None or (":" in clock and not _NUMBER.fullmatch(clock)):
            time = self._since_first(clock)
        else:
            time = self._number(clock) * header.time_size
        wind = self._number(second.strip()) * header.wind_size
        if not (math.isfinite(time) and math.isfinite(wind)):
            raise ValueError("expected finite numbers")
        return time, wind

    def _number(self, cell: str) -> float:
        if not _NUMBER.fullmatch(cell):
            raise ValueError("expected two numbers")
        for sign in ".,":
            if sign in cell:
                # A comma between thousands would make wind of a thousandth.
                if self._decimal not in ("", sign):
                    raise ValueError("expected decimal points or decimal commas, not both")
                self._decimal = sign
        return float(cell.replace(",", "."))

    def _since_first(self, clock: str) -> float:
        try:
            moment = datetime.fromisoformat(clock)
            if self._first is None:
                self._first = moment
            return (moment - self._first).total_seconds()
        except (ValueError, TypeError):  # no such date, or one of two has a time zone
            raise ValueError(
                "expected a time in ISO 8601 such as 2024-01-31T13:00:00.5, of one time zone or none in every line"
            ) from None


def _seconds(time: float) -> str:
    return f"{time:.15g} s"


def _name(path: str | os.PathLike[str]) -> str:
    return one_line(os.fsdecode(path), 300)
