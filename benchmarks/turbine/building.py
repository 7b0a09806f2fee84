"""What models of other cases are like and what they cost: `python -m benchmarks.turbine.building [PART ...]`.

Prints what docs/turbine.md says of forms, unequal blades, flutter and building in Markdown. Every case is built in a
process of its own, so that processor time and memory are its alone. All parts take some five minutes on an idle core.
For one core: OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.aerodynamics import table
from benchmarks.turbine.accuracy import AZIMUTH, OUTPUTS, STEPS, errors, on_blades, signals, time_invariant
from flapgym.aeroelastic.build import build_model
from flapgym.aeroelastic.equations import periodic_equations
from flapgym.aeroelastic.flutter import find_flutter
from flapgym.aeroelastic.periodic import step_matrices
from flapgym.core.arrays import Array
from flapgym.core.units import DEGREE
from flapgym.model import TurbineModel, load_model, save_model
from flapgym.model.harmonics import simulate_periodic
from flapgym.model.reduced import reduced_model
from flapgym.turbine import Case, load_case
from reference.floquet import floquet_multipliers
from studies.parts import Study

CASE = load_case("nrel5mw-rated")
REVOLUTIONS = 60
"""After which the tower's answer to the imbalance is steady, its own modes being damped by 1 % and more."""


@dataclass(frozen=True, eq=False)
class Built:
    """A model, and the processor time [s] and the most memory [GB] its process took, flutter included."""

    model: TurbineModel
    seconds: float
    memory: float


def built(case: Case) -> Built:
    """Build a case and look for its flutter, as `flapgym build` does."""
    begin = time.process_time()
    model = build_model(case)
    model = replace(model, record=replace(model.record, flutter=find_flutter(case.of_mean_blade())))
    unit = 1.0 if sys.platform == "darwin" else 1024.0
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9
    return Built(model, time.process_time() - begin, memory)


def builds(cases: Iterable[Case]) -> list[Built]:
    """One process after the other, each its own."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn, max_tasks_per_child=1) as pool:
        return list(pool.map(built, cases))


def third_blades() -> dict[str, Case]:
    """The shipped case with a third blade, or all three, unlike the others."""
    heavy, pitched = (1.0, 1.0, 1.02), (0.0, 0.0, 0.3 * DEGREE)
    changes = {
        "flap at half effect": {"flap_effectiveness": (1.0, 1.0, 0.5)},
        "2 % heavier": {"mass_factor": heavy},
        "pitched by 0.3 deg": {"pitch_offset": pitched},
        "all four, three different blades": {
            "mass_factor": heavy,
            "stiffness_factor": (1.0, 0.97, 1.0),
            "flap_effectiveness": (1.0, 0.5, 1.0),
            "pitch_offset": (-0.3 * DEGREE, 0.0, 0.3 * DEGREE),
        },
    }
    return {name: replace(CASE, blades=replace(CASE.blades, **change)) for name, change in changes.items()}


def sway(model: TurbineModel) -> Array:
    """Amplitudes (2,) [m], once a revolution, of the tower's top downwind and sideways by the blades' imbalance."""
    assert model.periodic is not None
    steps = round(2.0 * np.pi / (model.rotor_speed * model.time_step))
    azimuth = np.asarray(model.rotor_speed * model.time_step * np.arange(REVOLUTIONS * steps), dtype=float)
    y = simulate_periodic(model.turbine, model.periodic, np.zeros((len(azimuth), 7)), azimuth)[-steps:, 6:]
    return np.asarray(np.abs(2.0 * np.exp(-1j * azimuth[-steps:]) @ y / steps))


def unequal() -> None:
    """Unequal blades."""
    cases, rows = third_blades(), []
    for name, of in zip(cases, builds(cases.values()), strict=True):
        assert of.model.periodic is not None
        with tempfile.TemporaryDirectory() as folder:
            save_model(of.model, Path(folder) / "model")
            size = (Path(folder) / "model").stat().st_size
        top = 1e3 * sway(of.model)
        rows.append(
            [
                name,
                f"{of.model.periodic.harmonics}",
                f"{of.model.periodic.rank}",
                f"{size / 1e6:.1f} MB",
                f"{of.seconds:.0f} s",
                f"{of.memory:.1f} GB",
                f"{np.abs(floquet_multipliers(of.model)).max():.4f}",
                f"{top[0]:.1f}, {top[1]:.1f} mm",
            ]
        )
    head = ["third blade", "harmonics", "rank", "file", "CPU", "memory", "largest multiplier"]
    table("Unequal blades", [*head, "tower top downwind, sideways"], rows)


def flutter() -> None:
    """Flutter with the centres of gravity further aft, by a share of the chord, and with the published axis."""
    turbine, rows = CASE.turbine, []
    sections, planform = turbine.blade_sections_12, turbine.planform
    chord = np.interp(sections.radius, planform.radius, planform.chord)
    for share in (0.0, 0.1, 0.2):
        aft = replace(sections, centre_of_gravity_offset=sections.centre_of_gravity_offset + share * chord)
        case = replace(CASE, turbine=replace(turbine, blade_sections_12=aft))
        rows.append([f"{share:.0%}", find_flutter(case).describe()])
    rows.append(["the corrected turbine: 0%", find_flutter(load_case("nrel5mw-corrected")).describe()])
    table("Flutter", ["centres of gravity further aft", "flutter"], rows)


def other_cases() -> dict[str, Case]:
    """Other operating points, flaps and steps of time."""
    point, flap, grid = CASE.operating_point, CASE.flaps[0], CASE.discretisation
    return {
        "the paper's reading": CASE,
        "the corrected turbine": load_case("nrel5mw-corrected"),
        "5 m/s": replace(CASE, operating_point=replace(point, wind_speed=5.0)),
        "8 m/s, flap of 20 % chord on 0.5 to 0.9 of the span": replace(
            CASE,
            operating_point=replace(point, wind_speed=8.0),
            flaps=(replace(flap, chord_fraction=0.2, span_start=0.5),),
        ),
        "15 m/s, tip-speed ratio 5.32, pitch 10.45 deg": replace(
            CASE,
            operating_point=replace(point, wind_speed=15.0, tip_speed_ratio=5.32, pitch=10.45 * DEGREE),
        ),
        "11 m/s, tip-speed ratio 8, time step 10 ms": replace(
            CASE,
            operating_point=replace(point, tip_speed_ratio=8.0),
            discretisation=replace(grid, time_step=0.01),
        ),
    }


def building() -> None:
    """Cost and steady gains."""
    cases, rows = other_cases(), []
    for name, of in zip(cases, builds(cases.values()), strict=True):
        gain = of.model.turbine.dc_gain()[0] / 1e6
        rows.append(
            [
                name,
                f"{of.seconds:.0f} s",
                f"{of.memory:.1f} GB",
                f"{gain[6]:.3f}, {gain[0] * DEGREE:.3f}",
            ]
        )
    table("Building", ["case", "CPU", "memory", "root moment per m/s, per deg of flap [MN m]"], rows)


def newmark_gap(study: Study, steps: int) -> dict[str, list[float]]:
    """Rms difference by input of the time-invariant form from A(theta) at its exact azimuths, over rms, by output."""
    still, equations, lattice = time_invariant(study), periodic_equations(study.parts), study.seen(0.0)
    dt, speed = study.time_step, study.case.rotor_speed
    inputs = signals(study, steps)
    x = {name: np.zeros(still.order) for name in inputs}
    y = {name: np.empty((steps, len(still.outputs))) for name in inputs}
    for n in range(steps):
        A, B, C, D = step_matrices(equations, lattice, dt, AZIMUTH + n * speed * dt, speed * dt)
        for name, u in inputs.items():
            y[name][n] = C @ x[name] + D @ u[n]
            x[name] = A @ x[name] + B @ u[n]
    return {name: errors(on_blades(still, u, speed), y[name]) for name, u in inputs.items()}


def forms() -> None:
    """What Newmark's rule in other coordinates and a second reduction change."""
    study = Study(CASE)
    rows = [
        [name, *(f"{100.0 * error:.4f}" for error in gap)] for name, gap in newmark_gap(study, STEPS).items()
    ]
    table("Time-invariant form against A(theta) at exact azimuths, rms [%]", ["inputs", *OUTPUTS], rows)
    model, rows = load_model("nrel5mw-rated"), []
    for tolerance in (0.01, 0.001):
        small = reduced_model(model, tolerance)
        error = small.record.errors["turbine reduced as a whole"]
        rows.append([f"{tolerance:.1%}", f"{small.turbine.order}", f"{error:.3%}"])
    table("Reduced once more as a whole", ["tolerance", "states", "worst output's error"], rows)


PARTS = {"forms": forms, "unequal": unequal, "flutter": flutter, "building": building}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the parts asked for; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="benchmarks.turbine.building", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)} (default: all)")
    options = parser.parse_args(arguments)
    unknown = [part for part in options.parts if part not in PARTS]
    if unknown:
        parser.error(f"no part {unknown[0]!r}; there are {', '.join(PARTS)}")
    for part in options.parts or PARTS:
        PARTS[part]()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
