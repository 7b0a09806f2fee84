"""Forces on a lattice as linear functions of its circulations (paper eq. 12).

Steady part: Joukowski's force on every bound segment, spanwise and chordwise, in the undisturbed relative flow.
Unsteady part: the rate of the potential jump, which within a ring is its circulation; a ring covers three quarters
of its own panel and one quarter of the next, the last ring three quarters of the last panel only.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flapgym.aerodynamics.lattice import Inflow, Lattice

Array = NDArray[np.float64]

# Backward differences of first and second order: weights of the present and the past circulations.
BACKWARD_DIFFERENCE = {1: (1.0, -1.0), 2: (1.5, -2.0, 0.5)}


def _spanwise(lattice: Lattice, inflow: Inflow, density: float) -> tuple[Array, Array]:
    """Points (n, 3) and forces (n, 3, n) on the leading segments of the rings."""
    nc, ns = lattice.chordwise, lattice.strips
    front = lattice.node[:-1]
    point = 0.5 * (front[:, 1:] + front[:, :-1])
    per_circulation = density * np.cross(inflow.relative_velocity(point), front[:, 1:] - front[:, :-1])
    own = np.eye(nc * ns)
    net = own - np.concatenate([np.zeros((ns, nc * ns)), own[:-ns]])
    return point.reshape(-1, 3), per_circulation.reshape(-1, 3, 1) * net[:, None]


def _chordwise(lattice: Lattice, inflow: Inflow, density: float) -> tuple[Array, Array]:
    """Points (nc (ns + 1), 3) and forces on the side segments of the rings, as far as the trailing edge."""
    nc, ns = lattice.chordwise, lattice.strips
    start = lattice.node[:-1]
    end = np.concatenate([lattice.node[1:-1], lattice.trailing_edge[None]])
    point = 0.5 * (start + end)
    per_circulation = density * np.cross(inflow.relative_velocity(point), end - start)
    net = np.zeros((nc, ns + 1, nc, ns))
    rows, strips = np.arange(nc)[:, None], np.arange(ns)[None]
    net[rows, strips + 1, rows, strips] += 1.0
    net[rows, strips, rows, strips] -= 1.0
    return point.reshape(-1, 3), per_circulation.reshape(-1, 3, 1) * net.reshape(-1, 1, nc * ns)


def _unsteady(lattice: Lattice, density: float) -> tuple[Array, Array]:
    """Points (n, 3) and forces (n, 3, n) per rate of circulation on the part of each ring that lies on the surface."""
    nc = lattice.chordwise
    corner = lattice.on_surface(np.append((np.arange(nc) + 0.25) / nc, 1.0))
    diagonals = corner[1:, 1:] - corner[:-1, :-1], corner[:-1, 1:] - corner[1:, :-1]
    area = 0.5 * np.cross(*diagonals).reshape(-1, 3)
    centre = 0.25 * (corner[1:, 1:] + corner[:-1, :-1] + corner[:-1, 1:] + corner[1:, :-1])
    return centre.reshape(-1, 3), density * area[:, :, None] * np.eye(area.shape[0])[:, None]


def force_matrices(
    lattice: Lattice, inflow: Inflow, density: float, time_step: float, difference: Literal[1, 2] = 2
) -> tuple[Array, Array]:
    """Where the forces act and how they follow from present and past circulations.

    Parameters
    ----------
    difference : {1, 2}
        Order of the backward difference in time; the second order cuts the error at high frequency by three.

    Returns
    -------
    point : (P, 3) float
        Points of attack [m]: leading segments, side segments, then ring centres.
    force : (difference + 1, 3 P, n) float
        F^t = sum_l force[l] Gamma^{t - l} [N], Gamma in m^2/s, components of one point adjacent.
    """
    span_point, span_force = _spanwise(lattice, inflow, density)
    chord_point, chord_force = _chordwise(lattice, inflow, density)
    ring_point, ring_force = _unsteady(lattice, density)
    weights = BACKWARD_DIFFERENCE[difference]
    point = np.concatenate([span_point, chord_point, ring_point])
    n = span_point.shape[0]
    force = np.zeros((len(weights), *point.shape, n))
    for lag, weight in enumerate(weights):
        force[lag, -n:] = weight / time_step * ring_force
    force[0, :n] = span_force
    force[0, n : n + chord_point.shape[0]] = chord_force
    return point, force.reshape(len(weights), -1, n)
