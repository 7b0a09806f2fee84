"""A blade's lattice moved by its beam: what the full linearisation of downwash and loads needs of each mode.

The rings are laid anew on the displaced beam and differenced, so that nothing of the lattice's own geometry is lost:
bilinear strips, camber, the turn of every segment, and the velocities that the mean circulations and their wakes, held
displaced with the blade, then induce elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.aerodynamics import (
    Aerodynamics,
    MeanFlow,
    SegmentMotion,
    bound_segments,
    cambered_normals,
    gust_past_segments,
)
from flapgym.aerodynamics.rotor import blade_rings
from flapgym.aeroelastic.interaction import lattice_shape
from flapgym.core.arrays import Array
from flapgym.structure import LinearBlade
from flapgym.structure.rotation import hat, rigid_displacement, rotation_matrix
from flapgym.turbine import Case

STEP = 0.003
"""Of the differences, over the shortest chord: central ones are then good to 1e-4."""


@dataclass(frozen=True, eq=False)
class LatticeMotion:
    """Change of a blade's lattice per unit of m modes held displaced, all blades alike.

    Attributes
    ----------
    collocation, normal : (n, 3, m) float
        Of the collocation points [m] and of the normals there, tilted by the sections' zero-lift angles.
    midpoint, vector : (q, 3, m) float
        Of the bound segments, leading ones first [m].
    induced_normal, induced_leading : (n, m), (n, 3, m) float
        Of the velocity that the mean circulations induce along the lattice's normals and on the leading segments [m/s].
    """

    collocation: Array
    normal: Array
    midpoint: Array
    vector: Array
    induced_normal: Array
    induced_leading: Array


def lattice_motion(case: Case, blade: LinearBlade, shape: Array, flow: MeanFlow) -> LatticeMotion:
    """Difference the lattice of a mean flow over each mode of a shape (6 n, m), on the blade of n elements."""
    first, zero_lift = case.discretisation.first_lattice_node, flow.loads.zero_lift_angle
    positions, turned = lattice_shape(case, blade)
    chord = float(np.linalg.norm(flow.aero.lattice.chord_vector, axis=1).min())
    clamped = np.concatenate([np.zeros((1, 6, shape.shape[1])), shape.reshape(-1, 6, shape.shape[1])])

    def state(mode: Array, size: float) -> tuple[Array, ...]:
        rings = blade_rings(
            case,
            flow.aero.inflow,
            positions + size * mode[:, :3],
            rotation_matrix(size * mode[:, 3:]) @ turned,
        )
        segments = bound_segments(rings)
        normals = cambered_normals(rings, zero_lift)
        return rings.collocation, normals, segments.midpoint, segments.vector, *flow.induced_on(rings)

    columns = []
    for mode in np.moveaxis(clamped[first:], 2, 0):
        # Edges of the chord move by turning, too: a torsion mode displaces its axis little.
        size = STEP * chord / float(np.abs(mode * ([1.0] * 3 + [chord] * 3)).max())
        ahead, behind = state(mode, size), state(mode, -size)
        columns.append([(a - b) / (2.0 * size) for a, b in zip(ahead, behind, strict=True)])
    return LatticeMotion(*(np.stack(parts, axis=-1) for parts in zip(*columns, strict=True)))


def mode_downwash(aero: Aerodynamics, rotor_speed: float, motion: LatticeMotion) -> tuple[Array, Array]:
    """Downwash (n, m) per rate of the modes, and per unit of the modes held; ``aero`` has the tilted normals."""
    spin = hat(np.array([rotor_speed, 0.0, 0.0]))
    moved = motion.collocation
    rate = -np.einsum("ni,nim->nm", aero.normal, moved)
    held = (
        np.einsum("nim,ni->nm", motion.normal, aero.relative_velocity)
        - np.einsum("ni,ij,njm->nm", aero.normal, spin, moved)
        + motion.induced_normal
    )
    return rate, held


def segment_motion(case: Case, aero: Aerodynamics, motion: LatticeMotion) -> SegmentMotion:
    """How the inputs of ``BladeLattice`` move the bound segments and the air past them."""
    midpoint = bound_segments(aero.lattice).midpoint
    q, m, n = len(midpoint), motion.midpoint.shape[2], len(motion.induced_leading)
    held = -np.einsum("ij,qjm->qim", hat(np.array([case.rotor_speed, 0.0, 0.0])), motion.midpoint)
    held[:n] += motion.induced_leading
    # A rotor that turns out of the wind carries axes, segments and loads along: only the wind changes, -phi x U e_x.
    wind = np.array([case.operating_point.wind_speed, 0.0, 0.0])
    hub_turn = np.broadcast_to(hat(wind)[:, 1:], (q, 3, 2))
    parts = [
        -motion.midpoint,
        held,
        -rigid_displacement(midpoint).reshape(q, 3, 6),
        hub_turn,
        np.zeros((q, 3, 2 * len(case.flaps))),  # a flap is felt in the downwash alone
        gust_past_segments(aero),
    ]
    velocity = np.concatenate(parts, axis=2)
    turned = np.zeros_like(velocity)
    turned[:, :, m : 2 * m] = motion.vector
    return SegmentMotion(velocity, turned)
