"""Non-linear dynamics of one beam in a frame that moves at will: eq. 1 of the paper, forces and energies.

The nodes move by u and R in the frame; the frame by its velocities nu = (v, omega) in its own axes. Nothing is small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.structure.beam import Beam, Configuration, internal_force, strain_energy, tangent
from flapgym.structure.inertia import distribution, linearise_inertia, section_distribution
from flapgym.structure.rotation import cross


@dataclass(frozen=True, eq=False)
class Body:
    """A beam and what is bolted to its nodes.

    Parameters
    ----------
    beam : Beam
        The elastic part.
    distribution : (4(n + 1), 4(n + 1)) float
        Its mass over nodal positions and directors (`inertia.distribution`), with that of rigid parts on nodes.
    """

    beam: Beam
    distribution: AnyArray

    @classmethod
    def of(cls, beam: Beam, rigid_parts: dict[int, AnyArray] | None = None) -> Body:
        """Body of a beam with 6 x 6 masses, in section axes, on some nodes."""
        total = distribution(beam)
        for node, mass in (rigid_parts or {}).items():
            own = slice(4 * (node % (beam.elements + 1)), 4 * (node % (beam.elements + 1)) + 4)
            total[own, own] += section_distribution(mass)
        return cls(beam, total)


@dataclass(frozen=True, eq=False)
class FrameMotion:
    """Velocity nu = (v, omega) (6,) [m/s, rad/s] of a frame in its own axes, and its rate (6,) of change in them."""

    velocity: AnyArray
    acceleration: AnyArray


def _points(
    configuration: Configuration, velocity: AnyArray, acceleration: AnyArray
) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Positions and directors (n + 1, 4, 3) and their first and second rates in the frame."""
    directors = np.swapaxes(configuration.orientation, -1, -2)
    spin, turning = velocity[:, None, 3:], acceleration[:, None, 3:]
    rates = cross(spin, directors)
    second = cross(turning, directors) + cross(spin, rates)
    return (
        np.concatenate([configuration.position[:, None], directors], axis=1),
        np.concatenate([velocity[:, None, :3], rates], axis=1),
        np.concatenate([acceleration[:, None, :3], second], axis=1),
    )


def dynamic_forces(
    body: Body, configuration: Configuration, velocity: AnyArray, acceleration: AnyArray, frame: FrameMotion
) -> tuple[AnyArray, AnyArray]:
    """Elastic and inertial nodal forces (n + 1, 6), and the resultant (6,) about the frame's origin of all inertia.

    In frame axes. velocity and acceleration (n + 1, 6) are the nodes' rates in the frame, spatial for rotation; the
    nodal forces balance external nodal loads, the resultant all external force on the body.
    """
    points, rates, second = _points(configuration, velocity, acceleration)
    spin, turning = frame.velocity[3:], frame.acceleration[3:]
    second = second + 2.0 * cross(spin, rates) + cross(turning, points) + cross(spin, cross(spin, points))
    second[:, 0] += frame.acceleration[:3] + cross(spin, frame.velocity[:3])
    momentum_rate = (body.distribution @ second.reshape(-1, 3)).reshape(points.shape)
    moments = cross(points[:, 1:], momentum_rate[:, 1:]).sum(axis=1)
    nodal = internal_force(body.beam, configuration) + np.concatenate([momentum_rate[:, 0], moments], axis=1)
    about_origin = cross(points, momentum_rate).sum(axis=(0, 1))
    return nodal, np.concatenate([momentum_rate[:, 0].sum(axis=0), about_origin])


def energy(body: Body, configuration: Configuration, velocity: AnyArray, frame: FrameMotion) -> float:
    """Kinetic and elastic energy [J] of the body as seen from the ground."""
    points, rates, _ = _points(configuration, velocity, np.zeros_like(velocity))
    rates += cross(frame.velocity[3:], points)
    rates[:, 0] += frame.velocity[:3]
    flat = rates.reshape(-1, 3)
    return 0.5 * float(np.sum(flat * (body.distribution @ flat))) + strain_energy(body.beam, configuration)


@dataclass(frozen=True, eq=False)
class DynamicTangent:
    """Iteration matrices of a body: derivatives of its forces for motion of nodes (S) and frame (R), combined."""

    ss: AnyArray  # (N, N)
    sr: AnyArray  # (N, 6)
    rs: AnyArray  # (6, N)
    rr: AnyArray  # (6, 6)


def dynamic_tangent(
    body: Body, configuration: Configuration, spin: AnyArray, rate_factor: float, mass_factor: float
) -> DynamicTangent:
    """mass_factor M + rate_factor C + K about the configuration, as if its nodes were at rest in the frame.

    What the nodes' own rates add is left out: Newton then converges a little slower, to the same solution.
    """
    inertia = linearise_inertia(body.distribution, configuration, spin)

    def combine(mass: AnyArray, damping: AnyArray) -> AnyArray:
        return mass_factor * mass + rate_factor * damping

    return DynamicTangent(
        ss=combine(inertia.mass, inertia.damping) + inertia.stiffness + tangent(body.beam, configuration),
        sr=combine(inertia.mass_sr, inertia.damping_sr),
        rs=combine(inertia.mass_rs, inertia.damping_rs) + inertia.stiffness_rs,
        rr=combine(inertia.mass_rr, inertia.damping_rr),
    )
