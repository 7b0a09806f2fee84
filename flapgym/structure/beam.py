"""Geometrically exact two-node composite beams: strains, internal forces and their tangent in closed form.

Section II.A of the paper (Hesse and Palacios' family of beams): nodal positions and rotations, arbitrary 6 x 6
section stiffness, initial twist and curvature. The relative rotation of the two nodes is interpolated, so that the
strain is objective, and taken at the middle of the element, so that it does not lock in shear.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flapgym.core.arrays import AnyArray
from flapgym.structure.rotation import (
    DEVIATOR,
    DEVIATOR_SLOPE,
    LARGEST_RELATIVE_ROTATION,
    SHEAR,
    SHEAR_SLOPE,
    STRETCH,
    STRETCH_SLOPE,
    cross,
    even,
    hat,
    rotation_matrix,
    rotation_vector,
)


@dataclass(frozen=True, eq=False)
class Configuration:
    """Where the nodes of a beam are, in the frame S the beam is described in.

    Parameters
    ----------
    position : (n + 1, 3) float
        Nodes on the reference line [m].
    orientation : (n + 1, 3, 3) float
        Section axes as columns: along the beam, then the two section axes.
    """

    position: AnyArray
    orientation: AnyArray

    def moved(self, increment: AnyArray) -> Configuration:
        """Return the configuration after displacements [m] and spatial rotations [rad], increment (n + 1, 6)."""
        turn = rotation_matrix(increment[:, 3:])
        return Configuration(self.position + increment[:, :3], turn @ self.orientation)


@dataclass(frozen=True, eq=False)
class Beam:
    """A chain of n beam elements, unstrained in its reference configuration.

    Parameters
    ----------
    reference : Configuration
        Stress-free nodes and section axes.
    stiffness : (n, 6, 6) float
        Section stiffness of each element: axial and two shear forces [N], torque and two bending moments
        [N m] for axial and shear strains, twist rate and curvatures [1/m], in section axes.
    mass : (n, 6, 6) float
        Section mass of each element [kg/m, kg, kg m]: linear, then angular momentum about the reference line.
    """

    reference: Configuration
    stiffness: AnyArray
    mass: AnyArray

    @property
    def elements(self) -> int:
        """Number of elements."""
        return int(self.stiffness.shape[0])

    @cached_property
    def _unstrained(self) -> _Middle:
        """Kinematics of the reference, asked for at every step of a march."""
        return _middle(self.reference)


@dataclass(frozen=True, eq=False)
class _Middle:
    """Kinematics at the middle of each element, in the element's mean section axes."""

    axes: AnyArray  # (n, 3, 3) mean section axes as columns
    chord: AnyArray  # (n, 3) from first to second node [m]
    bend: AnyArray  # (n, 3) relative rotation vector [rad]


def _middle(configuration: Configuration) -> _Middle:
    position, orientation = configuration.position, configuration.orientation
    bend = rotation_vector(np.swapaxes(orientation[:-1], -1, -2) @ orientation[1:])
    axes = orientation[:-1] @ rotation_matrix(0.5 * bend)
    chord = np.einsum("nji,nj->ni", axes, position[1:] - position[:-1])
    return _Middle(axes, chord, bend)


def _lengths(beam: Beam) -> AnyArray:
    return np.linalg.norm(np.diff(beam.reference.position, axis=0), axis=1)


def strains(beam: Beam, configuration: Configuration) -> AnyArray:
    """Section strains (n, 6) at the middle of each element: axial, shear, twist rate, curvatures [1/m]."""
    return _strains(beam, _middle(configuration))


def _strains(beam: Beam, now: _Middle) -> AnyArray:
    before = beam._unstrained
    change = np.concatenate([now.chord - before.chord, now.bend - before.bend], axis=1)
    return change / _lengths(beam)[:, None]


def section_loads(beam: Beam, configuration: Configuration) -> AnyArray:
    """Section forces [N] and moments [N m] (n, 6) at the middle of each element, in mean section axes."""
    return np.einsum("nij,nj->ni", beam.stiffness, strains(beam, configuration))


def strain_energy(beam: Beam, configuration: Configuration) -> float:
    """Elastic energy [J]."""
    energy = np.einsum(
        "n,ni,ni->", _lengths(beam), strains(beam, configuration), section_loads(beam, configuration)
    )
    return float(0.5 * energy)


def _times(matrix: AnyArray, vector: AnyArray) -> AnyArray:
    return np.einsum("...ij,...j->...i", matrix, vector)


def _rotation_operators(bend: AnyArray) -> tuple[AnyArray, AnyArray]:
    """H and b of each element: change of bend = H r, mean rotation = s - b bend x r (as in `tangent`)."""
    squared = np.sum(bend * bend, axis=-1)
    outer = bend[:, :, None] * bend[:, None, :]
    operator = (
        even(STRETCH, squared)[:, None, None] * np.eye(3) + even(DEVIATOR, squared)[:, None, None] * outer
    )
    return operator, even(SHEAR, squared)


def _check_bend(bend: AnyArray) -> None:
    worst = float(np.max(np.linalg.norm(np.real(bend), axis=-1)))
    if worst > LARGEST_RELATIVE_ROTATION:
        raise ValueError(
            f"beam.elements: expected less than {LARGEST_RELATIVE_ROTATION} rad of rotation within an "
            f"element, got {worst:.2f}; use more elements or smaller load steps"
        )


def internal_force(beam: Beam, configuration: Configuration) -> AnyArray:
    """Elastic nodal forces [N] and moments [N m] (n + 1, 6) in S axes: the gradient of the strain energy."""
    middle = _middle(configuration)
    _check_bend(middle.bend)
    loads = np.einsum("nij,nj->ni", beam.stiffness, _strains(beam, middle))
    force, moment = loads[:, :3], loads[:, 3:]
    operator, shear = _rotation_operators(middle.bend)
    mean = cross(force, middle.chord)
    relative = shear[:, None] * cross(middle.bend, mean) + _times(operator, moment)
    nodal = np.zeros((beam.elements + 1, 6), dtype=loads.dtype)
    for rows, sign in ((slice(None, -1), -1.0), (slice(1, None), 1.0)):
        nodal[rows, :3] += sign * _times(middle.axes, force)
        nodal[rows, 3:] += _times(middle.axes, 0.5 * mean + sign * relative)
    return nodal


def tangent(beam: Beam, configuration: Configuration) -> AnyArray:
    """Stiffness (6(n + 1), 6(n + 1)): derivative of `internal_force` for displacements and spatial rotations.

    In closed form, material and geometric. With d, s, r the difference of displacement, the mean and the
    difference of rotation of the two nodes in mean section axes, the section strains change by
    (d + chord x t) / L and H r / L, where t = s - b bend x r is the rotation of those axes.
    It is symmetric where the nodal moments are in equilibrium with moment-free loads.
    """
    middle = _middle(configuration)
    _check_bend(middle.bend)
    blocks = _element_tangent(middle, section_loads(beam, configuration), beam.stiffness, _lengths(beam))
    assembled = np.zeros((beam.elements + 1, 6, beam.elements + 1, 6), dtype=blocks.dtype)
    for element in range(beam.elements):
        assembled[element : element + 2, :, element : element + 2, :] += blocks[element].reshape(2, 6, 2, 6)
    size = 6 * (beam.elements + 1)
    return assembled.reshape(size, size)


def _element_tangent(middle: _Middle, loads: AnyArray, stiffness: AnyArray, length: AnyArray) -> AnyArray:
    """Tangent (n, 12, 12) of each element, nodal displacement and rotation in S axes."""
    count, bend, chord = len(length), middle.bend, middle.chord
    force, moment = loads[:, :3], loads[:, 3:]
    squared = np.sum(bend * bend, axis=-1)
    operator, shear = _rotation_operators(bend)
    mean = cross(force, chord)

    # Columns of what follows: d, s, r (each 3) in mean section axes.
    identity, zero = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3, 3))
    turn = np.concatenate([zero, identity, -shear[:, None, None] * hat(bend)], axis=-1)
    chord_change = np.concatenate([identity, zero, zero], axis=-1) + hat(chord) @ turn
    bend_change = np.concatenate([zero, zero, operator], axis=-1)
    strain_change = np.concatenate([chord_change, bend_change], axis=1) / length[:, None, None]
    load_change = stiffness @ strain_change
    force_change, moment_change = load_change[:, :3], load_change[:, 3:]

    mean_change = -hat(chord) @ force_change + hat(force) @ chord_change
    relative = shear[:, None] * cross(bend, mean) + _times(operator, moment)
    along = np.sum(bend * moment, axis=-1)
    # Derivative of shear(w) bend x mean + H(bend) moment for a change of bend; w = |bend|^2.
    slope = (
        2.0 * even(SHEAR_SLOPE, squared)[:, None] * cross(bend, mean)
        + 2.0 * even(STRETCH_SLOPE, squared)[:, None] * moment
        + 2.0 * (even(DEVIATOR_SLOPE, squared) * along)[:, None] * bend
    )
    deviator = even(DEVIATOR, squared)[:, None, None]
    bend_derivative = (
        slope[:, :, None] * bend[:, None, :]
        - shear[:, None, None] * hat(mean)
        + deviator * (along[:, None, None] * np.eye(3) + bend[:, :, None] * moment[:, None, :])
    )
    relative_change = (
        shear[:, None, None] * hat(bend) @ mean_change
        + operator @ moment_change
        + bend_derivative @ bend_change
    )
    # The mean section axes turn with the element and carry the forces along.
    force_change = force_change - hat(force) @ turn
    mean_change = mean_change - hat(mean) @ turn
    relative_change = relative_change - hat(relative) @ turn
    rows = np.concatenate(
        [
            -force_change,
            0.5 * mean_change - relative_change,
            force_change,
            0.5 * mean_change + relative_change,
        ],
        axis=1,
    )
    return _to_nodes(rows, middle.axes)


def _to_nodes(rows: AnyArray, axes: AnyArray) -> AnyArray:
    """From columns (d, s, r) in mean section axes to nodal columns (u1, theta1, u2, theta2) in S axes."""
    d, s, r = rows[:, :, 0:3], rows[:, :, 3:6], rows[:, :, 6:9]
    local = np.concatenate([-d, 0.5 * s - r, d, 0.5 * s + r], axis=-1)
    back = np.swapaxes(axes, -1, -2)
    blocks = local.reshape(-1, 4, 3, 4, 3)
    turned = np.einsum("nij,najbk,nkl->naibl", axes, blocks, back, optimize=True)
    return turned.reshape(-1, 12, 12)
