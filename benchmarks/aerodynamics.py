"""Convergence tables and Figure 8 of the vortex lattice: `python -m benchmarks.aerodynamics [--output DIR]`.

Prints the tables of docs/aerodynamics.md in Markdown and writes figure8.png. Two minutes and 0.7 GB on one core.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flapgym.aerodynamics import (
    Aerodynamics,
    build_aerodynamics,
    convected_gust_downwash,
    gust_downwash,
    mean_loads,
    root_moment_load,
    transfer_function,
)
from flapgym.aerodynamics.downwash import flap_downwash
from flapgym.aerodynamics.lattice import build_lattice
from flapgym.aerodynamics.model import assemble
from flapgym.aerodynamics.rotor import blade_edges, rotor_inflow, strip_radius, wake_rows
from flapgym.core.program import Parser, Work, run
from flapgym.evaluation import writable_folder
from flapgym.turbine import Case, load_case
from studies.document import Table
from studies.figures import draw_gust_loads
from studies.gust import gust_loads, steady_gains, variant
from studies.render import markdown_table

FREQUENCIES = np.array([0.0, 0.2, 1.0, 3.0, 5.0])
DEGREE = np.pi / 180.0
PUBLISHED_TIP_SPEED_RATIO = 12.1 * np.pi / 30.0 * 63.0 / 12.0  # 12 m/s, 12.1 rpm


def table(title: str, head: Iterable[str], rows: Iterable[Iterable[str]]) -> None:
    """Print a Markdown table."""
    print(f"\n{title}\n\n{markdown_table(Table(tuple(head), tuple(map(tuple, rows))))}")


def lattice_with(case: Case, strips: int, chordwise: int, time_step: float) -> Aerodynamics:
    """The case's rotor on other strips, panels and time step."""
    case = variant(case, time_step=time_step)
    ends, inflow = strip_radius(case), rotor_inflow(case, case.discretisation.induction)
    edges = blade_edges(case, np.linspace(ends[0], ends[-1], strips + 1))
    lattice = build_lattice(*edges, chordwise, inflow, time_step)
    density = case.operating_point.air_density
    rows = wake_rows(case)
    return assemble(lattice, inflow, time_step=time_step, wake_rows=rows, air_density=density, blades=3)


def responses(case: Case, aero: Aerodynamics) -> NDArray[np.complex128]:
    """Root moment per m/s of gust and per degree of flap at FREQUENCIES, shape (nf, 2) [MN m]."""
    z = np.exp(2j * np.pi * FREQUENCIES * aero.time_step)
    inputs = np.column_stack(
        [gust_downwash(aero).sum(axis=1), DEGREE * flap_downwash(aero, case.flaps[0])[0]]
    )
    return transfer_function(aero, 0, z, inputs, root_moment_load(aero, case))[:, 0] / 1e6


def discretisation_tables(case: Case) -> None:
    """Deviation of the collective root-moment response from the finest discretisation."""
    columns = [f"{name} {f:g} Hz" for name in ("gust", "flap") for f in FREQUENCIES]

    def study(title: str, variants: dict[str, tuple[int, int, float]]) -> None:
        values = {name: responses(case, lattice_with(case, *size)) for name, size in variants.items()}
        *_, finest = values.values()
        rows = [
            [
                name,
                *(
                    f"{100 * abs(v - f) / abs(f):.2f}"
                    for v, f in zip(value.T.ravel(), finest.T.ravel(), strict=True)
                ),
            ]
            for name, value in values.items()
        ]
        rows.append(["finest [MN m]", *(f"{abs(v):.4f}" for v in finest.T.ravel())])
        table(title, ["", *columns], rows)

    step = case.discretisation.time_step
    panels = {f"{nc} panels": (10, nc, 10 * step / nc) for nc in (10, 20, 30)}
    study("Chordwise panels, time step in proportion: deviation from the finest [%]", panels)
    steps = {f"{1e3 * s * step:.2f} ms": (10, 10, s * step) for s in (2.0, 1.0, 0.5, 0.25)}
    study("Time step at ten panels: deviation from the finest [%]", steps)
    strips = {f"{ns} strips": (ns, 10, step) for ns in (10, 20, 40)}
    study("Strips: deviation from the finest [%]", strips)


def wake_table(case: Case) -> None:
    """Gains, mean loads and coefficients by wake length and induction."""
    rows = []
    for length, induction in [
        (0.25, 0.0),
        (0.5, 0.0),
        (1.0, 0.0),
        (2.0, 0.0),
        (0.25, 0.3),
        (0.5, 0.3),
        (1.0, 0.3),
    ]:
        other = variant(case, wake_length=length, induction=induction)
        rotor = build_aerodynamics(other)
        gust, flap = steady_gains(other)
        alone = steady_gains(other, blades=1)[0]
        mean = mean_loads(other, rotor)
        point = replace(case.operating_point, tip_speed_ratio=PUBLISHED_TIP_SPEED_RATIO)
        faster = replace(other, operating_point=point)
        published = mean_loads(faster, build_aerodynamics(faster))
        rows.append(
            [
                f"{length:g}",
                f"{induction:g}",
                f"{gust / 1e6:.4f}",
                f"{flap * DEGREE / 1e6:.4f}",
                f"{gust / alone:.3f}",
                f"{mean.thrust / 1e3:.0f}",
                f"{mean.torque / 1e6:.2f}",
                f"{mean.root_moment / 1e6:.2f}",
                f"{published.thrust_coefficient:.3f}",
                f"{published.power_coefficient:.3f}",
            ]
        )
    head = ["length [D]", "induction", "gust [MN m s/m]", "flap [MN m/deg]", "full / single"]
    head += ["thrust [kN]", "torque [MN m]", "root moment [MN m]", "Ct, 12 m/s", "Cp, 12 m/s"]
    table(
        "Wake length and axial induction: steady gains, mean loads at 11 m/s, coefficients at 12 m/s",
        head,
        rows,
    )


def gust_table(case: Case) -> None:
    """Gust along the chord against gust at once."""
    aero = build_aerodynamics(case)
    frequency = np.array([0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0])
    z, load = np.exp(2j * np.pi * frequency * aero.time_step), root_moment_load(aero, case)
    at_once = transfer_function(aero, 0, z, gust_downwash(aero), load).sum(axis=2)[:, 0]
    convected = transfer_function(aero, 0, z, convected_gust_downwash(aero, z), load).sum(axis=2)[:, 0]
    rows = [
        [f"{f:g}", f"{abs(a) / 1e6:.3f}", f"{abs(c) / 1e6:.3f}", f"{100 * (abs(a / c) - 1):.1f}"]
        for f, a, c in zip(frequency, at_once, convected, strict=True)
    ]
    table(
        "Gust on all panels at once and along the chord", ["Hz", "at once", "convected", "excess [%]"], rows
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns the exit code."""
    return run(_parser(), arguments)


def _door(options: argparse.Namespace) -> Work:
    folder = writable_folder(options.output)

    def work() -> int:
        case = load_case("nrel5mw-rated")
        start = time.perf_counter()
        aero = build_aerodynamics(case)
        print(f"influence of the whole rotor: {time.perf_counter() - start:.2f} s")
        start = time.perf_counter()
        rng = np.random.default_rng(0)
        z = np.exp(2j * np.pi * np.arange(400) / 2048)
        load = rng.normal(size=(14, aero.force.shape[1]))
        transfer_function(aero, 1, z, rng.normal(size=(100, 19)), load)
        print(f"transfer function, 400 frequencies, 14 x 19 channels: {time.perf_counter() - start:.3f} s")
        discretisation_tables(case)
        wake_table(case)
        gust_table(case)
        draw_gust_loads(gust_loads(case), folder / "figure8.png")
        return 0

    return work


def _parser() -> argparse.ArgumentParser:
    parser = Parser(prog="python -m benchmarks.aerodynamics", description=(__doc__ or "").splitlines()[0])
    parser.set_defaults(door=_door, program="benchmarks.aerodynamics")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder for figure8.png")
    return parser


if __name__ == "__main__":
    sys.exit(main())
