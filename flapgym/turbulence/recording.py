"""Recorded wind series in CSV files: a header with units, then one sample a line.

    time [s], wind [m/s]
    0.0, 11.3
    0.5, 11.1

Units are those of case files: s, ms, min or h, and m/s, km/h or kn. The second column may be called
`wind_perturbation` instead: about the mean wind. Lines that begin with # are comments.
"""

from __future__ import annotations

import csv
import math
import os
import re
from dataclasses import dataclass

import numpy as np

from flapgym.state_space import Array
from flapgym.turbine.units import unit_size

_COLUMN = re.compile(r"\s*(\w+)\s*\[([^\]]*)\]\s*")
_DIMENSIONS = {"time": "time", "wind": "speed", "wind_perturbation": "speed"}
_EXAMPLE = '"time [s], wind [m/s]"'


@dataclass(frozen=True, eq=False)
class WindSeries:
    """A recording.

    Attributes
    ----------
    time : (t,) float
        Increasing [s].
    wind : (t,) float
        [m/s].
    perturbation : bool
        Whether `wind` is about the mean wind, or the wind itself.
    """

    time: Array
    wind: Array
    perturbation: bool


def read_wind(path: str | os.PathLike[str]) -> WindSeries:
    """Read a wind recording.

    Raises
    ------
    ValueError
        If the file is missing or holds anything else; the message names file, line and what is expected there.
    """
    times: list[float] = []
    winds: list[float] = []
    order: tuple[str, str] | None = None
    sizes = (1.0, 1.0)
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(file, skipinitialspace=True)
            for row in rows:
                if not any(cell.strip() for cell in row) or row[0].lstrip().startswith("#"):
                    continue
                place = f"{path}, line {rows.line_num}"
                if order is None:
                    order, sizes = _header(row, place)
                    continue
                values = dict(zip(order, _numbers(row, place), strict=True))
                time = sizes[0] * values.pop("time")
                if times and not time > times[-1]:
                    raise ValueError(
                        f"{place}: expected times that increase, got {time:g} s after {times[-1]:g} s"
                    )
                times.append(time)
                winds.append(sizes[1] * next(iter(values.values())))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror}); give the path of a CSV file") from None
    except csv.Error as error:
        raise ValueError(
            f"{path}, line {rows.line_num}: not a table ({error}); expected CSV that begins with {_EXAMPLE}"
        ) from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a text file; expected CSV that begins with {_EXAMPLE}") from None
    if order is None or len(times) < 2:
        raise ValueError(f"{path}: expected a header {_EXAMPLE} and at least two samples, got {len(times)}")
    return WindSeries(np.array(times), np.array(winds), "wind_perturbation" in order)


def _header(row: list[str], place: str) -> tuple[tuple[str, str], tuple[float, float]]:
    """Names of the two columns in their order, and the sizes of the units of time and wind."""
    found: dict[str, float] = {}
    for cell in row:
        match = _COLUMN.fullmatch(cell)
        if match is None or match[1] not in _DIMENSIONS:
            raise ValueError(
                f"{place}: expected a header of two columns with units, {_EXAMPLE} or with wind_perturbation [m/s], "
                f"got {cell.strip()!r}"
            )
        found[match[1]] = unit_size(_DIMENSIONS[match[1]], match[2], f"{place}: column {match[1]}")
    names = tuple(found)
    if len(row) != 2 or len(names) != 2 or "time" not in found:
        raise ValueError(f"{place}: expected two columns, {_EXAMPLE}, got {', '.join(map(str.strip, row))}")
    wind = next(name for name in names if name != "time")
    return (names[0], names[1]), (found["time"], found[wind])


def _numbers(row: list[str], place: str) -> tuple[float, float]:
    """Both values of a sample."""
    try:
        first, second = (float(cell) for cell in row)
    except ValueError:
        raise ValueError(
            f"{place}: expected two numbers separated by a comma, got {', '.join(row)!r}"
        ) from None
    if not (math.isfinite(first) and math.isfinite(second)):
        raise ValueError(f"{place}: expected finite numbers, got {', '.join(row)!r}")
    return first, second
