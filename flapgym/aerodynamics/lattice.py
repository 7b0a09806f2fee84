"""Vortex-ring lattice of one blade or wing, its inflow and its prescribed wake (paper II.C, Figures 3 and 7).

Rings start at the quarter of each panel; the boundary condition is met at the three-quarter point. Everything is
given for blade 1 in the rotor frame S at azimuth zero (x downwind along the shaft, z along blade 1), or, for a wing
in steady translation, in any frame fixed to the wing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flapgym.core.arrays import Array

# Age, in time steps, of the last bound vortex edge. At a quarter of a step behind the trailing edge the first wake
# row carries the same quarter/three-quarter rule as the bound panels, whatever the ratio of row to panel length.
SHED_AGE = 0.25


def rotation_about_x(angle: float) -> Array:
    """Rotation matrix (3, 3) by an angle [rad] about the x axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


@dataclass(frozen=True, eq=False)
class Inflow:
    """Undisturbed flow past a surface that may rotate about the x axis.

    Parameters
    ----------
    velocity : (3,) float
        Velocity of the air far away [m/s]; parallel to x when the surface rotates.
    rotor_speed : float
        Angular speed of the surface about +x [rad/s], zero for a wing in translation.
    wake_velocity : (3,) float
        Velocity at which the shed wake is carried away [m/s]; less than `velocity` with axial induction.
    """

    velocity: Array
    rotor_speed: float
    wake_velocity: Array

    def relative_velocity(self, point: Array) -> Array:
        """Velocity of the air relative to points (..., 3) fixed to the surface [m/s]."""
        return self.velocity - np.cross(np.array([self.rotor_speed, 0.0, 0.0]), point)

    def per_rotor_speed(self, point: Array) -> Array:
        """Change (..., 3) of that velocity as the surface turns faster [m/s per rad/s]."""
        return -np.cross(np.array([1.0, 0.0, 0.0]), point)

    def convect(self, point: Array, time: float) -> Array:
        """Where air that left points (..., 3) of the surface is after a time [s], in the surface's frame."""
        return point @ rotation_about_x(-self.rotor_speed * time).T + self.wake_velocity * time


@dataclass(frozen=True, eq=False)
class Lattice:
    """Bound vortex rings of one surface; ring (i, s) is number i * strips + s, i chordwise from the leading edge.

    Parameters
    ----------
    leading_edge, trailing_edge : (strips + 1, 3) float
        Edge points of the strips, root to tip [m].
    node : (chordwise + 1, strips + 1, 3) float
        Corners of the rings [m]: at the quarter points of the panels, the last row a quarter step into the wake.
    collocation, normal : (n, 3) float
        Three-quarter points of the panels, on the bilinear surface through the corners of each strip [m], and
        unit normals of that surface there, towards the suction side. On any smoother surface than the rings' own
        the root moment drifts by some 15 % with the number of chordwise panels.
    """

    leading_edge: Array
    trailing_edge: Array
    node: Array
    collocation: Array
    normal: Array

    @property
    def chordwise(self) -> int:
        """Number of panels along the chord."""
        return int(self.node.shape[0] - 1)

    @property
    def strips(self) -> int:
        """Number of panels along the span."""
        return int(self.node.shape[1] - 1)

    @property
    def chord_vector(self) -> Array:
        """Mid-strip vector from leading to trailing edge [m], shape (strips, 3)."""
        edge = self.trailing_edge - self.leading_edge
        return 0.5 * (edge[1:] + edge[:-1])

    @property
    def span(self) -> Array:
        """Arc length of the strips' edges from the root of the lattice, along the quarter chords (strips + 1,) [m]."""
        quarter = self.on_surface(np.array([0.25]))[0]
        return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(quarter, axis=0), axis=1)))

    def on_surface(self, fraction: Array) -> Array:
        """Points of the strips' edges at chord fractions (q,), shape (q, strips + 1, 3) [m]."""
        return self.leading_edge + fraction[:, None, None] * (self.trailing_edge - self.leading_edge)


def build_lattice(
    leading_edge: Array, trailing_edge: Array, chordwise: int, inflow: Inflow, time_step: float
) -> Lattice:
    """Lattice of `chordwise` equal panels on every strip between leading and trailing edge (strips + 1, 3) [m]."""
    if chordwise < 1:
        raise ValueError(f"discretisation.chordwise_panels: expected at least 1, got {chordwise}")
    chord = trailing_edge - leading_edge
    quarter = (np.arange(chordwise) + 0.25) / chordwise
    shed = inflow.convect(trailing_edge, SHED_AGE * time_step)
    node = np.concatenate([leading_edge + quarter[:, None, None] * chord, shed[None]])
    centre = leading_edge + ((np.arange(chordwise) + 0.75) / chordwise)[:, None, None] * chord
    collocation = 0.5 * (centre[:, 1:] + centre[:, :-1])
    along_chord = np.broadcast_to(0.5 * (chord[1:] + chord[:-1]), collocation.shape)
    along_span = centre[:, 1:] - centre[:, :-1]
    normal = np.cross(along_chord, along_span).reshape(-1, 3)
    return Lattice(
        leading_edge=leading_edge,
        trailing_edge=trailing_edge,
        node=node,
        collocation=collocation.reshape(-1, 3),
        normal=normal / np.linalg.norm(normal, axis=1, keepdims=True),
    )


def wake_ages(time_step: float, rows: int) -> Array:
    """Ages (rows + 1,) [s] of the edges of wake rows that move by exactly one row a time step.

    Row k lies between ages (k - 0.75) and (k + 0.25) time steps and carries the circulation that the last bound row
    had k steps ago.
    """
    if rows < 1:
        raise ValueError(f"wake rows: expected at least 1, got {rows}")
    return np.asarray((np.arange(rows + 1) + SHED_AGE) * time_step)


def wake_nodes(lattice: Lattice, inflow: Inflow, ages: Array) -> Array:
    """Corners of the wake rings that the trailing edge shed at ages (rows + 1,) [s], (rows + 1, strips + 1, 3) [m]."""
    return np.stack([inflow.convect(lattice.trailing_edge, age) for age in ages])
