"""Drawing of the parked turbine's mode shapes, as the paper's Figure 9; matplotlib is loaded only when it is called."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.core.atomic import write_picture
from flapgym.structure.blade import blade_beam
from flapgym.structure.modes import Mode, named_modes
from flapgym.structure.rotation import about_x
from flapgym.structure.support import LinearSupport, linear_support
from flapgym.turbine import Turbine

SWING = 0.24
"""Largest drawn displacement over the rotor radius."""
MARGIN = 0.03
"""Room left about the turbine in all its modes, over the rotor radius."""


def turbine_lines(turbine: Turbine, elements: int, mode: Mode | None = None) -> list[AnyArray]:
    """Tower, shaft and blades as lines (points, 3) [m] in the tower frame, at rest or swung out in a parked mode."""
    support, reference = linear_support(turbine), blade_beam(turbine, elements).reference
    size = 6 * elements
    shape = np.zeros(3 * size + support.mass.shape[0]) if mode is None else mode.shape
    tower, hub = support.tower_position, support.hub @ shape[3 * size :]
    lines, moves = [tower], [_tower_motion(support, shape[3 * size :])]
    link = np.array([tower[-1], support.apex])
    lines.append(link)
    moves.append(np.array([moves[0][-1], support.shaft_axes @ hub[:3]]))
    for index in range(turbine.rotor.blade_count):
        turn = about_x(2.0 * np.pi * index / turbine.rotor.blade_count)
        own = np.vstack([np.zeros(3), shape[index * size : (index + 1) * size].reshape(-1, 6)[:, :3]])
        points = reference.position @ turn.T
        moved = own @ turn.T + hub[:3] + np.cross(hub[3:], points)
        lines.append(support.apex + points @ support.shaft_axes.T)
        moves.append(moved @ support.shaft_axes.T)
    largest = max(float(np.abs(move).max()) for move in moves)
    scale = 0.0 if mode is None else SWING * turbine.rotor.radius / largest
    return [line + scale * move for line, move in zip(lines, moves, strict=True)]


def _tower_motion(support: LinearSupport, shape: AnyArray) -> AnyArray:
    free = shape[: 6 * (len(support.tower_position) - 1)].reshape(-1, 6)[:, :3]
    return np.vstack([np.zeros(3), free])


def box(turbine: Turbine, lines: list[AnyArray]) -> AnyArray:
    """Least and largest x, y and z, (2, 3) [m], of a box that holds the lines and stands on the ground."""
    points, room = np.vstack(lines), MARGIN * turbine.rotor.radius
    ends = np.array([points.min(axis=0) - room, points.max(axis=0) + room])
    ends[0, 2] = min(0.0, float(points[:, 2].min()))
    return ends


def plot_modes(turbine: Turbine, path: Path, elements: int) -> None:
    """Draw the first twelve modes, by frequency, of the parked turbine and write the picture to `path`."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    modes = sorted(named_modes(turbine, elements), key=lambda mode: mode.frequency)[:12]
    figure = Figure(figsize=(11.0, 13.0), layout="constrained")
    rest = turbine_lines(turbine, elements)
    swung = [turbine_lines(turbine, elements, mode) for mode in modes]
    # One box for all pictures, so that they compare.
    low, high = box(turbine, [*rest, *(line for lines in swung for line in lines)])
    for index, mode in enumerate(modes):
        axes: Any = figure.add_subplot(4, 3, index + 1, projection="3d")
        for line in rest:
            axes.plot(*line.T, color="0.75", linewidth=1.0)
        for line in swung[index]:
            axes.plot(*line.T, color="tab:blue", linewidth=2.0)
        axes.set_title(f"{mode.name}\n{mode.frequency:.3f} Hz", fontsize=9, pad=0.0)
        axes.set_box_aspect(high - low)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        for axis, bins in ((axes.xaxis, 2), (axes.yaxis, 4), (axes.zaxis, 4)):
            axis.set_major_locator(MaxNLocator(bins))
        axes.view_init(elev=12.0, azim=-125.0)
    title = f"{turbine.name}, parked, {elements} elements a blade: wind from the left, lengths in m"
    figure.suptitle(title, parse_math=False)  # a name may hold a dollar
    write_picture(path, figure, dpi=80)
