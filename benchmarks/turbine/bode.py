"""Figures 10, 13 and 14: gust to flapwise tip deflection of one blade at a frozen azimuth, blade 1 up.

"Stationary" is read as a joint frozen at an azimuth while inflow and wake turn. Decibels are of 1 m per m/s; the
paper's are of its own gust input, whose unit it does not give.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.aerodynamics import table
from benchmarks.reduction import TOTALS, reduced_states
from benchmarks.turbine.study import Study, Tell, pyplot, reduce_rotor, with_modes, with_tower
from flapgym.aeroelastic.blade_lattice import blade_lattice
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.aeroelastic.design import clamped_rotor, frozen_turbine
from flapgym.aeroelastic.equations import Parts, periodic_equations
from flapgym.aeroelastic.trim import deflected_lattice
from flapgym.core.arrays import ComplexArray
from flapgym.core.atomic import write_picture
from flapgym.core.state_space import StateSpace
from flapgym.reduction import normal_modes
from flapgym.structure import linear_blade, linear_support
from reference.exact import harmonic_response

Curves = Mapping[str, ComplexArray]

# Finer where lightly damped modes of tower and drivetrain make narrow marks [Hz].
FREQUENCY = np.unique(
    np.concatenate([np.geomspace(0.1, 10.0, 500), np.arange(0.15, 0.4, 0.0025), np.arange(0.55, 0.75, 0.001)])
)
BANDS = ((0.1, 1.0), (1.0, 3.0), (3.0, 10.0))
# Around the towers' first modes, the drivetrain and first flapwise ones, the towers' second ones.
TOWER_BANDS = ((0.1, 0.5), (0.5, 0.8), (1.5, 1.9), (2.8, 3.1))
PEAK = (0.5, 1.0)  # where the first peak stands
SOFTER = 3.0
FEW_MODES = (7, 5)  # of each blade, the paper's 20 for three; of the tower
ALL_MODES = (72, 66)


def tip(system: StateSpace, blade: int = 1) -> ComplexArray:
    """Tip deflection of one blade per homogeneous gust at FREQUENCY [m per m/s]."""
    felt = system.select(inputs=["wind"], outputs=[f"tip_deflection_{blade}"])
    return felt.frequency_response(FREQUENCY)[:, 0, 0]


def full_tip(parts: Parts, study: Study) -> ComplexArray:
    """The same with every state of the lattice."""
    equations = periodic_equations(parts)(0.0)
    response = harmonic_response(equations, study.rotor, parts.lattice, FREQUENCY)
    return response[:, equations.outputs.index("tip_deflection_1"), equations.inputs.index("wind")]


def parked_tip(study: Study) -> ComplexArray:
    """The same of a rotor that neither turns nor feels its own motion in the air, under the same gust loads."""
    case = study.case
    blade = linear_blade(case.turbine, case.discretisation.blade_elements, 0.0, case.operating_point.pitch)
    frequency, shape = normal_modes(blade.mass, blade.stiffness, case.reduction.blade_modes)
    rotor = deflected_lattice(case, blade, blades=3)
    lattice = blade_lattice(case, rotor, blade, shape)
    parts = Parts(case, blade, linear_support(case.turbine), frequency, shape, lattice)
    equations = replace(periodic_equations(parts), rotor_speed=0.0)(0.0)
    asks = equations.lattice_input
    deaf = replace(asks, position=0.0 * asks.position, velocity=0.0 * asks.velocity)
    response = harmonic_response(replace(equations, lattice_input=deaf), rotor, lattice, FREQUENCY)
    return response[:, equations.outputs.index("tip_deflection_1"), equations.inputs.index("wind")]


def decibel(response: ComplexArray) -> NDArray[np.float64]:
    """Of 1 m per m/s."""
    return np.asarray(20.0 * np.log10(np.abs(response)))


def figure10(study: Study, output: Path, tell: Tell) -> None:
    """Rigid, NREL and three times softer tower, and the parked structure beside them."""
    tell("Figure 10: reduced lattice")
    aerodynamics = study.seen(0.0)
    tell("Figure 10: towers")
    curves = on_towers(study)
    own = frozen_turbine(study.parts, aerodynamics, 0.0)
    parked = parked_tip(study)
    others = {f"NREL tower, blade {blade}": tip(own, blade) for blade in (2, 3)}
    rigid = curves["rigid tower"]
    compared = {name: response for name, response in (curves | others).items() if response is not rigid}
    rows = [[name, *tower_marks(response, rigid)] for name, response in compared.items()]
    head = [f"{low:g} to {high:g} Hz" for low, high in TOWER_BANDS]
    table("Figure 10: tip per gust over that on a rigid tower, largest change [dB]", ["", *head], rows)
    peaks = resonances(parked)
    print(
        "\nParked, windless peaks: "
        + ", ".join(f"{FREQUENCY[i]:.3f} Hz ({decibel(parked)[i]:+.0f} dB)" for i in peaks)
    )
    draw(
        curves | {"NREL tower, parked and windless": parked},
        output / f"figure10.{study.picture}",
        "Gust to tip deflection by tower",
    )


def on_towers(study: Study) -> dict[str, ComplexArray]:
    """Tip per gust on the three towers of Figure 10, the rigid one first."""
    aerodynamics = study.seen(0.0)
    softer = with_tower(study.parts, 1.0 / SOFTER)
    return {
        "rigid tower": tip(clamped_rotor(study.parts, aerodynamics)),
        "NREL tower": tip(frozen_turbine(study.parts, aerodynamics, 0.0)),
        "tower three times softer": tip(frozen_turbine(softer, aerodynamics, 0.0)),
    }


def tower_marks(response: ComplexArray, rigid: ComplexArray) -> list[str]:
    """Largest change from the answer on a rigid tower in each of TOWER_BANDS [dB], and where."""
    change = decibel(response) - decibel(rigid)
    marks = []
    for low, high in TOWER_BANDS:
        inside = np.flatnonzero((low <= FREQUENCY) & (high >= FREQUENCY))
        at = inside[np.abs(change[inside]).argmax()]
        marks.append(f"{change[at]:+.1f} at {FREQUENCY[at]:.2f} Hz")
    return marks


def resonances(response: ComplexArray) -> NDArray[np.int64]:
    """Local maxima that stand 3 dB above both valleys beside them."""
    level = decibel(response)
    inner = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:])) + 1
    valleys = np.split(level, inner)
    kept = [i for k, i in enumerate(inner) if level[i] - max(valleys[k].min(), valleys[k + 1].min()) > 3.0]
    return np.array(kept, dtype=np.int64)


def figure13(study: Study, output: Path, tell: Tell) -> None:
    """Few and many structural modes against all."""
    tell("Figure 13: full system")
    curves = {"full system": full_tip(with_modes(study.parts, study.rotor, *ALL_MODES), study)}
    tell("Figure 13: 5 tower, 20 blade modes")
    few = with_modes(study.parts, study.rotor, *FEW_MODES)
    components = reduce_rotor(few, study.rotor, study.case.reduction.aerodynamic_states)
    aerodynamics = multiblade_aerodynamics(*components, 0.0, study.time_step)
    curves["5 tower, 20 blade modes"] = tip(frozen_turbine(few, aerodynamics, 0.0))
    curves["15 tower, 40 blade modes"] = tip(frozen_turbine(study.parts, study.seen(0.0), 0.0))
    deviation_table("Figure 13: deviation from all modes and states [%], and in decibels", curves)
    draw(
        curves,
        output / f"figure13.{study.picture}",
        "Structural modes, 150 aerodynamic states",
        deviation=True,
    )


def figure14(study: Study, output: Path, tell: Tell) -> None:
    """Few and many aerodynamic states against all."""
    tell("Figure 14: full lattice")
    curves = {"full lattice": full_tip(study.parts, study)}
    for total in TOTALS:
        tell(f"Figure 14: {total} states")
        components = reduce_rotor(study.parts, study.rotor, reduced_states(total))
        aerodynamics = multiblade_aerodynamics(*components, 0.0, study.time_step)
        curves[f"{total} states"] = tip(frozen_turbine(study.parts, aerodynamics, 0.0))
    deviation_table("Figure 14: deviation from the full lattice [%], and in decibels", curves)
    draw(
        curves,
        output / f"figure14.{study.picture}",
        "Aerodynamic states, 15 tower and 40 blade modes",
        deviation=True,
    )


def deviation_table(title: str, curves: Curves) -> None:
    """Largest deviation from the first curve by band, and where the first peak stands."""
    full, *names = curves
    rows = []
    for name in names:
        share = np.abs(curves[name] / curves[full] - 1.0)
        level = np.abs(decibel(curves[name]) - decibel(curves[full]))
        row = [name]
        for low, high in BANDS:
            inside = (low <= FREQUENCY) & (high >= FREQUENCY)
            row.append(f"{100.0 * share[inside].max():.2g} ({level[inside].max():.2g} dB)")
        rows.append([*row, first_peak(curves[name])])
    rows.append([full, *("" for _ in BANDS), first_peak(curves[full])])
    table(title, ["", *(f"{low:g} to {high:g} Hz" for low, high in BANDS), "first peak"], rows)


def first_peak(response: ComplexArray) -> str:
    """Place and height of the largest response in PEAK."""
    inside = np.flatnonzero((PEAK[0] <= FREQUENCY) & (PEAK[1] >= FREQUENCY))
    at = inside[np.abs(response[inside]).argmax()]
    return f"{decibel(response)[at]:.1f} dB at {FREQUENCY[at]:.3f} Hz"


def draw(curves: Curves, path: Path, title: str, deviation: bool = False) -> None:
    """Magnitude and phase over frequency and, if asked for, the deviation from the first curve."""
    plt = pyplot()
    panels, size = (3, 8.4) if deviation else (2, 6.2)
    figure, axes = plt.subplots(panels, 1, figsize=(7.5, size), sharex=True, layout="constrained")
    first = next(iter(curves.values()))
    lines = zip(("C0-", "C1--", "C2-.", "C3:"), curves.items(), strict=False)
    for index, (line, (name, response)) in enumerate(lines):
        axes[0].semilogx(FREQUENCY, decibel(response), line, label=name, linewidth=1.4)
        phase = np.degrees(np.unwrap(np.angle(response)))
        axes[1].semilogx(FREQUENCY, phase - 360.0 * np.round(phase[0] / 360.0), line, linewidth=1.4)
        if deviation and index:
            axes[2].loglog(FREQUENCY, 100.0 * np.abs(response / first - 1.0), line, linewidth=1.4)
    axes[0].set(ylabel="magnitude [dB of 1 m per m/s]", title=title)
    axes[0].legend()
    axes[1].set(ylabel="phase [deg]")
    if deviation:
        axes[2].set(ylabel="deviation [%]", ylim=(1e-3, 3e2))
    axes[-1].set(xlabel="frequency [Hz]", xlim=(FREQUENCY[0], FREQUENCY[-1]))
    for axis in axes:
        axis.grid(which="both", color="0.9")
    write_picture(path, figure)
    plt.close(figure)
