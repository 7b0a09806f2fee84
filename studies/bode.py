"""Figures 10, 13 and 14: gust to flapwise tip deflection of one blade at a frozen azimuth, blade 1 up.

"Stationary" is read as a joint frozen at an azimuth while inflow and wake turn. Decibels are of 1 m per m/s; the
paper's are of its own gust input, whose unit it does not give. Each figure's study returns its curves; what stands in a
table follows from them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flapgym.aeroelastic.blade_lattice import blade_lattice
from flapgym.aeroelastic.coupling import multiblade_aerodynamics
from flapgym.aeroelastic.equations import Parts, periodic_equations
from flapgym.aeroelastic.trim import deflected_lattice
from flapgym.core.arrays import Array, ComplexArray
from flapgym.core.state_space import StateSpace
from flapgym.reduction import normal_modes
from flapgym.structure import linear_blade, linear_support
from reference.exact import harmonic_response
from studies.design import clamped_rotor, frozen_turbine
from studies.hankel import TOTALS, reduced_states
from studies.parts import Study, Tell, reduce_rotor, with_modes, with_tower

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
RIGID, OWN, SOFT = "rigid tower", "NREL tower", "tower three times softer"
PARKED = "NREL tower, parked and windless"


@dataclass(frozen=True, eq=False)
class Curves:
    """Tip deflection per homogeneous gust over frequency.

    Attributes
    ----------
    names : (n,) str
    frequency : (nf,) float
        [Hz].
    response : (n, nf) complex
        [m per m/s].
    """

    names: NDArray[np.str_]
    frequency: Array
    response: ComplexArray

    @classmethod
    def of(cls, curves: dict[str, ComplexArray]) -> Curves:
        """At FREQUENCY, by name."""
        return cls(np.array(list(curves)), FREQUENCY, np.array(list(curves.values())))

    def __getitem__(self, name: str) -> ComplexArray:
        """The response (nf,) of a name."""
        return np.asarray(self.response[list(self.names).index(name)])

    def inside(self, band: tuple[float, float]) -> NDArray[np.int64]:
        """Places of the frequencies of a band."""
        return np.flatnonzero((band[0] <= self.frequency) & (self.frequency <= band[1]))


@dataclass(frozen=True, eq=False)
class Mark:
    """Largest changes against a rigid tower in the bands of TOWER_BANDS: decibels, and where [Hz]."""

    name: str
    change: Array
    frequency: Array


@dataclass(frozen=True, eq=False)
class Deviation:
    """Largest deviations from the full system in the bands of BANDS: fractions of it, and decibels."""

    name: str
    share: Array
    level: Array


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


def towers(study: Study, tell: Tell) -> Curves:
    """Figure 10: rigid, NREL and three times softer tower, the other blades, and the parked structure beside them."""
    tell("Figure 10: reduced lattice")
    aerodynamics = study.seen(0.0)
    tell("Figure 10: towers")
    curves = on_towers(study)
    own = frozen_turbine(study.parts, aerodynamics, 0.0)
    others = {f"{OWN}, blade {blade}": tip(own, blade) for blade in (2, 3)}
    return Curves.of(curves | others | {PARKED: parked_tip(study)})


def on_towers(study: Study) -> dict[str, ComplexArray]:
    """Tip per gust on the three towers of Figure 10, the rigid one first."""
    aerodynamics = study.seen(0.0)
    softer = with_tower(study.parts, 1.0 / SOFTER)
    return {
        RIGID: tip(clamped_rotor(study.parts, aerodynamics)),
        OWN: tip(frozen_turbine(study.parts, aerodynamics, 0.0)),
        SOFT: tip(frozen_turbine(softer, aerodynamics, 0.0)),
    }


def tower_marks(curves: Curves) -> list[Mark]:
    """Where each answer but the parked structure's is changed most from that on a rigid tower."""
    rigid = decibel(curves[RIGID])
    marks = []
    for name in curves.names:
        if name in (RIGID, PARKED):
            continue
        change = decibel(curves[name]) - rigid
        at = [inside[np.abs(change[inside]).argmax()] for inside in map(curves.inside, TOWER_BANDS)]
        marks.append(Mark(name, change[at], curves.frequency[at]))
    return marks


def resonances(response: ComplexArray) -> NDArray[np.int64]:
    """Local maxima that stand 3 dB above both valleys beside them."""
    level = decibel(response)
    inner = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:])) + 1
    valleys = np.split(level, inner)
    kept = [i for k, i in enumerate(inner) if level[i] - max(valleys[k].min(), valleys[k + 1].min()) > 3.0]
    return np.array(kept, dtype=np.int64)


def structural_modes(study: Study, tell: Tell) -> Curves:
    """Figure 13: few and many structural modes against all, the first curve."""
    tell("Figure 13: full system")
    curves = {"full system": full_tip(with_modes(study.parts, study.rotor, *ALL_MODES), study)}
    tell("Figure 13: 5 tower, 20 blade modes")
    few = with_modes(study.parts, study.rotor, *FEW_MODES)
    components = reduce_rotor(few, study.rotor, study.case.reduction.aerodynamic_states)
    aerodynamics = multiblade_aerodynamics(*components, 0.0, study.time_step)
    curves["5 tower, 20 blade modes"] = tip(frozen_turbine(few, aerodynamics, 0.0))
    curves["15 tower, 40 blade modes"] = tip(frozen_turbine(study.parts, study.seen(0.0), 0.0))
    return Curves.of(curves)


def aerodynamic_states(study: Study, tell: Tell) -> Curves:
    """Figure 14: few and many aerodynamic states against all, the first curve."""
    tell("Figure 14: full lattice")
    curves = {"full lattice": full_tip(study.parts, study)}
    for total in TOTALS:
        tell(f"Figure 14: {total} states")
        components = reduce_rotor(study.parts, study.rotor, reduced_states(total))
        aerodynamics = multiblade_aerodynamics(*components, 0.0, study.time_step)
        curves[f"{total} states"] = tip(frozen_turbine(study.parts, aerodynamics, 0.0))
    return Curves.of(curves)


def deviations(curves: Curves) -> list[Deviation]:
    """Of every curve but the first from the first, by band."""
    full, *names = curves.names
    found = []
    for name in names:
        share = np.abs(curves[name] / curves[full] - 1.0)
        level = np.abs(decibel(curves[name]) - decibel(curves[full]))
        bands = [curves.inside(band) for band in BANDS]
        largest = [np.array([values[inside].max() for inside in bands]) for values in (share, level)]
        found.append(Deviation(name, *largest))
    return found


def first_peak(curves: Curves, name: str) -> tuple[float, float]:
    """Height [dB of 1 m per m/s] and place [Hz] of the largest response in PEAK."""
    inside = curves.inside(PEAK)
    at = inside[np.abs(curves[name][inside]).argmax()]
    return float(decibel(curves[name])[at]), float(curves.frequency[at])
