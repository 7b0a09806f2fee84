"""Flapwise moments along the blade, by force summation as at its root (Section II.D).

The moment in the beam at a node is that of all loads less inertia on the nodes outboard of it, about the node where it
has moved to. Between nodes it is taken as linear, the loads being nodal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array
from flapgym.structure import Configuration, LinearBlade
from flapgym.structure.beam import internal_force, tangent
from flapgym.structure.blade import blade_beam
from flapgym.turbine import Case

FLAPWISE = np.array([0.0, 1.0, 0.0])
"""In-plane axis of the coned, untwisted blade root, about which a load downwind turns positively."""


@dataclass(frozen=True, eq=False)
class Cut:
    """The moment about ``FLAPWISE`` at a station of a blade of n elements, but for what its root row gives.

    Attributes
    ----------
    root : float
        Factor on the root moment in it: how near the root node is.
    work : (6 n,) float
        Virtual displacement of the nodes: what nodal loads do on it is their moment.
    stiffness : (6 n,) float
        Moment that displacements take away, by the inertial loads they change and the arms of the steady ones.
    steady : (3,) float
        Steady moment [N m] about all axes.
    """

    root: float
    work: Array
    stiffness: Array
    steady: Array


def station_shares(case: Case) -> list[float]:
    """Stations outboard of the root at which the case asks for moments, over the blade's length, in order."""
    named = (name.rpartition("_") for name in case.signals.outputs)
    # At the root it is the root moment itself, at the tip there is none.
    return [
        int(percent) / 100.0
        for base, _, percent in named
        if base == "flapwise_moment" and 0 < int(percent) < 100
    ]


def nodes_beside(case: Case, share: float) -> list[tuple[int, float]]:
    """The nodes beside a share of the blade's length, each with its weight in what is linear between them."""
    radius = case.turbine.blade_sections(case.discretisation.blade_elements).radius
    at = float(np.interp(share, (radius - radius[0]) / (radius[-1] - radius[0]), np.arange(len(radius))))
    inner = min(int(at), len(radius) - 2)
    return [(inner, inner + 1 - at), (inner + 1, at - inner)]


def cut_at(case: Case, blade: LinearBlade, share: float) -> Cut:
    """The moment at a share of the blade's length."""
    nodes = nodes_beside(case, share)
    beam = blade_beam(case.turbine, case.discretisation.blade_elements, case.operating_point.pitch)
    there = Configuration(blade.position, blade.orientation)
    # In balance the beam's own nodal forces are the steady loads on it: air less inertia.
    nodal = internal_force(beam, there)
    steady, moment = nodal[:, :3], np.zeros(3)
    inertial = blade.stiffness - tangent(beam, there)[6:, 6:]
    work, arms = np.zeros_like(blade.orientation[:, :2]), np.zeros_like(blade.orientation[:, :2])
    for node, weight in nodes:
        if node == 0:
            continue  # the root's own row has what the clamped node takes up, too
        outer = slice(node + 1, None)
        work[outer, 0] += weight * np.cross(FLAPWISE, blade.position[outer] - blade.position[node])
        work[outer, 1] += weight * FLAPWISE
        # axis . (u x F) = u . (F x axis), u from where the node has moved to.
        turned = weight * np.cross(steady[outer], FLAPWISE)
        arms[outer, 0] += turned
        arms[node, 0] -= turned.sum(axis=0)
        about = np.cross(blade.position[outer] - blade.position[node], steady[outer]) + nodal[outer, 3:]
        moment += weight * about.sum(axis=0)
    virtual = work[1:].ravel()
    root = sum(weight for node, weight in nodes if node == 0)
    return Cut(root, virtual, virtual @ inertial - arms[1:].ravel(), moment)


def cuts(case: Case, blade: LinearBlade) -> list[Cut]:
    """Those of all stations that the case asks for."""
    return [cut_at(case, blade, share) for share in station_shares(case)]
