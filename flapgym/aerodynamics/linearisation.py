"""Loads of the mean circulation in the perturbed flow: what eq. 12 leaves out of the force's linear terms.

Joukowski's force on a bound segment, rho Gamma V x l, has three first variations. The paper keeps the perturbed
circulation in the undisturbed mean flow. Here stand the others: the mean circulation in the perturbed velocity (gust,
motion of the segment, velocities that the perturbed circulations induce), the mean circulation on the segment that has
turned, and the perturbed circulation in the velocity that the mean ones induce. They carry most of the torque.

As in `joukowski_force`, velocities induced on the chordwise segments are left out: their force lies along the span.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from flapgym.aerodynamics.lattice import Lattice
from flapgym.aerodynamics.loads import BoundSegments, FullLoads, leading_segments, side_segments
from flapgym.aerodynamics.model import Aerodynamics
from flapgym.aerodynamics.steady import MeanLoads, induced_velocity_at
from flapgym.core.arrays import Array


@dataclass(frozen=True, eq=False)
class MeanFlow:
    """A steady state of a blade's lattice, about which its loads are linearised.

    Attributes
    ----------
    aero : Aerodynamics
        The lattice and its mean wake.
    loads : MeanLoads
        Circulation, forces and moments of that state.
    """

    aero: Aerodynamics
    loads: MeanLoads

    @property
    def circulation(self) -> Array:
        """Bound circulations (n,) [m^2/s]."""
        return self.loads.circulation

    @property
    def shed(self) -> Array:
        """What each strip sheds into the wake (strips,) [m^2/s]."""
        return self.circulation.reshape(self.aero.lattice.chordwise, -1)[-1]

    def induced_on(self, lattice: Lattice) -> tuple[Array, Array]:
        """Velocity [m/s] that the circulations, moved to a lattice near by with its wake, induce there.

        Along the normals of its collocation points (n,), and on its leading segments (n, 3).
        """
        there = replace(self.aero, lattice=lattice)
        n, leading = lattice.normal.shape[0], leading_segments(lattice).midpoint
        velocity = induced_velocity_at(
            there, np.concatenate([lattice.collocation, leading]), self.circulation
        )
        return np.einsum("ni,ni->n", velocity[:n], lattice.normal), velocity[n:]

    @cached_property
    def induced(self) -> Array:
        """Velocity (n, 3) that all circulations induce on the leading segments [m/s]."""
        return self.induced_on(self.aero.lattice)[1]


def cambered_normals(lattice: Lattice, zero_lift_angle: Array) -> Array:
    """Normals (n, 3) of a lattice, tilted by the strips' zero-lift angles (strips,) [rad].

    A section without lift at a negative angle meets every velocity, not only the mean one, as if turned that much more.
    """
    chord = lattice.chord_vector
    along = chord / np.linalg.norm(chord, axis=1, keepdims=True)
    return np.asarray(lattice.normal - np.tile(zero_lift_angle[:, None] * along, (lattice.chordwise, 1)))


def cambered(aero: Aerodynamics, zero_lift_angle: Array) -> Aerodynamics:
    """The lattice with those normals for its downwash; its influences stay those of the flat rings."""
    return replace(
        aero, lattice=replace(aero.lattice, normal=cambered_normals(aero.lattice, zero_lift_angle))
    )


@dataclass(frozen=True, eq=False)
class SegmentMotion:
    """How inputs move the bound segments and the air past them, leading segments first; q of them, nu inputs.

    Attributes
    ----------
    velocity : (q, 3, nu) float
        Velocity of the air relative to the segment's midpoint per unit input [m/s].
    turned : (q, 3, nu) float
        Change of the segment's vector per unit input [m].
    """

    velocity: Array
    turned: Array


def bound_segments(lattice: Lattice) -> BoundSegments:
    """Leading, then side segments of a blade."""
    lead, side = leading_segments(lattice), side_segments(lattice)
    return BoundSegments(
        midpoint=np.concatenate([lead.midpoint, side.midpoint]),
        vector=np.concatenate([lead.vector, side.vector]),
        net=np.concatenate([lead.net, side.net]),
    )


def gust_past_segments(aero: Aerodynamics) -> Array:
    """Velocity (q, 3, strips) past the bound segments per unit gust along the shaft in each strip."""
    nc, ns = aero.lattice.chordwise, aero.lattice.strips
    own = np.eye(ns)
    beside = np.vstack(
        [own[:1], 0.5 * (own[1:] + own[:-1]), own[-1:]]
    )  # a side between two strips feels both
    along_shaft = np.concatenate([np.tile(own, (nc, 1)), np.tile(beside, (nc, 1))])
    return along_shaft[:, None, :] * np.array([1.0, 0.0, 0.0])[:, None]


def full_loads(aero: Aerodynamics, flow: MeanFlow, motion: SegmentMotion, load: Array) -> FullLoads:
    """Linear terms of the loads that the mean circulation adds.

    Parameters
    ----------
    aero : Aerodynamics
        The perturbations' lattice, of the same rings as the mean flow's.
    flow : MeanFlow
    motion : SegmentMotion
        Of the inputs.
    load : (ny, 3 P) float
        Loads as sums over the forces at `aero.force_point` [1/N].
    """
    segments, density = bound_segments(aero.lattice), aero.air_density
    q, n = len(segments.vector), aero.normal.shape[0]
    by_force = load.reshape(len(load), -1, 3)[:, :q]
    around = density * (segments.net @ flow.circulation)
    flow_past = aero.inflow.relative_velocity(segments.midpoint)
    flow_past[:n] += flow.induced

    # load . (V x l) = V . (l x load): what a velocity past each segment does to each load.
    felt = np.cross(segments.vector, by_force) * around[:, None]
    direct = np.einsum("yqi,qiu->yu", felt, motion.velocity)
    direct += np.einsum("yqi,qiu->yu", np.cross(by_force, flow_past) * around[:, None], motion.turned)
    in_induced = density * np.einsum(
        "yqi,qi->yq", by_force[:, :n], np.cross(flow.induced, segments.vector[:n])
    )
    return FullLoads(
        circulation=in_induced @ segments.net[:n],
        induced=felt[:, :n].reshape(len(load), -1),
        direct=direct,
    )
