"""Beams whose behaviour is known from elsewhere, for the tests of this folder."""

import numpy as np

from flapgym.structure.beam import Beam, Configuration
from flapgym.structure.inertia import section_mass
from flapgym.structure.rotation import about_x, about_y, about_z, rotation_matrix

# Section axes of a beam along z: columns along z, x, y.
AXES_ALONG_Z = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def uniform_beam(
    elements: int,
    length: float = 1.0,
    stiffness: tuple[float, ...] = (1e6, 1e6, 1e6, 1.0, 4.0, 1.0),
    density: float = 1.0,
    rotary: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> Beam:
    """Straight uniform beam from the origin along z; bending about the second section axis, then the third."""
    position = np.zeros((elements + 1, 3))
    position[:, 2] = np.linspace(0.0, length, elements + 1)
    mass = section_mass(density, np.zeros(3), np.diag(rotary))
    return Beam(
        Configuration(position, np.broadcast_to(AXES_ALONG_Z, (elements + 1, 3, 3))),
        np.broadcast_to(np.diag(stiffness), (elements, 6, 6)),
        np.broadcast_to(mass, (elements, 6, 6)),
    )


def bend_45_degrees(elements: int) -> Beam:
    """Eighth of a circle of radius 100 in the x, y plane, unit square section, E = 1e7, no Poisson effect."""
    angle = np.linspace(0.0, np.pi / 4, elements + 1)
    position = 100.0 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), np.zeros_like(angle)])
    young = 1e7
    stiffness = np.diag([young, young / 2, young / 2, young / 2 / 6, young / 12, young / 12])
    return Beam(
        Configuration(position, np.stack([about_z(turn) for turn in angle])),
        np.broadcast_to(stiffness, (elements, 6, 6)),
        np.zeros((elements, 6, 6)),
    )


def random_beam(elements: int, seed: int) -> Beam:
    """Crooked, twisted beam with full random section stiffness and mass."""
    rng = np.random.default_rng(seed)
    position = np.cumsum(rng.normal(size=(elements + 1, 3)) + [0.0, 0.0, 2.0], axis=0)
    orientation = rotation_matrix(rng.uniform(-0.5, 0.5, size=(elements + 1, 3)))
    root = rng.normal(size=(elements, 6, 6))
    # A rotary inertia that some cloud of particles has: tr(E) - E of its second moments E.
    cloud = 0.5 * rng.normal(size=(elements, 3, 3))
    moments = cloud @ np.swapaxes(cloud, 1, 2)
    rotary = np.trace(moments, axis1=1, axis2=2)[:, None, None] * np.eye(3) - moments
    density, centre = rng.uniform(0.5, 2.0, elements), 0.3 * rng.normal(size=(elements, 3))
    mass = np.stack([section_mass(*part) for part in zip(density, centre, rotary, strict=True)])
    return Beam(Configuration(position, orientation), root @ np.swapaxes(root, 1, 2), mass)


def turned(beam: Beam, angles: tuple[float, float, float], shift: np.ndarray) -> Configuration:
    """The reference configuration after a finite rigid rotation about the origin and a shift."""
    turn = about_z(angles[2]) @ about_y(angles[1]) @ about_x(angles[0])
    return Configuration(beam.reference.position @ turn.T + shift, turn @ beam.reference.orientation)
