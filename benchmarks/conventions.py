"""The picture of azimuth, blades and signs on the environments' page: `python -m benchmarks.conventions FOLDER`.

Writes conventions.png: the rotor from upwind, the turbine from its side, and a section of blade 1 from its tip.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flapgym.core.atomic import write_picture
from flapgym.core.multiblade import blade_azimuths
from flapgym.core.program import Parser, Work, run
from flapgym.evaluation import writable_folder

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, BLADE, FLAP, WIND, PALE = "#333333", "#0b5394", "#c1651c", "#3d85c6", "#b7b7b7"
SHOWN = np.deg2rad(35.0)
"""Azimuth of the picture."""
TEXT = 11


def front(axis: Axes) -> None:
    """The rotor as one sees it who stands upwind and looks downwind: it turns clockwise."""
    axis.set_title("from upwind", fontsize=TEXT + 1)
    axis.plot([0, 0], [0, -1.75], color=PALE, linewidth=7, solid_capstyle="butt", zorder=0)
    for blade, azimuth in enumerate(blade_azimuths(SHOWN), 1):
        tip = np.array([np.sin(azimuth), np.cos(azimuth)])
        axis.plot([0.0, tip[0]], [0.0, tip[1]], color=BLADE, linewidth=5, solid_capstyle="round")
        x, y = 1.14 * tip
        axis.text(x, y, str(blade), ha="center", va="center", color=BLADE, fontsize=TEXT + 3, weight="bold")
    axis.plot(0, 0, "o", color=INK, markersize=9)
    axis.plot([0, 0], [0, 1.12], color=INK, linestyle=":", linewidth=1.2)
    arc = np.linspace(0.0, SHOWN, 30)
    axis.plot(0.55 * np.sin(arc), 0.55 * np.cos(arc), color=INK, linewidth=1.2)
    axis.text(-0.08, 0.66, "azimuth", ha="right", fontsize=TEXT, color=INK)
    axis.text(-0.06, 1.16, "0", ha="center", fontsize=TEXT, color=INK)
    start, end = (
        (1.3 * float(np.sin(angle)), 1.3 * float(np.cos(angle))) for angle in np.deg2rad([80.0, 132.0])
    )
    _arrow(axis, start, end, INK, "arc3,rad=-0.28")
    axis.text(1.36, -0.08, "turns", fontsize=TEXT, color=INK)
    _arrow(axis, (-0.1, -0.4), (-0.6, -0.4), FLAP)
    axis.text(-0.66, -0.4, "tower top\nsideways +", ha="right", va="center", fontsize=TEXT, color=FLAP)
    axis.set(xlim=(-1.75, 1.85), ylim=(-1.8, 1.4))


def side(axis: Axes) -> None:
    """The turbine from its side, wind from the left."""
    axis.set_title("from the side", fontsize=TEXT + 1)
    axis.plot([0.25, 0.25], [-1.75, 0], color=PALE, linewidth=7, solid_capstyle="butt", zorder=0)
    axis.plot([-0.05, 0.42], [0, 0], color=PALE, linewidth=11, solid_capstyle="round", zorder=0)
    span = np.linspace(0.0, 1.0, 50)
    axis.plot(0 * span, span, color=BLADE, linewidth=1.2, linestyle=":")
    axis.plot(0.32 * span**2, span, color=BLADE, linewidth=5, solid_capstyle="round")
    axis.plot([0, 0], [0, -1.0], color=BLADE, linewidth=5, solid_capstyle="round")
    for height in (-0.55, 0.1, 0.75):
        _arrow(axis, (-1.25, height), (-0.6, height), WIND)
    axis.text(-1.25, 0.9, "wind +", fontsize=TEXT, color=WIND)
    _arrow(axis, (0.0, 1.14), (0.36, 1.14), FLAP)
    axis.text(0.42, 1.14, "tip deflection +", va="center", fontsize=TEXT, color=FLAP)
    _arrow(axis, (-0.24, 0.12), (0.26, 0.16), FLAP, "arc3,rad=-0.75")
    axis.text(0.32, 0.36, "root moment +", va="center", fontsize=TEXT, color=FLAP)
    _arrow(axis, (0.5, 0.0), (0.95, 0.0), FLAP)
    axis.text(1.01, -0.04, "tower top\ndownwind +", va="center", fontsize=TEXT, color=FLAP)
    axis.set(xlim=(-1.4, 1.9), ylim=(-1.8, 1.4))


def section(axis: Axes) -> None:
    """Blade 1, which points up, seen from its tip: the wind comes from above, the blade moves to the left."""
    axis.set_title("blade 1 from its tip", fontsize=TEXT + 1)
    chord = np.linspace(0.0, 0.9, 80)
    thickness = 0.42 * np.sqrt(chord) * (1.0 - chord)
    x = -1.0 + 2.0 * chord
    axis.fill_between(x, thickness, -thickness, color=BLADE, alpha=0.85, linewidth=0)
    hinge, half = (x[-1], 0.0), thickness[-1]
    for angle, alpha in ((0.0, 0.25), (np.deg2rad(28.0), 1.0)):
        tip = (hinge[0] + 0.55 * np.cos(angle), 0.55 * np.sin(angle))
        corners = [(hinge[0], half), tip, (hinge[0], -half)]
        axis.fill(*zip(*corners, strict=True), color=FLAP, alpha=alpha, linewidth=0)
    _arrow(axis, (1.42, 0.02), (1.32, 0.32), FLAP, "arc3,rad=0.25")
    axis.text(1.06, 0.5, "flap angle,\nrate, action +", ha="center", fontsize=TEXT, color=FLAP)
    for place in (-1.1, -0.65):
        _arrow(axis, (place, 1.2), (place, 0.7), WIND)
    axis.text(-0.55, 0.98, "wind, pressure side", va="center", fontsize=TEXT, color=WIND)
    _arrow(axis, (-0.4, -0.25), (-0.4, -0.85), INK)
    axis.text(-0.3, -0.68, "more lift,\ndownwind", va="center", fontsize=TEXT, color=INK)
    _arrow(axis, (-1.08, 0.0), (-1.6, 0.0), INK)
    axis.text(-1.62, 0.1, "turns", fontsize=TEXT, color=INK)
    axis.set(xlim=(-1.8, 1.8), ylim=(-1.8, 1.4))


def _arrow(
    axis: Axes, start: tuple[float, float], end: tuple[float, float], colour: str, bend: str = "arc3,rad=0"
) -> None:
    style = {
        "arrowstyle": "-|>",
        "color": colour,
        "linewidth": 1.8,
        "connectionstyle": bend,
        "mutation_scale": 14,
    }
    axis.annotate("", xy=end, xytext=start, arrowprops=style)


def draw(path: Path) -> None:
    """Write the picture."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 4.0), layout="constrained")
    for axis, picture in zip(figure.subplots(1, 3), (front, side, section), strict=True):
        picture(axis)
        axis.set_aspect("equal")
        axis.axis("off")
    write_picture(path, figure, dpi=110)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    folder = writable_folder(options.folder)

    def work() -> int:
        draw(folder / "conventions.png")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.conventions", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.conventions")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="for the picture, such as docs/figures")
    return parser


if __name__ == "__main__":
    sys.exit(main())
