"""Error bands and Figure 12 of the reduced vortex lattice: `python -m benchmarks.reduction [--output DIR]`.

Prints the table of docs/reduction.md in Markdown and writes figure12.png. Half a minute and 0.8 GB on one core.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flapgym.aerodynamics import Aerodynamics, transfer_function
from flapgym.aeroelastic.blade_lattice import BladeLattice, blade_lattice, reduce_component
from flapgym.aeroelastic.equations import root_moment
from flapgym.aeroelastic.trim import trim
from flapgym.core.program import Parser, Work, run
from flapgym.evaluation import writable_folder
from flapgym.reduction import ReducedSystem, normal_modes
from flapgym.structure import LinearBlade
from flapgym.turbine import Case, load_case
from flapgym.wind import von_karman_spectrum
from studies.figures import draw_hankel_values
from studies.hankel import TOTALS, reduced_states, rotor_values

FREQUENCY = np.linspace(0.01, 10.0, 600)  # Hz
BAND = FREQUENCY < 3.0  # where the lattice is independent of its discretisation
FIRST_MODES = 6


def errors(
    case: Case, aero: Aerodynamics, lattice: BladeLattice, blade: LinearBlade, component: int
) -> tuple[list[list[str]], NDArray[np.float64]]:
    """Rows of the table for one cyclic component, and its Hankel singular values over the largest."""
    wind, turbulence = case.operating_point.wind_speed, case.turbulence
    spectrum = von_karman_spectrum(FREQUENCY, wind, turbulence.intensity, turbulence.length_scale)

    def rms(response: NDArray[np.complex128]) -> NDArray[np.float64]:
        return np.sqrt(np.trapezoid(np.abs(response) ** 2 * spectrum[:, None], FREQUENCY, axis=0))

    z = np.exp(2j * np.pi * FREQUENCY * aero.time_step)
    full = transfer_function(aero, component, z, lattice.downwash, lattice.load)
    gust, flap = lattice.select("gust").sum(axis=1), lattice.select("flap_angle")[:, 0]
    root, modes = root_moment(blade, lattice.modes)[0], slice(0, FIRST_MODES)
    rows = []
    for total in TOTALS:
        start = time.perf_counter()
        reduced: ReducedSystem = reduce_component(aero, lattice, component, reduced_states(total))
        seconds = time.perf_counter() - start
        error = reduced.transfer_function(z) - full
        by_flap = np.abs(root @ (error @ flap)[BAND].T) / np.abs(root @ (full @ flap)[BAND].T)
        damping = np.linalg.norm(error[BAND, modes, modes], axis=(1, 2))
        damping /= np.linalg.norm(full[BAND, modes, modes], axis=(1, 2))
        figures = (
            (rms((error @ gust) @ root[:, None]) / rms((full @ gust) @ root[:, None])).item(),
            float((rms(error @ gust)[modes] / rms(full @ gust)[modes]).max()),
            float(by_flap.max()),
            float(damping.max()),
        )
        name = f"{total} ({reduced_states(total)})"
        radius = np.abs(np.linalg.eigvals(reduced.A)).max()
        rows.append([name, *(f"{100 * value:.2g}" for value in figures), f"{radius:.4f}", f"{seconds:.1f}"])
    values = reduced.hankel_singular_values
    return rows, values


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    folder = writable_folder(options.output)

    def work() -> int:
        case = load_case("nrel5mw-rated")
        balance = trim(case)
        _, shape = normal_modes(balance.blade.mass, balance.blade.stiffness, case.reduction.blade_modes)
        lattice = blade_lattice(case, balance.rotor, balance.blade, shape)
        head = ["states", "RBM, gust [%]", f"modal forces 1 to {FIRST_MODES}, gust [%]", "RBM, flap [%]"]
        head += ["modal forces, mode rates [%]", "spectral radius", "seconds"]
        values = []
        for component, name in enumerate(("collective", "whirl")):
            rows, component_values = errors(case, balance.rotor, lattice, balance.blade, component)
            values.append(component_values)
            print(f"\n{name}\n\n| {' | '.join(head)} |\n|{'---|' * len(head)}")
            print("\n".join(f"| {' | '.join(row)} |" for row in rows))
        collective, whirl = values
        combined = rotor_values(collective, whirl)
        draw_hankel_values(combined, folder / "figure12.png")
        for states in TOTALS:
            print(
                f"Hankel singular value number {states} over the first: {combined[states - 1] / combined[0]:.2g}"
            )
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.reduction", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.reduction")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder for figure12.png")
    return parser


if __name__ == "__main__":
    sys.exit(main())
