"""A flexible body in a moving frame, linearised: the matrices of eq. 2 with their rigid-body couplings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.structure.beam import Beam, Configuration, internal_force, tangent
from flapgym.structure.inertia import distribution, linearise_inertia, steady_force
from flapgym.structure.rotation import hat


@dataclass(frozen=True, eq=False)
class LinearBlade:
    """One blade clamped to the hub, about its steady equilibrium, in the rotor frame S at azimuth zero.

    q (6n) holds displacements [m] and small spatial rotations [rad] of the n free nodes, six a node from the
    root outwards, in S axes; nu = (v, omega) (6) the perturbation of the velocities of S at the apex, in its own
    axes; Q (6n) nodal forces [N] and moments [N m] (perturbations, S axes). Equation 2 of the paper:

        M q'' + M_SR nu' + C q' + C_SR nu + K q = Q,
        M_RS q'' + M_RR nu' + C_RS q' + C_RR nu + K_RS q = F,

    F being the force and the moment about the apex of everything that acts on the blade: the hub's reaction
    and Q. Undamped: structural damping is added where modes are (0.477 % a blade mode).
    K holds the elastic, geometric and centrifugal parts; with zero steady aerodynamic load K and M are
    symmetric and C is skew to round-off.

    Attributes
    ----------
    rotor_speed : float
        Omega about +x [rad/s].
    position : (n + 1, 3) float
        Nodes in equilibrium [m], the root first.
    orientation : (n + 1, 3, 3) float
        Section axes in equilibrium as columns: along the blade, normal (downwind), chordwise to the trailing
        edge.
    mass, damping, stiffness : (6n, 6n) float
        M, C, K.
    mass_sr, damping_sr : (6n, 6) float
    mass_rs, damping_rs, stiffness_rs : (6, 6n) float
    mass_rr, damping_rr : (6, 6) float
        Couplings with the apex.
    root_mass, root_damping, root_stiffness : (6, 6n), root_mass_sr, root_damping_sr : (6, 6) float
        Reaction of the hub on the blade's root node (force, moment about the node) in the same form:
        reaction = root_mass q'' + root_damping q' + root_stiffness q + root_mass_sr nu' + root_damping_sr nu.
    hub_load : (6,) float
        Steady force and moment about the apex that hub and steady load together exert (they balance the
        centrifugal load).
    root_load : (6,) float
        Steady reaction of the hub at the root node.
    """

    rotor_speed: float
    position: AnyArray
    orientation: AnyArray
    mass: AnyArray
    damping: AnyArray
    stiffness: AnyArray
    mass_sr: AnyArray
    damping_sr: AnyArray
    mass_rs: AnyArray
    damping_rs: AnyArray
    stiffness_rs: AnyArray
    mass_rr: AnyArray
    damping_rr: AnyArray
    root_mass: AnyArray
    root_damping: AnyArray
    root_stiffness: AnyArray
    root_mass_sr: AnyArray
    root_damping_sr: AnyArray
    hub_load: AnyArray
    root_load: AnyArray

    @property
    def on_hub(self) -> AnyArray:
        """Steady force and moment (6,) about the apex of the blade on the hub: minus the hub's reaction."""
        force, moment = self.root_load[:3], self.root_load[3:]
        return -np.concatenate([force, moment + hat(self.position[0]) @ force])


def linearise(
    beam: Beam, configuration: Configuration, rotor_speed: float, load: AnyArray | None = None
) -> LinearBlade:
    """Linear body about a steady configuration under rotation about +x; its first node is clamped.

    A steady dead `load` (n + 1, 6) moves with the node it acts on: its moment about the apex grows with the
    displacement, which K_RS takes in.
    """
    rotation = np.array([rotor_speed, 0.0, 0.0])
    inertia = distribution(beam)
    matrices = linearise_inertia(inertia, configuration, rotation)
    stiffness = tangent(beam, configuration) + matrices.stiffness
    steady = steady_force(inertia, configuration, rotation)
    free, root = slice(6, None), slice(0, 6)
    stiffness_rs = matrices.stiffness_rs[:, free].copy()
    if load is not None:
        moment = stiffness_rs[3:].reshape(3, -1, 6)
        moment[:, :, :3] += hat(load[1:, :3]).transpose(1, 0, 2)  # -(u x F)
    return LinearBlade(
        rotor_speed=rotor_speed,
        position=configuration.position,
        orientation=configuration.orientation,
        mass=matrices.mass[free, free],
        damping=matrices.damping[free, free],
        stiffness=stiffness[free, free],
        mass_sr=matrices.mass_sr[free],
        damping_sr=matrices.damping_sr[free],
        mass_rs=matrices.mass_rs[:, free],
        damping_rs=matrices.damping_rs[:, free],
        stiffness_rs=stiffness_rs,
        mass_rr=matrices.mass_rr,
        damping_rr=matrices.damping_rr,
        root_mass=matrices.mass[root, free],
        root_damping=matrices.damping[root, free],
        root_stiffness=stiffness[root, free],
        root_mass_sr=matrices.mass_sr[root],
        root_damping_sr=matrices.damping_sr[root],
        hub_load=_about_origin(configuration, steady),
        root_load=(internal_force(beam, configuration) + steady)[0],
    )


def _about_origin(configuration: Configuration, nodal: AnyArray) -> AnyArray:
    """Resultant force and moment about the origin of S of nodal forces and moments (n + 1, 6)."""
    moments = nodal[:, 3:] + np.cross(configuration.position, nodal[:, :3])
    return np.concatenate([nodal[:, :3].sum(axis=0), moments.sum(axis=0)])
