"""Rainflow counting (ASTM E1049-85, section 5.4.4) as compiled code: one pass over a series finds all of its cycles."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from flapgym.core.arrays import Array
from flapgym.plant import chosen_backend


def rainflow_cycles(series: Array) -> tuple[Array, Array]:
    """Ranges of the cycles of a series (T,) and their counts, 1/2 or 1, in the order in which they close.

    No binning. A series that only rises or only falls is half a cycle of its range.
    """
    values = np.ascontiguousarray(series, dtype=np.float64)
    ranges, counts = np.empty(values.size), np.empty(values.size)
    found = _counter()(values, np.empty(values.size), ranges, counts)
    return ranges[:found], counts[:found]


def get_ready() -> None:
    """Wait now for code that has to be compiled."""
    rainflow_cycles(np.zeros(1))


@cache
def _counter() -> Any:
    """`count_cycles`, compiled where the plant is, too."""
    if chosen_backend("auto") != "numba":
        return count_cycles
    # Loaded only here: numba takes longer than the rest of the package.
    from flapgym.core.kept import kept, run_kept

    compiled = kept(count_cycles)
    return lambda *arguments: run_kept(compiled, *arguments)


def count_cycles(series: Array, points: Array, ranges: Array, counts: Array) -> int:
    """Fill in ranges and counts of the cycles of a series, and return how many there are.

    Plain loops, to be compiled. The other arguments are as long as the series; `points` holds the turning points that
    no cycle has closed yet.
    """
    found, open_points, direction, last = 0, 1, 0, series[0]
    points[0] = last
    for place in range(1, series.size + 1):
        # Behind the last value the series turns once more: the end is a turning point.
        ends = place == series.size
        value = last if ends else series[place]
        if value == last and not ends:
            continue
        heading = 1 if value > last else -1
        if ends:
            heading = -direction
        if heading != direction and direction != 0:
            points[open_points] = last
            open_points += 1
            while open_points >= 3:
                newest = abs(points[open_points - 1] - points[open_points - 2])
                before = abs(points[open_points - 2] - points[open_points - 3])
                if newest < before:
                    break
                ranges[found] = before
                if open_points == 3:
                    # It begins where the history does: half a cycle, and the history now begins later.
                    counts[found] = 0.5
                    points[0], points[1] = points[1], points[2]
                    open_points = 2
                else:
                    counts[found] = 1.0
                    points[open_points - 3] = points[open_points - 1]
                    open_points -= 2
                found += 1
        direction, last = heading, value
    # What is left never closes.
    for place in range(open_points - 1):
        ranges[found], counts[found] = abs(points[place + 1] - points[place]), 0.5
        found += 1
    return found
