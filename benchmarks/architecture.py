"""The picture and the worked examples of docs/architecture.md: `python -m benchmarks.architecture FOLDER`.

Writes figures/architecture.png, and puts the programs of the folder `examples` into the page. The picture's arrows are
imports that the source code has; `tests/docs/test_architecture.py` holds them to it, and to saying all of them: what a
folder imports is reached by going its arrows backwards.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from benchmarks.page import fill
from flapgym.core.atomic import write_atomically, write_picture
from flapgym.core.program import Parser, Work, run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, BUILD, RUN, FILE, PALE = "#222222", "#dbe8f5", "#e2efda", "#fff2cc", "#eeeeee"
WIDE, HIGH = 0.88, 0.64
"""Of a box, where the next one stands at a distance of one."""


class Box(NamedTuple):
    """A folder, or a file between two of them: column and row of its place, what it is, and its colour."""

    column: int
    row: int
    what: str
    colour: str


BOXES = {
    "case.toml": Box(0, 1, "numbers, sources", FILE),
    "turbine": Box(1, 1, "machine and case", BUILD),
    "structure": Box(0, 2, "beams, modes", BUILD),
    "aerodynamics": Box(1, 2, "vortex lattice", BUILD),
    "reduction": Box(2, 2, "fewer states", BUILD),
    "aeroelastic": Box(1, 3, "joins and builds", BUILD),
    "wind": Box(2, 3, "turbulence, gusts", RUN),
    "model file": Box(0, 4, "matrices", FILE),
    "model": Box(1, 4, "what all others load", RUN),
    "plant": Box(2, 4, "the fast step", RUN),
    "control": Box(0, 5, "agents, design", RUN),
    "wrappers": Box(1, 5, "other actions", RUN),
    "envs": Box(2, 5, "task and episode", RUN),
    "table": Box(0, 6, "text, JSON, figure", FILE),
    "evaluation": Box(1, 6, "the same wind for all", RUN),
    "adapters": Box(2, 6, "other libraries", RUN),
    "cli": Box(1, 7, "the command", RUN),
}
WAY = (
    ("case.toml", "turbine"),
    ("turbine", "structure"),
    ("turbine", "aerodynamics"),
    ("structure", "aeroelastic"),
    ("aerodynamics", "aeroelastic"),
    ("reduction", "aeroelastic"),
    ("aeroelastic", "model file"),
    ("model file", "model"),
    ("model", "plant"),
    ("wind", "plant"),
    ("plant", "envs"),
    ("envs", "evaluation"),
    ("evaluation", "table"),
)
"""From the data to the table, drawn bold; between two folders each is an import, the first by the second."""
BESIDE = (
    ("wind", "aeroelastic"),
    ("model", "control"),
    ("control", "wrappers"),
    ("control", "evaluation"),
    ("envs", "wrappers"),
    ("envs", "adapters"),
    ("evaluation", "cli"),
)
"""Further imports, drawn thin."""
STRIPS = {
    0: ("core", "what every folder stands on"),
    8: ("beside the package", "reference, studies, baselines, benchmarks, train"),
}


def draw(path: Path) -> None:
    """Write the picture."""
    from matplotlib.figure import Figure

    # Large letters on few inches: a telephone shows it a third as wide.
    figure = Figure(figsize=(8.0, 8.4))
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    for row, (name, what) in STRIPS.items():
        _box(axis, 1.0, row, 2.0 + WIDE, name, what, PALE)
    for name, box in BOXES.items():
        _box(axis, box.column, box.row, WIDE, name, box.what, box.colour)
    for arrows, width, colour in ((BESIDE, 1.4, "#777777"), (WAY, 3.2, INK)):
        for start, end in arrows:
            _arrow(axis, BOXES[start], BOXES[end], width, colour)
    axis.set(xlim=(-0.5, 2.5), ylim=(8.5, -0.5))
    axis.axis("off")
    write_picture(path, figure, dpi=160)


def _box(axis: Axes, x: float, y: float, width: float, name: str, what: str, colour: str) -> None:
    from matplotlib.patches import FancyBboxPatch

    edge = "#999999" if colour == FILE else INK
    corner = (x - 0.5 * width + 0.03, y - 0.5 * HIGH + 0.03)
    patch = FancyBboxPatch(corner, width - 0.06, HIGH - 0.06, "round,pad=0.03,rounding_size=0.07")
    patch.set(facecolor=colour, edgecolor=edge, linewidth=1.2, linestyle="--" if colour == FILE else "-")
    axis.add_patch(patch)
    axis.text(x, y - 0.12, name, ha="center", va="center", fontsize=19, weight="bold", color=INK)
    axis.text(x, y + 0.17, what, ha="center", va="center", fontsize=14.5, color=INK)


def _arrow(axis: Axes, start: Box, end: Box, width: float, colour: str) -> None:
    """From the side of a box that faces the other to the side that faces it."""
    across, down = end.column - start.column, end.row - start.row
    if down:
        shift = 0.26 * across
        tail = (start.column + shift, start.row + 0.5 * HIGH)
        head = (end.column - shift, end.row - 0.5 * HIGH)
    else:
        side = 0.5 * WIDE * across
        tail, head = (start.column + side, start.row), (end.column - side, end.row)
    style = {"arrowstyle": "-|>", "color": colour, "linewidth": width, "mutation_scale": 20}
    axis.annotate("", xy=head, xytext=tail, arrowprops={**style, "shrinkA": 0.0, "shrinkB": 0.0})


def filled(page: str, examples: Path) -> str:
    """The page with each program of a folder between the marks of its name."""
    code = {path.stem: path.read_text(encoding="utf-8") for path in examples.glob("*.py")}
    return fill(page, {name: f"```python\n{text}```" for name, text in code.items()})


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    folder, page = options.folder, options.folder / "architecture.md"
    if not page.is_file():
        raise ValueError(f"folder: expected one that holds architecture.md, such as docs, got {folder}")

    def work() -> int:
        draw(folder / "figures" / "architecture.png")
        text = filled(page.read_text(encoding="utf-8"), folder / "examples")
        write_atomically(page, text.encode())
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.architecture", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.architecture")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="of the documentation, such as docs")
    return parser


if __name__ == "__main__":
    sys.exit(main())
