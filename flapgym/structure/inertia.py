"""Inertia of a beam in a moving frame S: mass, gyroscopic and rigid-body coupling matrices (eq. 1 and 2).

Material points of a section are carried by its node's position and three section axes ("directors"). Between
nodes both are interpolated linearly and integrated with two points an element (exact), so the kinetic energy is a
constant quadratic form in the nodal positions and directors. Every matrix below is a projection of that form: M is
symmetric, C skew and K symmetric to round-off, and a rigid motion carries exactly the inertia of the rigid body.
Between nodes that differ by an angle phi the rotary inertia of an element is represented to phi^2 / 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.structure.beam import Beam, Configuration
from flapgym.structure.rotation import hat


@dataclass(frozen=True, eq=False)
class InertiaMatrices:
    """Linear inertia about a steady rotation; q holds nodal displacements and spatial rotations in S axes.

    Forces on the nodes: M q'' + M_SR nu' + C q' + C_SR nu + K q; force and moment about the origin of S:
    M_RS q'' + M_RR nu' + C_RS q' + C_RR nu + K_RS q, where nu = (v, omega) is the perturbation of the
    velocities of S in its own axes [m/s, rad/s].
    """

    mass: AnyArray  # (N, N)
    damping: AnyArray  # (N, N) gyroscopic
    stiffness: AnyArray  # (N, N) centrifugal
    mass_sr: AnyArray  # (N, 6)
    damping_sr: AnyArray  # (N, 6)
    mass_rs: AnyArray  # (6, N)
    damping_rs: AnyArray  # (6, N)
    stiffness_rs: AnyArray  # (6, N)
    mass_rr: AnyArray  # (6, 6)
    damping_rr: AnyArray  # (6, 6)


def section_distribution(mass: AnyArray) -> AnyArray:
    """Second moments of mass (..., 4, 4) over (1, section coordinates) from the 6 x 6 section mass.

    Of the momentum matrix [[m, -m c~], [m c~, J]] this is [[m, m c], [m c, tr(J) / 2 - J]].
    """
    rotary = mass[..., 3:, 3:]
    moment = np.stack([mass[..., 5, 1], mass[..., 3, 2], mass[..., 4, 0]], axis=-1)
    out = np.empty((*mass.shape[:-2], 4, 4))
    out[..., 0, 0] = mass[..., 0, 0]
    out[..., 0, 1:] = out[..., 1:, 0] = moment
    trace = np.trace(rotary, axis1=-2, axis2=-1)[..., None, None]
    out[..., 1:, 1:] = 0.5 * trace * np.eye(3) - rotary
    return out


def section_mass(density: float, centre: AnyArray, rotary: AnyArray) -> AnyArray:
    """6 x 6 section mass from mass [kg/m], its centre (3,) [m] and rotary inertia about it (3, 3) [kg m]."""
    offset = hat(centre)
    return np.block(
        [
            [density * np.eye(3), -density * offset],
            [density * offset, rotary - density * offset @ offset],
        ]
    )


def distribution(beam: Beam) -> AnyArray:
    """Quadratic form of the kinetic energy (4(n + 1), 4(n + 1)) over nodal positions and directors."""
    lengths = np.linalg.norm(np.diff(beam.reference.position, axis=0), axis=1)
    weighted = lengths[:, None, None] * section_distribution(beam.mass)
    size = beam.elements + 1
    out = np.zeros((size, 4, size, 4))
    for element in range(beam.elements):
        first, second = element, element + 1
        out[first, :, first] += weighted[element] / 3.0
        out[second, :, second] += weighted[element] / 3.0
        out[first, :, second] += weighted[element] / 6.0
        out[second, :, first] += weighted[element] / 6.0
    return out.reshape(4 * size, 4 * size)


def _points(configuration: Configuration) -> AnyArray:
    """Node positions and directors (4(n + 1), 3)."""
    directors = np.swapaxes(configuration.orientation, -1, -2)
    return np.concatenate([configuration.position[:, None], directors], axis=1).reshape(-1, 3)


def _nodal_motion(configuration: Configuration) -> AnyArray:
    """Velocity of positions and directors per nodal velocity, (4(n + 1), 3, 6(n + 1))."""
    nodes = len(configuration.position)
    out = np.zeros((nodes, 4, 3, nodes, 6))
    turning = -hat(np.swapaxes(configuration.orientation, -1, -2))
    for node in range(nodes):
        out[node, 0, :, node, :3] = np.eye(3)
        out[node, 1:, :, node, 3:] = turning[node]
    return out.reshape(4 * nodes, 3, 6 * nodes)


def _rigid_motion(configuration: Configuration) -> AnyArray:
    """Velocity of positions and directors per velocity (v, omega) of S, (4(n + 1), 3, 6)."""
    points = _points(configuration)
    out = np.zeros((len(points), 3, 6))
    out[::4, :, :3] = np.eye(3)
    out[:, :, 3:] = -hat(points)
    return out


def steady_force(distribution: AnyArray, configuration: Configuration, rotation: AnyArray) -> AnyArray:
    """Inertial nodal forces and moments (n + 1, 6) in S axes under constant `rotation` (3,) [rad/s].

    They stand on the left of the equation of motion: the centrifugal load is their negative.
    """
    spin = hat(rotation)
    momentum_rate = distribution @ _points(configuration) @ (spin @ spin).T
    return np.einsum("pia,pi->a", _nodal_motion(configuration), momentum_rate).reshape(-1, 6)


def linearise_inertia(
    distribution: AnyArray, configuration: Configuration, rotation: AnyArray
) -> InertiaMatrices:
    """Inertia matrices about a configuration at rest in S, which turns at `rotation` (3,) [rad/s]."""
    spin = hat(rotation)
    nodal, rigid = _nodal_motion(configuration), _rigid_motion(configuration)
    carried = np.kron(np.eye(2), spin)
    identity = np.eye(3)

    def project(left: AnyArray, operator: AnyArray, right: AnyArray) -> AnyArray:
        driven = np.einsum("ij,pjb->pib", operator, right)
        weighted = np.tensordot(distribution, driven, axes=1)
        return np.tensordot(left, weighted, axes=((0, 1), (0, 1)))

    mass_sr, mass_rr = project(nodal, identity, rigid), project(rigid, identity, rigid)
    momentum_rate = distribution @ _points(configuration) @ (spin @ spin).T
    stiffness_rs = project(rigid, spin @ spin, nodal)
    stiffness_rs[3:] -= np.einsum("pij,pjb->ib", hat(momentum_rate), nodal)
    return InertiaMatrices(
        mass=project(nodal, identity, nodal),
        damping=project(nodal, 2.0 * spin, nodal),
        stiffness=project(nodal, spin @ spin, nodal) + _turned_moments(configuration, momentum_rate),
        mass_sr=mass_sr,
        damping_sr=project(nodal, 2.0 * spin, rigid) - mass_sr @ carried,
        mass_rs=project(rigid, identity, nodal),
        damping_rs=project(rigid, 2.0 * spin, nodal),
        stiffness_rs=stiffness_rs,
        mass_rr=mass_rr,
        damping_rr=project(rigid, 2.0 * spin, rigid) - mass_rr @ carried,
    )


def _turned_moments(configuration: Configuration, momentum_rate: AnyArray) -> AnyArray:
    """Change of the nodal moments (N, N) when directors turn under a rate of momentum (4(n + 1), 3)."""
    nodes = len(configuration.position)
    directors = np.swapaxes(configuration.orientation, -1, -2)
    blocks = hat(momentum_rate.reshape(nodes, 4, 3)[:, 1:]) @ hat(directors)
    out = np.zeros((nodes, 6, nodes, 6))
    index = np.arange(nodes)
    out[index, 3:, index, 3:] = blocks.sum(axis=1)
    return out.reshape(6 * nodes, 6 * nodes)
