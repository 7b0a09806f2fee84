"""Forces on a lattice as linear functions of its circulations (paper eq. 12).

Steady part: Joukowski's force on every bound segment, spanwise and chordwise, in the undisturbed relative flow.
Unsteady part: the rate of the potential jump over the surface. Within a ring the jump is its circulation; a ring
covers three quarters of its own panel and one quarter of the next, the last ring three quarters of the last panel only.
The textbook form (Katz and Plotkin) gives the whole panel its own ring's rate instead; it is kept to compare.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from flapgym.aerodynamics.lattice import Inflow, Lattice
from flapgym.core.arrays import Array

Cover = Literal["ring", "panel"]

# Backward differences of first and second order: weights of the present and the past circulations.
BACKWARD_DIFFERENCE = {1: (1.0, -1.0), 2: (1.5, -2.0, 0.5)}


@dataclass(frozen=True, eq=False)
class BoundSegments:
    """Straight pieces of bound vortex: midpoints, vectors (q, 3) [m], net circulation (q, n) per ring circulation."""

    midpoint: Array
    vector: Array
    net: Array

    def force(self, density: float, velocity: Array) -> Array:
        """Joukowski's force (q, 3, n) [N] per ring circulation in the velocity (q, 3) of the air past the segments."""
        return density * np.cross(velocity, self.vector)[:, :, None] * self.net[:, None]


@dataclass(frozen=True, eq=False)
class FullLoads:
    """What the mean circulation adds to the linear terms of ny loads, see `flapgym.aerodynamics.linearisation`.

    Attributes
    ----------
    circulation : (ny, n) float
        Loads per perturbed circulation, in the velocity that the mean ones induce [load / (m^2/s)].
    induced : (ny, 3 n) float
        Loads per velocity induced on the leading segments [load / (m/s)], components of one segment adjacent.
    direct : (ny, nu) float
        Loads per unit input.
    """

    circulation: Array
    induced: Array
    direct: Array


def leading_segments(lattice: Lattice) -> BoundSegments:
    """The spanwise segments at the front of the rings, root to tip, in the rings' order."""
    nc, ns = lattice.chordwise, lattice.strips
    front = lattice.node[:-1]
    own = np.eye(nc * ns)
    return BoundSegments(
        midpoint=(0.5 * (front[:, 1:] + front[:, :-1])).reshape(-1, 3),
        vector=(front[:, 1:] - front[:, :-1]).reshape(-1, 3),
        net=own - np.concatenate([np.zeros((ns, nc * ns)), own[:-ns]]),
    )


def side_segments(lattice: Lattice) -> BoundSegments:
    """The chordwise segments between the rings, front to back, as far as the trailing edge."""
    nc, ns = lattice.chordwise, lattice.strips
    start = lattice.node[:-1]
    end = np.concatenate([lattice.node[1:-1], lattice.trailing_edge[None]])
    net = np.zeros((nc, ns + 1, nc, ns))
    rows, strips = np.arange(nc)[:, None], np.arange(ns)[None]
    net[rows, strips + 1, rows, strips] += 1.0
    net[rows, strips, rows, strips] -= 1.0
    return BoundSegments(
        midpoint=(0.5 * (start + end)).reshape(-1, 3),
        vector=(end - start).reshape(-1, 3),
        net=net.reshape(-1, nc * ns),
    )


def _unsteady(lattice: Lattice, density: float, cover: Cover) -> tuple[Array, Array]:
    """Points (n, 3) and forces (n, 3, n) per rate of circulation on the part of the surface that each ring is given."""
    nc = lattice.chordwise
    offset = {"ring": 0.25, "panel": 0.0}[cover]
    corner = lattice.on_surface(np.append((np.arange(nc) + offset) / nc, 1.0))
    diagonals = corner[1:, 1:] - corner[:-1, :-1], corner[:-1, 1:] - corner[1:, :-1]
    area = 0.5 * np.cross(*diagonals).reshape(-1, 3)
    centre = 0.25 * (corner[1:, 1:] + corner[:-1, :-1] + corner[:-1, 1:] + corner[1:, :-1])
    return centre.reshape(-1, 3), density * area[:, :, None] * np.eye(area.shape[0])[:, None]


def force_matrices(
    lattice: Lattice,
    inflow: Inflow,
    density: float,
    time_step: float,
    difference: Literal[1, 2] = 2,
    cover: Cover = "ring",
) -> tuple[Array, Array]:
    """Where the forces act and how they follow from present and past circulations.

    Parameters
    ----------
    difference : {1, 2}
        Order of the backward difference in time; the second order cuts the error at high frequency by three.
    cover : {"ring", "panel"}
        The part of the surface on which a ring's rate of circulation acts.

    Returns
    -------
    point : (P, 3) float
        Points of attack [m]: leading segments, side segments, then ring centres.
    force : (difference + 1, 3 P, n) float
        F^t = sum_l force[l] Gamma^{t - l} [N], Gamma in m^2/s, components of one point adjacent.
    """
    segments = leading_segments(lattice), side_segments(lattice)
    ring_point, ring_force = _unsteady(lattice, density, cover)
    point = np.concatenate([*(part.midpoint for part in segments), ring_point])
    weights, n = BACKWARD_DIFFERENCE[difference], ring_point.shape[0]
    force = np.zeros((len(weights), *point.shape, n))
    for lag, weight in enumerate(weights):
        force[lag, -n:] = weight / time_step * ring_force
    force[0, :-n] = np.concatenate(
        [part.force(density, inflow.relative_velocity(part.midpoint)) for part in segments]
    )
    return point, force.reshape(len(weights), -1, n)
