"""Tower, nacelle, shaft and hub in the fixed frame, linear about the unstrained state (Section IV.A).

Tower frame: origin at the base, x downwind and horizontal, z up. Shaft frame H (the rotor frame S at azimuth
zero): origin at the rotor apex, x downwind along the shaft, tilted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.core.fields import Quantity
from flapgym.structure.beam import Beam, Configuration, tangent
from flapgym.structure.blade import SHEAR_TO_AXIAL
from flapgym.structure.inertia import distribution, linearise_inertia, section_mass
from flapgym.structure.rotation import about_y, hat, rigid_displacement
from flapgym.turbine import Turbine

SHAFT_AXIAL_STIFFNESS = 1e13
"""Axial and shear stiffness of the shaft [N], which only twists and barely bends."""


@dataclass(frozen=True, eq=False)
class LinearSupport:
    """Tower, nacelle, shaft and hub: M q'' + C q' + K q = Q, undamped (modal damping comes where modes are).

    q (N) holds displacements [m] and small spatial rotations [rad], six a node in tower axes: the tower's free
    nodes from the bottom up, then the shaft's hub end.

    Attributes
    ----------
    mass, damping, stiffness : (N, N) float
        `damping` is the gyroscopic moment of the spinning hub alone and skew.
    hub : (6, N) float
        Displacement [m] and rotation [rad] of the rotor apex in H axes; its transpose takes hub loads in.
    tower_top : (6, N) float
        Displacement and rotation of the tower top in tower axes.
    apex : (3,) float
        The apex in the tower frame [m].
    shaft_axes : (3, 3) float
        Axes of H as columns in the tower frame.
    tower_position : (n + 1, 3) float
        Tower nodes, the base first [m].
    weight : (N,) float
        Nodal forces and moments of tower, nacelle and hub per unit of gravity [kg, kg m], down.
    """

    mass: AnyArray
    damping: AnyArray
    stiffness: AnyArray
    hub: AnyArray
    tower_top: AnyArray
    apex: AnyArray
    shaft_axes: AnyArray
    tower_position: AnyArray
    weight: AnyArray


def tower_beam(turbine: Turbine) -> Beam:
    """Tower as beam elements between its documented stations, in the tower frame."""
    tower = turbine.tower
    height = tower.height
    position = np.column_stack([np.zeros_like(height), np.zeros_like(height), height])
    axes = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    shear = SHEAR_TO_AXIAL
    stiffness = np.stack(
        [
            np.diag([axial, shear * axial, shear * axial, torsion, bending, bending])
            for axial, torsion, bending in zip(
                tower.axial_stiffness, tower.torsion_stiffness, tower.bending_stiffness, strict=True
            )
        ]
    )
    mass = np.stack(
        [
            section_mass(density, np.zeros(3), np.diag([2.0 * inertia, inertia, inertia]))
            for density, inertia in zip(tower.mass_density, tower.inertia, strict=True)
        ]
    )
    orientation = np.broadcast_to(axes, (len(height), 3, 3))
    return Beam(
        Configuration(position, orientation),
        0.5 * (stiffness[:-1] + stiffness[1:]),
        0.5 * (mass[:-1] + mass[1:]),
    )


def shaft_beam(turbine: Turbine) -> Beam:
    """Drivetrain as one massless element from the yaw axis to the apex, flexible in torsion only.

    Its torsion constant over its length is the documented drivetrain spring.
    """
    rotor = turbine.rotor
    downwind = about_y(rotor.tilt)[:, 0]
    start = np.array([0.0, 0.0, turbine.tower.height[-1] + rotor.tower_top_to_shaft])
    position = np.stack([start, start - rotor.overhang * downwind])
    axes = np.column_stack([-downwind, [0.0, -1.0, 0.0], np.cross(-downwind, [0.0, -1.0, 0.0])])
    torsion = turbine.drivetrain.torsion_spring * rotor.overhang
    bending = turbine.drivetrain.shaft_bending_stiffness
    stiffness = np.diag([SHAFT_AXIAL_STIFFNESS] * 3 + [torsion, bending, bending])
    orientation = np.broadcast_to(axes, (2, 3, 3))
    return Beam(Configuration(position, orientation), stiffness[None], np.zeros((1, 6, 6)))


def linear_support(turbine: Turbine, rotor_speed: float = 0.0) -> LinearSupport:
    """Tower, nacelle, shaft and hub about the unstrained state; the generator end of the shaft is locked.

    Parameters
    ----------
    turbine : Turbine
        The machine.
    rotor_speed : float
        Omega about +x of H [rad/s], for the hub's gyroscopic moment.
    """
    Quantity("angular rate").check(rotor_speed, "support.rotor_speed")
    tower, shaft = tower_beam(turbine), shaft_beam(turbine)
    tower_size, size = 6 * tower.elements, 6 * tower.elements + 6
    top = slice(tower_size - 6, tower_size)
    hub = slice(tower_size, size)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    at_rest = _at_rest_mass(tower)
    mass[:tower_size, :tower_size] = at_rest[6:, 6:]
    stiffness[:tower_size, :tower_size] = tangent(tower, tower.reference)[6:, 6:]

    ends = np.zeros((12, size))
    ends[:3, top] = rigid_displacement(shaft.reference.position[:1] - tower.reference.position[-1])
    ends[3:6, top] = np.eye(3, 6, 3)
    ends[6:, hub] = np.eye(6)
    stiffness += ends.T @ tangent(shaft, shaft.reference) @ ends

    axes = about_y(turbine.rotor.tilt)
    nacelle = turbine.nacelle
    mass[top, top] += section_mass(
        nacelle.mass,
        np.array([nacelle.downwind, 0.0, nacelle.above]),
        np.diag([nacelle.roll_inertia, 0.0, 0.0]),
    )
    polar = turbine.hub.inertia_about_shaft
    mass[hub, hub] += section_mass(turbine.hub.mass, np.zeros(3), polar * np.outer(axes[:, 0], axes[:, 0]))
    damping = np.zeros((size, size))
    damping[tower_size + 3 :, tower_size + 3 :] = -polar * rotor_speed * hat(axes[:, 0])

    # Weight is what a fall of all nodes alike takes; the tower's base, which is no unknown, falls too.
    fall = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    weight = mass @ np.tile(fall, size // 6)
    weight[:tower_size] += at_rest[6:, :6] @ fall

    hub_motion, top_motion = np.zeros((6, size)), np.zeros((6, size))
    hub_motion[:3, hub.start : hub.start + 3] = axes.T
    hub_motion[3:, hub.start + 3 :] = axes.T
    top_motion[:, top] = np.eye(6)
    return LinearSupport(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        hub=hub_motion,
        tower_top=top_motion,
        apex=shaft.reference.position[1],
        shaft_axes=axes,
        tower_position=tower.reference.position,
        weight=weight,
    )


def _at_rest_mass(beam: Beam) -> AnyArray:
    return linearise_inertia(distribution(beam), beam.reference, np.zeros(3)).mass
