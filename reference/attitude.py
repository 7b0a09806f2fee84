"""Attitude and place of a moving base: a unit quaternion, integrated from its prescribed velocities (Section II.B)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flapgym.core.arrays import AnyArray
from reference.body_motion import FrameMotion

# Points and weights of the two-point Gauss rule on a unit step.
_GAUSS = 0.5 + np.array([-1.0, 1.0]) * np.sqrt(3.0) / 6.0


def quaternion_product(first: AnyArray, second: AnyArray) -> AnyArray:
    """Quaternion (4,), scalar part first, of the rotation `second` followed by `first`."""
    a, b = first[0], first[1:]
    c, d = second[0], second[1:]
    return np.concatenate([[a * c - b @ d], a * d + c * b + np.cross(b, d)])


def quaternion_of(vector: AnyArray) -> AnyArray:
    """Unit quaternion (4,) of a Cartesian rotation vector [rad]."""
    angle = float(np.linalg.norm(vector))
    return np.concatenate([[np.cos(0.5 * angle)], 0.5 * np.sinc(0.5 * angle / np.pi) * vector])


def quaternion_matrix(quaternion: AnyArray) -> AnyArray:
    """Rotation matrix (3, 3), from moving to ground axes, of a unit quaternion."""
    scalar, (x, y, z) = quaternion[0], quaternion[1:]
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * scalar * skew + 2.0 * skew @ skew


def base_path(
    base: Callable[[float], FrameMotion], time_step: float, steps: int, attitude: AnyArray | None = None
) -> tuple[AnyArray, AnyArray]:
    """Attitude (steps + 1, 4) as unit quaternions and position (steps + 1, 3) [m] of a base in ground axes.

    The attitude is of fourth order in the step (Magnus) and keeps its length to round-off; the position is of second.
    """
    quaternions = [np.array([1.0, 0.0, 0.0, 0.0]) if attitude is None else np.asarray(attitude, dtype=float)]
    positions = [np.zeros(3)]
    for step in range(steps):
        first, second = (base((step + part) * time_step).velocity for part in _GAUSS)
        spins = first[3:], second[3:]
        turn = 0.5 * time_step * (spins[0] + spins[1]) - np.sqrt(3.0) / 12.0 * time_step**2 * np.cross(
            *spins[::-1]
        )
        start = quaternions[-1]
        travelled = np.zeros(3)
        for part, velocity in zip(_GAUSS, (first, second), strict=True):
            within = quaternion_product(start, quaternion_of(part * turn))
            travelled += 0.5 * time_step * quaternion_matrix(within) @ velocity[:3]
        quaternions.append(quaternion_product(start, quaternion_of(turn)))
        positions.append(positions[-1] + travelled)
    return np.array(quaternions), np.array(positions)
