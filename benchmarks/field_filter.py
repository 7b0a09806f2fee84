"""The picture of docs/control.md, a field and the filter for it: `python -m benchmarks.field_filter FOLDER`.

Writes field-filter.png, and says the largest error of the fit below 1 Hz, for the field of flapgym/NREL5MWSite-v0.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flapgym.control.field_lqg import field_met
from flapgym.core.arrays import Array
from flapgym.core.atomic import write_picture
from flapgym.core.program import Parser, Work, run
from flapgym.evaluation import writable_folder
from flapgym.model import TurbineModel, load_model
from flapgym.wind import Kaimal, blade_filter, component_filter
from flapgym.wind.field_filter import one_sided_spectrum

OURS, PALE = "#c1651c", "#b7b7b7"
FREQUENCY = np.linspace(0.0, 1.0, 1001)
TEXT = 15


def spectra(model: TurbineModel) -> dict[str, tuple[Array, Array]]:
    """One-sided spectra (F,) [m^2/s^2/Hz] of the effective wind and of its filter, by what meets it."""
    met = field_met(model, Kaimal(turbulence_class="B"))
    mean, cyclic = met.component_spectra(FREQUENCY)
    of_components = one_sided_spectrum(component_filter(met, model.time_step), FREQUENCY)
    (of_blade,) = one_sided_spectrum(blade_filter(met, model.time_step), FREQUENCY)
    return {
        "collective component": (mean, of_components[0]),
        "cosine or sine component": (cyclic, of_components[1]),
        "one blade": (met.blade_spectrum(FREQUENCY), of_blade),
    }


def draw(found: dict[str, tuple[Array, Array]], turn: float, path: Path) -> None:
    """The three, each with the rotor's speed and its multiples."""
    from matplotlib.figure import Figure  # takes long to import

    figure = Figure(figsize=(15.0, 5.0), layout="constrained")
    axes = figure.subplots(1, len(found), sharey=True)
    for axis, (name, (exact, fitted)) in zip(axes, found.items(), strict=True):
        axis.semilogy(FREQUENCY, exact, color=PALE, linewidth=6.0, label="the field")
        axis.semilogy(FREQUENCY, fitted, color=OURS, linewidth=1.5, label="the filter")
        for times in range(1, 6):
            axis.axvline(times * turn, color=PALE, linewidth=0.8, zorder=0)
            place = axis.get_xaxis_transform()
            axis.text(times * turn, 1.02, f"{times}P", transform=place, ha="center", fontsize=TEXT - 3)
        axis.set_xlabel(f"{name}: frequency [Hz]", fontsize=TEXT)
        axis.tick_params(labelsize=TEXT - 1)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel(r"spectrum [m$^2$/s$^2$/Hz]", fontsize=TEXT)
    axes[0].legend(loc="upper right", fontsize=TEXT, frameon=False)
    write_picture(path, figure, dpi=80)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    folder = writable_folder(options.folder)

    def work() -> int:
        model = load_model("nrel5mw-site")
        found = spectra(model)
        draw(found, model.rotor_speed / (2.0 * np.pi), folder / "field-filter.png")
        for name, (exact, fitted) in found.items():
            print(f"{name}: {np.abs(10.0 * np.log10(fitted / exact)).max():.2f} dB at most")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.field_filter", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.field_filter")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="for the picture, such as docs/figures")
    return parser


if __name__ == "__main__":
    sys.exit(main())
