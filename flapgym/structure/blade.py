"""The turbine's blade as a beam in the rotor frame S, its equilibrium under rotation and its linear model."""

from __future__ import annotations

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.core.fields import Quantity
from flapgym.structure.beam import Beam, Configuration
from flapgym.structure.body import LinearBlade, linearise
from flapgym.structure.equilibrium import solve_equilibrium
from flapgym.structure.inertia import distribution, section_mass
from flapgym.structure.rotation import about_y, about_z
from flapgym.turbine import BladeSections, Turbine

SHEAR_TO_AXIAL = 10.0
"""Shear stiffness over axial stiffness. None is published, and the turbine's definition knows no shear: ten
makes the beams rigid in shear (a hundred moves no Table 1 mode by more than 0.1 %)."""

LOAD_STEPS = 4
"""Newton takes the turbine's own mean load (some six metres of tip deflection) in this many steps with a margin."""

# Columns: along the beam, normal (downwind), chordwise to the trailing edge, for zero twist and cone in S.
_SECTION_AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def blade_beam(turbine: Turbine, elements: int, pitch: float = 0.0) -> Beam:
    """Blade 1 at azimuth zero in S, stress-free: 12 elements (the paper's Table 2) or 48 (the documented).

    An element's properties are the average of its end nodes'; `pitch` [rad] adds to the twist.
    """
    Quantity("angle").check(pitch, "blade.pitch")
    sections = turbine.blade_sections(elements)
    cone = about_y(-turbine.rotor.precone)
    position = np.outer(sections.radius, cone[:, 2])
    orientation = np.stack([cone @ about_z(-(twist + pitch)) @ _SECTION_AXES for twist in sections.twist])
    stiffness = np.stack([_stiffness(sections, node) for node in range(len(sections.radius))])
    mass = np.stack([_mass(sections, node) for node in range(len(sections.radius))])
    return Beam(
        Configuration(position, orientation),
        0.5 * (stiffness[:-1] + stiffness[1:]),
        0.5 * (mass[:-1] + mass[1:]),
    )


def _stiffness(sections: BladeSections, node: int) -> AnyArray:
    """6 x 6 stiffness in section axes; bending about the normal is edgewise, about the chord flapwise."""
    axial = sections.axial_stiffness[node]
    return np.diag(
        [
            axial,
            SHEAR_TO_AXIAL * axial,
            SHEAR_TO_AXIAL * axial,
            sections.torsion_stiffness[node],
            sections.edge_stiffness[node],
            sections.flap_stiffness[node],
        ]
    )


def _mass(sections: BladeSections, node: int) -> AnyArray:
    """6 x 6 mass in section axes; the rotary inertias are about the centre of gravity."""
    flap, edge = sections.flap_inertia[node], sections.edge_inertia[node]
    centre = np.array([0.0, 0.0, sections.centre_of_gravity_offset[node]])
    return section_mass(float(sections.mass_density[node]), centre, np.diag([flap + edge, edge, flap]))


def linear_blade(
    turbine: Turbine,
    elements: int = 12,
    rotor_speed: float = 0.0,
    pitch: float = 0.0,
    load: AnyArray | None = None,
    near: LinearBlade | None = None,
) -> LinearBlade:
    """Blade 1 linearised about its steady equilibrium under rotation (the paper's eq. 2).

    Parameters
    ----------
    turbine : Turbine
        The machine.
    elements : int
        12 or 48.
    rotor_speed : float
        Omega about +x of S [rad/s]; zero for a parked rotor.
    pitch : float
        Collective pitch [rad], leading edge upwind positive.
    load : (elements + 1, 6) float, optional
        Steady nodal forces [N] and moments [N m] in S axes (dead), the aerodynamic trim's.
    near : LinearBlade, optional
        One about nearly the same equilibrium, to start from; default the unstrained blade, load by steps.
    """
    Quantity("angular rate").check(rotor_speed, "blade.rotor_speed")
    beam = blade_beam(turbine, elements, pitch)
    steps = 1 if load is None or near else LOAD_STEPS
    start = Configuration(near.position, near.orientation) if near else None
    configuration = solve_equilibrium(
        beam, np.array([rotor_speed, 0.0, 0.0]), load, load_steps=steps, start=start
    )
    return linearise(beam, configuration, rotor_speed, load)


def mean_gravity_load(turbine: Turbine, elements: int = 12) -> AnyArray:
    """Nodal loads (elements + 1, 6) [N, N m] in S axes of gravity's mean over a turn, for `linear_blade`.

    Only the part along the tilted shaft stays: g sin(tilt) downwind. The load is dead and taken on the undeformed
    blade; what bending does to the arms of the centres of gravity within the sections is left out.
    """
    beam = blade_beam(turbine, elements)
    fall = np.array([turbine.gravity * np.sin(turbine.rotor.tilt), 0.0, 0.0])
    accelerated = np.zeros((elements + 1, 4, 3))
    accelerated[:, 0] = fall
    weight = (distribution(beam) @ accelerated.reshape(-1, 3)).reshape(elements + 1, 4, 3)
    directors = np.swapaxes(beam.reference.orientation, -1, -2)
    return np.concatenate([weight[:, 0], np.cross(directors, weight[:, 1:]).sum(axis=1)], axis=1)
